//! Recursive least squares in the paper's own six numbers per joint, for comparison.
//!
//! The paper writes an axis as a direction w and a point v, three numbers each, and filters all six:
//!
//! ```text
//! K = P Hᵀ (H P Hᵀ + R)⁻¹,   (w, v) ← (w, v) + K (y − h),   w ← w/‖w‖,   P as in (3) and (5)
//! ```
//!
//! A line has four degrees of freedom. The other two, the length of w and the place of v along the axis, move nothing
//! that can be measured: no data shrink their variance, and the stabilising noise makes it grow for ever. So this
//! estimator keeps its covariance to itself; a trace or an ellipsoid of it would mislead.

use nalgebra::{DMatrix, DVector, Matrix3xX, UnitVector3, Vector3};

use super::{Belief, EstimationError, Estimator, StabilisingNoise, Update};
use crate::{
    kinematics::{Joint, jacobian::walk},
    sensing::{Observation, isotropic},
};

/// The filter in six numbers per learned revolute joint, three per learned prismatic joint. The marker must be known.
#[derive(Clone, Debug)]
pub struct SixNumbers {
    belief: Belief,
    covariance: DMatrix<f64>,
    stabilising: Option<StabilisingNoise>,
    step: u64,
}

impl SixNumbers {
    /// Starts from `belief` with these prior standard deviations of every coordinate of a direction (rad) and of a
    /// point (m).
    pub fn new(belief: Belief, direction_sd: f64, point_sd: f64, stabilising: Option<StabilisingNoise>) -> Self {
        let variances: Vec<f64> = belief
            .chain
            .joints
            .iter()
            .enumerate()
            .filter(|(index, _)| belief.layout.is_learned(*index))
            .flat_map(|(_, joint)| {
                let points = if joint.line().is_some() { 3 } else { 0 };
                std::iter::repeat_n(direction_sd.powi(2), 3).chain(std::iter::repeat_n(point_sd.powi(2), points))
            })
            .collect();
        let covariance = DMatrix::from_diagonal(&DVector::from_vec(variances));
        Self { belief: Belief { covariance: None, ..belief }, covariance, stabilising, step: 0 }
    }

    /// The predicted marker and its derivative by all numbers, w before v, joint by joint.
    fn jacobian(&self, positions: &[f64]) -> (Vector3<f64>, Matrix3xX<f64>) {
        let mut h = Matrix3xX::zeros(self.covariance.nrows());
        let mut column = 0;
        let (marker, _) = walk(&self.belief.chain, positions, |index, derivative| {
            if !self.belief.layout.is_learned(index) {
                return;
            }
            let units = [Vector3::x(), Vector3::y(), Vector3::z()];
            let mut put = |value| {
                h.set_column(column, &value);
                column += 1;
            };
            // The length of w does not count: only what is ⟂ w turns the axis.
            let w = derivative.joint.direction().into_inner();
            units.iter().for_each(|e| put(derivative.direction(&(e - w * w.dot(e)))));
            if derivative.joint.line().is_some() {
                units.iter().for_each(|e| put(derivative.point(e)));
            }
        });
        (marker.coords, h)
    }

    fn correct(&mut self, positions: &[f64], measured: &Vector3<f64>) -> Result<f64, EstimationError> {
        let p = &self.covariance;
        let noise = isotropic(self.belief.noise_m2);
        let (predicted, h) = self.jacobian(positions);
        let innovation = measured - predicted;
        let numerator = p * h.transpose();
        let s = (&h * &numerator).fixed_view::<3, 3>(0, 0).into_owned() + noise;
        let diverged = || EstimationError::Diverged("an update was not a finite number");
        let s_inverse = s.cholesky().ok_or_else(diverged)?.inverse();
        let k = numerator * s_inverse;
        let delta: DVector<f64> = &k * innovation;
        let shrink = DMatrix::identity(p.nrows(), p.ncols()) - &k * &h;
        let covariance = &shrink * p * shrink.transpose() + &k * noise * k.transpose();
        if !delta.iter().chain(covariance.iter()).all(|x| x.is_finite()) {
            return Err(diverged());
        }
        self.covariance = (&covariance + covariance.transpose()) * 0.5;
        let mut at = 0;
        let mut take = || {
            at += 3;
            delta.fixed_rows::<3>(at - 3).into_owned()
        };
        let layout = self.belief.layout.clone();
        for (_, joint) in self.belief.chain.joints.iter_mut().enumerate().filter(|(index, _)| layout.is_learned(*index))
        {
            match joint {
                Joint::Revolute(line) => {
                    line.direction = UnitVector3::new_normalize(line.direction.into_inner() + take());
                    line.point += take();
                }
                Joint::Prismatic(w) => *w = UnitVector3::new_normalize(w.into_inner() + take()),
            }
        }
        Ok((innovation.transpose() * s_inverse * innovation).x)
    }
}

impl Estimator for SixNumbers {
    fn belief(&self) -> &Belief {
        &self.belief
    }

    fn update(&mut self, positions: &[f64], observation: &Observation) -> Result<Update, EstimationError> {
        let mut update = Update::default();
        if let Some(measured) = observation.position() {
            update.nis = Some((self.correct(positions, &measured.coords)?, 3));
        }
        self.step += 1;
        if let Some(noise) = self.stabilising.filter(|noise| noise.is_due(self.step)) {
            (0..self.covariance.nrows()).for_each(|k| self.covariance[(k, k)] += noise.variance);
        }
        Ok(update)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::kinematics::{TangentLayout, laws::random_chain};

    /// To first order both parameterisations make the same step: the two surplus numbers change no measurement.
    #[test]
    fn a_small_update_moves_the_marker_as_minimal_coordinates_do() {
        for seed in 0..20 {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let chain = random_chain(&mut rng, 5);
            let layout = Arc::new(TangentLayout::new(&chain.joints, &[], false));
            let m = layout.dimension();
            let theta: Vec<f64> = (0..5).map(|_| rng.random_range(-1.5..1.5)).collect();
            let y = chain.marker_at(&theta) + Vector3::new(1e-5, -2e-5, 1e-5);
            let belief = Belief { chain, layout, covariance: None, noise_m2: 1e-2, alternatives: Vec::new() };
            let mut six = SixNumbers::new(belief.clone(), 0.5, 0.5, None);
            let mut minimal = super::super::Rls::new(belief, DMatrix::identity(m, m) * 0.25, None);
            six.update(&theta, &Observation::Seen(y)).expect("an update");
            minimal.update(&theta, &Observation::Seen(y)).expect("an update");
            let other: Vec<f64> = (0..5).map(|_| rng.random_range(-1.5..1.5)).collect();
            let difference = six.belief().chain.marker_at(&other) - minimal.belief().chain.marker_at(&other);
            assert!(difference.norm() < 1e-8, "seed {seed}: {difference}");
        }
    }
}
