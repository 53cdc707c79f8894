//! What a session has come to after some of its events, so that nobody need learn it again.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};

use super::{Event, Happened, ledger::Ledger};
use body_schema_experiment as experiment;
use body_schema_wire::{Description, StepReport};

/// What was learned from the first events of a session, by the same build: replaying goes on from there, to the last bit as if it had
/// begun at the first event.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Checkpoint {
    /// After so many events.
    events: usize,
    /// So many were known when it was made: which observations count is told by all of them.
    known: usize,
    experiment: experiment::Checkpoint,
}

impl Checkpoint {
    pub(super) fn of(ledger: &Ledger, events: usize, known: usize) -> Option<Self> {
        Some(Self { events, known, experiment: ledger.experiment.checkpoint()? })
    }

    /// As [`to_bytes`](Self::to_bytes) wrote it; `None` for anything else, as what another build wrote.
    pub fn from_bytes(bytes: &[u8]) -> Option<Self> {
        postcard::from_bytes(bytes).ok()
    }

    /// To be read by the same build.
    pub fn to_bytes(&self) -> Vec<u8> {
        // It holds numbers, texts and lists alone.
        postcard::to_allocvec(self).unwrap_or_default()
    }

    /// After so many events it was made.
    pub fn events(&self) -> usize {
        self.events
    }

    /// The step after which it was made.
    pub fn step(&self) -> u64 {
        self.experiment.step()
    }

    /// Whether replaying these events may go on from it: all that came before it counts as it did, and some observation that counts
    /// comes after it.
    pub fn serves(&self, events: &[Event]) -> bool {
        if self.events > events.len() || self.known > events.len() {
            return false;
        }
        let is_told = |event: &&Event| matches!(event.happened, Happened::Observed { .. });
        let told = events[..self.events].iter().filter(is_told).count() as u64;
        let counts_as_before = events[self.known..].iter().all(|event| match event.happened {
            Happened::Excluded { observation } | Happened::Included { observation } => observation > told,
            _ => true,
        });
        let all = events.iter().filter(is_told).count() as u64;
        let excluded = excluded(events);
        counts_as_before && (told + 1..=all).any(|number| !excluded.contains(&number))
    }

    pub(super) fn experiment(&self) -> &experiment::Checkpoint {
        &self.experiment
    }
}

/// The observations that do not count after all of these events.
pub(super) fn excluded(events: &[Event]) -> BTreeSet<u64> {
    let mut excluded = BTreeSet::new();
    for event in events {
        match event.happened {
            Happened::Excluded { observation } => drop(excluded.insert(observation)),
            Happened::Included { observation } => drop(excluded.remove(&observation)),
            _ => {}
        }
    }
    excluded
}

/// A step that is replayed.
pub struct Replayed<'a> {
    /// After so many events.
    pub events: usize,
    pub(super) known: usize,
    pub(super) ledger: &'a Ledger,
}

impl Replayed<'_> {
    /// What was learned up to it; `None` for a learner that keeps nothing to go on from.
    pub fn checkpoint(&self) -> Option<Checkpoint> {
        Checkpoint::of(self.ledger, self.events, self.known)
    }

    /// The step that it is.
    pub fn step(&self) -> u64 {
        self.ledger.experiment.latest().step
    }

    /// Its report.
    pub fn report(&self) -> StepReport {
        StepReport::of(&self.ledger.experiment)
    }

    /// How many observations had been told, those that do not count among them.
    pub fn told(&self) -> u64 {
        self.ledger.told.len() as u64
    }

    /// What stays the same from step to step.
    pub fn description(&self) -> Description {
        Description::of(&self.ledger.experiment)
    }

    /// How many events there are in all.
    pub fn of(&self) -> usize {
        self.known
    }
}

/// Finds the checkpoint from which replaying these events is to go on.
pub type Find<'a> = dyn FnMut(&[Event]) -> Option<Checkpoint> + 'a;

/// Hears of every step that is replayed, and says whether it is to go on.
pub type Hear<'a> = dyn FnMut(Replayed<'_>) -> bool + 'a;
