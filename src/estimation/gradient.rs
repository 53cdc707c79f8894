//! The stochastic gradient: the baseline of the paper.
//!
//! The paper compares against the online learning of Hersch, Sauser and Billard (2008) without printing its update.
//! This one is our own derivation: steepest descent on the squared error of one observation,
//!
//! ```text
//! E = ½ ‖y − h(x, θ)‖²,     x ← x ⊞ η Hᵀ (y − h(x, θ))
//! ```
//!
//! in the same tangent coordinates as the filter, so that axes stay of unit length by construction. Points move in
//! metres and directions in radians under one rate η, that is, with a characteristic length of 1 m.

use nalgebra::DVector;

use super::{Belief, EstimationError, Estimator, Update};
use crate::{kinematics::jacobian::jacobian, sensing::Observation};

/// A step beyond this many metres or radians has nothing to do with a robot any more. (A NaN is not below it.)
const LARGEST_STEP: f64 = 1e6;

/// Steepest descent on one observation at a time, with a constant rate.
#[derive(Clone, Debug)]
pub struct Gradient {
    belief: Belief,
    rate: f64,
}

impl Gradient {
    /// Starts from `belief`, whose covariance is dropped: a gradient keeps none.
    pub fn new(belief: Belief, rate: f64) -> Self {
        Self { belief: Belief { covariance: None, ..belief }, rate }
    }
}

impl Estimator for Gradient {
    fn belief(&self) -> &Belief {
        &self.belief
    }

    fn update(&mut self, positions: &[f64], observation: &Observation) -> Result<Update, EstimationError> {
        if let Some(measured) = observation.position() {
            let Belief { chain, layout, .. } = &self.belief;
            let (predicted, h) = jacobian(chain, layout, positions);
            let delta: DVector<f64> = h.transpose() * (measured - predicted) * self.rate;
            if !delta.iter().all(|x| x.abs() < LARGEST_STEP) {
                return Err(EstimationError::Diverged("a gradient step left all bounds; the rate is too large"));
            }
            self.belief.chain = chain.retract(layout, &delta);
        }
        Ok(Update::default())
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::kinematics::{TangentLayout, laws::random_chain};

    #[test]
    fn a_small_step_lowers_the_error_it_descends() {
        for seed in 0..50 {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let chain = random_chain(&mut rng, 5);
            let layout = Arc::new(TangentLayout::new(&chain.joints, &[], true));
            let theta: Vec<f64> = (0..5).map(|_| rng.random_range(-1.5..1.5)).collect();
            let target = chain.marker_at(&theta) + nalgebra::Vector3::new(0.05, -0.02, 0.03);
            let belief = Belief { chain, layout, covariance: None, noise_m2: 1e-4, alternatives: Vec::new() };
            let mut gradient = Gradient::new(belief, 1e-3);
            let error = |gradient: &Gradient| (gradient.belief().chain.marker_at(&theta) - target).norm();
            let before = error(&gradient);
            gradient.update(&theta, &Observation::Seen(target)).expect("a finite step");
            assert!(error(&gradient) < before, "seed {seed}");
        }
    }
}
