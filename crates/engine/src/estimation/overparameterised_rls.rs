//! Recursive least squares in the paper's own six numbers per joint, for comparison.
//!
//! The paper writes an axis as a direction w and a point v, three numbers each, and filters all six:
//!
//! ```text
//! K = P Hᵀ (H P Hᵀ + I)⁻¹,   (w, v) ← (w, v) + K (y − h),   w ← w/‖w‖,   P as in (3) and (5)
//! ```
//!
//! A line has four degrees of freedom. The other two, the length of w and the place of v along the axis, move nothing
//! that can be measured: no data shrink their variance, and the stabilising noise makes it grow for ever. So this
//! estimator keeps its covariance to itself; a trace or an ellipsoid of it would mislead.

use nalgebra::{DMatrix, DVector, UnitVector3, Vector3};

use super::{
    Belief, EstimationError, Estimator, StabilisingNoise, Update,
    belief::{Revision, innovation_covariance, is_finite},
};
use crate::{kinematics::Joint, model::KinematicData, sensing::Observation};

/// The filter in six numbers per learned revolute joint, three per learned prismatic joint. Base and marker must be known,
/// and of all channels it reads the marker's position alone.
#[derive(Clone, Debug)]
pub struct OverparameterisedRls {
    belief: Belief,
    covariance: DMatrix<f64>,
    stabilising: Option<StabilisingNoise>,
    step: u64,
}

impl OverparameterisedRls {
    /// Starts from `belief` with these prior standard deviations of every coordinate of a direction (rad) and of a
    /// point (m).
    pub fn new(belief: Belief, direction_sd: f64, point_sd: f64, stabilising: Option<StabilisingNoise>) -> Self {
        let variances: Vec<f64> = belief
            .state
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

    /// The transposed derivative of the marker by all numbers, w before v, joint by joint, and its predicted position.
    fn rows(&self, positions: &[f64]) -> (DMatrix<f64>, Vector3<f64>) {
        let Belief { state, layout, .. } = &self.belief;
        let mut data = KinematicData::new(state, layout);
        let marker = data.at(positions).target(0);
        let mut rows = DMatrix::zeros(self.covariance.nrows(), 3);
        let mut number = 0;
        for (index, joint) in state.joints.iter().enumerate().filter(|(index, _)| layout.is_learned(*index)) {
            let (before, after) = (data.link(state.tree.link_before(index)), data.link(index + 1));
            let w = joint.direction().into_inner();
            let mut put = |column: Vector3<f64>| {
                rows.row_mut(number).copy_from(&column.transpose());
                number += 1;
            };
            for k in 0..3 {
                // The length of w does not count: only what is ⟂ w turns the axis.
                let e = Vector3::ith(k, 1.0) - w * w[k];
                put(match joint {
                    Joint::Revolute(line) => {
                        let turn = (before.rotation - after.rotation) * w.cross(&e);
                        turn.cross(&(marker - before.point(&line.point.coords)))
                    }
                    Joint::Prismatic(_) => before.rotation * e * data.links().position(index),
                });
            }
            if joint.line().is_some() {
                (0..3).for_each(|k| put((before.rotation - after.rotation).column(k).into_owned()));
            }
        }
        (rows, marker)
    }

    /// The state and the covariance after a measured marker, and the normalised innovation squared.
    fn corrected(&self, positions: &[f64], measured: &Vector3<f64>) -> Result<Revision, EstimationError> {
        let p = &self.covariance;
        let weight = self.belief.measurement_model.marker_sigma().recip();
        let (rows, predicted) = self.rows(positions);
        let (mut rows, mut innovation) = (rows * weight, (measured - predicted) * weight);
        self.belief.measurement_model.whiten_marker(
            &self.belief.state,
            positions,
            rows.as_mut_slice(),
            innovation.as_mut_slice(),
        );
        let diverged = || EstimationError::Diverged("an update was not a finite number");
        let (s, numerator) = innovation_covariance(p, &rows);
        let s = s.cholesky().ok_or_else(diverged)?;
        let k = s.solve(&numerator.transpose()).transpose();
        let delta: DVector<f64> = &k * innovation;
        let shrink = DMatrix::identity(p.nrows(), p.ncols()) - &k * rows.transpose();
        let covariance = &shrink * p * shrink.transpose() + &k * k.transpose();
        if !is_finite(&delta, &covariance) {
            return Err(diverged());
        }
        let mut at = 0;
        let mut take = || {
            at += 3;
            delta.fixed_rows::<3>(at - 3).into_owned()
        };
        let mut state = self.belief.state.clone();
        let layout = &self.belief.layout;
        for (_, joint) in state.joints.iter_mut().enumerate().filter(|(index, _)| layout.is_learned(*index)) {
            match joint {
                Joint::Revolute(line) => {
                    line.direction = UnitVector3::new_normalize(line.direction.into_inner() + take());
                    line.point += take();
                }
                Joint::Prismatic(w) => *w = UnitVector3::new_normalize(w.into_inner() + take()),
            }
        }
        let nis = (innovation.dot(&s.solve(&innovation)), 3);
        Ok(Revision { state, covariance: (&covariance + covariance.transpose()) * 0.5, nis })
    }
}

impl Estimator for OverparameterisedRls {
    fn boxed(&self) -> Box<dyn Estimator> {
        Box::new(self.clone())
    }

    fn belief(&self) -> &Belief {
        &self.belief
    }

    fn correct(&mut self, positions: &[f64], observation: &Observation) -> Result<Update, EstimationError> {
        let mut update = Update::default();
        if let Some(measured) = observation.marker(&self.belief.measurement_model) {
            let Revision { state, covariance, nis } = self.corrected(positions, &measured.coords)?;
            (self.belief.state, self.covariance) = (state, covariance);
            update.nis = Some(nis);
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
    use crate::{
        model::{Layout, random::random_arm},
        sensing::MeasurementModel,
    };

    /// To first order both parameterisations make the same step: the two surplus numbers change no measurement.
    #[test]
    fn a_small_update_moves_the_marker_as_minimal_coordinates_do() {
        for seed in 0..20 {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let state = random_arm(&mut rng, 5);
            let layout = Arc::new(Layout::of_arm(&state, &[], false));
            let m = layout.dimension();
            let theta: Vec<f64> = (0..5).map(|_| rng.random_range(-1.5..1.5)).collect();
            let y = state.marker_at(&theta) + Vector3::new(1e-5, -2e-5, 1e-5);
            let belief = Belief::new(state, layout, Arc::new(MeasurementModel::tracker(0.1)));
            let mut six = OverparameterisedRls::new(belief.clone(), 0.5, 0.5, None);
            let mut minimal = super::super::Rls::new(belief, DMatrix::identity(m, m) * 0.25, None);
            six.update(&theta, &Observation::seen(y)).expect("an update");
            minimal.update(&theta, &Observation::seen(y)).expect("an update");
            let other: Vec<f64> = (0..5).map(|_| rng.random_range(-1.5..1.5)).collect();
            let difference = six.belief().state.marker_at(&other) - minimal.belief().state.marker_at(&other);
            assert!(difference.norm() < 1e-8, "seed {seed}: {difference}");
        }
    }
}
