//! What a smoother has learned, as bytes from which it can go on.

use std::sync::Arc;

use nalgebra::DMatrix;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use super::{
    Smoother, hypotheses::Hypotheses, joint_scale::Said, marginalised::Marginalised, noise::Left,
    posterior::Measurement,
};
use crate::{
    estimation::{Misfit, ReadingReport},
    model::{Loads, Prior, Scales, State},
};

/// The part of a smoother that measurements change.
#[derive(Serialize, Deserialize)]
struct Stored {
    prior: Prior,
    original: Prior,
    pins: State,
    scales: Vec<f64>,
    /// t of the joints' errors, and what marginalised measurements said of it.
    joints: Option<(f64, Said)>,
    measurements: Vec<Measurement>,
    marginalised: Option<Marginalised>,
    hypotheses: Hypotheses,
    rng: ChaCha8Rng,
    movements: u64,
    past: Vec<ReadingReport>,
    degrees_of_freedom: Vec<f64>,
    remembered: Vec<Left>,
    changed_at: Option<u64>,
    told_at: Option<u64>,
    misfit: Option<Misfit>,
    widened: f64,
    prior_doubted_at: u64,
    chain: Option<Scales>,
    model_error_m: f64,
}

impl Stored {
    /// The stored states, which do not include the robot's loads.
    fn states(&mut self) -> impl Iterator<Item = &mut State> {
        let modes = self.hypotheses.modes.iter_mut().map(|mode| &mut mode.state);
        let marginalised = self.marginalised.iter_mut().map(|marginalised| &mut marginalised.state);
        [&mut self.pins, self.prior.guess_mut(), self.original.guess_mut()].into_iter().chain(marginalised).chain(modes)
    }

    /// Whether this was stored by a smoother like the given one.
    fn is_of(&self, smoother: &Smoother) -> bool {
        let m = smoother.belief.layout.dimension();
        let noises = smoother.unknown.len();
        let is_square = |matrix: &DMatrix<f64>| matrix.shape() == (m, m);
        let joints = smoother.belief.state.joints.len();
        is_square(self.prior.covariance())
            && is_square(self.original.covariance())
            && !self.hypotheses.modes.is_empty()
            && self.hypotheses.modes.iter().all(|mode| is_square(&mode.information))
            && [self.scales.len(), self.degrees_of_freedom.len(), self.remembered.len()] == [noises; 3]
            && self.joints.is_some() == smoother.posterior.joints.is_some()
            && self.chain.is_some() == smoother.scaled.is_some()
            && self.pins.joints.len() == joints
            && self.measurements.iter().all(|seen| seen.positions.len() == joints)
    }
}

impl Smoother {
    /// Everything learned so far; see [`Estimator::stored`](crate::estimation::Estimator::stored).
    pub(super) fn to_stored(&self) -> Option<Vec<u8>> {
        let posterior = &self.posterior;
        let stored = Stored {
            prior: posterior.prior.clone(),
            original: self.original.clone(),
            pins: posterior.pins.clone(),
            scales: posterior.scales.clone(),
            joints: posterior.joints.as_ref().map(|joints| (joints.factor, joints.marginalised)),
            measurements: posterior.measurements.clone(),
            marginalised: posterior.marginalised.clone(),
            hypotheses: self.hypotheses.clone(),
            rng: self.rng.clone(),
            movements: self.movements,
            past: self.past.to_vec(),
            degrees_of_freedom: self.degrees_of_freedom.clone(),
            remembered: self.remembered.clone(),
            changed_at: self.changed_at,
            told_at: self.told_at,
            misfit: self.misfit,
            widened: self.widened,
            prior_doubted_at: self.prior_doubted_at,
            chain: self.scaled.as_ref().map(|scaled| scaled.scales.clone()),
            model_error_m: self.belief.model_error_m,
        };
        postcard::to_allocvec(&stored).ok()
    }

    /// This smoother with what is stored; `None` if that was stored by another kind of smoother.
    pub(super) fn with_stored(&self, stored: &[u8]) -> Option<Self> {
        let mut stored: Stored = postcard::from_bytes(stored).ok()?;
        if !stored.is_of(self) {
            return None;
        }
        let loads: Option<Arc<Loads>> = self.belief.state.loads.clone();
        stored.states().for_each(|state| state.loads.clone_from(&loads));
        let mut smoother = self.clone();
        let posterior = &mut smoother.posterior;
        posterior.prior = stored.prior;
        posterior.pins = stored.pins;
        posterior.scales = stored.scales;
        if let Some((joints, (factor, marginalised))) = posterior.joints.as_mut().zip(stored.joints) {
            joints.noise = joints.stated.scaled(factor);
            (joints.factor, joints.marginalised) = (factor, marginalised);
        }
        posterior.measurements = stored.measurements;
        posterior.marginalised = stored.marginalised;
        if let Some((scaled, scales)) = smoother.scaled.as_mut().zip(stored.chain) {
            scaled.scales = scales;
        }
        let mut smoother = Self {
            hypotheses: stored.hypotheses,
            rng: stored.rng,
            original: stored.original,
            movements: stored.movements,
            past: Arc::new(stored.past),
            degrees_of_freedom: stored.degrees_of_freedom,
            remembered: stored.remembered,
            changed_at: stored.changed_at,
            told_at: stored.told_at,
            misfit: stored.misfit,
            widened: stored.widened,
            prior_doubted_at: stored.prior_doubted_at,
            ..smoother
        };
        smoother.publish();
        // As it was when it was published, before measurements were marginalised.
        smoother.belief.model_error_m = stored.model_error_m;
        Some(smoother)
    }
}
