//! Unscented recursive least squares: the filter of (2)–(5) without linearisation.
//!
//! The mean and covariances of what is measured come from 2m + 1 states (Julier and Uhlmann 1997), on the manifold: with
//! L the Cholesky factor of P, its columns lᵢ, s² = 3, and the whitened readings at the centre and at either side
//!
//! ```text
//! y₀ = h(x),   y±ᵢ = h(x ⊞ ±s lᵢ),   Δᵢ = (y₊ᵢ − y₋ᵢ)/2s,   Bᵢ = (y₊ᵢ + y₋ᵢ − 2y₀)/2s²
//! ŷ = y₀ + Σ Bᵢ,   S = Σ ΔᵢΔᵢᵀ + (s² − 1) Σ BᵢBᵢᵀ + I,   C = Σ lᵢ Δᵢᵀ
//! K = C S⁻¹,   x ← x ⊞ K (y − ŷ),   P ← J (P − K S Kᵀ) Jᵀ
//! ```
//!
//! with J the change of chart. ŷ and C are those of the unscented transform with κ = 3 − m, its authors' choice for a
//! normal distribution: the points stay at √3 standard deviations however many parameters there are, where a fixed κ
//! would send them to √(m + κ), half a turn away for an arm that is hardly known. The weight of the centre is negative
//! then, and S could be indefinite; in the form above (the divided differences of Nørgaard, Poulsen and Ravn 2000, their
//! second-order filter) it never is.
//!
//! The second moments see the bend of rotations: where the belief is wide S is larger than H P Hᵀ + I, and the filter is
//! less confident than the linearised one. The name is kept from the paper's recursive least squares: the state does not
//! move.

use nalgebra::{Cholesky, DMatrix, DVector};

use super::{
    Belief, ChangeDetector, EstimationError, Estimator, StabilisingNoise, Update,
    belief::{Revision, is_finite},
};
use crate::{model::State, sensing::Observation};

/// s², the kurtosis of a normal distribution.
const SPREAD: f64 = 3.0;

/// Recursive least squares by the unscented transform.
#[derive(Clone, Debug)]
pub struct UnscentedRls {
    belief: Belief,
    covariance: DMatrix<f64>,
    stabilising: Option<StabilisingNoise>,
    step: u64,
    changes: ChangeDetector,
}

impl UnscentedRls {
    /// Starts from `belief`, with `covariance` as prior P₀.
    pub fn new(belief: Belief, covariance: DMatrix<f64>, stabilising: Option<StabilisingNoise>) -> Self {
        let belief = Belief { covariance: Some(covariance.clone()), ..belief };
        Self { belief, covariance, stabilising, step: 0, changes: ChangeDetector::relative() }
    }

    /// The update by an observation: state and covariance before the stabilising noise, and the normalised innovation
    /// squared; `None` if nothing was seen.
    fn corrected(&self, positions: &[f64], observation: &Observation) -> Result<Option<Revision>, EstimationError> {
        let Belief { state, layout, measurement_model, .. } = &self.belief;
        let m = layout.dimension();
        let diverged = || EstimationError::Diverged("an update was not a finite number");
        // All whitened residuals are taken from the observation: y₀ − y = −residual at the centre, and so on.
        let residual_of = |at: &State| measurement_model.residual_near(state, at, positions, observation);
        let centre = residual_of(state);
        let d = centre.len();
        if d == 0 {
            return Ok(None);
        }
        let root = Cholesky::new(self.covariance.clone()).ok_or_else(diverged)?.l();
        let spread = SPREAD.sqrt();
        let (mut innovation, mut s, mut cross) = (centre.clone(), DMatrix::identity(d, d), DMatrix::zeros(m, d));
        for column in root.column_iter() {
            let delta: DVector<f64> = column * spread;
            let above = residual_of(&state.retract(layout, &delta));
            let below = residual_of(&state.retract(layout, &-delta));
            if above.len() != d || below.len() != d {
                return Err(EstimationError::Diverged("a reading has no prediction within the belief"));
            }
            let slope = (&below - &above) / (2.0 * spread);
            let bend = (&centre * 2.0 - above - below) / (2.0 * SPREAD);
            innovation -= &bend;
            s += &slope * slope.transpose() + &bend * bend.transpose() * (SPREAD - 1.0);
            cross += column * slope.transpose();
        }
        let cholesky = s.clone().cholesky().ok_or_else(diverged)?;
        let gain = cholesky.solve(&cross.transpose()).transpose();
        let delta: DVector<f64> = &gain * &innovation;
        let posterior = &self.covariance - &gain * s * gain.transpose();
        let transport = state.transport(layout, &delta);
        let covariance = &transport * posterior * transport.transpose();
        let covariance = (&covariance + covariance.transpose()) * 0.5;
        let nis = innovation.dot(&cholesky.solve(&innovation));
        if !(is_finite(&delta, &covariance) && nis.is_finite()) {
            return Err(diverged());
        }
        Ok(Some(Revision { state: state.retract(layout, &delta), covariance, nis: (nis, d) }))
    }
}

impl Estimator for UnscentedRls {
    fn boxed(&self) -> Box<dyn Estimator> {
        Box::new(self.clone())
    }

    fn belief(&self) -> &Belief {
        &self.belief
    }

    fn correct(&mut self, positions: &[f64], observation: &Observation) -> Result<Update, EstimationError> {
        let mut update = Update::default();
        if let Some(Revision { state, covariance, nis }) = self.corrected(positions, observation)? {
            (self.belief.state, self.covariance) = (state, covariance);
            update = Update { nis: Some(nis), change_noticed: self.changes.observe(nis.0, nis.1) };
        }
        self.step += 1;
        if let Some(noise) = self.stabilising.filter(|noise| noise.is_due(self.step)) {
            (0..self.covariance.nrows()).for_each(|k| self.covariance[(k, k)] += noise.variance);
        }
        self.belief.covariance = Some(self.covariance.clone());
        Ok(update)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::Vector3;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::{
        estimation::Rls,
        model::{Layout, random::random_arm},
        sensing::MeasurementModel,
    };

    /// Where the belief is narrow the transform sees no bend, and agrees with the linearised filter.
    #[test]
    fn a_narrow_belief_is_updated_as_by_linearisation() {
        for seed in 0..20 {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let state = random_arm(&mut rng, 4);
            let layout = Arc::new(Layout::of_arm(&state, &[], true));
            let m = layout.dimension();
            let covariance = DMatrix::identity(m, m) * 1e-8;
            let theta: Vec<f64> = (0..4).map(|_| rng.random_range(-1.5..1.5)).collect();
            let y = state.marker_at(&theta) + Vector3::new(1e-4, -2e-4, 1e-4);
            let belief = Belief::new(state, layout, Arc::new(MeasurementModel::tracker(1e-4)));
            let mut unscented = UnscentedRls::new(belief.clone(), covariance.clone(), None);
            let mut linear = Rls::new(belief, covariance, None);
            unscented.update(&theta, &Observation::seen(y)).expect("an update");
            linear.update(&theta, &Observation::seen(y)).expect("an update");
            let apart = unscented.belief().state.marker_at(&theta) - linear.belief().state.marker_at(&theta);
            assert!(apart.norm() < 1e-7, "seed {seed}: {apart}");
            let difference = (&unscented.covariance - linear.belief().covariance.as_ref().expect("kept")).amax();
            assert!(difference < 1e-11, "seed {seed}: {difference}");
        }
    }

    #[test]
    fn covariance_stays_positive_over_wild_updates() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let state = random_arm(&mut rng, 5);
        let layout = Arc::new(Layout::of_arm(&state, &[], false));
        let m = layout.dimension();
        let belief = Belief::new(state, layout, Arc::new(MeasurementModel::tracker(1e-2)));
        let mut filter = UnscentedRls::new(belief, DMatrix::identity(m, m) * 0.2, None);
        for _ in 0..500 {
            let theta: Vec<f64> = (0..5).map(|_| rng.random_range(-1.5..1.5)).collect();
            let near = filter.belief().state.marker_at(&theta);
            let y = near + Vector3::from_fn(|_, _| rng.random_range(-0.3..0.3));
            filter.update(&theta, &Observation::seen(y)).expect("an update");
            assert!(filter.covariance.clone().symmetric_eigenvalues().min() > 0.0);
        }
    }
}
