//! Where movements are made and markers are measured.
//!
//! The world holds the truth. No module of `estimation` or `selection` can name this type.

use nalgebra::{Point3, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use super::streams::Stream;
use crate::{
    kinematics::Chain,
    selection::Movement,
    sensing::{MarkerTracker, Observation},
};

/// A simulated arm, or a recorded data set.
#[derive(Clone, Debug)]
pub enum World {
    /// A chain that is known here and nowhere else, seen by a noisy tracker.
    Simulated {
        /// The true chain.
        truth: Chain,
        /// The tracker.
        tracker: MarkerTracker,
    },
    /// Recorded marker positions by row; no truth is known.
    Measured {
        /// The measured marker of every row of the data set, metres.
        markers_m: Vec<Point3<f64>>,
    },
}

/// The noise of one world: the k-th movement of every learner sees the k-th draw, whether its marker was seen or not.
#[derive(Clone, Debug)]
pub struct NoiseSequence(ChaCha8Rng);

impl NoiseSequence {
    /// The sequence of a seed.
    pub fn new(seed: u64) -> Self {
        Self(Stream::Noise.rng(seed))
    }

    /// The standard normal draw of the next movement.
    pub fn draw(&mut self) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.0.sample(StandardNormal))
    }
}

impl World {
    /// The true chain, where one is known.
    pub fn truth(&self) -> Option<&Chain> {
        match self {
            Self::Simulated { truth, .. } => Some(truth),
            Self::Measured { .. } => None,
        }
    }

    /// What is seen after `movement`, under the standard normal draw `noise`.
    pub fn observe(&self, movement: &Movement, noise: &Vector3<f64>) -> Observation {
        match self {
            Self::Simulated { truth, tracker } => tracker.observe(truth, &movement.configuration, noise),
            Self::Measured { markers_m } => movement
                .row
                .and_then(|row| markers_m.get(row))
                .map_or(Observation::Missed, |marker| Observation::Seen(*marker)),
        }
    }
}
