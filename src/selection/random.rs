//! Uniform random movements.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::{Actions, Movement, Policy, Selection, SelectionError};
use crate::estimation::Belief;

/// Draws uniformly inside the limits, or from what is left of a pool (which shuffles it).
///
/// Where a head watches, it is told as much as every learner, and ignores it: the paper's random movements.
#[derive(Clone, Copy, Debug, Default)]
pub struct Random;

impl Policy for Random {
    fn select(
        &mut self,
        _belief: &Belief,
        actions: &Actions,
        rng: &mut ChaCha8Rng,
    ) -> Result<Selection, SelectionError> {
        let movement = match actions {
            Actions::Box(limits) => Movement { configuration: draw_configuration(limits, rng), row: None },
            Actions::Pool(pool) if pool.is_empty() => return Err(SelectionError::Exhausted),
            Actions::Pool(pool) => pool[rng.random_range(0..pool.len())].clone(),
        };
        Ok(Selection { movement, criterion: None, gain: None, evaluations: 0, partition: None })
    }
}

/// A configuration uniform in the box of limits.
pub(crate) fn draw_configuration(limits: &[(f64, f64)], rng: &mut ChaCha8Rng) -> Vec<f64> {
    limits.iter().map(|&(lower, upper)| if lower < upper { rng.random_range(lower..=upper) } else { lower }).collect()
}
