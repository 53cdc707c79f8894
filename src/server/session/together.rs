//! The recording for late followers, put together once for all of them.

use std::sync::Arc;

use axum::body::Bytes;
use tokio::sync::Mutex as AsyncMutex;

use super::{Session, memory::Counted, recording_failed};
use crate::server::{blocking::run_blocking, problem::Problem};

/// The number of parts from which on they are put together: a viewer reads some dozens a frame.
const MANY_PARTS: usize = 200;

/// The recording so far, without its header, in few parts.
pub(in crate::server) struct Together {
    pub(in crate::server) parts: Vec<Bytes>,
    /// The index of the recording's next part.
    pub(in crate::server) next: usize,
}

/// The recording that was put together last.
pub(super) type LastTogether = Arc<AsyncMutex<Option<Arc<Together>>>>;

impl Together {
    /// Whether so much has come since that it should be made anew: when the recording has grown by a fifth at least, so that all
    /// copies that slow readers still hold amount to a few times the recording.
    fn is_outdated(&self, length: usize) -> bool {
        length.saturating_sub(self.next) > MANY_PARTS.max(self.next / 5)
    }
}

impl Session {
    /// The scene's recording from its beginning in few parts; `None` if there are not many. One copy is made at a time, however
    /// many wait for it, and its bytes count in the memory of all sessions.
    pub(in crate::server) async fn together(&self) -> Result<Option<Arc<Together>>, Problem> {
        let (live, budget) = (self.live().clone(), self.shared.budget.clone());
        if live.len() < MANY_PARTS {
            return Ok(None);
        }
        // Held to the end of the work, whether or not whoever asked still waits.
        let mut kept = self.together.clone().lock_owned().await;
        if let Some(together) = kept.as_ref().filter(|together| !together.is_outdated(live.len())) {
            return Ok(Some(together.clone()));
        }
        let made = run_blocking(move || {
            let parts = live.scene_parts_from(1);
            let next = 1 + parts.len();
            let parts = live.put_together(&parts).map_err(recording_failed)?;
            let parts = parts.into_iter().map(|part| Counted::shared(part.into(), &budget)).collect();
            let together = Arc::new(Together { parts, next });
            *kept = Some(together.clone());
            Ok::<_, Problem>(together)
        });
        made.await.map(Some)
    }
}
