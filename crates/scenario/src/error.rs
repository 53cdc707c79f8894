//! Errors in a scenario: what is wrong, where, and what to do.

use std::fmt;

pub(super) use body_schema_engine::suggest::{did_you_mean, suggest};
use body_schema_engine::{estimation::EstimationError, model::PriorError};
use body_schema_experiment::ExperimentError;

/// A single problem in a scenario file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    /// Line in the file, counted from 1.
    pub line: usize,
    /// The key, with its path.
    pub key: String,
    /// What is wrong.
    pub what: String,
    /// What to do about it.
    pub hint: String,
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "line {}: `{}`: {}; {}", self.line, self.key, self.what, self.hint)
    }
}

/// Why a scenario cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ScenarioError {
    /// The file has problems.
    #[error("{file} is not a valid scenario\n{}", list(file, problems))]
    Invalid {
        /// The file, as it was named.
        file: String,
        /// All problems found.
        problems: Vec<Problem>,
    },
    /// There is no such built-in scenario.
    #[error("there is no scenario `{name}`{}; built in are: {}", suggestion(suggested), known.join(", "))]
    UnknownScenario {
        /// The name asked for.
        name: String,
        /// The name that was probably meant.
        suggested: Option<String>,
        /// The known names.
        known: Vec<String>,
    },
    /// The scenario offers no such learner.
    #[error(
        "scenario `{scenario}` has no learner `{name}`{}; it offers: {}; or write estimator:policy, as in smoother:random",
        suggestion(suggested),
        known.join(", ")
    )]
    UnknownLearner {
        /// The scenario.
        scenario: String,
        /// The name asked for.
        name: String,
        /// The name that was probably meant.
        suggested: Option<String>,
        /// The known names.
        known: Vec<String>,
    },
    /// Postures are to be chosen for a robot some joints of which follow others.
    #[error("joint `{joint}` follows others, and postures are chosen joint by joint; measure postures of your own")]
    Follows {
        /// The joint.
        joint: String,
    },
    /// The parts of a composed learner do not fit.
    #[error("there is no learner `{name}`: {what}; write `{fitting}`")]
    Misfit {
        /// The name asked for.
        name: String,
        /// The reason.
        what: String,
        /// The nearest learner that fits.
        fitting: String,
    },
    /// A learner is named twice.
    #[error("learner `{0}` is named twice; name each learner once")]
    RepeatedLearner(String),
    /// No learner is named.
    #[error("no learner is named; leave the list out to take the scenario's own")]
    NoLearner,
    /// The prior is not a positive definite covariance.
    #[error("scenario `{scenario}`: {source}")]
    Prior {
        /// The scenario.
        scenario: String,
        /// Why.
        source: PriorError,
    },
    /// A learner cannot absorb the observations from before any movement.
    #[error("scenario `{scenario}`: the readings known before any movement cannot be learned from: {source}")]
    Beforehand {
        /// The scenario.
        scenario: String,
        /// Why.
        source: EstimationError,
    },
    /// A run failed.
    #[error(transparent)]
    Experiment(#[from] ExperimentError),
}

fn list(file: &str, problems: &[Problem]) -> String {
    let lines: Vec<String> = problems
        .iter()
        .map(|problem| {
            let Problem { line, key, what, hint } = problem;
            format!("  {file}:{line}: `{key}`: {what}\n    to mend it: {hint}")
        })
        .collect();
    lines.join("\n")
}

fn suggestion(name: &Option<String>) -> String {
    name.as_ref().map(|name| format!(" (did you mean `{name}`?)")).unwrap_or_default()
}
