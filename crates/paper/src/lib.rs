//! The paper's experiments, rerun and set beside its numbers.
//!
//! [`run`] carries out the [`EXPERIMENTS`], keeps each outcome in a folder so that an interrupted run of the same
//! program continues, draws the figures, and judges every number and remark of the paper by what was measured. It writes
//!
//! | file | what |
//! |---|---|
//! | `outcomes/{id}.json` | what an experiment gave, with the fingerprint of what it was run with |
//! | `{id}.svg`, `{id}.png` | the figures |
//! | `paper.json` | a [`Report`]: one row per number or remark |
//! | `paper.md` | a table, made from `paper.json` [alone](markdown) |
//!
//! Experiments, claims and their texts are data; figures measured are never written down in code.

mod claims;
mod error;
mod experiments;
mod figures;
mod measure;
mod outcome;
mod report;
mod store;
mod table;

use std::{
    collections::BTreeMap,
    ops::RangeInclusive,
    path::{Path, PathBuf},
};

pub use body_schema_chart::RasterError;
pub use error::PaperError;
pub use experiments::{EXPERIMENTS, Kind, PaperExperiment};
pub use report::{Agreement, FigureEntry, Report, Row};
pub use table::markdown;

use claims::{Evidence, claims};
use measure::Measurement;
use outcome::Outcome;
use store::{Fingerprint, Store};

use body_schema_chart as chart;
use body_schema_scenario::{BUILTIN, Scenario, builtin};

/// The experiments to run, and the folder of their outcomes.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Whether to run few seeds and short runs.
    pub quick: bool,
    /// The names of the experiments to run; of the others, only kept outcomes are shown. Empty for all.
    pub only: Vec<String>,
    /// The folder of outcomes, figures and tables.
    pub out: PathBuf,
}

impl Plan {
    /// The seeds of all experiments that run over seeds.
    pub fn seeds(&self) -> RangeInclusive<u64> {
        1..=if self.quick { 4 } else { 20 }
    }

    /// The seeds of one experiment.
    pub fn seeds_of(&self, experiment: &PaperExperiment) -> RangeInclusive<u64> {
        if experiment.kind.is_single_run() { 1..=1 } else { self.seeds() }
    }

    fn includes(&self, experiment: &PaperExperiment) -> bool {
        self.only.is_empty() || self.only.iter().any(|id| id == experiment.id)
    }

    fn check(&self) -> Result<(), PaperError> {
        for id in &self.only {
            if experiments::experiment(id).is_none() {
                let known: Vec<&'static str> = EXPERIMENTS.iter().map(|experiment| experiment.id).collect();
                let suggested = known
                    .iter()
                    .map(|name| (strsim::jaro_winkler(id, name), *name))
                    .filter(|(likeness, _)| *likeness > 0.8)
                    .max_by(|a, b| a.0.total_cmp(&b.0))
                    .map(|(_, name)| name.to_owned());
                return Err(PaperError::UnknownExperiment { id: id.clone(), suggested, known });
            }
        }
        Ok(())
    }
}

/// Follows a run.
pub trait Progress: Sync {
    /// An experiment begins, for which [`tick`](Self::tick) will be called `ticks` times.
    fn start(&self, experiment: &PaperExperiment, ticks: u64);
    /// One movement of all learners of one seed was made.
    fn tick(&self);
    /// The experiment has ended.
    fn finish(&self, experiment: &PaperExperiment, how: Ending);
}

/// How an experiment ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// It was run.
    Measured,
    /// Its outcome was kept from before.
    Reused,
    /// It was left out, or its scenario is not built in.
    Skipped,
}

/// Runs what the plan holds, writes figures and tables, and returns the report.
///
/// # Errors
///
/// [`PaperError`] if the plan names an unknown experiment, a scenario or a run fails, a figure cannot be drawn, or a
/// file cannot be read or written.
pub fn run(plan: &Plan, progress: &dyn Progress) -> Result<Report, PaperError> {
    plan.check()?;
    let store = Store::open(&plan.out)?;
    let build = store::build();
    let mut outcomes = BTreeMap::new();
    let mut figures = Vec::new();
    for experiment in EXPERIMENTS {
        let (outcome, how) = obtain(experiment, plan, &store, build.clone(), progress)?;
        progress.finish(experiment, how);
        if let Ok((scenario, outcome)) = &outcome {
            for figure in figures::figures(experiment, scenario, plan, outcome) {
                let svg = figure.chart.svg();
                let png =
                    chart::png(&svg).map_err(|source| PaperError::Figure { figure: figure.id.clone(), source })?;
                store::write(&plan.out.join(format!("{}.svg", figure.id)), svg.as_bytes())?;
                store::write(&plan.out.join(format!("{}.png", figure.id)), &png)?;
                figures.push(FigureEntry { id: figure.id, title: figure.chart.title, caption: figure.caption });
            }
        }
        outcomes.insert(experiment.id, outcome);
    }
    let report = report(plan, figures, &outcomes);
    let json = serde_json::to_string_pretty(&report)? + "\n";
    store::write(&plan.out.join("paper.json"), json.as_bytes())?;
    // From what was written, so that the table can hold nothing else.
    let written: Report = serde_json::from_str(&json)?;
    store::write(&plan.out.join("paper.md"), markdown(&written).as_bytes())?;
    Ok(written)
}

/// A scenario and what its experiment gave, or why there is nothing.
type Obtained = Result<(Scenario, Outcome), String>;

fn obtain(
    experiment: &'static PaperExperiment,
    plan: &Plan,
    store: &Store,
    build: Option<String>,
    progress: &dyn Progress,
) -> Result<(Obtained, Ending), PaperError> {
    if !BUILTIN.iter().any(|found| found.name == experiment.scenario) {
        return Ok((Err(format!("scenario `{}` is not built in", experiment.scenario)), Ending::Skipped));
    }
    let scenario =
        builtin(experiment.scenario).map_err(|source| PaperError::Scenario { experiment: experiment.id, source })?;
    let fingerprint = Fingerprint::new(experiment, &scenario, plan, build);
    if let Some(outcome) = store.load(&fingerprint) {
        return Ok((Ok((scenario, outcome)), Ending::Reused));
    }
    if !plan.includes(experiment) {
        return Ok((Err("left out with --only".to_owned()), Ending::Skipped));
    }
    let seeds = plan.seeds_of(experiment);
    let runs = (seeds.end() - seeds.start() + 1) * experiment.kind.trials();
    progress.start(experiment, runs * experiment.kind.steps(plan.quick));
    let tick = || progress.tick();
    let outcome = Measurement { experiment, scenario: &scenario, plan, tick: &tick }.run()?;
    store.save(&fingerprint, &outcome)?;
    Ok((Ok((scenario, outcome)), Ending::Measured))
}

fn report(plan: &Plan, figures: Vec<FigureEntry>, outcomes: &BTreeMap<&'static str, Obtained>) -> Report {
    let rows = claims().map(|claim| {
        let evidence = claim.experiment().and_then(|experiment| {
            let steps = experiment.kind.steps(plan.quick);
            Some(match outcomes.get(experiment.id)? {
                Ok((scenario, outcome)) => Ok(Evidence { experiment, scenario, steps, outcome }),
                Err(reason) => Err(reason.clone()),
            })
        });
        claim.row(plan, evidence)
    });
    let seeds = plan.seeds();
    Report {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        quick: plan.quick,
        seeds: [*seeds.start(), *seeds.end()],
        figures,
        rows: rows.collect(),
    }
}

/// The folder of a plan's files: `paper`, or `paper/quick`, so that the short form never replaces the full one.
pub fn default_folder(quick: bool) -> PathBuf {
    let folder = Path::new("paper");
    if quick { folder.join("quick") } else { folder.to_owned() }
}
