//! The depth of a target: its coordinate along the z axis of a camera or of another target, `y = z + v`, one equation. The depth at a
//! point of a picture (RGB-D), or the height above a plane that a target stands for: 0 where a tip touches a table.

use super::{Channel, Equipment, KeyError, Keys, Part, Relative, Sensor, Subject};
use crate::model::{Hand, KinematicData, Links};

/// The z coordinate of a target in the frame of a device or of another target, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Depth {
    /// The target, and the part along whose z axis it is measured.
    of: Relative,
}

impl Depth {
    /// The depth of a target along the z axis of `seen_from`.
    pub fn new(target: usize, seen_from: Hand) -> Self {
        Self { of: Relative { target, seen_from, has_rotation: false } }
    }

    pub(super) fn from_keys(keys: &Keys, equipment: &Equipment) -> Result<Sensor, KeyError> {
        keys.only(&["target", "camera", "in", "sigma_m"])?;
        if keys.seen_in.is_some() && keys.camera.is_some() {
            return Err(KeyError::new("in", "a camera is named as well", "remove `in` or `camera`"));
        }
        let of = match Relative::from_keys(keys, equipment, false)? {
            Some(of) => of,
            None => {
                let (target, camera) = (keys.target(equipment)?.0, keys.camera(equipment)?.0);
                Relative { target, seen_from: Hand::Device(camera), has_rotation: false }
            }
        };
        Ok(Sensor::even(Self { of }, keys.sigma_m()?))
    }

    #[cfg(test)]
    pub(super) fn example(rng: &mut rand_chacha::ChaCha8Rng, state: &crate::model::State) -> Sensor {
        use rand::RngExt;
        Sensor::even(Self { of: Relative::any(rng, state, false) }, rng.random_range(0.001..0.1))
    }
}

impl Channel for Depth {
    fn subject(&self) -> Subject {
        Subject { parts: vec![Part::Lengths(1)], ..self.of.subject() }
    }

    fn predict(&self, links: &Links<'_>, reading: &mut [f64]) -> bool {
        let mut place = [0.0; 3];
        let is_predicted = self.of.predict(links, &mut place);
        reading[0] = place[2];
        is_predicted
    }

    fn rows(&self, data: &KinematicData<'_>, reading: &mut [f64], rows: &mut [f64]) -> bool {
        let m = rows.len();
        let (mut place, mut all) = ([0.0; 3], vec![0.0; 3 * m]);
        let is_predicted = self.of.rows(data, &mut place, &mut all);
        reading[0] = place[2];
        rows.copy_from_slice(&all[2 * m..]);
        is_predicted
    }
}
