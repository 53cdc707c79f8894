//! `sweep`: a grid of values, ranked by a learner's own median.
//!
//! This is how the scenarios' filter values and rates were found: on seeds that no comparison is judged by.

use std::{path::PathBuf, str::FromStr};

use anyhow::Result;
use body_schema_scenario::{Scenario, edited};
use body_schema_wire::Summary;
use serde::Serialize;
use toml::Value;

use super::{
    BadInput, ScenarioArguments, Seeds, Threads,
    compare::over_seeds,
    output::{self, Failures, Outputs},
    progress, steps_of,
};

#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    scenario: ScenarioArguments,
    /// A key of the scenario file and the values to try, as `filter.measurement_variance_m2=0.001,0.01`; repeat for a grid
    #[arg(long = "set", value_name = "KEY=V1,V2,…", required = true)]
    axes: Vec<Axis>,
    /// Seeds: `20` for 1 to 20, or a range with both ends
    #[arg(long, default_value = "1001..1020", value_name = "SEEDS", value_parser = Seeds::counted)]
    seeds: Seeds,
    /// Movements of every run [default: the scenario's]
    #[arg(long, value_name = "N", value_parser = super::steps)]
    steps: Option<u64>,
    /// Write the ranking as JSON to FILE, or to standard output for `-`
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    #[command(flatten)]
    threads: Threads,
}

/// One axis of the grid.
#[derive(Clone, Debug)]
struct Axis {
    key: String,
    values: Vec<Value>,
}

impl FromStr for Axis {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (key, values) = text.split_once('=').ok_or("write KEY=VALUE,VALUE,…")?;
        let value = |text: &str| -> Result<Value, String> {
            let text = text.trim();
            let integer = text.parse().map(Value::Integer).ok();
            let float = || text.parse().map(Value::Float).ok();
            integer.or_else(float).ok_or_else(|| format!("`{text}` is not a number"))
        };
        Ok(Self { key: key.trim().to_owned(), values: values.split(',').map(value).collect::<Result<_, _>>()? })
    }
}

/// A point of the grid, and the learner's results there.
#[derive(Debug, Serialize)]
struct Trial {
    values: Vec<(String, String)>,
    summary: Summary,
    /// Median errors at the end, for ranking points that do not converge.
    location_m: Option<f64>,
    prediction_mean_m: Option<f64>,
}

impl Trial {
    /// Earlier median first; then more runs converged; then the smaller error at the end.
    fn rank(&self) -> (f64, usize, f64) {
        let late = self.summary.median_converged_at.unwrap_or(f64::INFINITY);
        let error = self.location_m.or(self.prediction_mean_m).unwrap_or(f64::INFINITY);
        (late, self.summary.runs - self.summary.converged, error)
    }
}

pub fn sweep(arguments: &Arguments) -> Result<()> {
    let (base, learners) = arguments.scenario.load()?;
    let Some([learner]) = learners else {
        return Err(BadInput("a sweep ranks by one learner's own median; name it with --learner".into()).into());
    };
    let steps = steps_of(&base, arguments.steps)?;
    Outputs::default().file("--json", arguments.json.as_deref()).check(&arguments.scenario.files(&base))?;
    let points = arguments.axes.iter().fold(1_usize, |points, axis| points.saturating_mul(axis.values.len()));
    if points > MOST_POINTS {
        return Err(BadInput(format!("--set: the grid has more than {MOST_POINTS} points; name fewer values")).into());
    }
    let grid = grid(&arguments.axes);
    let bar = progress::bar(
        grid.len() as u64 * arguments.seeds.count() * steps,
        &format!("{} × {} points × {} seeds", base.name, grid.len(), arguments.seeds.count()),
    );
    let mut trials = Vec::new();
    for values in grid {
        let scenario = with_values(&base, &values)?;
        let comparison =
            arguments.threads.run(|| over_seeds(&scenario, learners, &arguments.seeds, steps, &|| bar.inc(1)))?;
        let Some(outcome) = comparison.learners.into_iter().next() else { continue };
        let end = outcome.curve.last();
        trials.push(Trial {
            values: values.iter().map(|(key, value)| (key.clone(), value.to_string())).collect(),
            location_m: end.and_then(|end| end.location_m).map(|error| error.median),
            prediction_mean_m: end.and_then(|end| end.prediction_mean_m).map(|error| error.mean),
            summary: outcome.summary,
        });
    }
    bar.finish_and_clear();
    trials.sort_by(|a, b| {
        let ((late, missing, error), (other_late, other_missing, other_error)) = (a.rank(), b.rank());
        late.total_cmp(&other_late).then(missing.cmp(&other_missing)).then(error.total_cmp(&other_error))
    });
    let mut failures = Failures::default();
    if let Some(path) = &arguments.json {
        failures.keep(output::write_json(path, &trials));
    }
    if arguments.json.as_deref().is_some_and(output::is_stdout) {
        return failures.end();
    }
    let best = recommended(&trials);
    let rows = trials.iter().enumerate().map(|(index, trial)| {
        let mark = if Some(index) == best { "* " } else { "  " };
        let values: Vec<String> = trial.values.iter().map(|(key, value)| format!("{key} = {value}")).collect();
        [
            format!("{mark}{}", values.join(", ")),
            format!("{}/{}", trial.summary.converged, trial.summary.runs),
            output::number(trial.summary.median_converged_at, 1),
            output::number(trial.summary.p90_converged_at, 0),
            output::number(trial.location_m.map(|error| error * 1e3), 2),
            output::number(trial.prediction_mean_m.map(|error| error * 1e3), 2),
        ]
    });
    let header = ["values", "converged", "median", "90 %", "location (mm)", "predict. (mm)"];
    output::say(format!("{}, learner {learner}, {steps} movements, best first", base.name))?;
    output::say(output::table(header, rows))?;
    output::say("* lowest 90th percentile among the medians within 5 % of the lowest")?;
    failures.end()
}

/// The most points of a grid; more are a slip of the finger.
const MOST_POINTS: usize = 10_000;

/// The ratio of medians within which a few dozen seeds cannot tell two apart.
const INDISTINGUISHABLE: f64 = 1.05;

/// Of the trials whose median is within 5 % of the lowest, the one with the lowest 90th percentile; the first trial
/// where nothing converges. `trials` are ranked.
fn recommended(trials: &[Trial]) -> Option<usize> {
    let lowest = trials.first()?.rank().0;
    let late = |trial: &Trial| trial.summary.p90_converged_at.unwrap_or(f64::INFINITY);
    let rivals = trials.iter().enumerate().take_while(|(_, trial)| trial.rank().0 <= lowest * INDISTINGUISHABLE);
    rivals.min_by(|a, b| late(a.1).total_cmp(&late(b.1))).map(|(index, _)| index)
}

/// All points of the grid.
fn grid(axes: &[Axis]) -> Vec<Vec<(String, Value)>> {
    axes.iter().fold(vec![Vec::new()], |points, axis| {
        let extend = |point: &Vec<(String, Value)>| {
            let point = point.clone();
            axis.values
                .iter()
                .map(move |value| {
                    let mut point = point.clone();
                    point.push((axis.key.clone(), value.clone()));
                    point
                })
                .collect::<Vec<_>>()
        };
        points.iter().flat_map(extend).collect()
    })
}

/// The scenario with these values; recorded data are those of `base`.
fn with_values(base: &Scenario, values: &[(String, Value)]) -> Result<Scenario> {
    let text = edited(&base.source, values).map_err(BadInput)?;
    let open = |file: &str| base.data_file(file);
    Ok(Scenario::parse(&format!("{} with {values:?}", base.name), &text, &open)?)
}
