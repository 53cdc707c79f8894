//! What the learners have done so far: a few numbers per learner and step, small enough to keep them all.

use crate::wire::{Description, LearnerReport, Report, Thresholds};

/// Movements within the thresholds that must follow before a run counts as converged.
pub const CONFIRMATION: u64 = 20;

/// One learner after one step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Row {
    /// Mean error of the angles between axes, degrees.
    pub orientation_deg: Option<f64>,
    /// Mean distance to the true axis points, metres.
    pub location_m: Option<f64>,
    /// Mean distance of the predicted marker, metres.
    pub prediction_m: Option<f64>,
    /// tr(W P).
    pub trace: Option<f64>,
    /// Cramér–Rao bound on it, given the data collected.
    pub bound: Option<f64>,
    /// Expected fall of the trace.
    pub gain: Option<f64>,
    /// How long the choice took, ms.
    pub selection_ms: Option<f64>,
    /// Movements made.
    pub movements: u64,
    /// Movements after which the marker was not seen.
    pub misses: u64,
    /// The learner's own verdict.
    pub settled: bool,
    /// It has stopped learning.
    pub failed: bool,
}

impl Row {
    fn of(report: &LearnerReport) -> Self {
        let LearnerReport { movement, metrics, failure } = report;
        Self {
            orientation_deg: metrics.orientation_deg,
            location_m: metrics.location_m,
            prediction_m: metrics.prediction_mean_m,
            trace: metrics.trace,
            bound: metrics.bound_trace,
            gain: movement.as_ref().and_then(|movement| movement.gain),
            selection_ms: movement.as_ref().map(|movement| movement.selection_ms),
            movements: metrics.movements,
            misses: metrics.misses,
            settled: metrics.settled,
            failed: failure.is_some(),
        }
    }

    /// Whether both errors are within the thresholds; `None` where no truth is known. A NaN is outside.
    pub fn within(&self, thresholds: &Thresholds) -> Option<bool> {
        if self.orientation_deg.is_none() && self.location_m.is_none() {
            return None;
        }
        let orientation = self.orientation_deg.is_none_or(|error| error <= thresholds.orientation_deg);
        let location = self.location_m.is_none_or(|error| error <= thresholds.location_m);
        Some(orientation && location)
    }
}

/// What has become of a learner.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// No movement yet.
    Waiting,
    /// Its estimate ran away; it has stopped.
    Diverged,
    /// On its way; there is no truth to judge by.
    Learning,
    /// It says itself that it knows enough; there is no truth to judge by.
    Settled,
    /// Errors outside the thresholds.
    Outside,
    /// Within the thresholds since a movement; so many more have confirmed it.
    Within(u64, u64),
    /// Within the thresholds since this movement, confirmed by 20 more.
    Converged(u64),
}

/// All steps of a session.
#[derive(Clone, Debug, Default)]
pub struct History {
    thresholds: Thresholds,
    change_at: Option<u64>,
    /// The step of the first row.
    first: u64,
    /// Step by step, all learners.
    rows: Vec<Vec<Row>>,
    /// Per learner, the reason why it stopped.
    failures: Vec<Option<String>>,
}

impl History {
    /// A session that has not begun.
    pub fn new(description: &Description) -> Self {
        Self {
            thresholds: description.thresholds,
            change_at: description.change_at,
            first: 0,
            rows: Vec::new(),
            failures: vec![None; description.learners.len()],
        }
    }

    /// Takes a report in, the first whatever its step; one that is known already or leaves a gap changes nothing.
    pub fn take(&mut self, report: &Report) -> bool {
        if self.rows.is_empty() {
            self.first = report.step;
        }
        if report.step != self.first + self.rows.len() as u64 || report.learners.len() != self.failures.len() {
            return false;
        }
        for (failure, learner) in self.failures.iter_mut().zip(&report.learners) {
            failure.clone_from(&learner.failure);
        }
        self.rows.push(report.learners.iter().map(Row::of).collect());
        true
    }

    /// The first step; 0 before any.
    pub fn first(&self) -> u64 {
        self.first
    }

    /// The latest step; 0 before any.
    pub fn latest(&self) -> u64 {
        self.first + self.rows.len().saturating_sub(1) as u64
    }

    /// Whether there is nothing yet.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// A learner's row at a step.
    pub fn row(&self, step: u64, learner: usize) -> Option<&Row> {
        self.rows.get(usize::try_from(step.checked_sub(self.first)?).ok()?)?.get(learner)
    }

    /// One number of a learner over all steps; those that are not finite are left out.
    pub fn curve(&self, learner: usize, value: impl Fn(&Row) -> Option<f64>) -> Vec<[f64; 2]> {
        let steps = (self.first..).zip(&self.rows);
        steps
            .filter_map(|(step, rows)| Some([step as f64, value(rows.get(learner)?)?]))
            .filter(|[_, value]| value.is_finite())
            .collect()
    }

    /// Why a learner stopped.
    pub fn failure(&self, learner: usize) -> Option<&str> {
        self.failures.get(learner)?.as_deref()
    }

    /// What has become of a learner up to a step. After a change of the body movements count from the change.
    pub fn verdict(&self, step: u64, learner: usize) -> Verdict {
        let Some(row) = self.row(step, learner) else { return Verdict::Waiting };
        if row.failed {
            return Verdict::Diverged;
        }
        if step == 0 {
            return Verdict::Waiting;
        }
        let Some(within) = row.within(&self.thresholds) else {
            return if row.settled { Verdict::Settled } else { Verdict::Learning };
        };
        if !within {
            return Verdict::Outside;
        }
        let begin = self.change_at.filter(|change| step > *change).map_or(0, |change| change + 1);
        let outside = (begin..step)
            .rev()
            .find(|step| self.row(*step, learner).and_then(|row| row.within(&self.thresholds)) == Some(false));
        let first = outside.map_or(begin, |outside| outside + 1);
        let confirmed = step - first;
        if confirmed >= CONFIRMATION { Verdict::Converged(first) } else { Verdict::Within(first, confirmed) }
    }

    /// Where the learner converged, judged up to a step.
    pub fn converged_at(&self, step: u64, learner: usize) -> Option<u64> {
        match self.verdict(step, learner) {
            Verdict::Converged(first) => Some(first),
            _ => None,
        }
    }
}
