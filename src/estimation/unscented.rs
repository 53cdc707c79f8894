//! Unscented recursive least squares: the filter of (2)–(5) without linearisation.
//!
//! The marker's mean and covariances under the belief come from 2m + 1 chains (Julier and Uhlmann 1997), on the
//! manifold: with L the Cholesky factor of P, and its columns lᵢ,
//!
//! ```text
//! x₀ = x,   x±ᵢ = x ⊞ ±√(m + κ) lᵢ,    w₀ = κ/(m + κ),   wᵢ = 1/(2(m + κ))
//! ŷ = Σ wᵢ h(xᵢ),   S = Σ wᵢ (h(xᵢ) − ŷ)(h(xᵢ) − ŷ)ᵀ + R,   C = Σ wᵢ δᵢ (h(xᵢ) − ŷ)ᵀ
//! K = C S⁻¹,   x ← x ⊞ K (y − ŷ),   P ← J (P − K S Kᵀ) Jᵀ
//! ```
//!
//! with δᵢ the coordinates of xᵢ and J the change of chart. Its second moments see the bend of rotations: where the
//! belief is wide S is larger than H P Hᵀ + R, and the filter is less sure of itself than the linearised one. κ = 1
//! keeps all weights positive. The name is kept from the paper's recursive least squares: the state does not move.

use nalgebra::{Cholesky, DMatrix, DVector, Matrix3, Vector3};

use super::{Belief, ChangeDetector, EstimationError, Estimator, StabilisingNoise, Update};
use crate::sensing::{Observation, isotropic};

/// κ.
const KAPPA: f64 = 1.0;

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

    fn correct(&mut self, positions: &[f64], measured: &Vector3<f64>) -> Result<f64, EstimationError> {
        let Belief { chain, layout, noise_m2, .. } = &self.belief;
        let m = layout.dimension();
        let diverged = || EstimationError::Diverged("an update was not a finite number");
        let root = Cholesky::new(self.covariance.clone()).ok_or_else(diverged)?.l() * (m as f64 + KAPPA).sqrt();
        let weight = 0.5 / (m as f64 + KAPPA);
        let centre = chain.marker_at(positions).coords;
        let mut markers = Vec::with_capacity(2 * m);
        for column in root.column_iter() {
            let delta: DVector<f64> = column.into_owned();
            let above = chain.retract(layout, &delta).marker_at(positions).coords;
            let below = chain.retract(layout, &-delta).marker_at(positions).coords;
            markers.push((above, below));
        }
        let first = KAPPA / (m as f64 + KAPPA);
        let mean = centre * first + markers.iter().map(|(a, b)| (a + b) * weight).sum::<Vector3<f64>>();
        let mut s: Matrix3<f64> = isotropic(*noise_m2) + (centre - mean) * (centre - mean).transpose() * first;
        let mut cross = DMatrix::zeros(m, 3);
        for (column, (above, below)) in root.column_iter().zip(&markers) {
            let (a, b) = (above - mean, below - mean);
            s += (a * a.transpose() + b * b.transpose()) * weight;
            cross += column * (a - b).transpose() * weight;
        }
        let inverse = s.cholesky().ok_or_else(diverged)?.inverse();
        let innovation = measured - mean;
        let gain = &cross * inverse;
        let delta: DVector<f64> = &gain * innovation;
        let posterior = &self.covariance - &gain * s * gain.transpose();
        let transport = chain.transport(layout, &delta);
        let covariance = &transport * posterior * transport.transpose();
        let covariance = (&covariance + covariance.transpose()) * 0.5;
        let nis = innovation.dot(&(inverse * innovation));
        if !(delta.iter().chain(covariance.iter()).all(|x| x.is_finite()) && nis.is_finite()) {
            return Err(diverged());
        }
        self.belief.chain = chain.retract(layout, &delta);
        self.covariance = covariance;
        Ok(nis)
    }
}

impl Estimator for UnscentedRls {
    fn belief(&self) -> &Belief {
        &self.belief
    }

    fn update(&mut self, positions: &[f64], observation: &Observation) -> Result<Update, EstimationError> {
        let mut update = Update::default();
        if let Some(measured) = observation.position() {
            let nis = self.correct(positions, &measured.coords)?;
            update = Update { nis: Some((nis, 3)), change_noticed: self.changes.observe(nis) };
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

    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::{
        estimation::Rls,
        kinematics::{TangentLayout, laws::random_chain},
    };

    /// Where the belief is narrow the transform sees no bend, and agrees with the linearised filter.
    #[test]
    fn a_narrow_belief_is_updated_as_by_linearisation() {
        for seed in 0..20 {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let chain = random_chain(&mut rng, 4);
            let layout = Arc::new(TangentLayout::new(&chain.joints, &[], true));
            let m = layout.dimension();
            let covariance = DMatrix::identity(m, m) * 1e-8;
            let theta: Vec<f64> = (0..4).map(|_| rng.random_range(-1.5..1.5)).collect();
            let y = chain.marker_at(&theta) + Vector3::new(1e-4, -2e-4, 1e-4);
            let belief = Belief { chain, layout, covariance: None, noise_m2: 1e-8, alternatives: Vec::new() };
            let mut unscented = UnscentedRls::new(belief.clone(), covariance.clone(), None);
            let mut linear = Rls::new(belief, covariance, None);
            unscented.update(&theta, &Observation::Seen(y)).expect("an update");
            linear.update(&theta, &Observation::Seen(y)).expect("an update");
            let apart = unscented.belief().chain.marker_at(&theta) - linear.belief().chain.marker_at(&theta);
            assert!(apart.norm() < 1e-7, "seed {seed}: {apart}");
            let difference = (&unscented.covariance - linear.belief().covariance.as_ref().expect("kept")).amax();
            assert!(difference < 1e-11, "seed {seed}: {difference}");
        }
    }

    #[test]
    fn covariance_stays_positive_over_wild_updates() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let chain = random_chain(&mut rng, 5);
        let layout = Arc::new(TangentLayout::new(&chain.joints, &[], false));
        let m = layout.dimension();
        let belief = Belief { chain, layout, covariance: None, noise_m2: 1e-4, alternatives: Vec::new() };
        let mut filter = UnscentedRls::new(belief, DMatrix::identity(m, m) * 0.2, None);
        for _ in 0..500 {
            let theta: Vec<f64> = (0..5).map(|_| rng.random_range(-1.5..1.5)).collect();
            let near = filter.belief().chain.marker_at(&theta);
            let y = near + Vector3::from_fn(|_, _| rng.random_range(-0.3..0.3));
            filter.update(&theta, &Observation::Seen(y)).expect("an update");
            assert!(filter.covariance.clone().symmetric_eigenvalues().min() > 0.0);
        }
    }
}
