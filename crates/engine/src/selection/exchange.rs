//! Movements into sockets, planned together.
//!
//! As [`Plan`](super::plan) does over the joint box: the movements that are still needed are sought one after the other, each given
//! those before it, and then each in turn is taken out and exchanged for a better one (Fedorov 1972). Candidates are those of a
//! pool of postures on the believed manifolds; what is made first is polished along its tangent, given the rest.

use std::{mem::replace, sync::Arc};

use rand_chacha::ChaCha8Rng;

use super::{
    MixtureCriterion, Movement, Planner, Scope, Selection, SelectionError, Sockets,
    held::{Values, evaluate},
    plan::{Plan, condition},
};
use crate::{estimation::Belief, optimize::least};

impl Belief {
    /// Changes the covariance of every hypothesis as `movement` would, counted `weight` times; see `condition`.
    pub fn after(&mut self, movement: &Movement, weight: impl Fn(usize) -> f64) -> bool {
        let there = Arc::new(self.measurement_model.held_in(movement.socket));
        let whole = replace(&mut self.measurement_model, there);
        let sound = condition(self, &movement.configuration, weight);
        self.measurement_model = whole;
        sound
    }
}

/// What is expected of the belief after some movements.
struct Ahead {
    now: Belief,
    after: Belief,
    movements: Vec<Movement>,
}

impl Ahead {
    fn add(&mut self, movement: Movement) {
        self.after.after(&movement, |_| 1.0);
        self.movements.push(movement);
    }

    fn remove(&mut self, index: usize) -> Movement {
        let movement = self.movements.remove(index);
        if !self.after.after(&movement, |_| -1.0) {
            // Too much would cancel: from the beginning, without it.
            self.after = self.now.clone();
            for movement in &self.movements {
                self.after.after(movement, |_| 1.0);
            }
        }
        movement
    }
}

impl Planner {
    /// The movement into a socket that teaches most of those that are planned together.
    pub(super) fn select_in_sockets(
        &self,
        belief: &Belief,
        sockets: &Sockets,
        scope: &Scope<'_>,
        rng: &mut ChaCha8Rng,
    ) -> Result<Selection, SelectionError> {
        let mut now = belief.clone();
        now.truncate(self.planning.considered);
        let pool = sockets.pool(&now, scope, self.search.max_evaluations, rng);
        let mut evaluations = 0;
        let mut ahead = Ahead { after: now.clone(), now, movements: Vec::new() };
        let horizon = self.horizon(&ahead.now, &pool)?;
        let mut sought = |ahead: &Ahead, others: &[Movement]| {
            let held = sockets.held(&ahead.after);
            let candidates = [others, &pool].concat();
            evaluations += candidates.len();
            let mut found = evaluate(&held, &candidates, |held| self.values(held))?;
            for (value, candidate) in found.iter_mut().zip(&candidates) {
                let planned = ahead.movements.iter().map(|movement| movement.configuration.as_slice());
                *value += scope.travel_cost(planned, &candidate.configuration);
            }
            least(candidates.into_iter().zip(found))
                .map(|(movement, _)| movement)
                .ok_or(SelectionError::NoFiniteCriterion)
        };
        while ahead.movements.len() < horizon {
            let movement = sought(&ahead, &[])?;
            ahead.add(movement);
        }
        if horizon > 1 {
            for _ in 0..self.planning.sweeps * horizon {
                // Always the first; what replaces it goes to the end.
                let movement = ahead.remove(0);
                let movement = sought(&ahead, &[movement])?;
                ahead.add(movement);
            }
        }
        // Of the plan, what teaches most at once comes first.
        let held = sockets.held(&ahead.now);
        let mut at_once = evaluate(&held, &ahead.movements, |held| self.values(held))?;
        at_once.iter_mut().zip(&ahead.movements).for_each(|(value, it)| *value += scope.price(&it.configuration));
        let Some((first, _)) = least(at_once.into_iter().enumerate()) else {
            return Err(SelectionError::NoFiniteCriterion);
        };
        let first = ahead.remove(first);
        let without = sockets.held(&ahead.after);
        let (movement, _) =
            sockets.best((&ahead.now, scope), &without, &[first], &mut evaluations, |held| self.values(held))?;
        let value = evaluate(&held, std::slice::from_ref(&movement), |held| self.values(held))?[0];
        let (criterion, gain) = (Some(value), Some(self.mixture(&ahead.now)?.before() - value));
        Ok(Selection { criterion, gain, evaluations, ..Selection::of(movement) })
    }

    pub(super) fn values<'a>(&'a self, held: &'a Belief) -> Result<Values<'a>, SelectionError> {
        let mixture = self.mixture(held)?;
        Ok(Box::new(move |postures| mixture.evaluate(postures)))
    }

    pub(super) fn mixture<'a>(&'a self, belief: &'a Belief) -> Result<MixtureCriterion<'a>, SelectionError> {
        MixtureCriterion::new(belief, &self.weights, self.planning.optimality, &self.workspace)
    }

    /// How many movements are planned together: as many as bring an equation for each unknown, and some to spare; where
    /// nothing is unknown any more, for each parameter.
    fn horizon(&self, now: &Belief, pool: &[Movement]) -> Result<usize, SelectionError> {
        let first = pool.first().ok_or(SelectionError::OutOfReach)?;
        let held = now.held_in(first.socket);
        let plan = Plan::new(&held, self.planning.considered);
        let equations = plan.equations(&first.configuration);
        let unknown = plan.unknown(&self.weights, self.planning.unknown)?.div_ceil(equations);
        let wanted = match unknown {
            0 => now.layout.dimension().div_ceil(equations),
            _ => unknown + self.planning.spare,
        };
        Ok(wanted.clamp(1, self.planning.ahead.max(1)))
    }
}
