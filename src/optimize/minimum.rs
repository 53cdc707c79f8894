//! What a search has found.

use serde::{Deserialize, Serialize};

/// What a search has found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Minimum {
    /// The best point, in the unit cube.
    pub point: Vec<f64>,
    /// Its value.
    pub value: f64,
    /// How many points were evaluated.
    pub evaluations: usize,
}
