//! One run of all learners, and what a comparison keeps of it.

use serde::{Deserialize, Serialize};

use super::RunSummary;
use crate::JointMetrics;
use body_schema_experiment::{Experiment, ExperimentError, MovementOutcome, StepOutcome};

/// What is kept of one run of all learners.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Trace {
    pub(super) seed: u64,
    pub(super) movements_by_counting: usize,
    pub(super) learners: Vec<LearnerTrace>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct LearnerTrace {
    pub(super) name: String,
    #[serde(default)]
    pub(super) parameters: usize,
    pub(super) converged_at: Option<u64>,
    pub(super) recovered_at: Option<u64>,
    pub(super) movements: u64,
    pub(super) misses: u64,
    pub(super) errors: Vec<RunSummary>,
    pub(super) joints: Vec<Vec<JointMetrics>>,
    pub(super) selection_ms: Vec<f64>,
}

impl Trace {
    /// The seed of the run.
    pub fn seed(&self) -> u64 {
        self.seed
    }

    /// Whether it is of these learners, and of so many steps.
    pub fn is_of(&self, learners: &[String], steps: u64) -> bool {
        let whole =
            |trace: &LearnerTrace| trace.errors.len() as u64 == steps + 1 && trace.joints.len() == trace.errors.len();
        self.learners.iter().map(|trace| &trace.name).eq(learners) && self.learners.iter().all(whole)
    }

    /// Runs `experiment` for `steps` steps and calls `tick` after each.
    ///
    /// # Errors
    ///
    /// [`ExperimentError`] of the first step that fails.
    pub fn run(mut experiment: Experiment, steps: u64, mut tick: impl FnMut()) -> Result<Self, ExperimentError> {
        let mut learners: Vec<LearnerTrace> = experiment
            .learners()
            .iter()
            .map(|learner| LearnerTrace {
                name: learner.setting.name.clone(),
                parameters: learner.belief().layout.dimension(),
                converged_at: None,
                recovered_at: None,
                movements: 0,
                misses: 0,
                errors: Vec::with_capacity(steps as usize + 1),
                joints: Vec::with_capacity(steps as usize + 1),
                selection_ms: Vec::with_capacity(steps as usize),
            })
            .collect();
        let mut take = |outcome: &StepOutcome| {
            for (trace, learner) in learners.iter_mut().zip(&outcome.learners) {
                trace.errors.push(RunSummary::from(&learner.metrics));
                trace.joints.push(learner.metrics.joints.iter().map(JointMetrics::from).collect());
                trace.selection_ms.extend(learner.movement.as_ref().map(MovementOutcome::selection_ms));
                (trace.movements, trace.misses) = (learner.metrics.movements, learner.metrics.misses);
            }
        };
        take(experiment.latest());
        for _ in 0..steps {
            take(experiment.step()?);
            tick();
        }
        for (trace, verdict) in learners.iter_mut().zip(experiment.verdicts()) {
            trace.converged_at = verdict.convergence.converged_at();
            trace.recovered_at = verdict.recovery.converged_at();
        }
        let setting = experiment.setting();
        Ok(Self { seed: setting.seed, movements_by_counting: setting.movements_by_counting, learners })
    }
}
