//! Checkpoints: what a session has learned from some of its events, so that it need not be learned again.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};

use super::{Event, Happened};
use body_schema_experiment as experiment;
use body_schema_experiment::Experiment;
use body_schema_wire::{Description, StepReport};

/// A checkpoint: what was learned from the first events of a session, by the same build. Replaying goes on from it, with results
/// equal to the last bit to those from the first event.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Checkpoint {
    /// The number of events that it covers.
    events: usize,
    /// The number of events known when it was made, which decide which observations count.
    known: usize,
    experiment: experiment::Checkpoint,
}

impl Checkpoint {
    pub(super) fn of(experiment: &Experiment, events: usize, known: usize) -> Option<Self> {
        Some(Self { events, known, experiment: experiment.checkpoint()? })
    }

    /// Reads what [`to_bytes`](Self::to_bytes) wrote; `None` for anything else, such as bytes from another build.
    pub fn from_bytes(bytes: &[u8]) -> Option<Self> {
        postcard::from_bytes(bytes).ok()
    }

    /// The checkpoint as bytes for the same build.
    pub fn to_bytes(&self) -> Vec<u8> {
        // It holds numbers, texts and lists alone.
        postcard::to_allocvec(self).unwrap_or_default()
    }

    /// The number of events after which it was made.
    pub fn events(&self) -> usize {
        self.events
    }

    /// The step after which it was made.
    pub fn step(&self) -> u64 {
        self.experiment.step()
    }

    /// Whether replaying these events may go on from it: everything before it counts as it did then, and some observation that
    /// counts comes after it.
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

/// The observations that are excluded after all of these events.
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

/// A step of a replay.
pub struct Replayed<'a> {
    /// After so many events.
    pub events: usize,
    pub(super) known: usize,
    /// How many observations had been told, those that do not count among them.
    pub told: u64,
    pub(super) experiment: &'a Experiment,
}

impl Replayed<'_> {
    /// The checkpoint after this step; `None` for a learner that cannot go on from one.
    pub fn checkpoint(&self) -> Option<Checkpoint> {
        Checkpoint::of(self.experiment, self.events, self.known)
    }

    /// The step that it is.
    pub fn step(&self) -> u64 {
        self.experiment.latest().step
    }

    /// Its report.
    pub fn report(&self) -> StepReport {
        StepReport::of(self.experiment)
    }

    /// What stays the same from step to step.
    pub fn description(&self) -> Description {
        Description::of(self.experiment)
    }

    /// The number of all events.
    pub fn of(&self) -> usize {
        self.known
    }
}

/// A function that finds the checkpoint from which replaying these events goes on.
pub type Find<'a> = dyn FnMut(&[Event]) -> Option<Checkpoint> + 'a;

/// A function that receives every replayed step, and says whether to go on.
pub type Hear<'a> = dyn FnMut(Replayed<'_>) -> bool + 'a;
