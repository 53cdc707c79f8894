//! What happens in a session.

use serde::{Deserialize, Serialize};

use super::{Answer, Observation, Outcome, Setup, Suggestion};

/// The version of the form in which sessions are written.
pub const VERSION: u32 = 1;

/// Something that happened.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Event {
    /// When, seconds since 1970, if whoever called said so.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at_s: Option<f64>,
    /// What.
    #[serde(flatten)]
    pub happened: Happened,
}

/// What happened.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum Happened {
    /// A movement was suggested.
    Suggested {
        /// As it was then: pending.
        suggestion: Suggestion,
        /// How it was chosen.
        choice: Choice,
    },
    /// A suggestion is not carried out.
    Outcome {
        /// Its id.
        suggestion: u64,
        /// Why.
        state: Outcome,
        /// The same in words.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        reason: Option<String>,
    },
    /// Suggestions are replaced.
    Superseded {
        /// Their ids.
        suggestions: Vec<u64>,
        /// Why.
        why: Why,
    },
    /// The time of suggestions ran out.
    Expired {
        /// Their ids.
        suggestions: Vec<u64>,
    },
    /// An observation was told.
    Observed {
        /// As it was told.
        told: Observation,
        /// What was answered.
        answer: Answer,
    },
    /// An observation counts for nothing from now on.
    Excluded {
        /// Its number.
        observation: u64,
    },
    /// It counts again.
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
    /// How many configurations were evaluated.
    pub evaluations: usize,
    /// How long it took, milliseconds.
    pub selection_ms: f64,
    /// What is planned to follow.
    pub plan: Option<Plan>,
}

/// Movements that are planned to follow a suggestion.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    /// Rad or m per joint, base first.
    pub postures: Vec<Vec<f64>>,
    /// How many of them are made before the next plan.
    pub committed: usize,
}

/// A whole session, as it is written to a file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Document {
    /// [`VERSION`].
    pub version: u32,
    /// What it is about.
    pub setup: Setup,
    /// What happened, in order.
    pub events: Vec<Event>,
}
