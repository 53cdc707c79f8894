//! `compare`: many seeds, in parallel.

use std::{
    path::{Path, PathBuf},
    sync::{Mutex, PoisonError},
};

use anyhow::{Context, Result};
use body_schema_engine::design::best_designs;
use body_schema_recording::comparison_csv;
use body_schema_scenario::{Scenario, ScenarioError};
use body_schema_wire::{Comparison, LearnerComparison, Trace};
use comfy_table::Table;
use rayon::prelude::*;

use super::{
    Replacements, ScenarioArguments, Seeds, Threads, designs,
    output::{self, Failures},
    part::{self, About, Shard},
    progress, replaced, steps_of,
};

#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    scenario: ScenarioArguments,
    #[command(flatten)]
    replacements: Replacements,
    /// Seeds: `20` for 1 to 20, or a range with both ends such as `101..120`
    #[arg(long, default_value = "20", value_name = "SEEDS", value_parser = Seeds::counted)]
    seeds: Seeds,
    /// Movements of every run [default: the scenario's]
    #[arg(long, value_name = "N", value_parser = super::steps)]
    steps: Option<u64>,
    #[command(flatten)]
    outputs: Outputs,
    /// Run only the I-th of N parts of the seeds, and write it to the file that --part names: `merge` puts all of them
    /// together
    #[arg(long, value_name = "I/N", requires = "part", conflicts_with_all = ["json", "csv", "limits", "set"])]
    shard: Option<Shard>,
    /// Where the part is written
    #[arg(long, value_name = "FILE", requires = "shard")]
    part: Option<PathBuf>,
    #[command(flatten)]
    threads: Threads,
    /// Add the best possible designs of 5, 10, 20, … movements, which no learner can beat with as many. It takes a
    /// second for 6 joints, half a minute for 12, minutes for 20
    #[arg(long)]
    limits: bool,
}

/// The outputs of a comparison.
#[derive(Debug, clap::Args)]
pub struct Outputs {
    /// Write everything as JSON to FILE, or to standard output for `-`
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write the curves as CSV to FILE
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
}

pub fn compare(arguments: &Arguments) -> Result<()> {
    let (scenario, learners) = arguments.scenario.load_with(&arguments.replacements.set)?;
    let steps = steps_of(&scenario, arguments.steps)?;
    arguments.outputs.check(arguments.part.as_deref(), &arguments.scenario.files(&scenario))?;
    if let Some((shard, path)) = arguments.shard.zip(arguments.part.as_deref()) {
        return one_part(arguments, (&scenario, learners), steps, (shard, path));
    }
    if arguments.limits {
        designs::check(&scenario)?;
    }
    let bar = progress::bar(
        arguments.seeds.count() * steps,
        &format!("{} × {} seeds", scenario.name, arguments.seeds.count()),
    );
    let comparison = arguments.threads.run(|| {
        let comparison = over_seeds(&scenario, learners, &arguments.seeds, steps, &|| bar.inc(1))?;
        Ok(if arguments.limits {
            comparison.beside(best_designs(&scenario.design_stretches(steps)))
        } else {
            comparison
        })
    })?;
    bar.finish_and_clear();
    arguments.outputs.tell(&comparison)
}

impl Outputs {
    /// Checks that the outputs, and the part that is written, can be written, and overwrite no input.
    pub fn check(&self, part: Option<&Path>, inputs: &[PathBuf]) -> Result<()> {
        let outputs = output::Outputs::default().file("--json", self.json.as_deref());
        outputs.file("--csv", self.csv.as_deref()).file("--part", part).check(inputs)
    }

    /// Writes the requested outputs, and prints the rest.
    pub fn tell(&self, comparison: &Comparison) -> Result<()> {
        let mut failures = Failures::default();
        if let Some(path) = &self.csv {
            failures.keep(write_csv(comparison, path).with_context(|| output::cannot(path)));
        }
        if let Some(path) = &self.json {
            failures.keep(output::write_json(path, comparison));
        }
        if !self.json.as_deref().is_some_and(output::is_stdout) {
            let Comparison { scenario, set, steps, learners, .. } = comparison;
            let seeds = learners.first().map_or(0, |learner| learner.runs.len());
            output::say(format!("{scenario}{}: {seeds} seeds, {steps} movements each", replaced(set)))?;
            output::say(table(comparison))?;
            let efficiencies = learners.iter().map(|learner| (learner.name.as_str(), learner.efficiency));
            designs::say(comparison.movements_by_counting, &comparison.best_designs, efficiencies)?;
        }
        failures.end()
    }
}

fn write_csv(comparison: &Comparison, path: &Path) -> Result<()> {
    let (file, whole) = output::create(path)?;
    comparison_csv(comparison, file)?;
    Ok(whole.commit()?)
}

/// Runs one part of the seeds, and writes each run as it ends.
fn one_part(
    arguments: &Arguments,
    (scenario, learners): (&Scenario, Option<&[String]>),
    steps: u64,
    (shard, path): (Shard, &Path),
) -> Result<()> {
    let names = scenario.chosen(learners)?.into_iter().map(|learner| learner.name).collect();
    let seeds = shard.of(arguments.seeds.iter());
    let about = About::new((&scenario.name, &scenario.source), names, steps, arguments.seeds.ends(), shard);
    let writer = Mutex::new(part::Writer::begin(path, &about)?);
    let bar = progress::bar(seeds.len() as u64 * steps, &format!("{} × {} seeds", scenario.name, seeds.len()));
    let count = seeds.len();
    arguments.threads.run(|| {
        seeds.into_par_iter().try_for_each(|seed| {
            let trace =
                Trace::run(scenario.experiment(seed, learners)?, steps, || bar.inc(1)).map_err(ScenarioError::from)?;
            writer.lock().unwrap_or_else(PoisonError::into_inner).run(&trace)
        })
    })?;
    writer.into_inner().unwrap_or_else(PoisonError::into_inner).end()?;
    bar.finish_and_clear();
    output::say(format!("wrote {count} runs to {}", path.display()))
}

/// Runs the learners over the seeds, on all cores; the outcome does not depend on their number.
pub fn over_seeds(
    scenario: &Scenario,
    learners: Option<&[String]>,
    seeds: &Seeds,
    steps: u64,
    tick: &(dyn Fn() + Sync),
) -> Result<Comparison> {
    let seeds: Vec<u64> = seeds.iter().collect();
    let traces = seeds
        .into_par_iter()
        .map(|seed| Ok(Trace::run(scenario.experiment(seed, learners)?, steps, tick)?))
        .collect::<Result<Vec<_>, ScenarioError>>()?;
    Ok(Comparison { set: scenario.replaced.clone(), ..Comparison::of(&scenario.name, steps, &traces) })
}

fn table(comparison: &Comparison) -> Table {
    let has_truth = comparison.learners.iter().any(|learner| {
        learner.curve.last().is_some_and(|curve| curve.orientation_deg.is_some() || curve.location_m.is_some())
    });
    let end = |learner: &LearnerComparison| learner.curve.last().cloned();
    let time = |learner: &LearnerComparison| output::number(learner.selection_ms.median, 3);
    if !has_truth {
        let rows = comparison.learners.iter().map(|learner| {
            let mean_mm = |movements: usize| {
                let error = learner.curve.get(movements).and_then(|curve| curve.prediction_mean_m);
                output::number(error.map(|error| error.mean * 1e3), 2)
            };
            let last = comparison.steps as usize;
            [learner.name.clone(), mean_mm(0), mean_mm(last / 4), mean_mm(last / 2), mean_mm(last), time(learner)]
        });
        let at = |movements: u64| format!("after {movements} (mm)");
        let last = comparison.steps;
        let header = ["prediction".into(), at(0), at(last / 4), at(last / 2), at(last), "choice (ms)".into()];
        return output::table(header, rows);
    }
    let rows = comparison.learners.iter().map(|learner| {
        let (summary, end) = (&learner.summary, end(learner));
        let misses: u64 = learner.runs.iter().map(|run| run.misses).sum();
        let at_end = |value: Option<f64>, decimals| output::number(value, decimals);
        [
            learner.name.clone(),
            format!("{}/{}", summary.converged, summary.runs),
            output::number(summary.median_converged_at, 1),
            output::number(summary.p90_converged_at, 0),
            output::number(summary.max_converged_at, 0),
            at_end(end.as_ref().and_then(|end| end.orientation_deg).map(|error| error.median), 2),
            at_end(end.as_ref().and_then(|end| end.location_m).map(|error| error.median * 1e3), 1),
            at_end(end.as_ref().and_then(|end| end.prediction_mean_m).map(|error| error.median * 1e3), 1),
            misses.to_string(),
            time(learner),
        ]
    });
    let header = [
        "learner",
        "converged",
        "median",
        "90 %",
        "worst",
        "orient. (deg)",
        "location (mm)",
        "predict. (mm)",
        "misses",
        "choice (ms)",
    ];
    output::table(header, rows)
}
