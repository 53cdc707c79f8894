//! What is known of a session that is in the store, in memory or not.

use std::{
    sync::{Mutex, OnceLock},
    time::Duration,
};

use body_schema_ask_tell as ask_tell;
use body_schema_ask_tell::ChannelShape;
use body_schema_wire::Description;
use serde::{Deserialize, Serialize};
use tokio::{
    sync::{Mutex as AsyncMutex, MutexGuard},
    time::timeout,
};
use tokio_util::sync::CancellationToken;
use uuid::Uuid;

use super::SessionResource;
use crate::server::problem::{Kind, Problem};

/// The time that a request waits for a session that is being moved.
pub(super) const MOVED_WITHIN: Duration = Duration::from_secs(20);

/// A session that is in the store.
pub(super) struct Known {
    pub(super) id: Uuid,
    pub(super) made_s: f64,
    /// Held while the session is moved, so that it is never in memory twice. It contains the end of an engine that was told to end,
    /// and may write until then.
    pub(super) moving: AsyncMutex<Option<CancellationToken>>,
    /// The session as it was when it left memory; without its status as it was described at first.
    pub(super) resource: Mutex<Option<SessionResource>>,
    /// The damage of the session, once it was checked.
    pub(super) damage: OnceLock<Option<String>>,
}

impl Known {
    pub(super) fn new(id: Uuid, made_s: f64) -> Self {
        Self { id, made_s, moving: AsyncMutex::new(None), resource: Mutex::new(None), damage: OnceLock::new() }
    }

    /// Waits until the session is not being moved, and its last engine has ended.
    pub(super) async fn still(&self) -> Result<MutexGuard<'_, Option<CancellationToken>>, Problem> {
        let still = timeout(MOVED_WITHIN, async {
            let mut moving = self.moving.lock().await;
            if let Some(ending) = moving.as_ref() {
                ending.cancelled().await;
            }
            *moving = None;
            moving
        });
        still
            .await
            .map_err(|_| Problem::new(Kind::Busy, "the session is coming to memory or leaving it; ask again later"))
    }
}

/// The constant part of a session's entry in a list.
#[derive(Serialize, Deserialize)]
pub(super) struct Summary {
    pub(super) description: Description,
    pub(super) channels: Vec<ChannelShape>,
}

impl Summary {
    pub(super) fn of(session: &ask_tell::Session) -> Self {
        Self { description: session.description(), channels: session.channels().to_vec() }
    }

    /// Of numbers, texts and lists alone, it can be written.
    pub(super) fn text(&self) -> String {
        serde_json::to_string(self).unwrap_or_default()
    }
}
