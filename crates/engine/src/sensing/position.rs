//! The position of a target: `y = p(θ) + v`, `v ~ N(0, σ² I)` or `N(0, L Lᵀ)`, three equations.

use std::sync::Arc;

use nalgebra::{Matrix3, Vector3};

use super::{Apart, Channel, Equipment, KeyError, Keys, noise::root};
use crate::model::{Pass, State, Whitening};

/// A tracker of a target's position in space, metres, in the frame of the measurements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Position {
    /// The index of the target.
    pub target: usize,
    /// Standard deviation of the noise per coordinate, metres; √(tr/3) of a full covariance.
    pub sigma_m: f64,
    /// L/σ, lower triangular, and its inverse, if the noise is not the same in all directions.
    shape: Option<(Matrix3<f64>, Matrix3<f64>)>,
}

impl Position {
    /// A tracker of the marker, the first target.
    pub fn of_marker(sigma_m: f64) -> Self {
        Self::of(0, sigma_m)
    }

    /// A tracker of a target.
    pub fn of(target: usize, sigma_m: f64) -> Self {
        Self { target, sigma_m, shape: None }
    }

    /// A tracker of a target with noise of this covariance (m²); `None` if it is not symmetric and positive definite.
    pub fn with_covariance(target: usize, covariance: &Matrix3<f64>) -> Option<Self> {
        let sigma_m = (covariance.trace() / 3.0).sqrt();
        let root = root(covariance)? / sigma_m;
        Some(Self { target, sigma_m, shape: Some((root, root.try_inverse()?)) })
    }

    pub(super) fn from_keys(keys: &Keys, equipment: &Equipment) -> Result<Self, KeyError> {
        keys.only(&["target", "sigma_m", "covariance_m2"])?;
        let (target, _) = keys.target(equipment)?;
        match keys.covariance_m2()? {
            Some(covariance) if keys.sigma_m.is_none() => {
                let error = || KeyError::new("covariance_m2", "it is not positive", "write a symmetric, positive matrix");
                Self::with_covariance(target, &covariance).ok_or_else(error)
            }
            Some(_) => {
                let what = "the covariance says how much noise there is";
                Err(KeyError::new("sigma_m", what, "remove `sigma_m` or `covariance_m2`"))
            }
            None => Ok(Self::of(target, keys.sigma_m()?)),
        }
    }

    /// L⁻¹ x.
    #[inline]
    fn whiten(&self, x: Vector3<f64>) -> Vector3<f64> {
        let weight = self.sigma_m.recip();
        match &self.shape {
            None => x * weight,
            Some((_, inverse)) => inverse * x * weight,
        }
    }

    #[cfg(test)]
    pub(super) fn example(rng: &mut rand_chacha::ChaCha8Rng, state: &State) -> Self {
        use rand::RngExt;
        let target = rng.random_range(0..state.targets.len());
        if rng.random() {
            return Self::of(target, rng.random_range(0.001..0.1));
        }
        let root = Matrix3::from_fn(|_, _| rng.random_range(-0.1..0.1)) + Matrix3::identity() * 0.02;
        let covariance = root * root.transpose() + Matrix3::identity() * 1e-4;
        Self::with_covariance(target, &covariance).expect("positive")
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
        let difference = Vector3::from_column_slice(y) - Vector3::from_column_slice(h);
        whitened.copy_from_slice(self.whiten(difference).as_slice());
    }

    fn rows(&self, pass: &Pass<'_>, reading: &mut [f64], rows: &mut [f64]) -> bool {
        let (first, rest) = rows.split_at_mut(rows.len() / 3);
        let (second, third) = rest.split_at_mut(first.len());
        let point = pass.point_columns(self.target, |coordinate, column| {
            let column = self.whiten(column);
            first[coordinate] = column.x;
            second[coordinate] = column.y;
            third[coordinate] = column.z;
        });
        reading.copy_from_slice(point.as_slice());
        true
    }

    fn apart(&self, y: &[f64], h: &[f64]) -> Apart {
        Apart::lengths(y, h)
    }

    fn disturb(&self, reading: &mut [f64], v: &[f64]) {
        let v = Vector3::from_column_slice(v) * self.sigma_m;
        let noise = self.shape.as_ref().map_or(v, |(root, _)| root * v);
        reading.iter_mut().zip(&noise).for_each(|(reading, noise)| *reading += noise);
    }

    fn target(&self) -> Option<usize> {
        Some(self.target)
    }

    fn point(&self) -> Option<(usize, Whitening)> {
        let weight = self.sigma_m.recip();
        let whitening = match &self.shape {
            None => Whitening::Even(weight),
            Some((_, inverse)) => Whitening::Full(inverse * weight),
        };
        Some((self.target, whitening))
    }
}
