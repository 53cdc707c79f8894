//! The loop for callers who want no say in how a search goes.

use super::search::Direct;
use super::settings::{DirectError, Settings};
use crate::optimize::Minimum;

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
