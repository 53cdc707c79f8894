//! The events of a session.

use serde::{Deserialize, Serialize};

use super::{Answer, Observation, Outcome, Setup, Suggestion};

/// The version of the form in which sessions are written.
pub const VERSION: u32 = 1;

/// An event.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Event {
    /// Its time, seconds since 1970, if the caller gave one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at_s: Option<f64>,
    /// What happened.
    #[serde(flatten)]
    pub happened: Happened,
}

/// What happened.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum Happened {
    /// A movement was suggested.
    Suggested {
        /// The suggestion as it was then: pending.
        suggestion: Suggestion,
        /// How it was chosen.
        choice: Choice,
    },
    /// A suggestion is not going to be carried out.
    Outcome {
        /// The suggestion's id.
        suggestion: u64,
        /// Why.
        state: Outcome,
        /// The reason in words.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        reason: Option<String>,
    },
    /// Suggestions are replaced.
    Superseded {
        /// The suggestions' ids.
        suggestions: Vec<u64>,
        /// The reason.
        why: Why,
    },
    /// The time of suggestions ran out.
    Expired {
        /// The suggestions' ids.
        suggestions: Vec<u64>,
    },
    /// An observation was received.
    Observed {
        /// The observation as it was received.
        told: Observation,
        /// The answer to it.
        answer: Answer,
    },
    /// An observation is excluded from now on.
    Excluded {
        /// Its number.
        observation: u64,
    },
    /// An observation counts again.
    Included {
        /// Its number.
        observation: u64,
    },
}

/// Why suggestions are replaced.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Why {
    /// The body has changed.
    ChangedBody,
    /// They are not feasible any more.
    Constraints,
    /// Their client asked for others.
    Replan,
}

/// How a suggestion was chosen.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Choice {
    /// The criterion after the movement, in its own units.
    pub criterion: Option<f64>,
    /// The number of configurations that were evaluated.
    pub evaluations: usize,
    /// The time it took, milliseconds.
    pub selection_ms: f64,
    /// The planned movements that follow.
    pub plan: Option<Plan>,
}

/// Movements that are planned to follow a suggestion.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    /// The postures, rad or m per joint, base first.
    pub postures: Vec<Vec<f64>>,
    /// The number of them that are made before the next plan.
    pub committed: usize,
}

/// A whole session, as it is written to a file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Document {
    /// The version of the form, [`VERSION`].
    pub version: u32,
    /// The setup.
    pub setup: Setup,
    /// The events, in order.
    pub events: Vec<Event>,
}
