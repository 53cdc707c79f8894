//! The charts: which series the views show as curves.

/// The series of the best designs.
pub(super) const BEST_DESIGN: &str = "limits/best_design_trace";

/// Titles and metrics of the curves.
pub(super) const CHARTS: [(&str, &str); 3] = [
    ("Orientation error (deg)", "orientation_deg"),
    ("Location error (m)", "location_m"),
    ("Prediction error, mean (m)", "prediction_mean_m"),
];

/// Titles and metrics of the curves where no truth is known.
pub(super) const CHARTS_WITHOUT_TRUTH: [(&str, &str); 2] =
    [("Prediction error, mean (m)", "prediction_mean_m"), ("Trace of the covariance, tr(W P)", "trace")];

/// The trace beside its limits, in a tab where the truth is known.
pub(super) const TRACE: (&str, [&str; 2]) = ("Trace, and what data allow", ["trace", "bound_trace"]);

/// Whether a metric has its curve in some arrangement.
pub(super) fn shows(metric: &str) -> bool {
    TRACE.1.contains(&metric) || CHARTS.iter().chain(&CHARTS_WITHOUT_TRUTH).any(|(_, shown)| *shown == metric)
}
