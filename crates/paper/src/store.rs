//! Outcomes on disk, so that an interrupted run continues and nothing is measured twice.
//!
//! Every outcome lies beside the fingerprint of what it was measured with: the scenario's text, learners, movements,
//! seeds, and the program itself. It is reused if all of that still holds, and measured again otherwise. A file that
//! cannot be read counts as absent.

use std::{
    fs,
    hash::{DefaultHasher, Hasher},
    io,
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize};

use super::{PaperError, Plan, experiments::PaperExperiment, outcome::Outcome};
use body_schema_files as atomic;
use body_schema_scenario::Scenario;

/// The fingerprint of an outcome: everything that it depends on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Fingerprint {
    /// Version of body-schema.
    pub version: String,
    /// The program itself: a hash of the executable, so that a changed engine does not reuse outcomes of an earlier one
    /// with the same version. `None` if the executable cannot be read; it then matches nothing.
    pub build: Option<String>,
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

/// The version of the stored form; raise it when outcomes change their meaning.
const FORMAT: u32 = 2;

impl Fingerprint {
    /// The fingerprint of an experiment under a plan, carried out by [`build`].
    pub fn new(experiment: &PaperExperiment, scenario: &Scenario, plan: &Plan, build: Option<String>) -> Self {
        let seeds = plan.seeds_of(experiment);
        Self {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            build,
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

/// A hash of this program's file, if it can be read. It depends on every byte: a build that only moved a comment
/// measures again, and a build with another engine never passes for this one.
pub fn build() -> Option<String> {
    digest(fs::File::open(std::env::current_exe().ok()?).ok()?).ok()
}

fn digest(mut bytes: impl io::Read) -> io::Result<String> {
    // The hasher may differ from one Rust to the next; so do the programs that they build.
    let mut hasher = DefaultHasher::new();
    let mut buffer = vec![0; 1 << 16];
    loop {
        match bytes.read(&mut buffer)? {
            0 => return Ok(format!("{:016x}", hasher.finish())),
            count => hasher.write(&buffer[..count]),
        }
    }
}

#[derive(Serialize, Deserialize)]
struct Remembered<F, O> {
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
        let kept: Remembered<Fingerprint, Outcome> = serde_json::from_str(&text).ok()?;
        (fingerprint.build.is_some() && kept.fingerprint == *fingerprint).then_some(kept.outcome)
    }

    /// Stores an outcome.
    pub fn save(&self, fingerprint: &Fingerprint, outcome: &Outcome) -> Result<(), PaperError> {
        let text = serde_json::to_string(&Remembered { fingerprint, outcome })?;
        let path = self.path(&fingerprint.experiment);
        write(&path, text.as_bytes())
    }

    fn path(&self, experiment: &str) -> PathBuf {
        self.0.join(format!("{experiment}.json"))
    }
}

/// Writes a file whole or not at all.
pub fn write(path: &Path, bytes: &[u8]) -> Result<(), PaperError> {
    atomic::write(path, bytes).map_err(|source| PaperError::Write { path: path.to_owned(), source })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::EXPERIMENTS;
    use body_schema_scenario::builtin;

    #[test]
    fn every_byte_of_a_program_counts() {
        let program = vec![7_u8; 200_000];
        let mut other = program.clone();
        other[150_000] = 8;
        let digest = |bytes: &[u8]| digest(bytes).expect("bytes in memory");
        assert_eq!(digest(&program), digest(&program));
        assert_ne!(digest(&program), digest(&other));
        assert_ne!(digest(&program), digest(&program[1..]));
        assert_eq!(build(), build());
        assert!(build().is_some(), "the test's own executable");
    }

    #[test]
    fn outcomes_of_another_program_or_an_unknown_one_are_not_reused() {
        let folder = tempfile::tempdir().expect("a folder");
        let store = Store::open(folder.path()).expect("a store");
        let plan = Plan { quick: true, only: Vec::new(), out: folder.path().to_owned() };
        let scenario = builtin(EXPERIMENTS[0].scenario).expect("built in");
        let by = |build: Option<&str>| Fingerprint::new(&EXPERIMENTS[0], &scenario, &plan, build.map(str::to_owned));
        let outcome = Outcome::Trials(Vec::new());
        store.save(&by(Some("a")), &outcome).expect("kept");
        assert_eq!(store.load(&by(Some("a"))), Some(outcome.clone()));
        assert_eq!(store.load(&by(Some("b"))), None);
        store.save(&by(None), &outcome).expect("kept");
        assert_eq!(store.load(&by(None)), None);
    }
}
