//! Outcomes on disk, so that an interrupted run continues and nothing is measured twice.
//!
//! Every outcome lies beside the fingerprint of what it was measured with, in plain text. It is reused if all of that
//! still holds, and measured again otherwise. A file that cannot be read counts as absent.

use std::{
    fs, io,
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize};

use super::{PaperError, Plan, experiments::PaperExperiment, outcome::Outcome};
use crate::scenario::Scenario;

/// What an outcome depends on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Fingerprint {
    /// Version of body-schema.
    pub version: String,
    /// Version of the form in which outcomes are kept.
    pub format: u32,
    /// The experiment.
    pub experiment: String,
    /// How it is run, with all values.
    pub kind: String,
    /// The learners; empty for all.
    pub learners: Vec<String>,
    /// Movements of every run.
    pub steps: u64,
    /// First and last seed.
    pub seeds: [u64; 2],
    /// The scenario's text.
    pub scenario: String,
}

/// Raise this when outcomes mean something else than before.
const FORMAT: u32 = 2;

impl Fingerprint {
    /// The fingerprint of an experiment under a plan.
    pub fn new(experiment: &PaperExperiment, scenario: &Scenario, plan: &Plan) -> Self {
        let seeds = plan.seeds_of(experiment);
        Self {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            format: FORMAT,
            experiment: experiment.id.to_owned(),
            kind: format!("{:?}", experiment.kind),
            learners: experiment.learners.iter().map(|name| (*name).to_owned()).collect(),
            steps: experiment.kind.steps(plan.quick),
            seeds: [*seeds.start(), *seeds.end()],
            scenario: scenario.source.clone(),
        }
    }
}

#[derive(Serialize, Deserialize)]
struct Kept<F, O> {
    fingerprint: F,
    outcome: O,
}

/// The outcomes kept in a folder.
#[derive(Clone, Debug)]
pub struct Store(PathBuf);

impl Store {
    /// The store in `folder`, which is made if it is not there.
    pub fn open(folder: &Path) -> Result<Self, PaperError> {
        let folder = folder.join("outcomes");
        fs::create_dir_all(&folder).map_err(|source| PaperError::Write { path: folder.clone(), source })?;
        Ok(Self(folder))
    }

    /// The outcome of this fingerprint, if it is kept.
    pub fn load(&self, fingerprint: &Fingerprint) -> Option<Outcome> {
        let text = fs::read_to_string(self.path(&fingerprint.experiment)).ok()?;
        let kept: Kept<Fingerprint, Outcome> = serde_json::from_str(&text).ok()?;
        (kept.fingerprint == *fingerprint).then_some(kept.outcome)
    }

    /// Keeps an outcome.
    pub fn save(&self, fingerprint: &Fingerprint, outcome: &Outcome) -> Result<(), PaperError> {
        let text = serde_json::to_string(&Kept { fingerprint, outcome })?;
        let path = self.path(&fingerprint.experiment);
        write(&path, text.as_bytes())
    }

    fn path(&self, experiment: &str) -> PathBuf {
        self.0.join(format!("{experiment}.json"))
    }
}

/// Writes a file whole or not at all.
pub fn write(path: &Path, bytes: &[u8]) -> Result<(), PaperError> {
    let partial = path.with_extension("partial");
    let attempt = || -> io::Result<()> {
        fs::write(&partial, bytes)?;
        fs::rename(&partial, path)
    };
    attempt().map_err(|source| PaperError::Write { path: path.to_owned(), source })
}
