//! Where movements are made and what comes of them is measured.
//!
//! The world holds the truth. No module of `estimation` or `selection` can name this type.

use std::sync::Arc;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use super::streams::Stream;
use crate::{
    model::State,
    selection::Movement,
    sensing::{Head, Observation, Refused, Rig},
};

/// A simulated arm, or a recorded data set.
#[derive(Clone, Debug)]
pub enum World {
    /// A robot that is known here and nowhere else, seen through noisy channels.
    Simulated {
        /// The true state.
        truth: Box<State>,
        /// The channels, with their true noise.
        rig: Arc<Rig>,
        /// The head that watches; without one every marker is seen.
        head: Option<Head>,
        /// How the body will change.
        change: Option<Box<Change>>,
    },
    /// Recorded observations by row; no truth is known.
    Measured {
        /// What was observed at every row of the data set.
        observations: Vec<Observation>,
    },
}

/// A change of the body.
#[derive(Clone, Debug)]
pub struct Change {
    /// The number of movements after which it happens: the next movement is the first of the changed body.
    pub step: u64,
    /// The true state from then on.
    pub truth: State,
}

/// Why a world has nothing to show.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum WorldError {
    /// The data set has no such row.
    #[error("the recorded data have no row {row} (counted from 0); they have {rows}")]
    NoSuchRow {
        /// The row asked for.
        row: usize,
        /// How many there are.
        rows: usize,
    },
    /// A movement that is no row of the data set.
    #[error("recorded data hold what was measured at their own rows, not at other configurations")]
    NotRecorded,
    /// What was measured is no measurement.
    #[error("what the world shows is no measurement: {0}")]
    NoMeasurement(#[from] Refused),
}

/// The noise of one world: the k-th movement of every learner sees the k-th draw, whether its marker was seen or not.
#[derive(Clone, Debug)]
pub struct NoiseSequence(ChaCha8Rng);

impl NoiseSequence {
    /// The sequence of a seed.
    pub fn new(seed: u64) -> Self {
        Self(Stream::Noise.rng(seed))
    }

    /// The standard normal draw of the next movement, a number for each of `equations`.
    pub fn draw(&mut self, equations: usize) -> Vec<f64> {
        (0..equations).map(|_| self.0.sample(StandardNormal)).collect()
    }
}

impl World {
    /// The true state, where one is known.
    pub fn truth(&self) -> Option<&State> {
        match self {
            Self::Simulated { truth, .. } => Some(truth),
            Self::Measured { .. } => None,
        }
    }

    /// The change of the body that is still to come.
    pub fn change(&self) -> Option<&Change> {
        match self {
            Self::Simulated { change, .. } => change.as_deref(),
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

    /// The world with the body changed, if that is due after so many movements.
    pub(super) fn changed_after(&self, movements: u64) -> Option<Self> {
        let Self::Simulated { rig, head, change: Some(change), .. } = self else { return None };
        (change.step <= movements).then(|| Self::Simulated {
            truth: Box::new(change.truth.clone()),
            rig: rig.clone(),
            head: *head,
            change: None,
        })
    }

    /// Equations of a movement of which nothing is missed, where measurements are made here.
    pub fn equations(&self) -> usize {
        match self {
            Self::Simulated { rig, .. } => rig.equations(),
            Self::Measured { .. } => 0,
        }
    }

    /// What is seen after `movement`, under the standard normal draw `noise`, a number for each equation.
    pub fn observe(&self, movement: &Movement, noise: &[f64]) -> Result<Observation, WorldError> {
        match self {
            Self::Simulated { truth, rig, head, .. } => {
                let theta = &movement.configuration;
                Observation::missed(rig.channels().len()).check(rig, truth.joints.len(), theta)?;
                let observation = match head {
                    Some(head) if !head.sees(&truth.marker_at(theta)) => Observation::missed(rig.channels().len()),
                    _ => rig.observe(truth, theta, noise),
                };
                observation.check(rig, truth.joints.len(), theta)?;
                Ok(observation)
            }
            Self::Measured { observations } => {
                let (row, rows) = (movement.row.ok_or(WorldError::NotRecorded)?, observations.len());
                observations.get(row).cloned().ok_or(WorldError::NoSuchRow { row, rows })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;
    use crate::model::laws::random_arm;

    #[test]
    fn an_unknown_row_is_no_miss() {
        let world = World::Measured { observations: vec![Observation::of([1.0, 2.0, 3.0])] };
        let at = |row| world.observe(&Movement { configuration: vec![0.0], row }, &[]);
        assert_eq!(at(Some(0)), Ok(Observation::of([1.0, 2.0, 3.0])));
        assert_eq!(at(Some(1)), Err(WorldError::NoSuchRow { row: 1, rows: 1 }));
        assert_eq!(at(None), Err(WorldError::NotRecorded));
    }

    #[test]
    fn a_body_beyond_all_numbers_shows_nothing() {
        let mut truth = random_arm(&mut ChaCha8Rng::seed_from_u64(1), 2);
        truth = truth.with_marker(nalgebra::Point3::new(f64::INFINITY, 0.0, 0.0));
        let world =
            World::Simulated { truth: Box::new(truth), rig: Arc::new(Rig::tracker(0.1)), head: None, change: None };
        let shown = world.observe(&Movement { configuration: vec![0.1; 2], row: None }, &[0.0; 3]);
        assert!(matches!(shown, Err(WorldError::NoMeasurement(_))), "{shown:?}");
    }
}
