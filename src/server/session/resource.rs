//! A session as its resource shows it.

use serde::Serialize;
use utoipa::ToSchema;

use super::{Session, SessionResource, lock};
use body_schema_scenario::WorldKind;

impl Session {
    /// The kind of its world.
    pub(super) fn world(&self) -> WorldKind {
        if self.is_external() { WorldKind::External } else { body_schema_backend::world(&self.description) }
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
