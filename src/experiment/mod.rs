//! Several learners in one world, step by step.
//!
//! At every step each learner chooses a movement, the world shows it the marker there, and it revises its belief. All
//! learners start from the same estimate and see the same noise. One [`StepReport`] per step is all that the outside
//! reads.

mod choice;
mod comparison;
mod convergence;
mod learner;
mod limits;
mod metrics;
mod report;
mod result;
mod streams;
mod world;

pub use choice::{
    AppraisalReport, BoxReport, Choice, ChoiceError, ChosenReport, IterationReport, SearchedJoint, ShapeReport,
};
pub use comparison::{
    Comparison, Curve, LearnerComparison, Quantiles, RunSummary, SeedRun, SelectionTime, Summary, Trace,
};
pub use convergence::{CONFIRMATION, Convergence, Thresholds};
pub use learner::{Learner, Record, SETTLING_STEPS};
pub use limits::{BestDesign, Design, Limits, Stretch, best_designs, movements_by_counting};
pub use metrics::{Evaluation, JointMetrics, Metrics, axis_deg, location_m, nees, orientation_deg};
pub use report::{
    Description, GazeReport, HeadDescription, JointDescription, JointReport, LearnerDescription, LearnerReport,
    ModelReport, MovementReport, StepReport,
};
pub use result::{JointModel, LearnerResult, MarkerModel, Model, RunResult};
pub use streams::Stream;
pub use world::{Change, NoiseSequence, World};

use nalgebra::DMatrix;

use crate::{estimation::Update, selection::SelectionError};

/// A running comparison of learners.
pub struct Experiment {
    description: Description,
    world: World,
    noise: NoiseSequence,
    learners: Vec<Learner>,
    evaluation: Evaluation,
    verdicts: Vec<Verdict>,
    bounds: Option<Bounds>,
    latest: StepReport,
}

/// What the data of every learner allow.
struct Bounds {
    limits: Limits,
    /// Λ₀ + Σ HᵀH/σ² at the truth, one per learner.
    information: Vec<DMatrix<f64>>,
}

/// What is known of one learner's run so far.
struct Verdict {
    /// Up to the change of the body, if there is one.
    convergence: Convergence,
    /// From the change on.
    recovery: Convergence,
    settled_at: Option<u64>,
    /// Movements after the change at which the learner first noticed it.
    noticed_at: Option<u64>,
    /// Changes noticed before there was one.
    false_alarms: u64,
}

/// Why a step could not be made. The experiment stays as it was.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ExperimentError {
    /// A learner could not choose.
    #[error("learner `{learner}` cannot choose its next movement: {source}")]
    Selection {
        /// Its name.
        learner: String,
        /// Why.
        source: SelectionError,
    },
}

impl Experiment {
    /// A comparison of `learners` in `world`, judged over `evaluation`; step 0 is reported at once.
    pub fn new(description: Description, world: World, learners: Vec<Learner>, evaluation: Evaluation) -> Self {
        let verdicts = learners
            .iter()
            .map(|_| {
                let unjudged = Convergence::new(description.thresholds);
                Verdict {
                    convergence: unjudged.clone(),
                    recovery: unjudged,
                    settled_at: None,
                    noticed_at: None,
                    false_alarms: 0,
                }
            })
            .collect();
        let noise = NoiseSequence::new(description.seed);
        let latest = StepReport { step: 0, learners: Vec::new(), truth: None };
        let mut experiment = Self { description, world, noise, learners, evaluation, verdicts, bounds: None, latest };
        let truth = experiment.world.truth();
        let reports = experiment
            .learners
            .iter_mut()
            .map(|learner| learner.report(None, Update::default(), &experiment.evaluation, truth))
            .collect();
        experiment.conclude(StepReport { step: 0, learners: reports, truth: None });
        experiment
    }

    /// The same with the bound of the data collected in every report (see [`Limits`]).
    pub fn bounded(mut self, limits: Limits) -> Self {
        let information = vec![limits.prior(); self.learners.len()];
        let bound = limits.bound(&limits.prior());
        self.latest.learners.iter_mut().for_each(|learner| learner.metrics.bound_trace = bound);
        self.bounds = Some(Bounds { limits, information });
        self
    }

    /// What stays the same from step to step.
    pub fn description(&self) -> &Description {
        &self.description
    }

    /// The report of the latest step.
    pub fn latest(&self) -> &StepReport {
        &self.latest
    }

    /// How many steps can still be made; `None` without an end.
    pub fn remaining(&self) -> Option<usize> {
        self.learners.iter().filter_map(|learner| learner.actions.remaining()).min()
    }

    /// The truth, for those who judge: reports, recordings, bounds.
    pub fn world(&self) -> &World {
        &self.world
    }

    /// One movement of every learner.
    pub fn step(&mut self) -> Result<&StepReport, ExperimentError> {
        // All choose before any moves, so that a failed choice leaves the experiment as it was.
        let choices = self
            .learners
            .iter_mut()
            .map(|learner| {
                learner
                    .choose()
                    .map_err(|source| ExperimentError::Selection { learner: learner.description.name.clone(), source })
            })
            .collect::<Result<Vec<_>, _>>()?;
        let noise = self.noise.draw();
        let has_changed = self.world.advance(self.latest.step);
        let truth = self.world.truth();
        if let (Some(truth), true) = (truth, has_changed) {
            self.evaluation.follow(truth);
        }
        if let (Some(bounds), Some(truth), true) = (&mut self.bounds, truth, has_changed) {
            // What was measured before says nothing certain of the new body.
            bounds.limits.truth = truth.clone();
            let prior = bounds.limits.prior();
            bounds.information.fill(prior);
        }
        let mut reports: Vec<LearnerReport> = self
            .learners
            .iter_mut()
            .zip(choices)
            .map(|(learner, choice)| {
                let (movement, update) = match choice {
                    Some(choice) => {
                        let observation = self.world.observe(&choice.0.movement, &noise);
                        let (movement, update) = learner.learn(choice, &observation, &self.world);
                        (Some(movement), update)
                    }
                    None => (None, Update::default()),
                };
                learner.report(movement, update, &self.evaluation, truth)
            })
            .collect();
        if let Some(bounds) = &mut self.bounds {
            for (report, information) in reports.iter_mut().zip(&mut bounds.information) {
                if let Some(movement) = report.movement.as_ref().filter(|it| it.measured_marker_m.is_some()) {
                    *information += bounds.limits.information(&movement.configuration);
                }
                report.metrics.bound_trace = bounds.limits.bound(information);
            }
        }
        let truth = truth.filter(|_| has_changed).map(ModelReport::of_chain);
        self.conclude(StepReport { step: self.latest.step + 1, learners: reports, truth });
        Ok(&self.latest)
    }

    fn conclude(&mut self, report: StepReport) {
        for (verdict, learner) in self.verdicts.iter_mut().zip(&report.learners) {
            let metrics = &learner.metrics;
            let since_change = self.description.change_at.and_then(|change| report.step.checked_sub(change));
            match since_change {
                Some(movements @ 1..) => {
                    verdict.recovery.observe(movements, metrics.orientation_deg, metrics.location_m);
                }
                _ => verdict.convergence.observe(report.step, metrics.orientation_deg, metrics.location_m),
            }
            match since_change {
                Some(movements @ 1..) if metrics.changes_noticed > verdict.false_alarms => {
                    verdict.noticed_at.get_or_insert(movements);
                }
                Some(1..) => {}
                _ => verdict.false_alarms = metrics.changes_noticed,
            }
            if metrics.settled && verdict.settled_at.is_none() {
                verdict.settled_at = Some(metrics.movements);
            }
        }
        self.latest = report;
    }
}
