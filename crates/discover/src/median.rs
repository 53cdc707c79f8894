//! The median.

use body_schema_engine::most::middle;

/// The middle one of numbers; 0 of none.
pub(crate) fn median(values: Vec<f64>) -> f64 {
    middle(values).unwrap_or(0.0)
}
