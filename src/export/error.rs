//! Errors of an export.

use std::{
    io,
    path::{Path, PathBuf},
};

use crate::page::PageError;
use body_schema_scenario::ScenarioError;

/// Why a folder could not be written.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The folder holds something else.
    #[error("the folder {} is not empty and holds no export; name another with --out, or write into it with --force", .0.display())]
    NotEmpty(PathBuf),
    /// A run cannot have this many steps.
    #[error("a page plays `{scenario}` for 1 to {most} steps, {steps} were asked for; use --steps {most} or fewer")]
    Steps {
        /// The scenario.
        scenario: String,
        /// The number that was asked for.
        steps: u64,
        /// The most that is possible.
        most: u64,
    },
    /// No browser reads such a seed exactly.
    #[error("a page takes seeds from 0 to {most}, not {seed}")]
    Seed {
        /// The seed that was asked for.
        seed: u64,
        /// The greatest that is possible.
        most: u64,
    },
    /// The scenario has no such learners, or cannot be run.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// The page's files are not there.
    #[error(transparent)]
    Page(#[from] PageError),
    /// A value could not be written as JSON.
    #[error("cannot write JSON: {0}; please report this as a bug")]
    Json(#[from] serde_json::Error),
    /// The first steps of the first story could not be computed.
    #[error("the first steps cannot be computed: {0}")]
    FirstSteps(String),
    /// A file or folder could not be used.
    #[error("cannot {doing} {}: {source}", path.display())]
    File {
        /// What was tried.
        doing: &'static str,
        /// Where.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
}

impl ExportError {
    /// Whether the error lies in the request rather than in carrying it out.
    pub fn is_bad_input(&self) -> bool {
        match self {
            Self::NotEmpty(_) | Self::Steps { .. } | Self::Seed { .. } => true,
            Self::Scenario(error) => !matches!(error, ScenarioError::Experiment(_)),
            _ => false,
        }
    }
}

/// Adds to an error what was being done to which file.
pub(super) trait Doing<T> {
    fn doing(self, doing: &'static str, path: &Path) -> Result<T, ExportError>;
}

impl<T> Doing<T> for io::Result<T> {
    fn doing(self, doing: &'static str, path: &Path) -> Result<T, ExportError> {
        self.map_err(|source| ExportError::File { doing, path: path.to_owned(), source })
    }
}
