//! `run`: one seed, with everything that can be kept of it.

use std::{
    fs::File,
    io::BufWriter,
    path::{Path, PathBuf},
};

use anyhow::{Context, Result};
use body_schema_engine::design::best_designs;
use body_schema_experiment::Experiment;
use body_schema_files::AtomicFile;
use body_schema_recording::{EllipsoidSize, Recorder, StepsCsv, Target};
use body_schema_scenario::Scenario;
use body_schema_wire::{BestDesign, Description, RunResult, StepReport};
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};

use super::{
    Replacements, ScenarioArguments, designs,
    output::{self, Failures, Outputs},
    progress, replaced,
    signals::{Interrupted, Interruption},
    steps_of,
    until::{Ending, Until},
};

#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    scenario: ScenarioArguments,
    #[command(flatten)]
    replacements: Replacements,
    /// Seed of everything random: initial estimate, noise, random movements
    #[arg(long, default_value_t = 1, value_name = "SEED")]
    seed: u64,
    /// Movements to make [default: the scenario's]
    #[arg(long, value_name = "N", value_parser = super::steps)]
    steps: Option<u64>,
    /// Stop as soon as every learner that can tell calls itself settled, at the latest after the movements to make
    #[arg(long, value_name = "WHEN")]
    until: Option<Until>,
    /// Write a Rerun recording to FILE (open it with Rerun 0.36), which is there once the run has ended; `serve` shows a run while it goes
    /// on
    #[arg(long, value_name = "FILE")]
    rrd: Option<PathBuf>,
    /// Draw a real robot in the recording with K times as large differences from its description
    #[arg(long, value_name = "K", default_value_t = 1.0, value_parser = super::enlarged)]
    enlarge: f64,
    /// How large the recording's ellipsoids are
    #[arg(long, value_name = "SIZE", default_value = "1-sigma", requires = "rrd", value_parser = ellipsoid_sizes())]
    ellipsoids: EllipsoidSize,
    /// Write every step of every learner as CSV to FILE
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Write the outcome and the learned models as JSON to FILE, or to standard output for `-`
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Add the best possible designs of several lengths (see `compare --help`)
    #[arg(long)]
    limits: bool,
}

fn ellipsoid_sizes() -> impl TypedValueParser<Value = EllipsoidSize> {
    let help = |size: EllipsoidSize| match size {
        EllipsoidSize::OneSigma => "One standard deviation along each principal axis",
        EllipsoidSize::TwoSigma => "Two standard deviations along each principal axis",
        EllipsoidSize::NinetyFivePercent => "The ellipsoid that holds 95 % of the normal distribution",
    };
    let values = EllipsoidSize::ALL.map(|size| PossibleValue::new(size.name()).help(help(size)));
    PossibleValuesParser::new(values).map(|name| {
        // One of these names, as the parser has seen.
        EllipsoidSize::ALL.into_iter().find(|size| size.name() == name).unwrap_or_default()
    })
}

pub fn run(arguments: &Arguments) -> Result<()> {
    let (scenario, learners) = arguments.scenario.load_with(&arguments.replacements.set)?;
    let steps = steps_of(&scenario, arguments.steps)?;
    if arguments.limits {
        designs::check(&scenario)?;
    }
    let outputs = Outputs::default().file("--rrd", arguments.rrd.as_deref());
    let outputs = outputs.file("--csv", arguments.csv.as_deref()).file("--json", arguments.json.as_deref());
    outputs.check(&arguments.scenario.files(&scenario))?;
    let specs = scenario.chosen(learners)?;
    let ending = arguments.until.map(|Until::Settled| Ending::of(&scenario, &specs)).transpose()?;
    let mut experiment = scenario.experiment(arguments.seed, learners)?;
    let interruption = Interruption::watch()?;
    let mut files = Files::begin(&experiment, &scenario, arguments)?;

    let bar = progress::bar(steps, &scenario.name);
    files.observe(&experiment);
    while experiment.latest().step < steps && interruption.signal().is_none() {
        if let Err(error) = experiment.step() {
            files.discard();
            return Err(error.into());
        }
        files.observe(&experiment);
        bar.inc(1);
        if ending.as_ref().is_some_and(|ending| ending.is_reached(experiment.latest())) {
            break;
        }
    }
    bar.finish_and_clear();

    let mut result = RunResult::of(&experiment);
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
    let (mut written, mut failures) = files.end(&result.best_designs);
    if let Some(path) = &arguments.json {
        match output::write_json(path, &result) {
            Ok(()) => written.push(path.clone()),
            Err(error) => failures.keep(Err(error)),
        }
    }
    if !arguments.json.as_deref().is_some_and(output::is_stdout) {
        summarise(&result)?;
        if let Some(ending) = &ending {
            output::say(ending.told(experiment.latest()))?;
        }
        for path in written {
            output::say(format!("wrote {}", path.display()))?;
        }
    }
    failures.end()?;
    interrupted.map_or(Ok(()), |interrupted| Err(interrupted.into()))
}

/// The files that are written while the run goes on. A file that cannot be written is given up, and the run goes on
/// without it.
struct Files<'a> {
    recording: Option<(&'a Path, Recorder)>,
    table: Option<(&'a Path, StepsTable)>,
    failures: Failures,
}

struct StepsTable {
    rows: StepsCsv<BufWriter<File>>,
    whole: AtomicFile,
}

impl<'a> Files<'a> {
    fn begin(experiment: &Experiment, scenario: &Scenario, arguments: &'a Arguments) -> Result<Self> {
        let recording = arguments.rrd.as_deref().map(|path| -> Result<_> {
            let target = Target::file(path).with_ellipsoids(arguments.ellipsoids);
            let target =
                target.with_appearance(arguments.scenario.appearance(scenario)).with_enlarged(arguments.enlarge);
            Ok((path, Recorder::new(&Description::of(experiment), target)?))
        });
        let mut begun = Self { recording: recording.transpose()?, table: None, failures: Failures::default() };
        let table = arguments.csv.as_deref().map(|path| Ok((path, StepsTable::begin(experiment, path)?)));
        match table.transpose() {
            Ok(table) => begun.table = table,
            Err(error) => {
                begun.discard();
                return Err(error);
            }
        }
        Ok(begun)
    }

    fn observe(&mut self, experiment: &Experiment) {
        if self.recording.is_none() && self.table.is_none() {
            return;
        }
        let report = StepReport::of(experiment);
        let recorded = self.recording.as_mut().map_or(Ok(()), |(_, recorder)| recorder.log(&report));
        if let Err(error) = recorded {
            self.recording.take().into_iter().for_each(|(_, recorder)| recorder.discard());
            self.give_up(error.into());
        }
        let tabled = self
            .table
            .as_mut()
            .map_or(Ok(()), |(path, table)| table.rows.write(&report).with_context(|| output::cannot(path)));
        if let Err(error) = tabled {
            self.table = None;
            self.give_up(error);
        }
    }

    fn give_up(&mut self, error: anyhow::Error) {
        output::tell(format_args!("warning: {}; the run goes on without it", super::told(&error)));
        self.failures.keep(Err(error));
    }

    /// Gives the files their names. Returns those that have them, and what has failed.
    fn end(self, designs: &[BestDesign]) -> (Vec<PathBuf>, Failures) {
        let Self { recording, table, mut failures } = self;
        let mut written = Vec::new();
        let mut keep = |path: &Path, ended: Result<()>| match ended {
            Ok(()) => written.push(path.to_owned()),
            Err(error) => failures.keep(Err(error)),
        };
        if let Some((path, mut recorder)) = recording {
            let recorded = recorder.log_best_designs(designs);
            keep(path, recorded.and_then(|()| recorder.finish()).map_err(Into::into));
        }
        if let Some((path, mut table)) = table {
            let flushed = table.rows.flush().map_err(anyhow::Error::from);
            keep(path, flushed.and_then(|()| Ok(table.whole.commit()?)).with_context(|| output::cannot(path)));
        }
        (written, failures)
    }

    /// Removes all of them.
    fn discard(self) {
        self.recording.into_iter().for_each(|(_, recorder)| recorder.discard());
    }
}

impl StepsTable {
    fn begin(experiment: &Experiment, path: &Path) -> Result<Self> {
        let (file, whole) = output::create(path)?;
        let rows = StepsCsv::new(&Description::of(experiment), file).with_context(|| output::cannot(path))?;
        Ok(Self { rows, whole })
    }
}

fn summarise(result: &RunResult) -> Result<()> {
    let with = replaced(&result.set);
    output::say(format!("{}{with}, seed {}: {} movements each", result.scenario, result.seed, result.steps))?;
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
