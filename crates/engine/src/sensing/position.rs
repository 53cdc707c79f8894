//! The position of a target: `y = p(θ) + v`, three equations.

use nalgebra::Vector3;

use super::{Channel, Equipment, KeyError, Keys, Part, Relative, Sensor, Subject};
use crate::model::{KinematicData, Links};

/// A tracker of a target's position in space, metres, in the frame of the measurements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Position {
    /// The index of the target; the marker is the first.
    pub target: usize,
}

impl Position {
    pub(super) fn from_keys(keys: &Keys, equipment: &Equipment) -> Result<Sensor, KeyError> {
        keys.only(&["target", "in", "sigma_m", "covariance_m2"])?;
        match Relative::from_keys(keys, equipment, false)? {
            Some(relative) => Self::with_noise(keys, relative),
            None => Self::with_noise(keys, Self { target: keys.target(equipment)?.0 }),
        }
    }

    fn with_noise(keys: &Keys, channel: impl Channel + 'static) -> Result<Sensor, KeyError> {
        match keys.covariance_m2()? {
            Some(noise) => {
                Sensor::new(channel, noise).map_err(|unfit| KeyError::new("covariance_m2", unfit.to_string(), "write 3 × 3"))
            }
            None => Ok(Sensor::even(channel, keys.sigma_m()?)),
        }
    }

    #[cfg(test)]
    pub(super) fn example(rng: &mut rand_chacha::ChaCha8Rng, state: &crate::model::State) -> Sensor {
        use crate::sensing::NoiseModel;
        use nalgebra::DMatrix;
        use rand::RngExt;
        let position = Self { target: rng.random_range(0..state.targets.len()) };
        if rng.random() {
            return Sensor::even(Relative::any(rng, state, false), rng.random_range(0.001..0.1));
        }
        if rng.random() {
            return Sensor::even(position, rng.random_range(0.001..0.1));
        }
        let root = DMatrix::from_fn(3, 3, |_, _| rng.random_range(-0.1..0.1)) + DMatrix::identity(3, 3) * 0.02;
        let covariance = &root * root.transpose() + DMatrix::identity(3, 3) * 1e-4;
        Sensor::new(position, NoiseModel::covariance(&covariance).expect("positive")).expect("three equations")
    }
}

impl Channel for Position {
    fn subject(&self) -> Subject {
        Subject { target: Some(self.target), parts: vec![Part::Position], ..Subject::default() }
    }

    fn predict(&self, links: &Links<'_>, reading: &mut [f64]) -> bool {
        reading.copy_from_slice(links.target(self.target).as_slice());
        true
    }

    fn rows(&self, data: &KinematicData<'_>, reading: &mut [f64], rows: &mut [f64]) -> bool {
        let (first, rest) = rows.split_at_mut(rows.len() / 3);
        let (second, third) = rest.split_at_mut(first.len());
        let point = data.point_columns(self.target, |coordinate, column: Vector3<f64>| {
            first[coordinate] = column.x;
            second[coordinate] = column.y;
            third[coordinate] = column.z;
        });
        reading.copy_from_slice(point.as_slice());
        true
    }
}
