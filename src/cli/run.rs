//! `run`: one seed, with everything that can be kept of it.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use body_schema::{
    design::best_designs,
    experiment::{Experiment, RunResult},
    recording::{EllipsoidSize, Recorder, StepsCsv, Target},
};

use super::{
    ScenarioArguments, designs, output, progress,
    signals::{Interrupted, Interruption},
    steps_of,
    until::{Ending, Until},
};

#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    scenario: ScenarioArguments,
    /// Seed of everything random: initial estimate, noise, random movements
    #[arg(long, default_value_t = 1, value_name = "SEED")]
    seed: u64,
    /// Movements to make [default: the scenario's]
    #[arg(long, value_name = "N")]
    steps: Option<u64>,
    /// Stop as soon as every learner that can tell calls itself settled, at the latest after the movements to make
    #[arg(long, value_name = "WHEN")]
    until: Option<Until>,
    /// Write a Rerun recording to FILE (open it with Rerun 0.36)
    #[arg(long, value_name = "FILE")]
    rrd: Option<PathBuf>,
    /// How large the recording's ellipsoids are
    #[arg(long, value_name = "SIZE", default_value = "1-sigma", requires = "rrd")]
    ellipsoids: EllipsoidSize,
    /// Write every step of every learner as CSV to FILE
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Write the outcome and the learned models as JSON to FILE, or to standard output for `-`
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Set the best possible designs of several lengths beside the learners (see `compare --help`)
    #[arg(long)]
    limits: bool,
}

pub fn run(arguments: &Arguments) -> Result<()> {
    let (scenario, learners) = arguments.scenario.load()?;
    let steps = steps_of(&scenario, arguments.steps)?;
    if arguments.limits {
        designs::check(&scenario)?;
    }
    output::distinct([("--rrd", &arguments.rrd), ("--csv", &arguments.csv), ("--json", &arguments.json)])?;
    let specs = scenario.chosen(learners)?;
    let ending = arguments.until.map(|Until::Settled| Ending::of(&scenario, &specs)).transpose()?;
    let mut experiment = scenario.experiment(arguments.seed, learners)?;
    let interruption = Interruption::watch()?;
    let mut recorder =
        arguments.rrd.as_deref().map(|path| recorder(&experiment, path, arguments.ellipsoids)).transpose()?;
    let mut csv = match arguments.csv.as_deref().map(|path| steps_csv(&experiment, path)).transpose() {
        Ok(csv) => csv,
        Err(error) => {
            recorder.into_iter().for_each(Recorder::discard);
            return Err(error);
        }
    };

    let bar = progress::bar(steps, &scenario.name);
    observe(&experiment, recorder.as_mut(), csv.as_mut())?;
    while experiment.latest().step < steps && interruption.signal().is_none() {
        experiment.step()?;
        observe(&experiment, recorder.as_mut(), csv.as_mut())?;
        bar.inc(1);
        if ending.as_ref().is_some_and(|ending| ending.is_reached(experiment.latest())) {
            break;
        }
    }
    bar.finish_and_clear();

    let mut result = experiment.result();
    if arguments.limits {
        let stretches = scenario.design_stretches(result.steps);
        if let Some(designs) = interruption.unless(move || best_designs(&stretches)) {
            result = result.beside(designs);
        }
    }
    let interrupted = interruption.signal().map(|signal| {
        let step = experiment.latest().step;
        let told = format!("{signal} came at step {step} of {steps}; files end with it, and are complete");
        Interrupted { signal, told }
    });
    if let Some(recorder) = &mut recorder {
        recorder.log_best_designs(&result.best_designs)?;
    }
    if let Some(recorder) = recorder {
        recorder.finish()?;
    }
    if let Some(csv) = &mut csv {
        csv.flush().context("cannot finish the CSV file")?;
    }
    if let Some(path) = &arguments.json {
        output::write_json(path, &result)?;
    }
    if !arguments.json.as_deref().is_some_and(output::is_stdout) {
        summarise(&result)?;
        if let Some(ending) = &ending {
            output::say(ending.told(experiment.latest()))?;
        }
        for path in [&arguments.rrd, &arguments.csv, &arguments.json].into_iter().flatten() {
            output::say(format!("wrote {}", path.display()))?;
        }
    }
    interrupted.map_or(Ok(()), |interrupted| Err(interrupted.into()))
}

type CsvFile = StepsCsv<std::io::BufWriter<std::fs::File>>;

fn recorder(experiment: &Experiment, path: &Path, ellipsoids: EllipsoidSize) -> Result<Recorder> {
    Ok(Recorder::new(experiment.description(), Target::file(path).with_ellipsoids(ellipsoids))?)
}

fn steps_csv(experiment: &Experiment, path: &Path) -> Result<CsvFile> {
    StepsCsv::new(experiment.description(), output::create(path)?)
        .with_context(|| format!("cannot write {}", path.display()))
}

fn observe(experiment: &Experiment, recorder: Option<&mut Recorder>, csv: Option<&mut CsvFile>) -> Result<()> {
    if let Some(recorder) = recorder {
        recorder.log(experiment.latest())?;
    }
    if let Some(csv) = csv {
        csv.write(experiment.latest()).context("cannot write the CSV file")?;
    }
    Ok(())
}

fn summarise(result: &RunResult) -> Result<()> {
    output::say(format!("{}, seed {}: {} movements each", result.scenario, result.seed, result.steps))?;
    // Where nothing but sockets tells how good they are.
    let is_predicted = result.learners.iter().any(|learner| learner.metrics.prediction_mean_m.is_some());
    let meets_itself = !is_predicted && result.learners.iter().any(|learner| learner.metrics.scatter_m.is_some());
    let rows = result.learners.iter().map(|learner| {
        let metrics = &learner.metrics;
        let predicted = if meets_itself { metrics.scatter_m } else { metrics.prediction_mean_m };
        let verdict = match (&learner.failure, learner.converged_at) {
            (Some(failure), _) => failure.clone(),
            (None, Some(at)) => format!("converged at {at}"),
            // Too soon for 20 further movements to confirm it.
            (None, None) if learner.settled_at.is_some_and(|at| at == result.steps) => "settled".into(),
            (None, None) if metrics.orientation_deg.is_none() && metrics.location_m.is_none() => "truth unknown".into(),
            (None, None) => "not converged".into(),
        };
        [
            learner.name.clone(),
            output::number(metrics.orientation_deg, 2),
            output::number(metrics.axis_deg, 2),
            output::number(metrics.location_m.map(|error| error * 1e3), 1),
            output::number(predicted.map(|error| error * 1e3), 2),
            metrics.misses.to_string(),
            verdict,
        ]
    });
    let predicted = if meets_itself { "scatter (mm)" } else { "predict. (mm)" };
    let header = ["learner", "orient. (deg)", "axis (deg)", "location (mm)", predicted, "misses", "verdict"];
    output::say(output::table(header, rows))?;
    for learner in &result.learners {
        for remark in &learner.remarks {
            output::say(format!("{}: {remark}", learner.name))?;
        }
    }
    let efficiencies = result.learners.iter().map(|learner| (learner.name.as_str(), learner.efficiency));
    designs::say(result.movements_by_counting, &result.best_designs, efficiencies)
}
