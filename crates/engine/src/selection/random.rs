//! Uniform random movements.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::{
    Actions, Appraisal, Criterion, Domain, Movement, Policy, Scope, Selection, SelectionError, Situation, Watch,
    Weights,
};
use crate::kinematics::JointBox;

/// Draws uniformly among what is feasible: inside the limits, or from what is left of a pool (which shuffles it); where targets are held
/// in sockets, inside the limits and then projected into one of them.
///
/// Where a head watches, it is told as much as every learner, and ignores it: the paper's random movements. What a
/// movement would have taught it tells by the A-criterion.
#[derive(Clone, Debug)]
pub struct Random {
    weights: Weights,
    watch: Option<Watch>,
}

impl Random {
    /// With the weights of the A-criterion that it appraises by, and the head that watches.
    pub fn new(weights: Weights, watch: Option<Watch>) -> Self {
        Self { weights, watch }
    }
}

impl Policy for Random {
    fn select(&self, situation: &Situation<'_>, rng: &mut ChaCha8Rng) -> Result<Selection, SelectionError> {
        let scope = Scope::of(situation)?;
        if let Actions::Sockets(sockets) = situation.actions {
            return Ok(Selection::of(match sockets.beginning(&scope) {
                Some(beginning) => beginning.clone(),
                None => sockets.draw(situation.belief, &scope, rng)?,
            }));
        }
        let movement = match &scope.domain {
            Domain::Box { searched, .. } => Movement::to(scope.draw(searched, rng)?),
            Domain::List { movements, .. } => movements[rng.random_range(0..movements.len())].clone(),
        };
        Ok(Selection::of(movement))
    }

    fn appraise(
        &self,
        situation: &Situation<'_>,
        limits: &JointBox,
        configuration: &[f64],
    ) -> Result<Appraisal, SelectionError> {
        let criterion = Criterion::new(situation.belief, &self.weights)?;
        criterion.watched(Watch::sight(self.watch.as_ref(), situation, limits)).appraise(configuration)
    }
}
