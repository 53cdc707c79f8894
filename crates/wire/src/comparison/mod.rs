//! A comparison of learners over many seeds.

mod statistics;
mod trace;

pub use trace::Trace;

use serde::{Deserialize, Serialize};

use super::{BestDesign, JointMetrics};
use body_schema_engine::design;
use body_schema_experiment::Metrics;
use statistics::{median, nearest_rank, sorted};

/// Many runs of the same learners, one per seed: `compare --json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Comparison {
    /// Name of the scenario.
    pub scenario: String,
    /// What is other than in the scenario's file, as `KEY=VALUE`; empty for the scenario as it is.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub set: Vec<String>,
    /// Steps of every run.
    pub steps: u64,
    /// See [`Description::movements_by_counting`](crate::Description::movements_by_counting).
    #[serde(default)]
    pub movements_by_counting: usize,
    /// The best designs of several lengths up to these runs', by step; empty unless they were asked for, and where no
    /// truth is known.
    #[serde(default)]
    pub best_designs: Vec<BestDesign>,
    /// The learners.
    pub learners: Vec<LearnerComparison>,
}

/// One learner over many seeds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct LearnerComparison {
    /// Its name.
    pub name: String,
    /// Its runs, in the order of the seeds.
    pub runs: Vec<SeedRun>,
    /// When they converged.
    pub summary: Summary,
    /// The errors by number of movements, over the runs.
    pub curve: Vec<Curve>,
    /// How long choosing one movement took, milliseconds.
    pub selection_ms: SelectionTime,
    /// The A-efficiency of the data collected: the trace of the last of `best_designs` as a fraction of the median
    /// `bound_trace` at the end; null without one of them.
    #[serde(default)]
    pub efficiency: Option<f64>,
    /// How many parameters it learns.
    #[serde(default)]
    pub parameters: usize,
}

/// One run of one learner.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct SeedRun {
    /// Its seed.
    pub seed: u64,
    /// First movement of the final stretch within the thresholds, confirmed by 20 more; null if there is none.
    pub converged_at: Option<u64>,
    /// The same after a change of the body, counted from it; null if there is none or no change.
    pub recovered_at: Option<u64>,
    /// Movements made.
    pub movements: u64,
    /// Movements after which the marker was not seen.
    pub misses: u64,
    /// The errors at the end.
    #[serde(rename = "final")]
    pub last: RunSummary,
}

/// The errors of one run at its end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct RunSummary {
    /// See [`Metrics::orientation_deg`].
    pub orientation_deg: Option<f64>,
    /// See [`Metrics::axis_deg`].
    pub axis_deg: Option<f64>,
    /// See [`Metrics::location_m`].
    pub location_m: Option<f64>,
    /// See [`Metrics::prediction_m`].
    pub prediction_m: Option<f64>,
    /// See [`Metrics::prediction_mean_m`].
    pub prediction_mean_m: Option<f64>,
    /// See [`Metrics::scatter_m`].
    #[serde(default)]
    pub scatter_m: Option<f64>,
    /// See [`Metrics::trace`].
    #[serde(default)]
    pub trace: Option<f64>,
    /// See [`Metrics::bound_trace`].
    #[serde(default)]
    pub bound_trace: Option<f64>,
}

impl From<&Metrics> for RunSummary {
    fn from(metrics: &Metrics) -> Self {
        Self {
            orientation_deg: metrics.orientation_deg,
            axis_deg: metrics.axis_deg,
            location_m: metrics.location_m,
            prediction_m: metrics.prediction_m,
            prediction_mean_m: metrics.prediction_mean_m,
            scatter_m: metrics.scatter_m,
            trace: metrics.trace,
            bound_trace: metrics.bound_trace,
        }
    }
}

/// When the runs of a learner converged. A run that did not counts as infinitely late: a quantile that falls on one is
/// null. Quantiles are nearest-rank, but the median of an even number is the mean of its two middle runs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Summary {
    /// How many runs.
    pub runs: usize,
    /// How many converged.
    pub converged: usize,
    /// The median run.
    pub median_converged_at: Option<f64>,
    /// The run at the 90th percentile.
    pub p90_converged_at: Option<f64>,
    /// The last run; null unless all converged.
    pub max_converged_at: Option<f64>,
}

/// The errors after so many movements, over the runs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Curve {
    /// Movements made.
    pub movements: u64,
    /// See [`Metrics::orientation_deg`].
    pub orientation_deg: Option<Quantiles>,
    /// See [`Metrics::axis_deg`].
    pub axis_deg: Option<Quantiles>,
    /// See [`Metrics::location_m`].
    pub location_m: Option<Quantiles>,
    /// See [`Metrics::prediction_m`].
    pub prediction_m: Option<Quantiles>,
    /// See [`Metrics::prediction_mean_m`].
    pub prediction_mean_m: Option<Quantiles>,
    /// See [`Metrics::scatter_m`].
    #[serde(default)]
    pub scatter_m: Option<Quantiles>,
    /// See [`Metrics::trace`].
    #[serde(default)]
    pub trace: Option<Quantiles>,
    /// See [`Metrics::bound_trace`].
    #[serde(default)]
    pub bound_trace: Option<Quantiles>,
    /// Every joint by itself, base first: medians over the runs.
    pub joints: Vec<JointMetrics>,
}

/// One error over the runs in which it is a finite number.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Quantiles {
    /// Arithmetic mean.
    pub mean: f64,
    /// Median.
    pub median: f64,
    /// Lower quartile.
    pub q25: f64,
    /// Upper quartile.
    pub q75: f64,
}

/// Wall time of choosing one movement.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct SelectionTime {
    /// Median over all movements of all runs, milliseconds.
    pub median: Option<f64>,
    /// 95th percentile, milliseconds.
    pub p95: Option<f64>,
}

impl Comparison {
    /// Puts together the runs of one scenario, in the order given.
    pub fn of(scenario: &str, steps: u64, traces: &[Trace]) -> Self {
        let count = traces.first().map_or(0, |trace| trace.learners.len());
        let learners = (0..count).map(|index| LearnerComparison::of(index, steps, traces)).collect();
        let movements_by_counting = traces.first().map_or(0, |trace| trace.movements_by_counting);
        let (scenario, set) = (scenario.to_owned(), Vec::new());
        Self { scenario, set, steps, movements_by_counting, best_designs: Vec::new(), learners }
    }

    /// The same beside the best designs of the scenario.
    pub fn beside(mut self, best_designs: Vec<design::BestDesign>) -> Self {
        for learner in &mut self.learners {
            let bound = learner.curve.last().and_then(|end| end.bound_trace).map(|bound| bound.median);
            learner.efficiency = design::BestDesign::efficiency(&best_designs, bound, learner.parameters);
        }
        Self { best_designs: best_designs.into_iter().map(BestDesign::from).collect(), ..self }
    }
}

impl LearnerComparison {
    fn of(index: usize, steps: u64, traces: &[Trace]) -> Self {
        let of_learner = || traces.iter().map(|trace| (trace.seed, &trace.learners[index]));
        let runs: Vec<SeedRun> = of_learner()
            .map(|(seed, trace)| SeedRun {
                seed,
                converged_at: trace.converged_at,
                recovered_at: trace.recovered_at,
                movements: trace.movements,
                misses: trace.misses,
                last: trace.errors.last().copied().unwrap_or_default(),
            })
            .collect();
        let joints = of_learner().filter_map(|(_, trace)| trace.joints.first()).map(Vec::len).min().unwrap_or(0);
        let of_joint = |movements: usize, joint: usize| {
            let metrics = || of_learner().filter_map(|(_, trace)| trace.joints.get(movements)?.get(joint));
            let over_runs = |metric: fn(&JointMetrics) -> Option<f64>| median(&sorted(metrics().filter_map(metric)));
            JointMetrics {
                axis_deg: over_runs(|joint| joint.axis_deg),
                location_m: over_runs(|joint| joint.location_m),
                signal_to_noise: over_runs(|joint| joint.signal_to_noise),
            }
        };
        let curve = (0..=steps)
            .map(|movements| {
                let over_runs = |error: fn(&RunSummary) -> Option<f64>| {
                    Quantiles::of(of_learner().filter_map(|(_, trace)| error(trace.errors.get(movements as usize)?)))
                };
                Curve {
                    movements,
                    orientation_deg: over_runs(|errors| errors.orientation_deg),
                    axis_deg: over_runs(|errors| errors.axis_deg),
                    location_m: over_runs(|errors| errors.location_m),
                    prediction_m: over_runs(|errors| errors.prediction_m),
                    prediction_mean_m: over_runs(|errors| errors.prediction_mean_m),
                    scatter_m: over_runs(|errors| errors.scatter_m),
                    trace: over_runs(|errors| errors.trace),
                    bound_trace: over_runs(|errors| errors.bound_trace),
                    joints: (0..joints).map(|joint| of_joint(movements as usize, joint)).collect(),
                }
            })
            .collect();
        let times = sorted(of_learner().flat_map(|(_, trace)| trace.selection_ms.iter().copied()));
        Self {
            name: of_learner().next().map(|(_, trace)| trace.name.clone()).unwrap_or_default(),
            summary: Summary::of(runs.iter().map(|run| run.converged_at)),
            runs,
            curve,
            efficiency: None,
            parameters: of_learner().next().map(|(_, trace)| trace.parameters).unwrap_or_default(),
            selection_ms: SelectionTime { median: median(&times), p95: nearest_rank(&times, 0.95) },
        }
    }
}
