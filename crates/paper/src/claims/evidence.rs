//! The evidence for a claim, and the verdict.

use crate::{experiments::PaperExperiment, outcome::Outcome, report::Agreement};
use body_schema_scenario::Scenario;
use body_schema_wire::{Curve, LearnerComparison, Quantiles};

/// The outcome of an experiment, with what was run.
#[derive(Clone, Copy, Debug)]
pub struct Evidence<'a> {
    /// The experiment.
    pub experiment: &'static PaperExperiment,
    /// Its scenario.
    pub scenario: &'a Scenario,
    /// Movements of every run.
    pub steps: u64,
    /// Its outcome.
    pub outcome: &'a Outcome,
}

/// A verdict, with its reasons.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// Our number, if there is one.
    pub ours: Option<f64>,
    /// What we measured, in words.
    pub text: String,
    /// Whether we agree.
    pub agrees: Agreement,
    /// Why we say so.
    pub why: String,
}

/// The factor within which numbers agree.
const CLOSE: f64 = 1.5;
/// The factor within which numbers agree in part.
const SAME_ORDER: f64 = 3.0;

impl Evidence<'_> {
    /// A learner's runs.
    pub fn learner(&self, name: &str) -> Option<&LearnerComparison> {
        self.outcome.learner(name)
    }

    /// A learner's errors after `movements`, or at the nearest number that was kept.
    pub fn curve_at(&self, learner: &str, movements: u64) -> Option<&Curve> {
        self.learner(learner)?.curve.iter().min_by_key(|point| point.movements.abs_diff(movements))
    }

    /// A learner's errors at the end.
    pub fn end(&self, learner: &str) -> Option<&Curve> {
        self.learner(learner)?.curve.last()
    }

    /// "median 98.5 movements, 20 of 20 runs converge".
    pub fn convergence(&self, learner: &LearnerComparison) -> String {
        let summary = &learner.summary;
        let within = format!("{} of {} runs converge within {}", summary.converged, summary.runs, self.steps);
        match summary.median_converged_at {
            Some(median) => format!("median {median} movements; {within}"),
            None => format!("the median run does not converge; {within}"),
        }
    }

    /// The thresholds of convergence, in words.
    pub fn thresholds(&self) -> String {
        let thresholds = self.scenario.thresholds;
        format!("thresholds {} deg and {} cm", thresholds.orientation_deg, short(thresholds.location_m * 100.0))
    }

    /// The first movement from which the median of an error stays at or below `level`.
    pub fn falls_below(&self, learner: &str, error: fn(&Curve) -> Option<Quantiles>, level: f64) -> Option<u64> {
        let curve = &self.learner(learner)?.curve;
        let above = curve.iter().rposition(|point| error(point).is_none_or(|error| error.median > level));
        curve.get(above.map_or(0, |above| above + 1)).map(|point| point.movements)
    }

    /// Judges the median number of movements of a learner against the paper's, which is `about` that, or at most that.
    pub fn movements(&self, learner: &str, paper: f64, about: bool, if_differs: &str) -> Option<Finding> {
        let learner = self.learner(learner)?;
        let text = self.convergence(learner);
        let thresholds = self.thresholds();
        let Some(ours) = learner.summary.median_converged_at else {
            let reached = self.steps as f64 > paper * CLOSE;
            let agrees = if reached { Agreement::No } else { Agreement::Partly };
            let why = format!(
                "no median within {} movements to set against {paper} ({thresholds}). {if_differs}",
                self.steps
            );
            return Some(Finding { ours: None, text, agrees, why: why.trim_end().to_owned() });
        };
        let ratio = ours / paper;
        let agrees = match () {
            () if !about && ratio <= 1.0 => Agreement::Yes,
            () if about && (1.0 / CLOSE..=CLOSE).contains(&ratio) => Agreement::Yes,
            () if (1.0 / SAME_ORDER..=SAME_ORDER).contains(&ratio) => Agreement::Partly,
            () => Agreement::No,
        };
        let bound = if about { "" } else { " limit" };
        let reason = if agrees == Agreement::Yes { "" } else { if_differs };
        let why = format!("{} times the paper's{bound} ({thresholds}). {reason}", short(ratio));
        Some(Finding { ours: Some(ours), text, agrees, why: why.trim_end().to_owned() })
    }
}

/// A number in about three digits.
pub fn short(value: f64) -> String {
    let size = value.abs();
    let decimals = match size {
        _ if size == 0.0 || size >= 100.0 => 0,
        _ if size >= 10.0 => 1,
        _ if size >= 0.1 => 2,
        _ => return format!("{value:.2e}"),
    };
    let text = format!("{value:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// A share in per cent.
pub fn percent(share: f64) -> String {
    format!("{} %", short(share * 100.0))
}
