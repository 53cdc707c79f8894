//! The page without a server: a folder that any static host serves. Without plans its engine is in it, and computes every built-in
//! scenario in the visitor's browser; with plans it holds their runs, recorded.
//!
//! ```text
//! index.html, *.js, *.css          the page, as the server has it, with relative addresses
//! panel/, viewer/, engine/         its WebAssembly, compressed; the page unpacks it
//! export.json                      what is here: scenarios, and their runs
//! scenarios/NAME.toml              the scenario files
//! runs/NAME/SEED/                  a run: see the module `run`
//! ```
//!
//! Nothing in it needs a server that computes, sets headers or knows a media type: everything is fetched as bytes from
//! addresses relative to the page, so that the folder works below any address.

mod error;
mod page;
mod run;

use std::{
    fs, io,
    path::{Path, PathBuf},
};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

pub use error::ExportError;

use body_schema_ask_tell::Session;
use body_schema_files::{AtomicFolder, undisturbed};
use body_schema_scenario::{Scenario, ScenarioSummary, WorldSpec};
use error::Doing;
use run::Recorded;

/// The name of the manifest, which marks a folder as an export and lists its content.
const MANIFEST: &str = "export.json";
/// The folders of runs and scenario files.
const RUNS: &str = "runs";
const SCENARIOS: &str = "scenarios";
/// The folder in which the runs of an earlier export wait to be removed.
const OLD: &str = ".old";
/// The version of the form; raised when the meaning of a file changes.
const FORMAT: u32 = 1;
/// The steps of a run, unless stated otherwise.
const USUAL_STEPS: u64 = 100;
/// The longest run: what a page can fetch at once.
pub const MAX_STEPS: u64 = 1000;

/// An export: what to write, and how.
pub struct Export<'a> {
    /// The scenarios, each with what to run of it; with none the page computes all built-in ones itself.
    pub plans: Vec<Plan<'a>>,
    /// The seeds of each scenario; a session has its own.
    pub seeds: Vec<u64>,
    /// The address at which the folder will be served, with a slash at its end, if known: previews of links to it have
    /// a picture only then.
    pub address: Option<String>,
    /// Another build of the page's panel than this program's, for work on it.
    pub panel_dir: Option<PathBuf>,
}

/// A scenario, and its runs.
pub struct Plan<'a> {
    /// The scenario.
    pub scenario: &'a Scenario,
    /// The learners' names.
    pub learners: Vec<String>,
    /// Steps of each run.
    pub steps: u64,
    /// A session with a robot elsewhere, which is shown in place of runs.
    told: Option<&'a Session>,
}

impl<'a> Plan<'a> {
    /// A plan with the given learners and steps, or those that a page shows by default.
    ///
    /// # Errors
    ///
    /// [`ExportError::Scenario`] if the scenario has no such learners, [`ExportError::Steps`] if `steps` is 0 or more
    /// than a page can show.
    pub fn new(scenario: &'a Scenario, learners: Option<&[String]>, steps: Option<u64>) -> Result<Self, ExportError> {
        let learners = learners.map_or_else(|| scenario.summary().explorer, <[String]>::to_vec);
        let available = scenario.experiment(1, Some(&learners))?.remaining().map(|left| left as u64);
        let most = available.unwrap_or(MAX_STEPS).min(MAX_STEPS);
        let steps = match steps {
            Some(steps) if steps > most || steps == 0 => {
                return Err(ExportError::Steps { scenario: scenario.name.clone(), steps, most });
            }
            Some(steps) => steps,
            None => usual_steps(scenario).min(most),
        };
        Ok(Self { scenario, learners, steps, told: None })
    }

    /// A plan that shows a session with a robot elsewhere: its first `steps` counting observations, or all.
    ///
    /// # Errors
    ///
    /// [`ExportError::Steps`] if `steps` is 0 or more than there are observations, or if there are none.
    pub fn told(session: &'a Session, steps: Option<u64>) -> Result<Self, ExportError> {
        let scenario = &**session.scenario();
        let most = session.latest().step.min(MAX_STEPS);
        let steps = steps.unwrap_or(most);
        if steps > most || steps == 0 {
            return Err(ExportError::Steps { scenario: scenario.name.clone(), steps, most });
        }
        let learners = session.experiment().setting().learners.iter().map(|learner| learner.name.clone()).collect();
        Ok(Self { scenario, learners, steps, told: Some(session) })
    }

    /// The seeds of its runs: the requested ones, or that of its session.
    fn seeds(&self, asked: &[u64]) -> Vec<u64> {
        self.told.map_or_else(|| asked.to_vec(), |session| vec![session.setup().seed])
    }
}

/// The default number of steps: where the body changes, it includes what comes after that.
fn usual_steps(scenario: &Scenario) -> u64 {
    let changes_at = match &scenario.world {
        WorldSpec::Simulated { change: Some(change), .. } => change.step,
        _ => 0,
    };
    (changes_at + USUAL_STEPS).min(scenario.steps)
}

/// What an export wrote.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Written {
    /// The number of files.
    pub files: u64,
    /// The size of all files, bytes.
    pub bytes: u64,
}

/// The content of a folder.
#[derive(Debug, Serialize, Deserialize)]
struct Manifest {
    format: u32,
    version: String,
    scenarios: Vec<Exported>,
    /// The sizes of compressed files when unpacked, bytes, by address.
    unpacked: std::collections::BTreeMap<String, usize>,
}

/// A scenario of the folder.
#[derive(Debug, Serialize, Deserialize)]
struct Exported {
    /// The scenario as a server lists it, with the learners and steps of its runs alone.
    #[serde(flatten)]
    summary: ScenarioSummary,
    /// The address of its file.
    source: String,
    runs: Vec<ExportedRun>,
}

/// A run of the folder.
#[derive(Debug, Serialize, Deserialize)]
struct ExportedRun {
    seed: u64,
    steps: u64,
    learners: Vec<String>,
    #[serde(flatten)]
    recorded: Recorded,
    /// The address of its files.
    folder: String,
}

impl Export<'_> {
    /// The number of steps to make.
    pub fn steps(&self) -> u64 {
        self.plans.iter().map(|plan| plan.steps * plan.seeds(&self.seeds).len() as u64).sum()
    }

    /// Writes the folder. One that holds another export is replaced; one that holds anything else is refused unless `force` says to
    /// write beside it. Everything is written to a hidden folder first, and takes its place once it is complete; if that fails the
    /// folder is unchanged. Seeds are run side by side; `tick` is called after every step.
    ///
    /// # Errors
    ///
    /// [`ExportError::NotEmpty`] if the folder holds something else and `force` is not set, [`ExportError::Page`] if the page's files
    /// are missing, [`ExportError::Run`] if a run breaks off, [`ExportError::File`] if a file cannot be written.
    pub fn write(&self, out: &Path, force: bool, tick: &(dyn Fn() + Sync)) -> Result<Written, ExportError> {
        let is_export = examine(out, force)?;
        let is_there = out.exists();
        let aside = if is_there { AtomicFolder::within(out) } else { AtomicFolder::beside(out) };
        let aside = aside.doing("write into the folder", out)?;
        let folder = aside.path();
        let files = page::Files::load(self.panel_dir.as_deref())?;
        files.write(folder, &self.plans, self.address.as_deref())?;
        let mut manifest = Manifest {
            format: FORMAT,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            scenarios: Vec::new(),
            unpacked: files.unpacked(),
        };
        for plan in &self.plans {
            manifest.scenarios.push(self.write_plan(plan, folder, tick)?);
        }
        write_json(&folder.join(MANIFEST), &manifest)?;
        match is_there {
            true => undisturbed(|| put(folder, out, is_export))?,
            false => aside.replace(out).doing("write", out)?,
        }
        measure(out)
    }

    fn write_plan(&self, plan: &Plan<'_>, out: &Path, tick: &(dyn Fn() + Sync)) -> Result<Exported, ExportError> {
        let scenario = plan.scenario;
        let source = format!("{SCENARIOS}/{}.toml", scenario.name);
        write(&out.join(&source), scenario.source.as_bytes())?;
        let run = |&seed: &u64| {
            let folder = format!("{RUNS}/{}/{seed}", scenario.name);
            let recorded = run::record(plan, seed, &out.join(&folder), tick)?;
            Ok(ExportedRun { seed, steps: plan.steps, learners: plan.learners.clone(), recorded, folder })
        };
        let runs = plan.seeds(&self.seeds).par_iter().map(run).collect::<Result<Vec<_>, ExportError>>()?;
        let summary = ScenarioSummary {
            learners: scenario
                .chosen(Some(&plan.learners))?
                .iter()
                .map(|spec| scenario.learner_description(spec))
                .collect(),
            compositions: Vec::new(),
            explorer: plan.learners.clone(),
            steps: plan.steps,
            ..scenario.summary()
        };
        Ok(Exported { summary, source, runs })
    }
}

/// Whether the folder holds an export; an error if it holds something else.
fn examine(out: &Path, force: bool) -> Result<bool, ExportError> {
    if !out.exists() {
        return Ok(false);
    }
    let is_other = |entry: io::Result<fs::DirEntry>| {
        entry.map_or(true, |entry| !AtomicFolder::is_hidden(&entry.file_name().to_string_lossy()))
    };
    let is_empty = !fs::read_dir(out).doing("read the folder", out)?.any(is_other);
    let text = fs::read(out.join(MANIFEST)).unwrap_or_default();
    let is_export = serde_json::from_slice::<Manifest>(&text).is_ok();
    if is_empty || is_export || force { Ok(is_export) } else { Err(ExportError::NotEmpty(out.to_owned())) }
}

/// Puts a new export in the place of an earlier one, whose runs are removed with the rest of the new one's hidden
/// folder.
fn put(from: &Path, to: &Path, is_export: bool) -> Result<(), ExportError> {
    let old = from.join(OLD);
    fs::create_dir(&old).doing("make the folder", &old)?;
    let runs = || [RUNS, SCENARIOS].map(|name| (to.join(name), old.join(name))).into_iter();
    let mut moved = runs().filter(|(place, _)| is_export && place.exists());
    let placed = moved.try_for_each(|(place, aside)| fs::rename(&place, aside).doing("replace", &place));
    placed.and_then(|()| place(from, to)).inspect_err(|_| {
        for (place, aside) in runs().filter(|(_, aside)| aside.exists()) {
            // Those of the new one, if there are any. What then cannot be put back nobody can.
            let _ = fs::remove_dir_all(&place);
            let _ = fs::rename(aside, place);
        }
    })
}

/// Moves all files of a folder to their places in another, the manifest last.
fn place(from: &Path, to: &Path) -> Result<(), ExportError> {
    let entries =
        fs::read_dir(from).and_then(Iterator::collect::<io::Result<Vec<_>>>).doing("read the folder", from)?;
    let mut names: Vec<_> = entries.iter().map(fs::DirEntry::file_name).filter(|name| name != OLD).collect();
    names.sort_by_key(|name| name == MANIFEST);
    for name in names {
        let (old, new) = (from.join(&name), to.join(&name));
        if old.is_dir() && new.exists() {
            place(&old, &new)?;
        } else {
            fs::rename(&old, &new).doing("write", &new)?;
        }
    }
    Ok(())
}

fn write(path: &Path, bytes: &[u8]) -> Result<(), ExportError> {
    let folder = path.parent().unwrap_or(Path::new(""));
    fs::create_dir_all(folder).doing("make the folder", folder)?;
    fs::write(path, bytes).doing("write", path)
}

fn write_json(path: &Path, value: &impl Serialize) -> Result<(), ExportError> {
    write(path, &serde_json::to_vec(value)?)
}

/// The number and size of all files below a folder.
fn measure(folder: &Path) -> Result<Written, ExportError> {
    let mut sum = Written { files: 0, bytes: 0 };
    for entry in fs::read_dir(folder).doing("read the folder", folder)? {
        let entry = entry.doing("read the folder", folder)?;
        let metadata = entry.metadata().doing("read", &entry.path())?;
        let found = match metadata.is_dir() {
            true => measure(&entry.path())?,
            false => Written { files: 1, bytes: metadata.len() },
        };
        sum = Written { files: sum.files + found.files, bytes: sum.bytes + found.bytes };
    }
    Ok(sum)
}
