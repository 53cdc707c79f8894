//! The early end of a run.

use anyhow::Result;
use body_schema_experiment::{SETTLING_STEPS, StepOutcome};
use body_schema_scenario::{LearnerSpec, Scenario};

use super::BadInput;

/// The reasons to end a run early.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Until {
    /// The learners' own verdict, without truth.
    Settled,
}

/// The end of a run whose learners are all settled: those that can be.
#[derive(Clone, Debug)]
pub struct Ending {
    /// The threshold of a learner's own expected error, in words.
    target: String,
    /// The learners that are waited for.
    awaited: Vec<String>,
    /// The learners that keep no covariance, and so expect no error.
    others: Vec<String>,
}

impl Ending {
    /// The end of a run of these learners. Returns an error if none of them can ever settle.
    pub fn of(scenario: &Scenario, learners: &[LearnerSpec]) -> Result<Self> {
        let (awaited, others): (Vec<_>, Vec<_>) = learners.iter().partition(|spec| spec.estimator.keeps_covariance());
        let names = |specs: Vec<&LearnerSpec>| specs.into_iter().map(|spec| spec.name.clone()).collect::<Vec<_>>();
        let (awaited, others) = (names(awaited), names(others));
        if awaited.is_empty() {
            return Err(BadInput(format!(
                "--until settled: {} can never settle, for want of a covariance to tell how wrong it is; name a learner \
                 that has one as well, or leave --until out",
                list(&others)
            ))
            .into());
        }
        let target = format!("{} mm for {SETTLING_STEPS} steps", 1e3 * scenario.settled_below_m);
        Ok(Self { target, awaited, others })
    }

    /// Whether every learner that can be settled is.
    pub fn is_reached(&self, outcome: &StepOutcome) -> bool {
        let mut awaited = outcome.learners.iter().filter(|learner| self.awaited.contains(&learner.name));
        awaited.all(|learner| learner.metrics.settled)
    }

    /// Why a run ended with this step.
    pub fn told(&self, outcome: &StepOutcome) -> String {
        let Self { target, others, .. } = self;
        let steps = outcome.step;
        let but = if others.is_empty() {
            String::new()
        } else {
            format!(" ({} not waited for: no covariance to tell by)", list(others))
        };
        if self.is_reached(outcome) {
            format!(
                "stopped after {steps} movements: every learner is settled{but}, its own expected error was below {target}"
            )
        } else {
            format!(
                "made all {steps} movements: some learner is not settled{but}, its own expected error below {target}"
            )
        }
    }
}

fn list(names: &[String]) -> String {
    names.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ")
}
