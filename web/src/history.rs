//! The history of the learners: a few numbers per learner and step, small enough to keep them all.

use body_schema_experiment::Convergence;
use body_schema_wire::{ChannelReading, Description, LearnerReport, StepReport};

/// The numbers of one learner after one step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Row {
    /// Mean error of the angles between axes, degrees.
    pub orientation_deg: Option<f64>,
    /// Mean distance to the true axis points, metres.
    pub location_m: Option<f64>,
    /// Mean distance of the predicted marker, metres.
    pub prediction_m: Option<f64>,
    /// Mean distance of a predicted target from its mean in held-out sockets, metres.
    pub scatter_m: Option<f64>,
    /// Mean error of predictions over the workspace as the learner itself expects it, metres.
    pub expected_m: Option<f64>,
    /// tr(W P).
    pub trace: Option<f64>,
    /// The least trace that its data allow, linearised at the truth.
    pub bound: Option<f64>,
    /// Expected fall of the trace.
    pub gain: Option<f64>,
    /// The time of the choice, ms.
    pub selection_ms: Option<f64>,
    /// Movements made.
    pub movements: u64,
    /// Movements after which the marker was not seen.
    pub misses: u64,
    /// The learner's own verdict.
    pub settled: bool,
    /// Whether it has stopped learning.
    pub failed: bool,
    /// The step since which both errors are within the thresholds; `None` outside of them, and where no truth is known.
    pub within_since: Option<u64>,
    /// The movement at which it converged, once enough movements have confirmed it.
    pub converged_at: Option<u64>,
}

impl Row {
    /// The error that shows how good it is where no truth is known, metres; see [`Yardstick`].
    pub fn error_m(&self) -> Option<f64> {
        self.prediction_m.or(self.scatter_m).or(self.expected_m)
    }

    /// The row of a report; `convergence` is judged up to it, and counts from step `begin`.
    fn of(report: &LearnerReport, convergence: &Convergence, begin: u64) -> Self {
        let LearnerReport { movement, metrics, failure, .. } = report;
        let step = |movements: u64| begin + movements;
        Self {
            orientation_deg: metrics.orientation_deg,
            location_m: metrics.location_m,
            prediction_m: metrics.prediction_mean_m,
            scatter_m: metrics.scatter_m,
            expected_m: metrics.expected_prediction_m,
            trace: metrics.trace,
            bound: metrics.bound_trace,
            gain: movement.as_ref().and_then(|movement| movement.gain),
            selection_ms: movement.as_ref().map(|movement| movement.selection_ms),
            movements: metrics.movements,
            misses: metrics.misses,
            settled: metrics.settled,
            failed: failure.is_some(),
            within_since: convergence.within_since().map(step),
            converged_at: convergence.converged_at().map(step),
        }
    }

    /// Whether there is a truth to judge by.
    fn is_judged(&self) -> bool {
        self.orientation_deg.is_some() || self.location_m.is_some()
    }
}

/// The error by which learners are best judged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Yardstick {
    /// Predictions, compared with the truth or with held-out measurements.
    Prediction,
    /// The scatter of predictions in sockets, if nothing else is measured.
    Scatter,
    /// The learners' own expected error, with a robot elsewhere.
    Expected,
}

/// The state of a learner.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// No movement yet.
    Waiting,
    /// Its estimate diverged; it has stopped.
    Diverged,
    /// It is learning; there is no truth to judge by.
    Learning,
    /// It reports that it has settled; there is no truth to judge by.
    Settled,
    /// Its errors are outside the thresholds.
    Outside,
    /// Its errors have been within the thresholds since a movement, and this many more have confirmed it.
    Within(u64, u64),
    /// Its errors have been within the thresholds since this movement, confirmed by 20 more.
    Converged(u64),
}

/// The number of movements without a sighting after which no progress of a learner is expected.
const BLIND: u64 = 100;

/// All steps of a session.
#[derive(Clone, Debug, Default)]
pub struct History {
    change_at: Option<u64>,
    /// The convergence of each learner by the engine's rule, from the start or from the change of the body.
    convergence: Vec<Convergence>,
    /// The step of the first row.
    first: u64,
    /// The rows of all learners, step by step.
    rows: Vec<Vec<Row>>,
    /// The readings of all learners, step by step; empty where nothing was moved.
    readings: Vec<Vec<Vec<ChannelReading>>>,
    /// The reason why each learner stopped, if it did.
    failures: Vec<Option<String>>,
}

impl History {
    /// The history of a session that has not begun.
    pub fn new(description: &Description) -> Self {
        Self {
            change_at: description.change_at,
            convergence: vec![Convergence::new(description.thresholds.into()); description.learners.len()],
            first: 0,
            rows: Vec::new(),
            readings: Vec::new(),
            failures: vec![None; description.learners.len()],
        }
    }

    /// Whether a learner's story is over: it has learned the arm, has diverged, or no longer sees anything.
    pub fn is_over(&self, learner: usize) -> bool {
        let latest = self.latest();
        let misses = |step| self.row(step, learner).map_or(0, |row| row.misses);
        let is_blind = || latest > BLIND && misses(latest) - misses(latest - BLIND) == BLIND;
        matches!(self.verdict(latest, learner), Verdict::Converged(_) | Verdict::Diverged) || is_blind()
    }

    /// The error by which the learners are best judged.
    pub fn yardstick(&self) -> Yardstick {
        let rows = self.rows.last().map_or(&[][..], Vec::as_slice);
        let any = |value: fn(&Row) -> Option<f64>| rows.iter().any(|row| value(row).is_some());
        if any(|row| row.prediction_m.or(row.orientation_deg)) {
            Yardstick::Prediction
        } else if any(|row| row.scatter_m) {
            Yardstick::Scatter
        } else if any(|row| row.expected_m) {
            Yardstick::Expected
        } else {
            Yardstick::Prediction
        }
    }

    /// Whether every learner's story is over, and the body will not change any more.
    pub fn is_told(&self) -> bool {
        self.change_at.is_none_or(|change| self.latest() > change)
            && (0..self.failures.len()).all(|learner| self.is_over(learner))
    }

    /// The step from which movements count, seen from a step: the change of the body, once it has changed.
    pub fn begin(&self, step: u64) -> u64 {
        self.change_at.filter(|change| step > *change).unwrap_or(0)
    }

    /// The error of a learner after each of its movements, metres, by step.
    pub fn errors(&self, learner: usize) -> Vec<[f64; 2]> {
        self.curve(learner, |row| row.error_m().filter(|_| row.movements > 0))
    }

    /// Adds a report, the first whatever its step. One that is known already or leaves a gap changes nothing.
    pub fn take(&mut self, report: &StepReport) -> bool {
        if self.rows.is_empty() {
            self.first = report.step;
        }
        if report.step != self.first + self.rows.len() as u64 || report.learners.len() != self.failures.len() {
            return false;
        }
        for (failure, learner) in self.failures.iter_mut().zip(&report.learners) {
            failure.clone_from(&learner.failure);
        }
        if self.change_at.is_some_and(|change| report.step == change + 1) {
            self.convergence.iter_mut().for_each(Convergence::restart);
        }
        let begin = self.begin(report.step);
        let rows = self.convergence.iter_mut().zip(&report.learners).map(|(convergence, learner)| {
            let metrics = &learner.metrics;
            convergence.observe(report.step - begin, metrics.orientation_deg, metrics.location_m);
            Row::of(learner, convergence, begin)
        });
        self.rows.push(rows.collect());
        let read = |learner: &LearnerReport| learner.movement.as_ref().map(|movement| movement.readings.clone());
        self.readings.push(report.learners.iter().map(|learner| read(learner).unwrap_or_default()).collect());
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

    /// Whether it is empty.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// A learner's row at a step.
    pub fn row(&self, step: u64, learner: usize) -> Option<&Row> {
        self.rows.get(usize::try_from(step.checked_sub(self.first)?).ok()?)?.get(learner)
    }

    /// The readings of a learner at a step, channel by channel.
    pub fn readings(&self, step: u64, learner: usize) -> &[ChannelReading] {
        let at = step.checked_sub(self.first).and_then(|index| self.readings.get(usize::try_from(index).ok()?));
        at.and_then(|learners| learners.get(learner)).map_or(&[], Vec::as_slice)
    }

    /// One number of a learner over all steps; those that are not finite are left out.
    pub fn curve(&self, learner: usize, value: impl Fn(&Row) -> Option<f64>) -> Vec<[f64; 2]> {
        let steps = (self.first..).zip(&self.rows);
        steps
            .filter_map(|(step, rows)| Some([step as f64, value(rows.get(learner)?)?]))
            .filter(|[_, value]| value.is_finite())
            .collect()
    }

    /// The reason why a learner stopped.
    pub fn failure(&self, learner: usize) -> Option<&str> {
        self.failures.get(learner)?.as_deref()
    }

    /// The state of a learner up to a step. After a change of the body movements count from the change.
    pub fn verdict(&self, step: u64, learner: usize) -> Verdict {
        let Some(row) = self.row(step, learner) else { return Verdict::Waiting };
        if row.failed {
            return Verdict::Diverged;
        }
        if step == 0 {
            return Verdict::Waiting;
        }
        match (row.converged_at, row.within_since) {
            _ if !row.is_judged() => {
                if row.settled {
                    Verdict::Settled
                } else {
                    Verdict::Learning
                }
            }
            (Some(first), _) => Verdict::Converged(first),
            (None, Some(first)) => Verdict::Within(first, step - first),
            (None, None) => Verdict::Outside,
        }
    }

    /// The movement at which the learner converged, judged up to a step.
    pub fn converged_at(&self, step: u64, learner: usize) -> Option<u64> {
        match self.verdict(step, learner) {
            Verdict::Converged(first) => Some(first),
            _ => None,
        }
    }
}
