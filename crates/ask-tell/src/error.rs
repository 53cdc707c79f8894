//! What is refused, and why: the field, what is wrong with it, how to mend it.

use std::fmt;

use super::SuggestionState;
use body_schema_engine::selection::SelectionError;
use body_schema_scenario::{Problem, ScenarioError};

/// Something that is wrong with what was given.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fault {
    /// The field, with its path, as `configuration.elbow`.
    pub field: String,
    /// What is wrong.
    pub what: String,
    /// How to mend it.
    pub mend: String,
}

impl Fault {
    pub(super) fn new(field: impl Into<String>, what: impl Into<String>, mend: impl Into<String>) -> Self {
        Self { field: field.into(), what: what.into(), mend: mend.into() }
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "`{}`: {}; {}", self.field, self.what, self.mend)
    }
}

impl std::error::Error for Fault {}

impl From<Problem> for Fault {
    fn from(Problem { key, what, mend, .. }: Problem) -> Self {
        // Lines are those of a text that nobody has written.
        Self { field: if key == "(file)" { "calibration".to_owned() } else { key }, what, mend }
    }
}

/// Why there is no session of a setup.
#[derive(Debug, thiserror::Error)]
pub enum SetupError {
    /// Values that cannot be used.
    #[error("{}", .0.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n"))]
    Invalid(Vec<Fault>),
    /// No agent can be made of it.
    #[error("`agent`: {0}")]
    Agent(ScenarioError),
}

impl SetupError {
    /// What to do about an agent that cannot be made.
    pub const AGENT_MEND: &str = "name a learner of the calibration, or an estimator and a policy";
}

impl From<Fault> for SetupError {
    fn from(fault: Fault) -> Self {
        Self::Invalid(vec![fault])
    }
}

/// Why something was refused. Nothing was changed by it.
#[derive(Debug, thiserror::Error)]
pub enum Refusal {
    /// A field of what was given.
    #[error(transparent)]
    Field(#[from] Fault),
    /// There is no such suggestion.
    #[error("there is no suggestion {id}; {count} were made so far, counted from 1")]
    UnknownSuggestion {
        /// What was asked for.
        id: u64,
        /// How many there are.
        count: usize,
    },
    /// The suggestion has come to its end.
    #[error("suggestion {id} is {state} and not pending; ask for the next suggestion")]
    NotPending {
        /// Which.
        id: u64,
        /// What became of it.
        state: SuggestionState,
    },
    /// There is no such observation.
    #[error("there is no observation {number}; {count} were told so far, counted from 1")]
    UnknownObservation {
        /// What was asked for.
        number: u64,
        /// How many there are.
        count: usize,
    },
    /// No more fits into the session.
    #[error("this session has {most} {what}, the most that there may be; {mend}")]
    Full {
        /// Of what.
        what: &'static str,
        /// How many.
        most: usize,
        /// What to do.
        mend: &'static str,
    },
    /// No movement can be chosen.
    #[error("nothing can be suggested: {0}")]
    Selection(SelectionError),
    /// The estimate has left the range of numbers: nothing is learned any more.
    #[error("{0}; exclude the observation at which it happened")]
    Ended(String),
    /// Whoever asked waits no longer.
    #[error("nobody waits for it any longer, and nothing has happened; ask again")]
    GivenUp,
    /// Something else was committed after this was prepared.
    #[error("the session has changed since this was prepared; prepare it anew")]
    Stale,
}

/// Why stored events are none of this session.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// The setup does not fit this version.
    #[error(transparent)]
    Setup(#[from] SetupError),
    /// The text is no session.
    #[error("this is no session of body-schema: {0}")]
    NotASession(String),
    /// Written by a later version.
    #[error(
        "this session was written in version {found} of its form, and this program knows {known}; update body-schema"
    )]
    Version {
        /// Of the session.
        found: u32,
        /// The latest known.
        known: u32,
    },
    /// An event that cannot have happened.
    #[error("event {index} (counted from 1) cannot have happened: {what}")]
    Event {
        /// Counted from 1.
        index: usize,
        /// Why not.
        what: String,
    },
}
