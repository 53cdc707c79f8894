//! The series of a learner: every metric, and the figures of its choice of movement.

use body_schema_wire::LearnerReport;

/// Names, in the order of [`values`].
pub(super) const NAMES: [&str; 20] = [
    "orientation_deg",
    "axis_deg",
    "location_m",
    "prediction_m",
    "prediction_mean_m",
    "expected_prediction_m",
    "scatter_m",
    "trace",
    "bound_trace",
    "nis",
    "nis_dof",
    "nees",
    "nees_dof",
    "movements",
    "misses",
    "settled",
    "selection_ms",
    "criterion",
    "gain",
    "evaluations",
];

/// The values of a report; what is null, or not finite as after a divergence, is `None`.
pub(super) fn values(report: &LearnerReport) -> [Option<f64>; NAMES.len()] {
    let metrics = &report.metrics;
    let movement = report.movement.as_ref();
    let count = |count: u64| Some(count as f64);
    [
        metrics.orientation_deg,
        metrics.axis_deg,
        metrics.location_m,
        metrics.prediction_m,
        metrics.prediction_mean_m,
        metrics.expected_prediction_m,
        metrics.scatter_m,
        metrics.trace,
        metrics.bound_trace,
        metrics.nis,
        metrics.nis_dof.map(|dof| dof as f64),
        metrics.nees,
        metrics.nees_dof.map(|dof| dof as f64),
        count(metrics.movements),
        count(metrics.misses),
        count(metrics.settled.into()),
        movement.map(|movement| movement.selection_ms),
        movement.and_then(|movement| movement.criterion),
        movement.and_then(|movement| movement.gain),
        movement.map(|movement| movement.evaluations as f64),
    ]
    .map(|value| value.filter(|value| value.is_finite()))
}
