//! The request for a session with a robot elsewhere, and the snapshot of its state.

use std::sync::Arc;

use serde::{Deserialize, Serialize};
use serde_json::Value;
use utoipa::ToSchema;

use body_schema_ask_tell::{Answer, ChannelShape, Event, Status, Suggestion, Told};
use body_schema_recording::EllipsoidSize;

/// The request for a session with a robot elsewhere.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct NewOutsideSession {
    /// `outside`.
    pub world: OutsideWorld,
    /// The keys of a calibration file as JSON, with the text of the URDF as `robot.urdf` and without measurements.
    #[schema(value_type = Object)]
    pub calibration: Value,
    /// The events so far, in the form of `session.json` of another session or of a saved one; none if absent.
    #[serde(default)]
    #[schema(value_type = Vec<Object>)]
    pub events: Vec<Event>,
    /// The version of the form of these events; the latest if absent.
    #[serde(default)]
    pub version: Option<u32>,
    /// The learner that decides; `global`, unless the calibration lists others, if absent or null.
    #[serde(default)]
    pub agent: Option<String>,
    /// The seed of all random draws.
    #[serde(default, deserialize_with = "body_schema_ask_tell::integer::integer")]
    pub seed: u64,
    /// The size of the ellipsoids of its recording.
    #[serde(default)]
    pub ellipsoids: EllipsoidSize,
}

/// The world of a robot elsewhere.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "lowercase")]
pub enum OutsideWorld {
    /// A robot elsewhere.
    Outside,
}

/// A snapshot of a session, for everyone to read while its engine is busy. Followers receive its status and what is pending.
#[derive(Debug, Serialize, ToSchema)]
pub(in crate::server) struct Snapshot {
    /// The status.
    pub(in crate::server) status: Status,
    /// The pending suggestions of all clients, in the order in which they were chosen.
    #[schema(value_type = Vec<Suggestion>)]
    pub(in crate::server) pending: Vec<Arc<Suggestion>>,
    /// The answer to the latest observation; null before any.
    pub(in crate::server) last: Option<Answer>,
    /// All suggestions ever made, by id.
    #[serde(skip)]
    pub(in crate::server) suggestions: Vec<Arc<Suggestion>>,
    /// All observations ever received, by number.
    #[serde(skip)]
    pub(in crate::server) observations: Vec<Arc<Told>>,
    /// The id of its recording.
    #[serde(skip)]
    pub(in crate::server) recording: String,
    #[serde(skip)]
    pub(in crate::server) channels: Arc<[ChannelShape]>,
}

impl Snapshot {
    /// The observations that count, each of which is a step.
    pub(super) fn step(&self) -> u64 {
        self.status.observations - self.status.excluded.len() as u64
    }
}
