//! Postures that show that something is feasible, or what excludes everything.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::{Constraints, Infeasible, Tally};
use crate::kinematics::JointBox;

/// Postures drawn before it is said that none is feasible.
pub const PATIENCE: usize = 20_000;
/// Feasible postures that are enough to begin a search with.
const WANTED: usize = 64;

impl Constraints {
    /// The smallest box that is sure to hold all that is feasible from a posture: the tighter limits within the greatest
    /// travel.
    ///
    /// # Errors
    ///
    /// [`Infeasible::Stranded`] if a joint cannot come back within its limits in one movement.
    pub fn reach(&self, from: Option<&[f64]>) -> Result<JointBox, Infeasible> {
        let Some(from) = from else { return Ok(self.tightened.clone()) };
        let joints = self.tightened.joints().iter().zip(from).zip(&self.greatest_travel);
        let reach = joints.map(|((&(lower, upper), at), by)| (lower.max(at - by), upper.min(at + by))).collect();
        JointBox::new(reach).map_err(|error| Infeasible::Stranded {
            joint: self.joints[error.joint].clone(),
            position: from[error.joint],
            lower: self.tightened.lower(error.joint),
            upper: self.tightened.upper(error.joint),
            greatest: self.greatest_travel[error.joint],
        })
    }

    /// Some postures that are feasible from one, one at least and always the same; drawn uniformly, after the one where the
    /// robot stands.
    ///
    /// # Errors
    ///
    /// [`Infeasible::Tried`] if none of 20 000 draws is feasible, [`Infeasible::Stranded`] if a joint cannot come back within
    /// its limits.
    pub fn some(&self, from: Option<&[f64]>) -> Result<Vec<Vec<f64>>, Infeasible> {
        let reach = self.reach(from)?;
        let mut tally = Tally::new(from.is_some() && self.greatest_travel.iter().any(|travel| travel.is_finite()));
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let mut found: Vec<Vec<f64>> = Vec::new();
        let stands = from.filter(|from| reach.contains(from)).map(<[f64]>::to_vec);
        for posture in stands.into_iter().chain(std::iter::repeat_with(|| reach.draw(&mut rng)).take(PATIENCE)) {
            match self.violations(from, &posture).collect::<Vec<_>>().as_slice() {
                [] => found.push(posture),
                violations => tally.count(violations),
            }
            if found.len() == WANTED {
                break;
            }
        }
        if found.is_empty() { Err(Infeasible::Tried(tally)) } else { Ok(found) }
    }

    /// What of a list is feasible from a posture, by the `posture` of each.
    ///
    /// # Errors
    ///
    /// [`Infeasible::Tried`] if nothing in the list is feasible.
    pub fn of<T>(
        &self,
        from: Option<&[f64]>,
        list: impl IntoIterator<Item = T>,
        posture: impl Fn(&T) -> &[f64],
    ) -> Result<Vec<T>, Infeasible> {
        let mut tally = Tally::default();
        let mut kept = Vec::new();
        for one in list {
            match self.violations(from, posture(&one)).collect::<Vec<_>>().as_slice() {
                [] => kept.push(one),
                violations => tally.count(violations),
            }
        }
        if kept.is_empty() { Err(Infeasible::Tried(tally)) } else { Ok(kept) }
    }
}
