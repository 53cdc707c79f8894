//! Errors of rerunning the paper.

use std::{io, path::PathBuf};

use body_schema_chart::RasterError;
use body_schema_engine::optimize::DirectError;
use body_schema_experiment::ExperimentError;
use body_schema_scenario::ScenarioError;

/// Why the paper could not be rerun. What was measured before the error is kept.
#[derive(Debug, thiserror::Error)]
pub enum PaperError {
    /// There is no such experiment.
    #[error("there is no experiment `{id}`{}; the experiments are {}", suggestion(suggested.as_deref()), known.join(", "))]
    UnknownExperiment {
        /// The name that was asked for.
        id: String,
        /// The name that was probably meant.
        suggested: Option<String>,
        /// The known names.
        known: Vec<&'static str>,
    },
    /// A scenario is not what the experiment needs.
    #[error("experiment `{experiment}`: {source}")]
    Scenario {
        /// Its name.
        experiment: &'static str,
        /// Why.
        source: ScenarioError,
    },
    /// A run broke off.
    #[error("experiment `{experiment}`, seed {seed}: {source}")]
    Run {
        /// Its name.
        experiment: &'static str,
        /// The seed of the run.
        seed: u64,
        /// Why.
        source: ExperimentError,
    },
    /// DIRECT refused its settings.
    #[error("DIRECT: {0}")]
    Search(#[from] DirectError),
    /// An experiment cannot be done with its scenario; a mistake in the table of experiments.
    #[error("experiment `{experiment}` cannot be done: {reason}; please report this as a bug")]
    Impossible {
        /// Its name.
        experiment: &'static str,
        /// Why.
        reason: String,
    },
    /// A file could not be written.
    #[error("cannot write {}: {source}; name a folder that may be written to with --out", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// Threads could not be started.
    #[error("cannot start threads: {0}")]
    Threads(#[from] rayon::ThreadPoolBuildError),
    /// Something could not be written as JSON.
    #[error("cannot write JSON: {0}; please report this as a bug")]
    Json(#[from] serde_json::Error),
    /// A figure could not be turned into a picture.
    #[error("figure `{figure}`: {source}; please report this as a bug")]
    Figure {
        /// Its name.
        figure: String,
        /// Why.
        source: RasterError,
    },
}

impl PaperError {
    /// Whether the error lies in the request rather than in carrying it out.
    pub fn is_bad_input(&self) -> bool {
        matches!(self, Self::UnknownExperiment { .. })
    }
}

fn suggestion(suggested: Option<&str>) -> String {
    suggested.map_or_else(String::new, |id| format!("; did you mean `{id}`?"))
}
