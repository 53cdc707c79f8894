//! The place of a camera in the frame of another, six equations that are known before any movement: a stereo pair, as its maker or its
//! own calibration tells it.
//!
//! With C, C′ the poses of the two cameras in one and the same frame,
//!
//! ```text
//! y = (t, ω) ⊕ v,     C⁻¹ C′ = (exp([ω]×), t)
//! ```
//!
//! Both are carried by one link, so that the posture does not matter. Where nothing else measures a length, ‖t‖ tells how large the robot
//! is.

use super::{Channel, Occasion, Part, Pose, Subject, relative::between};
use crate::model::{Frame, KinematicData, Links};

/// The pose of a camera in the frame of another on the same link: metres, and a rotation vector in radians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Baseline {
    /// The index of the camera among the devices.
    pub camera: usize,
    /// That of the camera in whose frame it is known.
    pub from: usize,
}

impl Baseline {
    fn frames(&self) -> (Frame, Frame) {
        (Frame::Device(self.camera), Frame::Device(self.from))
    }

    #[cfg(test)]
    pub(super) fn example(rng: &mut rand_chacha::ChaCha8Rng, state: &crate::model::State) -> super::Sensor {
        use rand::RngExt;
        let sigmas = [rng.random_range(0.001..0.1), rng.random_range(0.001..0.1)];
        let baseline = Self { camera: state.devices.len() - 1, from: 0 };
        super::Sensor::new(baseline, super::NoiseModel::parts(sigmas)).expect("two parts")
    }
}

impl Channel for Baseline {
    fn subject(&self) -> Subject {
        let parts = vec![Part::Position, Part::Rotation];
        Subject { occasion: Occasion::Beforehand, parts, ..Subject::default() }
    }

    fn predict(&self, links: &Links<'_>, reading: &mut [f64]) -> bool {
        let (camera, from) = self.frames();
        Pose::write(&links.relative(camera, from), reading);
        true
    }

    fn rows(&self, data: &KinematicData<'_>, reading: &mut [f64], rows: &mut [f64]) -> bool {
        between(data, self.frames(), reading, rows);
        true
    }

    fn difference(&self, y: &[f64], h: &[f64], residual: &mut [f64]) {
        Pose::residual(y, h, residual);
    }

    fn add(&self, reading: &mut [f64], v: &[f64]) {
        Pose::add_to(reading, v);
    }
}
