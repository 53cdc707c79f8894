//! The keys of measurements: the table, its held-out rows, and sockets.

use serde::Deserialize;
use toml::Spanned;

use super::Exactly;

/// The table.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Measurements {
    pub file: Spanned<String>,
    /// The columns of the marker, where only a marker was measured and no `[[sensor]]` describes it.
    pub marker_columns_m: Option<Spanned<Exactly<String, 3>>>,
    pub held_out: Option<Spanned<usize>>,
}

/// The held-out rows; exactly one of the keys.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HeldOut {
    pub folds: Option<Spanned<usize>>,
    pub count: Option<Spanned<usize>>,
    pub by: Option<Spanned<String>>,
    pub train: Option<Spanned<Vec<String>>>,
    pub rows: Option<Spanned<Vec<usize>>>,
    pub file: Option<Spanned<String>>,
}

/// The columns that tell in which socket a target was held.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sockets {
    pub target: Option<Spanned<String>>,
    pub place_column: Option<Spanned<String>>,
    pub socket_column: Option<Spanned<String>>,
    pub sigma_m: Option<Spanned<f64>>,
    pub distance_m: Option<Spanned<f64>>,
    pub sigma_distance_m: Option<Spanned<f64>>,
}
