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
    sensing::{Head, MarkerTracker, Observation},
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
        /// The head that watches; without one every marker is seen.
        head: Option<Head>,
        /// How the body will change.
        change: Option<Change>,
    },
    /// Recorded marker positions by row; no truth is known.
    Measured {
        /// The measured marker of every row of the data set, metres.
        markers_m: Vec<Point3<f64>>,
    },
}

/// A change of the body.
#[derive(Clone, Debug)]
pub struct Change {
    /// The number of movements after which it happens: the next movement is the first of the changed body.
    pub step: u64,
    /// The true chain from then on.
    pub truth: Chain,
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

    /// The change of the body that is still to come.
    pub fn change(&self) -> Option<&Change> {
        match self {
            Self::Simulated { change, .. } => change.as_ref(),
            Self::Measured { .. } => None,
        }
    }

    /// The head that watches.
    pub fn head(&self) -> Option<&Head> {
        match self {
            Self::Simulated { head, .. } => head.as_ref(),
            Self::Measured { .. } => None,
        }
    }

    /// Changes the body if that is due after so many movements, and says whether it was.
    pub(super) fn advance(&mut self, movements: u64) -> bool {
        let Self::Simulated { truth, change, .. } = self else { return false };
        let due = change.take_if(|change| change.step <= movements);
        due.is_some_and(|change| {
            *truth = change.truth;
            true
        })
    }

    /// What is seen after `movement`, under the standard normal draw `noise`.
    pub fn observe(&self, movement: &Movement, noise: &Vector3<f64>) -> Observation {
        match self {
            Self::Simulated { truth, tracker, head, .. } => {
                let theta = &movement.configuration;
                match head {
                    Some(head) if !head.sees(&truth.marker_at(theta)) => Observation::Missed,
                    _ => tracker.observe(truth, theta, noise),
                }
            }
            Self::Measured { markers_m } => movement
                .row
                .and_then(|row| markers_m.get(row))
                .map_or(Observation::Missed, |marker| Observation::Seen(*marker)),
        }
    }
}
