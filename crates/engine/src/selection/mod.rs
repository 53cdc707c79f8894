//! Which movement to make next.
//!
//! * [`Criterion`]: the expected posterior error of (7) and its kin, in the form that never builds a posterior.
//! * [`Policy`]: chooses among [`Actions`], the whole joint box, a list of recorded movements or sockets, in a [`Situation`].
//! * [`Sockets`]: movements that hold a target in a socket.
//! * [`MixtureCriterion`]: the criterion under several hypotheses.
//! * [`Active`]: minimises the criterion, by DIRECT over a box or by trying all of a list.
//! * [`Planner`]: plans the movements that are still needed together, under all hypotheses.
//! * [`Visibility`]: where a head watches, the chance that the marker is seen, which weighs the gain.
//! * [`Random`]: draws uniformly, the paper's comparison.
//! * [`Human`]: waits for a person, and tells how good their choices are.
//! * [`Constraints`]: what movements are bound to; every policy chooses within a [`Scope`].
//!
//! A policy chooses, explains and appraises, each time from the situation alone: it remembers nothing.

mod active;
mod bhattacharyya;
mod criterion;
mod cube;
mod exchange;
mod feasible;
mod held;
mod herding;
mod human;
mod innovation;
#[cfg(test)]
mod laws;
mod mixture_criterion;
mod optimality;
mod partition;
mod perturbations;
mod plan;
mod planner;
mod prediction;
mod random;
mod search;
mod setting;
mod sight;
mod situation;
mod sockets;
mod views;
mod visibility;
mod watch;
mod weights;

use rand_chacha::ChaCha8Rng;

pub use active::{Active, Minimiser};
pub use criterion::{Appraisal, Criterion};
pub use feasible::{Constraints, Domain, Hull, Infeasible, Obstacle, Outline, Scope, Tally, Vetoes, Violation, travel};
pub use herding::herd;
pub use human::Human;
pub use mixture_criterion::MixtureCriterion;
pub use optimality::Optimality;
pub use partition::{Leaf, Partition};
pub use planner::{Planner, Planning};
pub use random::Random;
pub use search::Search;
pub use sight::Sight;
pub use situation::{KeptSituation, Past, Planned, Situation};
pub use sockets::Sockets;
pub use visibility::Visibility;
pub use watch::Watch;
pub use weights::{CriterionUnits, Weights};

use crate::{
    estimation::Belief,
    kinematics::JointBox,
    optimize::{DirectError, least},
};

/// The movements that may be chosen now.
#[derive(Clone, Debug, PartialEq)]
pub enum Actions {
    /// Any configuration inside the joint limits.
    Box(JointBox),
    /// One of a list, each at most once: a recorded data set.
    Pool(Vec<Movement>),
    /// Any in which a target is held in one of these sockets.
    Sockets(Sockets),
}

impl Actions {
    /// Takes a movement of the pool out of it, and the posture that its socket begins with; a box stays as it is.
    pub fn use_up(&mut self, movement: &Movement) {
        match self {
            Self::Box(_) => {}
            Self::Pool(pool) => pool.retain(|candidate| match (candidate.row, movement.row) {
                (Some(row), Some(used)) => row != used,
                _ => candidate.configuration != movement.configuration,
            }),
            Self::Sockets(sockets) => sockets.use_up(movement),
        }
    }

    /// How many movements are left; `None` for a box and for sockets, which have no end.
    pub fn remaining(&self) -> Option<usize> {
        match self {
            Self::Box(_) | Self::Sockets(_) => None,
            Self::Pool(pool) => Some(pool.len()),
        }
    }

    /// The movement to a configuration (rad or m) that somebody else chose; where there are sockets, into the one that it is
    /// nearest to, as believed.
    pub fn movement_to(&self, belief: &Belief, configuration: &[f64]) -> Movement {
        match self {
            Self::Box(_) => Movement::to(configuration.to_vec()),
            Self::Pool(pool) => {
                let recorded = pool.iter().find(|movement| movement.configuration == configuration);
                recorded.cloned().unwrap_or_else(|| Movement::to(configuration.to_vec()))
            }
            Self::Sockets(sockets) => sockets.movement_to(belief, configuration.to_vec()),
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
    /// The socket in which a target is held then, counted from 0.
    pub socket: Option<usize>,
}

impl Movement {
    /// To a configuration, rad or m per joint, with nothing held in a socket.
    pub fn to(configuration: Vec<f64>) -> Self {
        Self { configuration, row: None, socket: None }
    }
}

/// A chosen movement and what the choice rested on.
#[derive(Clone, Debug, PartialEq)]
pub struct Selection {
    /// What to do.
    pub movement: Movement,
    /// C(θ) of the chosen movement; `None` for a policy without a criterion.
    pub criterion: Option<f64>,
    /// By how much the criterion is expected to fall.
    pub gain: Option<f64>,
    /// How many configurations were evaluated.
    pub evaluations: usize,
    /// The search of the joint box, if it was searched by DIRECT. That of a planner was for the first movement that its plan
    /// lacked, not for the one that it makes next.
    pub search: Option<Search>,
    /// What is to be done afterwards, for a policy that plans.
    pub plan: Option<Planned>,
}

impl Selection {
    /// A movement chosen without a criterion.
    pub fn of(movement: Movement) -> Self {
        Self { movement, criterion: None, gain: None, evaluations: 0, search: None, plan: None }
    }

    /// A configuration chosen without a criterion.
    pub(crate) fn plain(configuration: Vec<f64>) -> Self {
        Self::of(Movement::to(configuration))
    }

    /// The best of listed movements by the values of their criterion, which was `before` before, and by what the travel to
    /// them costs; where no value is finite the [fallback](Watch::fallback).
    pub(crate) fn of_list(
        watch: Option<&Watch>,
        scope: &Scope<'_>,
        list: &[Movement],
        values: Vec<f64>,
        before: f64,
    ) -> Result<Self, SelectionError> {
        let priced = |(movement, value): (&Movement, &f64)| value + scope.price(&movement.configuration);
        let priced: Vec<f64> = list.iter().zip(&values).map(priced).collect();
        let Some(((movement, value), _)) = least(list.iter().zip(values).zip(priced)) else {
            return Watch::fallback(watch, before, scope);
        };
        Ok(Self {
            criterion: Some(value),
            gain: Some(before - value),
            evaluations: list.len(),
            ..Self::of(movement.clone())
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
    /// Not a position for every joint.
    #[error("this robot does not have {0} joints; give one position for each of its joints")]
    NoConfiguration(usize),
    /// A person chooses, and has not chosen yet.
    #[error("a person chooses it, and has not chosen yet; set a configuration first, then step")]
    Unset,
    /// A configuration that the constraints exclude.
    #[error("this configuration is not feasible: {0}")]
    Refused(Violation),
    /// The constraints exclude everything.
    #[error("no configuration is feasible: {0}")]
    Infeasible(#[from] Infeasible),
    /// No socket can be reached.
    #[error("by the present estimate, no posture within the limits and constraints brings a target to its socket")]
    OutOfReach,
    /// The constraints exclude everything once joints aim their camera.
    #[error(
        "no posture that was tried is feasible once joints aim their camera: widen the constraints, or let no joint aim"
    )]
    Unaimed,
    /// No configuration has a finite criterion.
    #[error("no configuration has a finite criterion: the belief has diverged")]
    NoFiniteCriterion,
}

/// Chooses the next movement from what is believed. It keeps no state: the same situation and random numbers give the same
/// choice.
pub trait Policy: Send + Sync {
    /// Chooses; `rng` is for this choice alone.
    ///
    /// # Errors
    ///
    /// [`SelectionError`] if no movement can be chosen: none is left, none is feasible or within reach, a person has not
    /// chosen yet, or the criterion is not finite.
    fn select(&self, situation: &Situation<'_>, rng: &mut ChaCha8Rng) -> Result<Selection, SelectionError>;

    /// What a movement to `configuration` would teach, within `limits` (recorded movements have some too), by the criterion
    /// that this policy chooses by; at the estimate, where it chooses by samples of the posterior.
    ///
    /// # Errors
    ///
    /// [`SelectionError::NoCovariance`] or [`SelectionError::NoFiniteCriterion`] if the criterion cannot be computed at
    /// `configuration`.
    fn appraise(
        &self,
        situation: &Situation<'_>,
        limits: &JointBox,
        configuration: &[f64],
    ) -> Result<Appraisal, SelectionError>;

    /// How the criterion of the next movement looks over the joint box, for a policy whose own search was for something
    /// else: a search of it by DIRECT.
    ///
    /// # Errors
    ///
    /// [`SelectionError`] if the criterion cannot be computed or searched.
    fn explain(&self, _situation: &Situation<'_>, _limits: &JointBox) -> Result<Option<Search>, SelectionError> {
        Ok(None)
    }

    /// Whether movements are never chosen here, but by somebody outside.
    fn is_set_from_outside(&self) -> bool {
        false
    }
}
