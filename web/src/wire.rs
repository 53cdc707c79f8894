//! The server's own messages, as far as the panel reads them. What it passes on from the engine (scenarios,
//! descriptions, reports, choices) are the engine's own types.

use body_schema_ask_tell::{Answer, Status, Suggestion};
use body_schema_scenario::WorldKind;
use body_schema_wire::{Description, JointDescription, JointKind};
use serde::Deserialize;

/// A session.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct Session {
    /// Its id.
    pub id: String,
    /// The kind of world in which its movements are made.
    pub world: WorldKind,
    /// The description of its experiment.
    pub description: Description,
    /// Its latest step.
    pub step: u64,
    /// Steps that recorded data still offer; null without an end.
    #[serde(default)]
    pub remaining: Option<u64>,
    /// Why its recording lacks steps, if it does.
    #[serde(default)]
    pub recording_failure: Option<String>,
}

/// Whether a joint turns.
pub fn joint_turns(joint: &JointDescription) -> bool {
    joint.kind == JointKind::Revolute
}

/// How a session with a robot elsewhere stands.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct Standing {
    /// The status in numbers.
    pub status: Status,
    /// The suggestions that wait to be carried out, in the order in which they were chosen.
    pub pending: Vec<Suggestion>,
    /// The answer to the latest observation.
    #[serde(default)]
    pub last: Option<Answer>,
}

/// Why the server refused (RFC 9457).
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(default)]
pub struct Problem {
    /// HTTP status; 0 where there was no answer.
    pub status: u16,
    /// What kind of error.
    pub title: String,
    /// What is wrong.
    pub detail: String,
    /// The field that is wrong.
    pub field: Option<String>,
    /// The step that the session is at.
    pub step: Option<u64>,
}

impl Problem {
    /// One sentence.
    pub fn sentence(&self) -> String {
        let text = if self.detail.is_empty() { &self.title } else { &self.detail };
        if text.is_empty() { "the server does not answer".to_owned() } else { text.clone() }
    }
}
