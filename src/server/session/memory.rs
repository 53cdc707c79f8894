//! What sessions keep, counted: all of them together stay within one budget.

use std::{
    mem::{size_of, size_of_val},
    sync::atomic::{AtomicUsize, Ordering},
};

use crate::experiment::{JointMetrics, JointReport, LearnerReport, MovementReport, StepReport};

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
    pub(super) fn has_room(&self) -> bool {
        self.used.load(Ordering::Relaxed) < self.limit
    }

    pub(super) fn take(&self, bytes: usize) {
        self.used.fetch_add(bytes, Ordering::Relaxed);
    }

    pub(super) fn give_back(&self, bytes: usize) {
        self.used.fetch_sub(bytes, Ordering::Relaxed);
    }
}

/// About how much memory a report takes.
pub(super) fn of(report: &StepReport) -> usize {
    let learner = |learner: &LearnerReport| {
        let movement = learner.movement.as_ref().map_or(0, |movement| {
            size_of::<MovementReport>()
                + size_of_val(&movement.configuration[..])
                + size_of_val(&movement.estimated_skeleton_m[..])
                + movement.true_skeleton_m.as_ref().map_or(0, |skeleton| size_of_val(&skeleton[..]))
        });
        let joints = learner.estimate.joints.len() * (size_of::<JointReport>() + size_of::<JointMetrics>());
        size_of::<LearnerReport>() + joints + movement
    };
    size_of::<StepReport>() + report.learners.iter().map(learner).sum::<usize>()
}
