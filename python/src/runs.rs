//! Scenarios that run by themselves.

use body_schema_experiment::{LearnerOutcome, StepOutcome};
use body_schema_scenario::ScenarioError;
use body_schema_wire::{Comparison, Metrics, RunResult, Trace};
use pyo3::prelude::*;
use rayon::prelude::*;
use serde_json::{Map, Value, json};

use crate::{files::scenario, refusal::Failure};

/// One run: its result, and a flat row of metrics per learner and step, as JSON.
#[pyfunction]
#[pyo3(signature = (name, seed, steps=None, learners=None))]
pub fn simulate(
    py: Python<'_>,
    name: &str,
    seed: u64,
    steps: Option<u64>,
    learners: Option<Vec<String>>,
) -> PyResult<String> {
    let answer = py.detach(|| -> Result<String, Failure> {
        let scenario = scenario(name)?;
        let mut experiment = scenario.experiment(seed, learners.as_deref())?;
        let left = experiment.remaining().map_or(u64::MAX, |left| left as u64);
        let mut curve = rows(experiment.latest());
        for _ in 0..steps.unwrap_or(scenario.steps).min(left) {
            curve.extend(rows(experiment.step().map_err(ScenarioError::from)?));
        }
        let result = RunResult::of(&experiment);
        Ok(json!({ "result": result, "curve": curve }).to_string())
    });
    Ok(answer?)
}

/// Many runs, as JSON.
#[pyfunction]
#[pyo3(signature = (name, seeds, steps=None, learners=None))]
pub fn compare(
    py: Python<'_>,
    name: &str,
    seeds: Vec<u64>,
    steps: Option<u64>,
    learners: Option<Vec<String>>,
) -> PyResult<String> {
    let answer = py.detach(|| -> Result<String, Failure> {
        let scenario = scenario(name)?;
        let steps = steps.unwrap_or(scenario.steps);
        let run = |seed: u64| {
            let experiment = scenario.experiment(seed, learners.as_deref())?;
            let left = experiment.remaining().map_or(u64::MAX, |left| left as u64);
            Ok(Trace::run(experiment, steps.min(left), || ())?)
        };
        let traces = seeds.into_par_iter().map(run).collect::<Result<Vec<Trace>, ScenarioError>>()?;
        let compared = serde_json::to_string(&Comparison::of(&scenario.name, steps, &traces));
        compared.map_err(|error| Failure::new("EngineError", error))
    });
    Ok(answer?)
}

/// The metrics that are numbers, by learner.
fn rows(outcome: &StepOutcome) -> Vec<Value> {
    let row = |learner: &LearnerOutcome| {
        let metrics = serde_json::to_value(Metrics::from(&learner.metrics)).unwrap_or_default();
        let mut row = Map::from_iter([
            ("step".to_owned(), outcome.step.into()),
            ("learner".to_owned(), learner.name.as_str().into()),
        ]);
        let metrics =
            metrics.as_object().into_iter().flatten().filter(|(_, value)| !value.is_array() && !value.is_object());
        row.extend(metrics.map(|(name, value)| (name.clone(), value.clone())));
        Value::Object(row)
    };
    outcome.learners.iter().map(row).collect()
}
