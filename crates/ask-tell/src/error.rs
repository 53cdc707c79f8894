//! Errors: the field, what is wrong with it, and what to do.

use std::fmt;

use super::SuggestionState;
use body_schema_engine::selection::SelectionError;
use body_schema_scenario::{Problem, ScenarioError};

/// A value of the input that is wrong.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fault {
    /// The field, with its path, such as `configuration.elbow`.
    pub field: String,
    /// What is wrong.
    pub what: String,
    /// What to do about it.
    pub hint: String,
}

impl Fault {
    pub(super) fn new(field: impl Into<String>, what: impl Into<String>, hint: impl Into<String>) -> Self {
        Self { field: field.into(), what: what.into(), hint: hint.into() }
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "`{}`: {}; {}", self.field, self.what, self.hint)
    }
}

impl std::error::Error for Fault {}

impl From<Problem> for Fault {
    fn from(Problem { key, what, hint, .. }: Problem) -> Self {
        // Lines are those of a text that nobody has written.
        Self { field: if key == "(file)" { "calibration".to_owned() } else { key }, what, hint }
    }
}

/// Why a setup makes no session.
#[derive(Debug, thiserror::Error)]
pub enum SetupError {
    /// Values that cannot be used.
    #[error("{}", .0.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n"))]
    Invalid(Vec<Fault>),
    /// No agent can be made of the setup.
    #[error("`agent`: {0}")]
    Agent(ScenarioError),
}

impl SetupError {
    /// What to do about an agent that cannot be made.
    pub const AGENT_HINT: &str = "name a learner of the calibration, or an estimator and a policy";
}

impl From<Fault> for SetupError {
    fn from(fault: Fault) -> Self {
        Self::Invalid(vec![fault])
    }
}

/// Why a request was refused. It changed nothing.
#[derive(Debug, thiserror::Error)]
pub enum Refusal {
    /// A field of the request is wrong.
    #[error(transparent)]
    Field(#[from] Fault),
    /// There is no such suggestion.
    #[error("there is no suggestion {id}; {count} were made so far, counted from 1")]
    UnknownSuggestion {
        /// The id that was asked for.
        id: u64,
        /// The number of suggestions.
        count: usize,
    },
    /// The suggestion is no longer pending.
    #[error("suggestion {id} is {state} and not pending; ask for the next suggestion")]
    NotPending {
        /// The suggestion's id.
        id: u64,
        /// Its state.
        state: SuggestionState,
    },
    /// There is no such observation.
    #[error("there is no observation {number}; {count} were received so far, counted from 1")]
    UnknownObservation {
        /// The number that was asked for.
        number: u64,
        /// The number of observations.
        count: usize,
    },
    /// The session is full.
    #[error("this session has {most} {what}, the most that there may be; {hint}")]
    Full {
        /// What there are too many of.
        what: &'static str,
        /// The most that fit.
        most: usize,
        /// What to do.
        hint: &'static str,
    },
    /// No movement can be chosen.
    #[error("nothing can be suggested: {0}")]
    Selection(SelectionError),
    /// The estimate has left the range of numbers: nothing is learned any more.
    #[error("{0}; exclude the observation at which it happened")]
    Ended(String),
    /// The caller no longer waits.
    #[error("the caller no longer waits, so nothing was done; ask again")]
    GivenUp,
    /// Another change was committed after this one was prepared.
    #[error("the session has changed since this was prepared; prepare it anew")]
    Stale,
}

/// Why stored events make no session.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// The setup does not fit this version.
    #[error(transparent)]
    Setup(#[from] SetupError),
    /// The text is no session.
    #[error("this is no session of body-schema: {0}")]
    NotASession(String),
    /// The session was written by a later version.
    #[error(
        "this session was written in version {found} of its form, and this program knows {known}; update body-schema"
    )]
    Version {
        /// The version of the session.
        found: u32,
        /// The latest known version.
        known: u32,
    },
    /// An event cannot have happened.
    #[error("event {index} (counted from 1) cannot have happened: {what}")]
    Event {
        /// The event, counted from 1.
        index: usize,
        /// Why not.
        what: String,
    },
}
