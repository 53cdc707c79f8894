//! The distance of a target from a fixed point: `y = ‖p(θ) − a‖ + v`, `v ~ N(0, σ²)`, one equation. A laser, or a cable
//! with an encoder.

use std::sync::Arc;

use nalgebra::Point3;

use super::{Apart, Channel, Equipment, KeyError, Keys};
use crate::model::{Pass, State};

/// The distance of a target from a point whose place is known, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Distance {
    /// The index of the target.
    pub target: usize,
    /// a, in the frame of the measurements, metres.
    pub to: Point3<f64>,
    /// Standard deviation of the noise, metres.
    pub sigma_m: f64,
}

impl Distance {
    pub(super) fn from_keys(keys: &Keys, equipment: &Equipment) -> Result<Self, KeyError> {
        keys.only(&["target", "sigma_m", "to_m"])?;
        Ok(Self { target: keys.target(equipment)?.0, to: keys.to_m()?, sigma_m: keys.sigma_m()? })
    }

    #[cfg(test)]
    pub(super) fn example(rng: &mut rand_chacha::ChaCha8Rng, state: &State) -> Self {
        use rand::RngExt;
        let target = rng.random_range(0..state.targets.len());
        let to = Point3::from(nalgebra::Vector3::from_fn(|_, _| rng.random_range(-2.0..2.0)));
        Self { target, to, sigma_m: rng.random_range(0.001..0.1) }
    }
}

impl Channel for Distance {
    fn equations(&self) -> usize {
        1
    }

    fn subject(&self) -> Option<usize> {
        Some(self.target)
    }

    fn sigma(&self) -> f64 {
        self.sigma_m
    }

    fn with_sigma(&self, sigma_m: f64) -> Arc<dyn Channel> {
        Arc::new(Self { sigma_m, ..*self })
    }

    fn predict(&self, state: &State, positions: &[f64], reading: &mut [f64]) -> bool {
        reading[0] = (state.target_at(self.target, positions) - self.to).norm();
        reading[0] > 0.0
    }

    fn rows(&self, pass: &Pass<'_>, reading: &mut [f64], rows: &mut [f64]) -> bool {
        let away = pass.target(self.target) - self.to.coords;
        reading[0] = away.norm();
        // At the point itself every direction leads away from it.
        if reading[0] <= 0.0 {
            return false;
        }
        let slope = away / (reading[0] * self.sigma_m);
        pass.point_columns(self.target, |coordinate, column| rows[coordinate] = slope.dot(&column));
        true
    }

    fn apart(&self, y: &[f64], h: &[f64]) -> Apart {
        Apart::lengths(y, h)
    }
}
