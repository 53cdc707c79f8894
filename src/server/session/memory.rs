//! The memory of sessions, counted: all of them together stay within one budget.

use std::sync::{
    Arc,
    atomic::{AtomicUsize, Ordering},
};

use axum::body::Bytes;

use crate::server::problem::{Kind, Problem};

/// The memory that all sessions share for their reports and recordings.
#[derive(Debug)]
pub(in crate::server) struct Budget {
    used: AtomicUsize,
    limit: usize,
}

impl Budget {
    pub(in crate::server) fn new(limit: usize) -> Self {
        Self { used: AtomicUsize::new(0), limit }
    }

    /// Whether more steps may be made. The last command before the limit may overshoot it by what it makes.
    pub(in crate::server) fn has_room(&self) -> bool {
        self.used() < self.limit
    }

    /// Checks that there is room.
    pub(super) fn check(&self) -> Result<(), Problem> {
        match self.has_room() {
            true => Ok(()),
            false => Err(Problem::new(
                Kind::ServerFull,
                "the sessions together fill the server's memory, and nothing has happened; delete some and ask again",
            )),
        }
    }

    /// The bytes in use.
    pub(super) fn used(&self) -> usize {
        self.used.load(Ordering::Relaxed)
    }

    pub(super) fn take(&self, bytes: usize) {
        self.used.fetch_add(bytes, Ordering::Relaxed);
    }

    pub(super) fn give_back(&self, bytes: usize) {
        self.used.fetch_sub(bytes, Ordering::Relaxed);
    }
}

/// A share of a budget, returned when it is dropped.
pub(in crate::server) struct Taken {
    budget: Arc<Budget>,
    bytes: usize,
}

impl Taken {
    pub(in crate::server) fn of(budget: &Arc<Budget>, bytes: usize) -> Self {
        budget.take(bytes);
        Self { budget: budget.clone(), bytes }
    }
}

impl Drop for Taken {
    fn drop(&mut self) {
        self.budget.give_back(self.bytes);
    }
}

/// Bytes that count in the budget as long as anyone holds them.
pub(in crate::server) struct Counted {
    bytes: Vec<u8>,
    _taken: Taken,
}

impl Counted {
    pub(super) fn shared(bytes: Vec<u8>, budget: &Arc<Budget>) -> Bytes {
        let taken = Taken::of(budget, bytes.len());
        Bytes::from_owner(Self { bytes, _taken: taken })
    }
}

impl AsRef<[u8]> for Counted {
    fn as_ref(&self) -> &[u8] {
        &self.bytes
    }
}
