//! The distance of a target from a fixed point: `y = ‖p(θ) − a‖ + v`, one equation. A laser, or a cable with an encoder. From another
//! target it is a [`Separation`].

use nalgebra::Point3;

use super::{Channel, Equipment, KeyError, Keys, Part, Sensor, Separation, Subject};
use crate::model::{KinematicData, Links};

/// The distance of a target from a point whose place is known, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Distance {
    /// The index of the target.
    pub target: usize,
    /// a, in the frame of the measurements, metres.
    pub to: Point3<f64>,
}

impl Distance {
    pub(super) fn from_keys(keys: &Keys, equipment: &Equipment) -> Result<Sensor, KeyError> {
        keys.only(&["target", "sigma_m", "to", "to_m"])?;
        let target = keys.target(equipment)?.0;
        let Some(other) = keys.to(equipment)? else {
            return Ok(Sensor::even(Self { target, to: keys.to_m()? }, keys.sigma_m()?));
        };
        if keys.to_m.is_some() {
            return Err(KeyError::new("to", "a fixed point is given as well", "remove `to` or `to_m`"));
        }
        if other == target {
            return Err(KeyError::new("to", "a target has no distance from itself", "name another target"));
        }
        Ok(Sensor::even(Separation { target, to: other }, keys.sigma_m()?))
    }

    #[cfg(test)]
    pub(super) fn example(rng: &mut rand_chacha::ChaCha8Rng, state: &crate::model::State) -> Sensor {
        use rand::RngExt;
        let target = rng.random_range(0..state.targets.len());
        if rng.random() {
            let to = (target + 1) % state.targets.len();
            return Sensor::even(Separation { target, to }, rng.random_range(0.001..0.1));
        }
        let to = Point3::from(nalgebra::Vector3::from_fn(|_, _| rng.random_range(-2.0..2.0)));
        Sensor::even(Self { target, to }, rng.random_range(0.001..0.1))
    }
}

impl Channel for Distance {
    fn subject(&self) -> Subject {
        Subject { target: Some(self.target), parts: vec![Part::Norm], ..Subject::default() }
    }

    fn predict(&self, links: &Links<'_>, reading: &mut [f64]) -> bool {
        reading[0] = (links.target(self.target) - self.to.coords).norm();
        reading[0] > 0.0
    }

    fn rows(&self, data: &KinematicData<'_>, reading: &mut [f64], rows: &mut [f64]) -> bool {
        let away = data.target(self.target) - self.to.coords;
        reading[0] = away.norm();
        // At the point itself every direction leads away from it.
        if reading[0] <= 0.0 {
            return false;
        }
        data.point_columns(self.target, |coordinate, column| rows[coordinate] = away.dot(&column));
        true
    }
}
