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
//! metres and directions in radians under one rate η, that is, with a characteristic length of 1 m. Its measurement model whitens by
//! σ = 1 m: errors are in metres. (Another channel's errors count in proportion to its own σ.)

use std::sync::Arc;

use nalgebra::DVector;

use super::{Belief, EstimationError, Estimator, Update};
use crate::sensing::Observation;

/// The greatest plausible step, metres or radians; a greater one means that the search has diverged. (A NaN is not
/// below it.)
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
        let measurement_model = Arc::new(belief.measurement_model.assuming(1.0));
        Self { belief: Belief { covariance: None, measurement_model, ..belief }, rate }
    }
}

impl Estimator for Gradient {
    fn boxed(&self) -> Box<dyn Estimator> {
        Box::new(self.clone())
    }

    fn belief(&self) -> &Belief {
        &self.belief
    }

    fn correct(&mut self, positions: &[f64], observation: &Observation) -> Result<Update, EstimationError> {
        let Belief { state, layout, measurement_model, .. } = &self.belief;
        let equations = measurement_model.equations_of(state, layout, positions, observation);
        let delta: DVector<f64> = equations.rows * equations.residual * self.rate;
        if !delta.iter().all(|x| x.abs() < LARGEST_STEP) {
            return Err(EstimationError::Diverged("a gradient step left all bounds; the rate is too large"));
        }
        self.belief.state = state.retract(layout, &delta);
        Ok(Update::default())
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::{
        model::{Layout, random::random_arm},
        sensing::MeasurementModel,
    };

    #[test]
    fn a_small_step_lowers_the_error_it_descends() {
        for seed in 0..50 {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let state = random_arm(&mut rng, 5);
            let layout = Arc::new(Layout::of_arm(&state, &[], true));
            let theta: Vec<f64> = (0..5).map(|_| rng.random_range(-1.5..1.5)).collect();
            let target = state.marker_at(&theta) + nalgebra::Vector3::new(0.05, -0.02, 0.03);
            let belief = Belief::new(state, layout, Arc::new(MeasurementModel::tracker(0.01)));
            let mut gradient = Gradient::new(belief, 1e-3);
            let error = |gradient: &Gradient| (gradient.belief().state.marker_at(&theta) - target).norm();
            let before = error(&gradient);
            gradient.update(&theta, &Observation::seen(target)).expect("a finite step");
            assert!(error(&gradient) < before, "seed {seed}");
        }
    }
}
