//! A session as its resource shows it.

use serde::Serialize;
use utoipa::ToSchema;

use super::{Session, lock};
use body_schema_ask_tell::{ChannelShape, Status};
use body_schema_experiment::Description;
use body_schema_scenario::WorldKind;

/// A session as its resource shows it.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct SessionResource {
    /// Its id.
    #[schema(format = "uuid")]
    pub id: String,
    /// The kind of world in which its movements are made.
    pub world: WorldKind,
    /// The description of its experiment, which is the same at every step.
    pub description: Description,
    /// The latest step; 0 is the start, before any movement. With a robot elsewhere a step is an observation that counts.
    pub step: u64,
    /// The number of steps that the recorded data set has left; null in a simulated world and with a robot elsewhere, which
    /// have no end.
    pub remaining: Option<u64>,
    /// The id of its recording, by which viewers tell one from another: with a robot elsewhere another one each time the
    /// session comes back to memory. Null for one that is not there.
    pub recording: Option<String>,
    /// Name of the recording's file in the server's data directory; null if it keeps none.
    pub file: Option<String>,
    /// Why the recording's file lacks steps, if it could not be written; null otherwise. Nothing else is affected, and it is
    /// written anew when the session ends.
    pub recording_failure: Option<String>,
    /// Why the session can make no more steps, if its engine has failed; null otherwise.
    pub failure: Option<String>,
    /// The status of a session with a robot elsewhere. Null for all others, and in a list for one that was not asked for
    /// since the server was started.
    pub status: Option<Status>,
    /// The channels of a session with a robot elsewhere, by their names among the measurements of an observation; empty for
    /// all others.
    pub channels: Vec<ChannelShape>,
}

impl Session {
    /// The kind of its world.
    pub(super) fn world(&self) -> WorldKind {
        match self.description.movements_available {
            _ if self.is_elsewhere() => WorldKind::Outside,
            Some(_) => WorldKind::Measured,
            None => WorldKind::Simulated,
        }
    }

    pub(in crate::server) fn resource(&self) -> SessionResource {
        let standing = self.shared.standing.borrow().clone();
        SessionResource {
            id: self.id.to_string(),
            world: self.world(),
            description: self.description.clone(),
            step: standing.as_deref().map_or(self.step(), |standing| standing.step()),
            remaining: self.remaining(),
            recording: Some(standing.as_deref().map_or(self.id.to_string(), |standing| standing.recording.clone())),
            file: self.file.clone(),
            recording_failure: lock(&self.shared.recording_failure).clone(),
            failure: self.failure(),
            status: standing.as_deref().map(|standing| standing.status.clone()),
            channels: standing.as_deref().map(|standing| standing.channels.to_vec()).unwrap_or_default(),
        }
    }
}

/// A kept session that is not as it was written.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct DamagedSession {
    /// Its id.
    pub id: String,
    /// What is wrong with it.
    pub detail: String,
}
