//! Which movement to make next.
//!
//! * [`ACriterion`]: the expected posterior error of (7), in the form that never builds a posterior.
//! * [`Policy`]: chooses among [`Actions`], the whole joint box or a list of recorded movements.
//! * [`Outlook`]: the same under several hypotheses.
//! * [`Active`]: minimises the criterion, by DIRECT over a box or by trying all of a list.
//! * [`Planner`]: plans the movements that are still needed together, under all hypotheses.
//! * [`Visibility`]: where a head watches, the chance that the marker is seen, which weighs the gain.
//! * [`Random`]: draws uniformly, the paper's comparison.

mod active;
mod criterion;
mod optimality;
mod outlook;
mod plan;
mod planner;
mod random;
mod visibility;

pub(crate) use random::draw_configuration;

use rand_chacha::ChaCha8Rng;

pub use active::{Active, Leaf, Partition, Search};
pub use criterion::{ACriterion, Appraisal, CriterionUnits, Sight, Weights};
pub use optimality::Optimality;
pub use outlook::Outlook;
pub use planner::{Planner, Planning};
pub use random::Random;
pub use visibility::{Visibility, Watch};

use crate::{
    estimation::Belief,
    optimize::{DirectError, Settings},
    sensing::Observation,
};

/// The movements that may be chosen now.
#[derive(Clone, Debug, PartialEq)]
pub enum Actions {
    /// Any configuration inside the joint limits, `(lower, upper)` per joint, rad or m.
    Box(Vec<(f64, f64)>),
    /// One of a list, each at most once: a recorded data set.
    Pool(Vec<Movement>),
}

impl Actions {
    /// Takes a movement of the pool out of it; a box stays as it is.
    pub fn use_up(&mut self, movement: &Movement) {
        if let Self::Pool(pool) = self {
            pool.retain(|candidate| candidate.row != movement.row);
        }
    }

    /// How many movements are left; `None` for a box, which has no end.
    pub fn remaining(&self) -> Option<usize> {
        match self {
            Self::Box(_) => None,
            Self::Pool(pool) => Some(pool.len()),
        }
    }
}

/// A movement to make: where to, and which row of a recorded data set that is.
#[derive(Clone, Debug, PartialEq)]
pub struct Movement {
    /// Joint positions, rad or m, one per joint.
    pub configuration: Vec<f64>,
    /// The row of the data set, counted from 0; `None` in a simulated world.
    pub row: Option<usize>,
}

/// A chosen movement and what the choice rested on.
#[derive(Clone, Debug)]
pub struct Selection {
    /// What to do.
    pub movement: Movement,
    /// C(θ) of the chosen movement; `None` for a policy without a criterion.
    pub criterion: Option<f64>,
    /// tr(W P) − C(θ): by how much the trace is expected to fall.
    pub gain: Option<f64>,
    /// How many configurations were evaluated.
    pub evaluations: usize,
    /// The minimiser's partition of the box, if it was searched by DIRECT.
    pub partition: Option<Partition>,
}

impl Selection {
    /// A configuration chosen without a criterion.
    pub(crate) fn plain(configuration: Vec<f64>) -> Self {
        let movement = Movement { configuration, row: None };
        Self { movement, criterion: None, gain: None, evaluations: 0, partition: None }
    }

    /// The best of recorded movements by the values of their criterion, which was `trace` before.
    pub(crate) fn of_pool(pool: &[Movement], values: Vec<f64>, trace: f64) -> Result<Self, SelectionError> {
        let best = pool.iter().zip(values).min_by(|a, b| a.1.total_cmp(&b.1));
        let (movement, value) = best.ok_or(SelectionError::Exhausted)?;
        if !value.is_finite() {
            return Err(SelectionError::NoFiniteCriterion);
        }
        Ok(Self {
            movement: movement.clone(),
            criterion: Some(value),
            gain: Some(trace - value),
            evaluations: pool.len(),
            partition: None,
        })
    }
}

/// Why no movement could be chosen.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SelectionError {
    /// Every recorded movement has been used.
    #[error("no movement is left: every row of the recorded data has been used")]
    Exhausted,
    /// The criterion needs a covariance.
    #[error("active selection needs an estimator with a covariance; pair this one with the random policy")]
    NoCovariance,
    /// The minimiser refused its settings.
    #[error("DIRECT: {0}")]
    Search(DirectError),
    /// No configuration has a finite criterion.
    #[error("no configuration has a finite criterion: the belief has diverged")]
    NoFiniteCriterion,
}

/// Chooses the next movement from what is believed.
pub trait Policy: Send {
    /// Chooses among `actions` under `belief`; `rng` is the policy's own stream.
    fn select(&mut self, belief: &Belief, actions: &Actions, rng: &mut ChaCha8Rng)
    -> Result<Selection, SelectionError>;

    /// Learns what came of a movement that it chose among `actions`. An estimator learns nothing from a miss; a policy
    /// may.
    fn observe(&mut self, _movement: &Movement, _actions: &Actions, _observation: &Observation) {}

    /// What it believes to be in view, if a head watches it.
    fn visibility(&self) -> Option<&Visibility> {
        None
    }

    /// The settings of the DIRECT that searches for it, if one does.
    fn direct(&self) -> Option<Settings> {
        None
    }
}
