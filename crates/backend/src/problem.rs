//! Everything that can go wrong, as RFC 9457 problem details.

use serde::Serialize;

use body_schema_ask_tell::{Refusal, ReplayError, ResultsError, SetupError};
use body_schema_calibration::CalibrationError;
use body_schema_experiment::ChoiceError;
use body_schema_scenario::ScenarioError;

/// What went wrong (RFC 9457). Optional members are left out where they say nothing.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Problem {
    /// Names the kind of problem; stable, to be compared by programs.
    #[serde(rename = "type")]
    #[cfg_attr(feature = "openapi", schema(format = "uri", example = "urn:body-schema:problem:step-mismatch"))]
    pub kind: &'static str,
    /// The kind in words; the same for every problem of this kind.
    pub title: &'static str,
    /// The HTTP status code.
    pub status: u16,
    /// What went wrong this time, and how to mend it.
    #[cfg_attr(feature = "openapi", schema(value_type = String))]
    pub detail: Box<str>,
    /// The body field, parameter or header that is to blame.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "openapi", schema(value_type = Option<String>))]
    pub field: Option<Box<str>>,
    /// The session's actual step, where it matters.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub step: Option<u64>,
    /// How many steps can still be made, where that is too few.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub remaining: Option<u64>,
    /// What is told beside.
    #[serde(flatten)]
    #[cfg_attr(feature = "openapi", schema(inline))]
    pub beside: Box<Beside>,
}

/// What is told of a problem beside the rest: members of the same object.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Beside {
    /// What is wrong with `field`: the first part of `detail`, where it has two.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub what: Option<String>,
    /// What to write instead: the second part.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hint: Option<String>,
    /// The id of the request, as in the answer's `X-Request-Id` and in the server's log.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub request_id: Option<String>,
}

/// The kinds of problems.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "their titles say what they are")]
pub enum Kind {
    Malformed,
    NoToken,
    ForeignOrigin,
    UnknownRoute,
    UnknownScenario,
    UnknownSession,
    UnknownLearner,
    UnknownSuggestion,
    /// The same, where the body names it.
    SuggestionOfBody,
    UnknownObservation,
    MethodNotAllowed,
    StepMismatch,
    NeverSteps,
    NotOutside,
    NotPending,
    SessionFull,
    NothingToSuggest,
    Diverged,
    KeyTaken,
    NothingToShow,
    Watched,
    NoConfiguration,
    ChoosesItself,
    BodyTooLarge,
    BodyTooSlow,
    HeadTooLarge,
    UnsupportedMediaType,
    TooManyStreams,
    InvalidValue,
    TooFewStepsLeft,
    EngineFailed,
    Internal,
    ServerFull,
    ShuttingDown,
    Ending,
    Dormant,
    Busy,
    Storage,
    Damaged,
    Other(u16, &'static str),
}

impl Kind {
    /// Status, name and title.
    fn parts(self) -> (u16, &'static str, &'static str) {
        macro_rules! urn {
            ($slug:literal) => {
                concat!("urn:body-schema:problem:", $slug)
            };
        }
        match self {
            Self::Malformed => (400, urn!("malformed"), "The request cannot be read"),
            Self::NoToken => (401, urn!("no-token"), "The request does not carry the server's token"),
            Self::ForeignOrigin => (403, urn!("foreign-origin"), "The request comes from a foreign page"),
            Self::UnknownRoute => (404, urn!("unknown-route"), "There is nothing here"),
            Self::UnknownScenario => (404, urn!("unknown-scenario"), "There is no such scenario"),
            Self::UnknownSession => (404, urn!("unknown-session"), "There is no such session"),
            Self::UnknownLearner => (404, urn!("unknown-learner"), "There is no such learner"),
            Self::UnknownSuggestion => (404, urn!("unknown-suggestion"), "There is no such suggestion"),
            Self::SuggestionOfBody => (422, urn!("unknown-suggestion"), "There is no such suggestion"),
            Self::UnknownObservation => (404, urn!("unknown-observation"), "There is no such observation"),
            Self::MethodNotAllowed => (405, urn!("method-not-allowed"), "This method is not allowed here"),
            Self::StepMismatch => (409, urn!("step-mismatch"), "The session is at another step"),
            Self::NeverSteps => (409, urn!("never-steps"), "The session never steps by itself"),
            Self::NotOutside => (409, urn!("not-outside"), "The session has no robot elsewhere"),
            Self::NotPending => (409, urn!("not-pending"), "The suggestion is not pending any more"),
            Self::SessionFull => (409, urn!("session-full"), "The session holds as much as it can"),
            Self::NothingToSuggest => (409, urn!("nothing-to-suggest"), "No movement can be suggested"),
            Self::Diverged => (409, urn!("diverged"), "The estimate has diverged"),
            Self::KeyTaken => (409, urn!("key-taken"), "The key came with another body"),
            Self::NothingToShow => (409, urn!("nothing-to-show"), "There is nothing to show yet"),
            Self::Watched => (409, urn!("watched"), "Somebody follows the session"),
            Self::NoConfiguration => (409, urn!("no-configuration"), "A person has not chosen the next movement"),
            Self::ChoosesItself => (409, urn!("chooses-itself"), "The learner chooses its movements itself"),
            Self::BodyTooSlow => (408, urn!("body-too-slow"), "The body did not come in time"),
            Self::BodyTooLarge => (413, urn!("body-too-large"), "The body is too large"),
            Self::HeadTooLarge => (431, urn!("head-too-large"), "The request's head is too large"),
            Self::UnsupportedMediaType => (415, urn!("unsupported-media-type"), "The body is not JSON"),
            Self::InvalidValue => (422, urn!("invalid-value"), "A value is not valid"),
            Self::TooFewStepsLeft => (422, urn!("too-few-steps-left"), "The session cannot make so many more steps"),
            Self::TooManyStreams => (429, urn!("too-many-streams"), "Too many follow the session"),
            Self::EngineFailed => (500, urn!("engine-failed"), "The session's engine has failed"),
            Self::Damaged => (500, urn!("damaged"), "What was kept is damaged"),
            Self::Internal => (500, urn!("internal"), "The server has failed"),
            Self::ServerFull => (503, urn!("server-full"), "The server holds as much as it can"),
            Self::ShuttingDown => (503, urn!("shutting-down"), "The server is shutting down"),
            Self::Ending => (503, urn!("session-ending"), "The session is being deleted"),
            Self::Dormant => (503, urn!("dormant"), "The session has just left memory"),
            Self::Busy => (503, urn!("busy"), "The server is still at it"),
            Self::Storage => (507, urn!("storage"), "There is no room to write"),
            Self::Other(status, title) => (status, "about:blank", title),
        }
    }
}

impl Problem {
    /// A problem of a kind, and what is wrong this time.
    pub fn new(kind: Kind, detail: impl Into<String>) -> Self {
        let (status, urn, title) = kind.parts();
        let detail = detail.into().into();
        let (field, step, remaining, beside) = Default::default();
        Self { kind: urn, title, status, detail, field, step, remaining, beside }
    }

    /// What of the request is to blame.
    pub fn field(self, field: impl Into<String>) -> Self {
        Self { field: Some(field.into().into()), ..self }
    }

    /// What is wrong, and what to do about it, each by itself.
    pub fn hint(mut self, what: impl Into<String>, hint: impl Into<String>) -> Self {
        (self.beside.what, self.beside.hint) = (Some(what.into()), Some(hint.into()));
        self
    }

    /// The step that the session is at.
    pub fn step(self, step: u64) -> Self {
        Self { step: Some(step), ..self }
    }

    /// How many steps are left.
    pub fn remaining(self, remaining: u64) -> Self {
        Self { remaining: Some(remaining), ..self }
    }

    /// Whether it is of this kind.
    pub fn is(&self, kind: Kind) -> bool {
        self.kind == kind.parts().1
    }

    /// Of a body beyond so many bytes.
    pub fn body_too_large(most: usize) -> Self {
        Self::new(Kind::BodyTooLarge, format!("the body may have at most {most} bytes"))
    }

    /// Of a session with a robot elsewhere that is to step.
    pub fn never_steps(id: impl std::fmt::Display) -> Self {
        let detail = format!(
            "a session with a robot elsewhere never steps by itself: ask for a movement with POST \
             /v1/sessions/{id}/suggestions, and tell what was seen after it with POST /v1/sessions/{id}/observations"
        );
        Self::new(Kind::NeverSteps, detail)
    }

    /// Of a session without a robot elsewhere that is asked for movements.
    pub fn not_outside(id: impl std::fmt::Display) -> Self {
        let detail = format!(
            "this session has no robot elsewhere: it makes steps, with POST /v1/sessions/{id}/steps. One that has is opened \
             with {{\"world\": \"outside\", \"calibration\": {{…}}}}"
        );
        Self::new(Kind::NotOutside, detail)
    }

    /// Of a session that there is not.
    pub fn unknown_session(id: impl std::fmt::Display) -> Self {
        Self::new(Kind::UnknownSession, format!("there is no session `{id}`; it may have been deleted")).field("id")
    }
}

/// A scenario that cannot become a session, blamed on the body field that asked for it.
impl From<ScenarioError> for Problem {
    fn from(error: ScenarioError) -> Self {
        let field = match &error {
            ScenarioError::UnknownScenario { .. } => "scenario",
            ScenarioError::UnknownLearner { .. }
            | ScenarioError::Misfit { .. }
            | ScenarioError::RepeatedLearner(_)
            | ScenarioError::NoLearner => "learners",
            ScenarioError::Invalid { .. }
            | ScenarioError::Prior { .. }
            | ScenarioError::Follows { .. }
            | ScenarioError::Beforehand { .. }
            | ScenarioError::Experiment(_) => {
                return Self::new(Kind::EngineFailed, error.to_string());
            }
        };
        Self::new(Kind::InvalidValue, error.to_string()).field(field)
    }
}

/// A question about a choice that has no answer.
impl From<ChoiceError> for Problem {
    fn from(error: ChoiceError) -> Self {
        let (kind, field) = match &error {
            ChoiceError::UnknownLearner { .. } => (Kind::UnknownLearner, Some("name")),
            ChoiceError::Configuration(_) => (Kind::InvalidValue, Some("configuration")),
            ChoiceError::ChoosesItself(_) => (Kind::ChoosesItself, Some("name")),
            ChoiceError::NotSearched(_) | ChoiceError::Selection(_) | ChoiceError::Ended { .. } => {
                (Kind::NothingToShow, None)
            }
            ChoiceError::Search(_) => (Kind::Internal, None),
        };
        let problem = Self::new(kind, error.to_string());
        field.into_iter().fold(problem, Self::field)
    }
}

/// A calibration that cannot become a session, blamed on the body field that is wrong.
impl From<SetupError> for Problem {
    fn from(error: SetupError) -> Self {
        let field = match &error {
            SetupError::Invalid(faults) => match faults.first().map(|fault| fault.field.as_str()) {
                None | Some("calibration") => "calibration".to_owned(),
                Some(key) => format!("calibration.{key}"),
            },
            SetupError::Agent(_) => "agent".to_owned(),
        };
        let (what, hint) = match &error {
            SetupError::Invalid(faults) => match faults.first() {
                Some(fault) => (fault.what.clone(), fault.hint.clone()),
                None => (error.to_string(), String::new()),
            },
            SetupError::Agent(why) => (why.to_string(), SetupError::AGENT_HINT.to_owned()),
        };
        Self::new(Kind::InvalidValue, error.to_string()).field(field).hint(what, hint)
    }
}

/// A kept session that this program cannot take up.
impl From<ReplayError> for Problem {
    fn from(error: ReplayError) -> Self {
        Self::new(Kind::EngineFailed, format!("the session cannot be taken up again: {error}"))
    }
}

/// What a session with a robot elsewhere has refused. Nothing has happened then.
impl From<Refusal> for Problem {
    fn from(refusal: Refusal) -> Self {
        let (kind, field) = match &refusal {
            Refusal::Field(fault) => (Kind::InvalidValue, Some(fault.field.clone())),
            Refusal::UnknownSuggestion { .. } => (Kind::UnknownSuggestion, Some("sid".to_owned())),
            Refusal::UnknownObservation { .. } => (Kind::UnknownObservation, Some("n".to_owned())),
            Refusal::NotPending { .. } => (Kind::NotPending, None),
            Refusal::Full { .. } => (Kind::SessionFull, None),
            Refusal::Selection(_) => (Kind::NothingToSuggest, None),
            Refusal::Ended(_) => (Kind::Diverged, None),
            Refusal::GivenUp => (Kind::Busy, None),
            Refusal::Stale => (Kind::Internal, None),
        };
        let problem = Self::new(kind, refusal.to_string());
        let problem = match &refusal {
            Refusal::Field(fault) => problem.hint(fault.what.as_str(), fault.hint.as_str()),
            _ => problem,
        };
        field.into_iter().fold(problem, Self::field)
    }
}

/// What was observed comes to nothing yet.
impl From<ResultsError> for Problem {
    fn from(error: ResultsError) -> Self {
        if let ResultsError::Calibration(CalibrationError::Folds { .. }) = &error {
            return Self::new(Kind::InvalidValue, error.to_string()).field("folds");
        }
        Self::new(Kind::NothingToShow, error.to_string())
    }
}
