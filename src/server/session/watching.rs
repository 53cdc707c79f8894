//! Who watches a session keeps it in memory.

use std::{
    ops::Deref,
    sync::{Arc, atomic::Ordering},
};

use super::Session;

/// One who watches a session.
pub(in crate::server) struct Watching(Arc<Session>);

impl Session {
    /// Counts the caller among those who watch, as long as it keeps the answer.
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
