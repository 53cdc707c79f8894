//! What is measured after a movement, and with what noise.
//!
//! * [`MarkerTracker`]: the position of the marker in space.
//! * [`Head`]: a camera head that follows the marker; where it cannot, the movement is a miss.

mod head;

pub use head::{Gaze, Head};

use nalgebra::{Matrix3, Point3, Vector3};

use crate::kinematics::Chain;

/// What came of looking for the marker after a movement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Observation {
    /// The measured marker position, metres, measurement frame.
    Seen(Point3<f64>),
    /// The marker was not seen. The movement counts all the same.
    Missed,
}

impl Observation {
    /// The measured position, if the marker was seen.
    pub fn position(&self) -> Option<&Point3<f64>> {
        match self {
            Self::Seen(position) => Some(position),
            Self::Missed => None,
        }
    }
}

/// A tracker of the marker's position in space: `y = p(θ) + v`, `v ~ N(0, σ² I)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MarkerTracker {
    /// Standard deviation of the noise per coordinate, metres.
    pub sigma_m: f64,
}

impl MarkerTracker {
    /// The observation of `chain` at θ under the standard normal draw `noise`.
    pub fn observe(&self, chain: &Chain, positions: &[f64], noise: &Vector3<f64>) -> Observation {
        Observation::Seen(chain.marker_at(positions) + noise * self.sigma_m)
    }
}

/// The isotropic measurement covariance R = r I (m²).
pub fn isotropic(variance_m2: f64) -> Matrix3<f64> {
    Matrix3::from_diagonal_element(variance_m2)
}
