//! Watchers of a session, which keep it in memory.

use std::{
    ops::Deref,
    sync::{Arc, atomic::Ordering},
};

use super::Session;
use crate::server::problem::{Kind, Problem};

/// A watcher of a session.
pub(in crate::server) struct Watching(Arc<Session>);

/// A watcher that follows a session by a stream.
pub(in crate::server) struct Following(Watching);

impl Session {
    /// Counts the caller among the followers, of whom there are at most `most`.
    pub(in crate::server) fn follow(self: &Arc<Self>, most: usize) -> Result<Following, Problem> {
        let one_more = |streams| (streams < most).then_some(streams + 1);
        self.streams.fetch_update(Ordering::Relaxed, Ordering::Relaxed, one_more).map_err(|_| {
            let detail = format!("{most} streams follow this session already; close one, or try again later");
            Problem::new(Kind::TooManyStreams, detail)
        })?;
        Ok(Following(self.watch()))
    }

    /// Counts the caller among the watchers, as long as it keeps the returned value.
    pub(in crate::server) fn watch(self: &Arc<Self>) -> Watching {
        self.watchers.fetch_add(1, Ordering::Relaxed);
        Watching(self.clone())
    }
}

impl Deref for Watching {
    type Target = Session;

    fn deref(&self) -> &Session {
        &self.0
    }
}

impl Drop for Watching {
    fn drop(&mut self) {
        self.0.touch();
        self.0.watchers.fetch_sub(1, Ordering::Relaxed);
    }
}

impl Deref for Following {
    type Target = Session;

    fn deref(&self) -> &Session {
        &self.0
    }
}

impl Drop for Following {
    fn drop(&mut self) {
        self.0.streams.fetch_sub(1, Ordering::Relaxed);
    }
}
