//! Problems: every error as RFC 9457 problem details.

use axum::{
    http::{HeaderValue, StatusCode, header},
    response::{IntoResponse, Response},
};
use serde::Serialize;
use utoipa::ToSchema;

use super::{requests, store::StoreError};
use body_schema_ask_tell::{Refusal, ReplayError, ResultsError, SetupError};
use body_schema_experiment::ChoiceError;
use body_schema_scenario::ScenarioError;

/// Media type of every error.
pub const PROBLEM_JSON: &str = "application/problem+json";

/// The seconds after which a client should ask again where there is too much to do.
pub(super) const RETRY_AFTER_S: u64 = 10;

/// What went wrong (RFC 9457). Optional members are left out where they say nothing.
#[derive(Clone, Debug, PartialEq, Serialize, ToSchema)]
pub struct Problem {
    /// Names the kind of problem; stable, to be compared by programs.
    #[serde(rename = "type")]
    #[schema(format = "uri", example = "urn:body-schema:problem:step-mismatch")]
    pub kind: &'static str,
    /// The kind in words; the same for every problem of this kind.
    pub title: &'static str,
    /// The HTTP status code.
    pub status: u16,
    /// What went wrong this time, and what to do.
    #[schema(value_type = String)]
    pub detail: Box<str>,
    /// The body field, parameter or header that is to blame.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<String>)]
    pub field: Option<Box<str>>,
    /// The session's actual step, where it matters.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub step: Option<u64>,
    /// How many steps can still be made, where that is too few.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub remaining: Option<u64>,
    /// Further members.
    #[serde(flatten)]
    #[schema(inline)]
    pub beside: Box<Beside>,
}

/// Further members of a problem's object.
#[derive(Clone, Debug, Default, PartialEq, Serialize, ToSchema)]
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

/// What an answer that is a problem carries for the log.
#[derive(Clone, Debug)]
pub(super) struct Refused {
    kind: &'static str,
    /// What went wrong, if that is internal to the server; details of clients' mistakes may hold their words, and are
    /// not logged.
    why: Option<String>,
}

impl Refused {
    /// The kind, without the prefix that all kinds share.
    pub(super) fn kind(&self) -> &'static str {
        self.kind.strip_prefix(URN).unwrap_or("other")
    }

    pub(super) fn why(&self) -> Option<&str> {
        self.why.as_deref()
    }
}

/// The prefix of the kinds' names.
const URN: &str = "urn:body-schema:problem:";

/// The kinds of problems.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Malformed,
    NoToken,
    ForeignOrigin,
    UnknownRoute,
    UnknownScenario,
    UnknownSession,
    UnknownLearner,
    UnknownSuggestion,
    /// An unknown suggestion that the body names.
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
    Dormant,
    Busy,
    Storage,
    Damaged,
    Other(StatusCode),
}

impl Kind {
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
            Self::Dormant => (503, urn!("dormant"), "The session has just left memory"),
            Self::Busy => (503, urn!("busy"), "The server is still at it"),
            Self::Storage => (507, urn!("storage"), "There is no room to write"),
            Self::Other(status) => (status.as_u16(), "about:blank", status.canonical_reason().unwrap_or("Error")),
        }
    }
}

impl Problem {
    pub(super) fn new(kind: Kind, detail: impl Into<String>) -> Self {
        let (status, urn, title) = kind.parts();
        let detail = detail.into().into();
        let (field, step, remaining, beside) = Default::default();
        Self { kind: urn, title, status, detail, field, step, remaining, beside }
    }

    pub(super) fn field(self, field: impl Into<String>) -> Self {
        Self { field: Some(field.into().into()), ..self }
    }

    /// Sets what is wrong, and separately what to do about it.
    pub(super) fn hint(mut self, what: impl Into<String>, hint: impl Into<String>) -> Self {
        (self.beside.what, self.beside.hint) = (Some(what.into()), Some(hint.into()));
        self
    }

    pub(super) fn step(self, step: u64) -> Self {
        Self { step: Some(step), ..self }
    }

    pub(super) fn remaining(self, remaining: u64) -> Self {
        Self { remaining: Some(remaining), ..self }
    }

    pub(super) fn is(&self, kind: Kind) -> bool {
        self.kind == kind.parts().1
    }

    pub(super) fn body_too_large(most: usize) -> Self {
        Self::new(Kind::BodyTooLarge, format!("the body may have at most {most} bytes"))
    }

    pub(super) fn never_steps(id: impl std::fmt::Display) -> Self {
        let detail = format!(
            "a session with a robot elsewhere never steps by itself: ask for a movement with POST \
             /v1/sessions/{id}/suggestions, and tell what was seen after it with POST /v1/sessions/{id}/observations"
        );
        Self::new(Kind::NeverSteps, detail)
    }

    pub(super) fn not_outside(id: impl std::fmt::Display) -> Self {
        let detail = format!(
            "this session has no robot elsewhere: it makes steps, with POST /v1/sessions/{id}/steps. One that has is opened \
             with {{\"world\": \"outside\", \"calibration\": {{…}}}}"
        );
        Self::new(Kind::NotOutside, detail)
    }

    pub(super) fn unknown_session(id: impl std::fmt::Display) -> Self {
        Self::new(Kind::UnknownSession, format!("there is no session `{id}`; it may have been deleted")).field("id")
    }
}

/// A scenario that makes no session, attributed to the body field that asked for it.
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
            | ScenarioError::Beforehand { .. }
            | ScenarioError::Experiment(_) => {
                return Self::new(Kind::EngineFailed, error.to_string());
            }
        };
        Self::new(Kind::InvalidValue, error.to_string()).field(field)
    }
}

/// A question about a choice that cannot be answered.
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

/// A calibration that makes no session, attributed to the body field that is wrong.
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
                Some(fault) => (fault.what.clone(), fault.mend.clone()),
                None => (error.to_string(), String::new()),
            },
            SetupError::Agent(why) => (why.to_string(), SetupError::AGENT_MEND.to_owned()),
        };
        Self::new(Kind::InvalidValue, error.to_string()).field(field).hint(what, hint)
    }
}

/// A kept session that this program cannot load.
impl From<ReplayError> for Problem {
    fn from(error: ReplayError) -> Self {
        Self::new(Kind::EngineFailed, format!("the session cannot be taken up again: {error}"))
    }
}

/// A refusal by a session with a robot elsewhere. Nothing has changed then.
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
            Refusal::Field(fault) => problem.hint(fault.what.as_str(), fault.mend.as_str()),
            _ => problem,
        };
        field.into_iter().fold(problem, Self::field)
    }
}

/// Observations without results yet.
impl From<ResultsError> for Problem {
    fn from(error: ResultsError) -> Self {
        Self::new(Kind::NothingToShow, error.to_string())
    }
}

/// A change that could not be written, and so was not made.
impl From<StoreError> for Problem {
    fn from(error: StoreError) -> Self {
        match error {
            StoreError::Full(_) | StoreError::Large(_) => Self::new(Kind::ServerFull, error.to_string()),
            StoreError::Damaged { .. } => {
                let mend = "end the server and run `body-schema repair` on its folder to keep what is before that";
                Self::new(Kind::Damaged, format!("{error}; {mend}"))
            }
            StoreError::Gone { .. } | StoreError::Changed { .. } => {
                Self::new(Kind::Storage, format!("it has not happened: {error}"))
            }
            _ if error.is_for_want_of_space() => {
                let detail =
                    format!("it could not be written, and has not happened: {error}; free some space and ask again");
                Self::new(Kind::Storage, detail)
            }
            _ => Self::new(Kind::Internal, format!("it has not happened: {error}")),
        }
    }
}

impl IntoResponse for Problem {
    fn into_response(mut self) -> Response {
        let status = StatusCode::from_u16(self.status).unwrap_or(StatusCode::INTERNAL_SERVER_ERROR);
        let refused = Refused { kind: self.kind, why: status.is_server_error().then(|| self.detail.to_string()) };
        self.beside.request_id = requests::id();
        let body = serde_json::to_vec(&self).unwrap_or_default();
        let mut response = (status, [(header::CONTENT_TYPE, PROBLEM_JSON)], body).into_response();
        response.extensions_mut().insert(refused);
        if matches!(status, StatusCode::SERVICE_UNAVAILABLE | StatusCode::TOO_MANY_REQUESTS) {
            // A session that has left memory is back at once.
            let after = if self.is(Kind::Dormant) { 0 } else { RETRY_AFTER_S };
            response.headers_mut().insert(header::RETRY_AFTER, after.into());
        }
        if matches!(status, StatusCode::REQUEST_TIMEOUT) {
            // What is still coming is no next request.
            response.headers_mut().insert(header::CONNECTION, HeaderValue::from_static("close"));
        }
        if matches!(status, StatusCode::UNAUTHORIZED) {
            response.headers_mut().insert(header::WWW_AUTHENTICATE, HeaderValue::from_static("Bearer"));
        }
        response
    }
}
