//! What passes between a search and its caller, and the loop for callers who want no say in it.

use serde::{Deserialize, Serialize};

use super::search::Direct;
use super::settings::{DirectError, Settings};

/// Points to evaluate, all of which may be evaluated at once.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Batch<'a> {
    dimension: usize,
    centres: &'a [f64],
}

impl<'a> Batch<'a> {
    pub(super) fn new(dimension: usize, centres: &'a [f64]) -> Self {
        Self { dimension, centres }
    }

    /// How many points there are: one at least.
    #[expect(clippy::len_without_is_empty, reason = "a batch is never empty")]
    pub fn len(&self) -> usize {
        self.centres.len() / self.dimension
    }

    /// The points in the order in which their values are to be told.
    pub fn iter(&self) -> std::slice::ChunksExact<'a, f64> {
        self.centres.chunks_exact(self.dimension)
    }
}

impl<'a> IntoIterator for Batch<'a> {
    type Item = &'a [f64];
    type IntoIter = std::slice::ChunksExact<'a, f64>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}

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

/// Minimises an objective over the unit cube until the search has ended, which is usually when the budget has.
/// `None` if no point was feasible, that is if the objective was finite nowhere.
///
/// # Errors
///
/// If the dimension or the budget is zero, or ε negative or not finite.
pub fn minimize(
    dimension: usize,
    settings: Settings,
    mut objective: impl FnMut(&[f64]) -> f64,
) -> Result<Option<Minimum>, DirectError> {
    let mut direct = Direct::new(dimension, settings)?;
    let mut values = Vec::new();
    while let Some(batch) = direct.ask() {
        values.clear();
        values.extend(batch.iter().map(&mut objective));
        direct.tell(&values)?;
    }
    let evaluations = direct.evaluations();
    Ok(direct.best().map(|(point, value)| Minimum { point: point.to_vec(), value, evaluations }))
}
