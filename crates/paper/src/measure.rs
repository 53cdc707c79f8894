//! Carrying experiments out.

use rayon::prelude::*;

use super::{
    PaperError, Plan,
    experiments::{Kind, PaperExperiment},
    outcome::{LearnedJoint, Outcome, Searched, Timing, Trial, is_kept},
};
use body_schema_engine::{design::best_designs, optimize::History};
use body_schema_experiment::{Experiment, ExperimentError, MovementOutcome};
use body_schema_scenario::{Scenario, edited};
use body_schema_wire::{Comparison, Trace};

/// One experiment, its scenario, and the plan to carry it out by.
pub struct Measurement<'a> {
    /// The experiment.
    pub experiment: &'static PaperExperiment,
    /// Its scenario.
    pub scenario: &'a Scenario,
    /// The plan.
    pub plan: &'a Plan,
    /// Called after every movement of every seed.
    pub tick: &'a (dyn Fn() + Sync),
}

impl Measurement<'_> {
    /// Runs the experiment on all cores. The outcome, times excepted, does not depend on their number.
    pub fn run(&self) -> Result<Outcome, PaperError> {
        match self.experiment.kind {
            Kind::Comparison { .. } => {
                let mut trial = self.trial(self.scenario, None)?;
                let steps = self.experiment.kind.steps(self.plan.quick);
                trial.comparison = trial.comparison.beside(best_designs(&self.scenario.design_stretches(steps)));
                Ok(Outcome::Trials(vec![trial]))
            }
            Kind::Sweep { key, values, .. } => {
                let trials = values.iter().map(|value| {
                    let scenario = self.with(&[(key, toml::Value::Float(*value))])?;
                    self.trial(&scenario, Some(*value))
                });
                Ok(Outcome::Trials(trials.collect::<Result<_, _>>()?))
            }
            Kind::Timing { steps } => {
                // Alone on one thread: other runs would compete for the cores, and be stolen in the midst of a choice.
                let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
                pool.install(|| self.timing(steps)).map(Outcome::Timing)
            }
            Kind::Selection { step } => {
                let searches = ["direct", "direct-l"].map(|variant| self.search(variant, step));
                Ok(Outcome::Searches(searches.into_iter().collect::<Result<_, _>>()?))
            }
        }
    }

    fn with(&self, values: &[(&str, toml::Value)]) -> Result<Scenario, PaperError> {
        let values: Vec<_> = values.iter().map(|(key, value)| ((*key).to_owned(), value.clone())).collect();
        let text = edited(&self.scenario.source, &values).map_err(|reason| self.impossible(reason))?;
        let open = |file: &str| self.scenario.data_file(file);
        Scenario::parse(&self.scenario.name, &text, &open)
            .map_err(|source| PaperError::Scenario { experiment: self.experiment.id, source })
    }

    fn impossible(&self, reason: impl Into<String>) -> PaperError {
        PaperError::Impossible { experiment: self.experiment.id, reason: reason.into() }
    }

    fn broke_off(&self, seed: u64, source: ExperimentError) -> PaperError {
        PaperError::Run { experiment: self.experiment.id, seed, source }
    }

    fn start(&self, scenario: &Scenario, seed: u64) -> Result<Experiment, PaperError> {
        let learners: Vec<String> = self.experiment.learners.iter().map(|name| (*name).to_owned()).collect();
        scenario
            .experiment(seed, (!learners.is_empty()).then_some(learners.as_slice()))
            .map_err(|source| PaperError::Scenario { experiment: self.experiment.id, source })
    }

    fn trial(&self, scenario: &Scenario, value: Option<f64>) -> Result<Trial, PaperError> {
        let steps = self.experiment.kind.steps(self.plan.quick);
        let traces = self
            .plan
            .seeds_of(self.experiment)
            .into_par_iter()
            .map(|seed| {
                Trace::run(self.start(scenario, seed)?, steps, self.tick).map_err(|source| self.broke_off(seed, source))
            })
            .collect::<Result<Vec<_>, PaperError>>()?;
        let mut comparison = Comparison::of(&scenario.name, steps, &traces);
        for learner in &mut comparison.learners {
            learner.curve.retain(|point| is_kept(point.movements, steps));
        }
        let names = scenario.robot.names.iter().enumerate();
        let joints = names
            .filter(|(index, _)| scenario.robot.layout.is_learned(*index))
            .map(|(index, name)| LearnedJoint { name: name.clone(), index })
            .collect();
        Ok(Trial { value, comparison, joints })
    }

    fn timing(&self, steps: u64) -> Result<Timing, PaperError> {
        let seed = *self.plan.seeds_of(self.experiment).start();
        let mut experiment = self.start(self.scenario, seed)?;
        let mut choices = Vec::new();
        for _ in 0..steps {
            let outcome = experiment.step().map_err(|source| self.broke_off(seed, source))?;
            let movements = outcome.learners.iter().filter_map(|learner| learner.movement.as_ref());
            choices.extend(movements.map(|movement| (movement.selection_ms(), movement.evaluations())));
            (self.tick)();
        }
        choices.sort_by(|a, b| a.0.total_cmp(&b.0));
        let count = choices.len();
        let (Some(median), Some(late)) = (choices.get(count / 2), choices.get(count * 95 / 100)) else {
            return Err(self.impossible("nothing was chosen"));
        };
        Ok(Timing { median_ms: median.0, p95_ms: late.0, evaluations: median.1, choices: count })
    }

    /// The search of one choice. Its partition comes with the outcome; the search is told the same values once more, for
    /// its hull.
    fn search(&self, variant: &str, step: u64) -> Result<Searched, PaperError> {
        let scenario = self.with(&[("selection.variant", toml::Value::String(variant.to_owned()))])?;
        let seed = *self.plan.seeds_of(self.experiment).start();
        let mut experiment = self.start(&scenario, seed)?;
        for _ in 0..step {
            experiment.step().map_err(|source| self.broke_off(seed, source))?;
        }
        let movement = experiment.latest().learners.first().and_then(|learner| learner.movement.as_ref());
        let partition =
            movement.and_then(MovementOutcome::partition).ok_or_else(|| self.impossible("nothing was searched"))?;
        let values: Vec<f64> = partition.leaves.iter().map(|leaf| leaf.value.unwrap_or(f64::NAN)).collect();
        let direct = History::replay(scenario.robot.limits.dimension(), scenario.selection.search, &values)?.search;
        (self.tick)();
        Ok(Searched {
            variant: variant.to_owned(),
            sizes: direct.partition().iter().map(|rectangle| rectangle.size).collect(),
            hull: direct.hull().to_vec(),
            joints: scenario
                .robot
                .names
                .iter()
                .zip(scenario.robot.limits.joints())
                .map(|(name, (lower, upper))| (name.clone(), [*lower, *upper]))
                .collect(),
            partition,
        })
    }
}
