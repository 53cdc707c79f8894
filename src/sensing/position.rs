//! The position of a target: `y = p(θ) + v`, `v ~ N(0, σ² I)`, three equations.

use std::sync::Arc;

use super::{Channel, KeyError, Keys};
use crate::model::{Pass, State};

/// A tracker of a target's position in space, metres, in the frame of the measurements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Position {
    /// Which target.
    pub target: usize,
    /// Standard deviation of the noise per coordinate, metres.
    pub sigma_m: f64,
}

impl Position {
    /// The tracker of the marker, the first target.
    pub fn of_marker(sigma_m: f64) -> Self {
        Self { target: 0, sigma_m }
    }

    pub(super) fn from_keys(keys: &Keys) -> Result<Self, KeyError> {
        keys.only(&["sigma_m"])?;
        Ok(Self::of_marker(keys.sigma_m()?))
    }

    #[cfg(test)]
    pub(super) fn example(rng: &mut rand_chacha::ChaCha8Rng, state: &State) -> Self {
        use rand::RngExt;
        Self { target: rng.random_range(0..state.targets.len()), sigma_m: rng.random_range(0.001..0.1) }
    }
}

impl Channel for Position {
    fn equations(&self) -> usize {
        3
    }

    fn sigma(&self) -> f64 {
        self.sigma_m
    }

    fn with_sigma(&self, sigma_m: f64) -> Arc<dyn Channel> {
        Arc::new(Self { sigma_m, ..*self })
    }

    fn predict(&self, state: &State, positions: &[f64], reading: &mut [f64]) -> bool {
        reading.copy_from_slice(state.target_at(self.target, positions).coords.as_slice());
        true
    }

    fn difference(&self, y: &[f64], h: &[f64], whitened: &mut [f64]) {
        let weight = self.sigma_m.recip();
        whitened.iter_mut().zip(y).zip(h).for_each(|((whitened, y), h)| *whitened = (y - h) * weight);
    }

    fn rows(&self, pass: &Pass<'_>, reading: &mut [f64], rows: &mut [f64]) -> bool {
        let weight = self.sigma_m.recip();
        let (first, rest) = rows.split_at_mut(rows.len() / 3);
        let (second, third) = rest.split_at_mut(first.len());
        let point = pass.point_columns(self.target, |coordinate, column| {
            first[coordinate] = column.x * weight;
            second[coordinate] = column.y * weight;
            third[coordinate] = column.z * weight;
        });
        reading.copy_from_slice(point.as_slice());
        true
    }

    fn disturb(&self, reading: &mut [f64], v: &[f64]) {
        reading.iter_mut().zip(v).for_each(|(reading, v)| *reading += self.sigma_m * v);
    }

    fn target(&self) -> Option<usize> {
        Some(self.target)
    }
}
