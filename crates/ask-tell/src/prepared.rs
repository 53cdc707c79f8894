//! A change of a session that was tried and has not happened yet.

use super::{Event, ledger::Ledger};

/// A change that was tried, with the answer once it is made.
#[must_use = "nothing has happened until it is committed"]
pub struct Prepared<A> {
    /// The number of events that the session had.
    pub(super) revision: usize,
    /// The events that are appended.
    pub(super) events: Vec<Event>,
    /// The answer.
    pub(super) answer: A,
    /// The session after it; `None` where nothing changes.
    pub(super) ledger: Option<Ledger>,
}

impl<A> Prepared<A> {
    /// The events that will be appended, to be written first; empty where nothing changes.
    pub fn events(&self) -> &[Event] {
        &self.events
    }

    /// The number of events before these.
    pub fn revision(&self) -> usize {
        self.revision
    }

    /// The answer that will be given.
    pub fn answer(&self) -> &A {
        &self.answer
    }
}
