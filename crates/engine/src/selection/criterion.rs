//! The criterion: what is expected to be left of the error after one more observation, under one hypothesis.
//!
//! With the future observation simulated at the current estimate, (7) becomes
//!
//! ```text
//! C(θ) = tr(W P_T) = tr(W P) − tr(S⁻¹ G W Gᵀ),    G = H P,   S = G Hᵀ + I      (H whitened)
//! ```
//!
//! W weighs the parameters (see [`Weights`]). The right side needs no posterior, and candidates are evaluated in batches.
//! That is criterion A; D, E and I (see [`Optimality`]) are evaluated in the same way, each as its value before the
//! movement less what the movement gains.
//!
//! Where a head watches, the gain is weighed by the chance p(θ) that the marker is seen (see [`Visibility`]):
//! `C = tr(W P) − p(θ) tr(S⁻¹ G W Gᵀ)`, which is the expectation over both outcomes, as a miss leaves P as it is.
//!
//! The criterion adds square metres and square radians. W decides what a radian is worth.

mod slope;

use std::sync::Arc;

use fearless_simd::Level;
use nalgebra::{DMatrix, Matrix3, Point3};

use super::{
    Optimality, SelectionError, Sight, Weights, optimality,
    perturbations::{self, AroundCentres},
    prediction::Predictions,
    views::Views,
};
use crate::{
    elementary::ln,
    estimation::Belief,
    model::{Layout, Points, State, Workspace, jacobian},
    parallel::{in_chunks, in_turn},
    sensing::MeasurementModel,
    simd,
};

pub(super) use slope::{Shown, Slope};

/// The criterion under one hypothesis.
#[derive(Clone)]
pub struct Criterion<'a> {
    state: &'a State,
    layout: &'a Layout,
    measurement_model: &'a MeasurementModel,
    /// What is measured, where that is the place of points and nothing else.
    points: Option<Arc<Points>>,
    /// The instructions that this processor has.
    level: Level,
    covariance: &'a DMatrix<f64>,
    weights: &'a Weights,
    value: f64,
    sight: Option<Sight<'a>>,
    /// What states drawn from the belief would see, where the sensors do not see everything.
    views: Option<Arc<Views>>,
    /// The covariance that visibility is judged by, if it is another than that of the criterion.
    unsure: Option<&'a DMatrix<f64>>,
    optimality: Optimality,
    /// Mean of HᵀH of the marker over the workspace, for criterion I.
    metric: Option<DMatrix<f64>>,
}

/// What one movement would teach.
#[derive(Clone, Debug, PartialEq)]
pub struct Appraisal {
    /// The criterion before any movement; tr(W P) for criterion A.
    pub before: f64,
    /// C(θ); as before the movement where the marker is certainly out of view.
    pub criterion: f64,
    /// By how much it is expected to fall.
    pub gain: f64,
    /// The predicted marker h(x̂, θ), metres.
    pub marker: Point3<f64>,
    /// Its covariance H P Hᵀ, m².
    pub marker_covariance: Matrix3<f64>,
    /// The believed chance that it is seen; 1 where no head watches.
    pub chance: f64,
}

/// What is measured in a state, where that is the place of points and nothing else.
pub(super) fn points(belief: &Belief, state: &State) -> Option<Arc<Points>> {
    belief.measurement_model.points().and_then(|points| Points::new(state, &belief.layout, &points)).map(Arc::new)
}

impl<'a> Criterion<'a> {
    /// The A-criterion at `belief`, which must hold a covariance.
    ///
    /// # Errors
    ///
    /// [`SelectionError::NoCovariance`] if the belief holds no covariance.
    pub fn new(belief: &'a Belief, weights: &'a Weights) -> Result<Self, SelectionError> {
        let covariance = belief.covariance.as_ref().ok_or(SelectionError::NoCovariance)?;
        Ok(Self::over(belief, &belief.state, covariance, weights))
    }

    /// The A-criterion under another state and covariance than the belief's own.
    pub(super) fn over(
        belief: &'a Belief,
        state: &'a State,
        covariance: &'a DMatrix<f64>,
        weights: &'a Weights,
    ) -> Self {
        Self::measuring(points(belief, state), belief, state, covariance, weights)
    }

    /// The same with the `points` that are measured in that state.
    pub(super) fn measuring(
        points: Option<Arc<Points>>,
        belief: &'a Belief,
        state: &'a State,
        covariance: &'a DMatrix<f64>,
        weights: &'a Weights,
    ) -> Self {
        Self {
            state,
            layout: &belief.layout,
            measurement_model: &belief.measurement_model,
            points,
            level: simd::level(),
            covariance,
            weights,
            value: weights.trace(covariance),
            sight: None,
            views: None,
            unsure: None,
            optimality: Optimality::A,
            metric: None,
        }
    }

    /// The same where not everything is seen.
    pub fn watched(self, sight: Option<Sight<'a>>) -> Self {
        let views =
            sight.and_then(|sight| sight.views(self.state, self.layout, self.covariance, self.measurement_model));
        Self { sight, views, ..self }
    }

    /// The same with what states drawn from the belief would see.
    pub(super) fn watched_by(self, sight: Sight<'a>, views: Option<Arc<Views>>) -> Self {
        Self { sight: Some(sight), views, ..self }
    }

    /// The same with visibility judged by another covariance: by today's, where the criterion is that of a plan.
    pub(super) fn unsure(self, covariance: &'a DMatrix<f64>) -> Self {
        Self { unsure: Some(covariance), ..self }
    }

    /// The same by another optimality; `workspace` serves criterion I alone.
    pub fn by(self, optimality: Optimality, workspace: &Workspace) -> Self {
        let (mut metric, covariance) = (None, self.covariance);
        let value = match optimality {
            Optimality::A => self.weights.trace(covariance),
            Optimality::D => optimality::half_log_determinant(covariance),
            Optimality::E => optimality::greatest_eigenvalue(covariance, self.weights, None),
            Optimality::I => {
                let of_predictions = optimality::prediction_metric(self.state, self.layout, workspace);
                let value = of_predictions.dot(covariance);
                metric = Some(of_predictions);
                value
            }
        };
        Self { optimality, value, metric, ..self }
    }

    /// The criterion before any further observation: tr(W P), or what another optimality makes of P.
    pub fn before(&self) -> f64 {
        self.value
    }

    /// By how much seeing each candidate would lower the criterion; NaN where that is no number.
    pub(super) fn gains(&self, predictions: &Predictions) -> Vec<f64> {
        match (self.optimality, &self.metric) {
            (Optimality::D, _) => predictions.information(),
            (Optimality::E, _) => {
                let of = |index| {
                    let (gain, s) = predictions.gain_and_innovation(index);
                    let update = s.cholesky().map(|s| (gain, s.inverse()));
                    update.map_or(f64::NAN, |update| {
                        self.value - optimality::greatest_eigenvalue(self.covariance, self.weights, Some(&update))
                    })
                };
                (0..predictions.len()).map(of).collect()
            }
            (_, Some(metric)) => predictions.traces_by(metric),
            (_, None) => predictions.traces(self.weights.all()),
        }
    }

    /// By how much readings whose whitened rows are Hᵀ (m × d) would lower the criterion: of a movement of which some are
    /// missing, as a row of a table. NaN where that is no number.
    pub fn gain_of(&self, rows: &DMatrix<f64>) -> f64 {
        let gains = self.covariance * rows;
        let s = rows.tr_mul(&gains) + DMatrix::identity(rows.ncols(), rows.ncols());
        let Some(s) = s.cholesky() else { return f64::NAN };
        match (self.optimality, &self.metric) {
            (Optimality::D, _) => s.l_dirty().diagonal().iter().map(|x| ln(*x)).sum(),
            (Optimality::E, _) => {
                let update = (gains, s.inverse());
                self.value - optimality::greatest_eigenvalue(self.covariance, self.weights, Some(&update))
            }
            (_, Some(metric)) => s.solve(&gains.tr_mul(&(metric * &gains))).trace(),
            (_, None) => s.solve(&gains.tr_mul(&self.weights.scale(&gains))).trace(),
        }
    }

    /// C(θ) of every candidate, in order. Chunks run on several cores with the feature `parallel`; the values do not
    /// depend on how many.
    pub fn evaluate<C: AsRef<[f64]> + Sync>(&self, candidates: &[C]) -> Vec<f64> {
        in_chunks(candidates, |chunk| self.evaluate_chunk(chunk))
    }

    /// The same on this thread alone.
    pub(super) fn evaluate_here<C: AsRef<[f64]>>(&self, candidates: &[C]) -> Vec<f64> {
        in_turn(candidates, |chunk| self.evaluate_chunk(chunk))
    }

    /// What evaluates perturbations faster than posture by posture; `None` where nothing does.
    pub(super) fn around_centres(&self) -> Option<AroundCentres<'_>> {
        let is_plain =
            self.sees_all() && self.optimality == Optimality::A && self.covariance.nrows() >= perturbations::FEWEST;
        let points = self.points.as_ref().filter(|_| is_plain)?;
        AroundCentres::new(self.level, points, self.covariance, self.weights.all(), self.value)
    }

    fn evaluate_chunk<C: AsRef<[f64]>>(&self, candidates: &[C]) -> Vec<f64> {
        let predictions = self.predictions(candidates);
        let mut values = self.gains(&predictions);
        for (index, value) in values.iter_mut().enumerate() {
            *value = self.expected(predictions.chance(index), *value);
        }
        values
    }

    /// The expectation over seeing and missing; not finite where nothing is to be seen or the gain is no number.
    fn expected(&self, chance: f64, gain: f64) -> f64 {
        if chance == 0.0 || !gain.is_finite() { f64::INFINITY } else { self.value - chance * gain }
    }

    /// What is predicted of every candidate.
    pub(super) fn predictions<C: AsRef<[f64]>>(&self, candidates: &[C]) -> Predictions {
        self.predicted(&candidates.iter().map(AsRef::as_ref).collect::<Vec<_>>())
    }

    fn predicted(&self, candidates: &[&[f64]]) -> Predictions {
        let views = self.views.as_deref();
        let mut predictions = match (&self.points, views) {
            (Some(points), None) => Predictions::of_points(self.level, points, self.covariance, candidates),
            _ => {
                let model = (self.state, self.layout, self.measurement_model);
                Predictions::new(self.level, model, self.covariance, candidates, views)
            }
        };
        if let (Some(Sight::Chance(visibility, limits)), true) = (&self.sight, views.is_some()) {
            predictions.discount(|index| visibility.discount(&limits.to_unit(candidates[index])));
        } else if let Some(sight) = &self.sight {
            predictions.seen(self.measurement_model, self.unsure, |index, marker, spread| {
                sight.chance(candidates[index], marker, spread)
            });
        }
        predictions
    }

    /// Whether every candidate is sure to be seen.
    pub(super) fn sees_all(&self) -> bool {
        self.sight.is_none() && self.views.is_none()
    }

    /// The criterion of one candidate and what it rests on; an error if it is no number.
    ///
    /// # Errors
    ///
    /// [`SelectionError::NoFiniteCriterion`] if the criterion at the candidate is not finite, unless the marker is
    /// certainly out of view there.
    pub fn appraise(&self, candidate: &[f64]) -> Result<Appraisal, SelectionError> {
        let value = self.evaluate(&[candidate]).first().copied().unwrap_or(f64::NAN);
        self.appraisal(candidate, self.value, value)
    }

    /// The appraisal of a candidate whose criterion is `value`, and was `before`: as before where the marker is certainly
    /// out of view.
    pub(super) fn appraisal(&self, candidate: &[f64], before: f64, value: f64) -> Result<Appraisal, SelectionError> {
        let (marker, marker_covariance, chance) = self.marker(candidate);
        let criterion = if value.is_finite() {
            value
        } else if chance == 0.0 && before.is_finite() {
            before
        } else {
            return Err(SelectionError::NoFiniteCriterion);
        };
        Ok(Appraisal { before, criterion, gain: before - criterion, marker, marker_covariance, chance })
    }

    /// The predicted marker (m), its covariance (m²) and the chance of seeing it.
    fn marker(&self, candidate: &[f64]) -> (Point3<f64>, Matrix3<f64>, f64) {
        let (marker, h) = jacobian(self.state, self.layout, candidate);
        let spread = &h * self.covariance * h.transpose();
        let spread = spread.fixed_view::<3, 3>(0, 0).into_owned();
        let chance = match (&self.sight, &self.views) {
            (None, _) => 1.0,
            (Some(_), Some(_)) => self.predictions(&[candidate]).chance(0),
            (Some(sight), None) => sight.chance(candidate, &marker, &spread),
        };
        (marker, spread, chance)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::DVector;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::{
        model::random::random_arm,
        selection::CriterionUnits,
        sensing::{JointNoise, MeasurementModel, Position, Sensor},
        simd::levels,
    };

    /// A random belief about an arm whose marker is seen by one tracker, or by two at once.
    fn random_belief(seed: u64, trackers: usize) -> (Belief, Weights, ChaCha8Rng) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let state = random_arm(&mut rng, 6);
        let layout = Arc::new(Layout::of_arm(&state, &[], true));
        let m = layout.dimension();
        let root = DMatrix::from_fn(m, m, |_, _| rng.random_range(-0.5..0.5));
        let covariance = &root * root.transpose() + DMatrix::identity(m, m) * 1e-3;
        let prior_sd = DVector::from_fn(m, |_, _| rng.random_range(0.1..2.0));
        let units =
            if seed.is_multiple_of(2) { CriterionUnits::Prior } else { CriterionUnits::CharacteristicLength(0.3) };
        let weights = Weights::new(units, &layout, &prior_sd);
        let tracker = |index: usize| Sensor::even(Position { target: 0 }, 0.1 + index as f64 * 0.05);
        let measurement_model = Arc::new(MeasurementModel::new((0..trackers).map(tracker).collect()));
        (Belief::new(state, layout, measurement_model).with_covariance(covariance), weights, rng)
    }

    /// The posterior that the criterion abbreviates, built the long way.
    fn posterior(belief: &Belief, theta: &[f64]) -> DMatrix<f64> {
        let p = belief.covariance.as_ref().expect("a covariance");
        let (_, h) = jacobian(&belief.state, &belief.layout, theta);
        let information: f64 = belief.measurement_model.sensors().iter().map(|sensor| sensor.sigma().powi(-2)).sum();
        let information = p.clone().try_inverse().expect("positive") + h.transpose() * &h * information;
        information.try_inverse().expect("positive")
    }

    /// Where joints' readings are off: every optimality against the posterior by the whole covariance of the readings, and how far
    /// two hypotheses are apart by it.
    #[test]
    fn readings_that_err_together_teach_less() {
        for seed in 0..20 {
            let (mut belief, weights, mut rng) = random_belief(seed, 1 + seed as usize % 2);
            let sigmas: Vec<f64> = (0..6).map(|_| rng.random_range(0.01..0.3)).collect();
            let noise = JointNoise::new(&belief.state, sigmas.clone()).map(Arc::new);
            let apart = belief.measurement_model.clone();
            belief.measurement_model = Arc::new(apart.as_ref().clone().with_joint_noise(noise.clone()));
            let offsets = Layout::new(&belief.state, (0..6).map(crate::model::Block::Offset));
            let workspace = Workspace::from(candidates(&mut rng, 10));
            let p = belief.covariance.clone().expect("a covariance");
            let whole = |state: &State, theta: &[f64]| {
                let h = apart.jacobian(state, &belief.layout, theta);
                let j = apart.jacobian(state, &offsets, theta);
                let sigma = DMatrix::from_diagonal(&DVector::from_fn(6, |joint, _| sigmas[joint] * sigmas[joint]));
                (h, j.tr_mul(&(sigma * &j)) + DMatrix::identity(j.ncols(), j.ncols()))
            };
            for optimality in [Optimality::A, Optimality::D, Optimality::I] {
                let criterion = Criterion::new(&belief, &weights).expect("a covariance").by(optimality, &workspace);
                for theta in candidates(&mut rng, 3) {
                    let (h, c) = whole(&belief.state, &theta);
                    let s = h.tr_mul(&(&p * &h)) + &c;
                    let posterior = &p - &p * &h * s.cholesky().expect("positive").solve(&(h.transpose() * &p));
                    let expected = match optimality {
                        Optimality::A => weights.trace(&posterior),
                        Optimality::D => 0.5 * posterior.determinant().ln(),
                        _ => {
                            let after = belief.clone().with_covariance(posterior);
                            let spread = |theta: &Vec<f64>| after.marker_covariance(theta).expect("kept").trace();
                            workspace.configurations.iter().map(spread).sum::<f64>() / 10.0
                        }
                    };
                    let value = criterion.evaluate(std::slice::from_ref(&theta))[0];
                    let scale = expected.abs().max(1e-3);
                    assert!((value - expected).abs() < 1e-6 * scale, "{seed} {optimality:?}: {value} {expected}");
                }
            }
            let other = random_arm(&mut rng, 6);
            let criteria = [&belief.state, &other].map(|state| Criterion::over(&belief, state, &p, &weights));
            for theta in candidates(&mut rng, 3) {
                let predicted = [&criteria[0], &criteria[1]].map(|of| of.predictions(std::slice::from_ref(&theta)));
                let told = crate::selection::prediction::told_apart(
                    &belief.measurement_model,
                    &predicted[0],
                    &predicted[1],
                    0,
                );
                let [(h, c), (g, e)] = [&belief.state, &other].map(|state| whole(state, &theta));
                let mean = (h.tr_mul(&(&p * &h)) + c + g.tr_mul(&(&p * &g)) + e) * 0.5;
                let mut apart_by = DVector::zeros(mean.nrows());
                apart.difference(predicted[0].reading(0), predicted[1].reading(0), apart_by.as_mut_slice());
                let distance = 0.125 * apart_by.dot(&mean.cholesky().expect("positive").solve(&apart_by));
                assert!((told + (-distance).exp_m1()).abs() < 1e-8, "{told} {distance}");
            }
        }
    }

    fn candidates(rng: &mut ChaCha8Rng, count: usize) -> Vec<Vec<f64>> {
        (0..count).map(|_| (0..6).map(|_| rng.random_range(-2.0..2.0)).collect()).collect()
    }

    /// Every optimality against the posterior, built the long way; for three equations and for six.
    #[test]
    fn equals_what_is_left_of_the_posterior() {
        for seed in 0..40 {
            let (belief, weights, mut rng) = random_belief(seed, 1 + seed as usize % 2);
            let workspace = Workspace::from(candidates(&mut rng, 10));
            for optimality in [Optimality::A, Optimality::D, Optimality::E, Optimality::I] {
                let criterion = Criterion::new(&belief, &weights).expect("a covariance").by(optimality, &workspace);
                let candidates = candidates(&mut rng, 7);
                for (value, theta) in criterion.evaluate(&candidates).iter().zip(&candidates) {
                    let posterior = posterior(&belief, theta);
                    let roots = DMatrix::from_diagonal(&weights.roots());
                    let expected = match optimality {
                        Optimality::A => weights.trace(&posterior),
                        Optimality::D => 0.5 * posterior.determinant().ln(),
                        Optimality::E => (&roots * &posterior * &roots).symmetric_eigenvalues().max(),
                        Optimality::I => {
                            let after = belief.clone().with_covariance(posterior);
                            let spread = |theta: &Vec<f64>| after.marker_covariance(theta).expect("kept").trace();
                            workspace.configurations.iter().map(spread).sum::<f64>() / 10.0
                        }
                    };
                    let gain =
                        criterion.gain_of(&belief.measurement_model.jacobian(&belief.state, &belief.layout, theta));
                    assert!((criterion.before() - gain - value).abs() < 1e-9 * value.abs().max(1e-3), "{optimality:?}");
                    // Lanczos' iteration comes near from below.
                    let tolerance = if optimality == Optimality::E { 1e-3 } else { 1e-6 };
                    let scale = expected.abs().max(1e-3);
                    assert!((value - expected).abs() < tolerance * scale, "{seed} {optimality:?}: {value} {expected}");
                    assert!(*value <= criterion.before() + 1e-9);
                }
            }
        }
    }

    /// Lanes across candidates against one posture after the other, for one tracker and for two.
    #[test]
    fn points_in_lanes_say_what_single_postures_say() {
        for seed in 0..40 {
            let (mut belief, weights, mut rng) = random_belief(seed, 1 + seed as usize % 2);
            belief.covariance = belief.covariance.map(|p| p * [1.0, 1e-2, 1e-4][seed as usize % 3]);
            let criterion = Criterion::new(&belief, &weights).expect("a covariance");
            let candidates = candidates(&mut rng, 33);
            for level in levels() {
                let criterion = Criterion { level, ..criterion.clone() };
                let one_by_one = Criterion { points: None, ..criterion.clone() };
                for (value, expected) in criterion.evaluate(&candidates).iter().zip(one_by_one.evaluate(&candidates)) {
                    assert!((value - expected).abs() <= 1e-12 * criterion.before(), "{level:?} {value} {expected}");
                }
                assert!(criterion.points.is_some());
            }
        }
    }

    /// As of a robot whose sensors all want a socket, where it is in none.
    #[test]
    fn a_movement_without_a_sensor_gains_nothing() {
        let (mut belief, weights, mut rng) = random_belief(3, 1);
        belief.measurement_model = Arc::new(MeasurementModel::new(Vec::new()));
        let criterion = Criterion::new(&belief, &weights).expect("a covariance");
        assert_eq!(criterion.evaluate(&candidates(&mut rng, 5)), [criterion.before(); 5]);
    }

    #[test]
    fn batches_equal_single_evaluations_to_the_last_bit_of_the_sum() {
        let (belief, weights, mut rng) = random_belief(7, 1);
        let criterion = Criterion::new(&belief, &weights).expect("a covariance");
        let candidates = candidates(&mut rng, 150);
        let batch = criterion.evaluate(&candidates);
        for (value, theta) in batch.iter().zip(&candidates) {
            let single = criterion.evaluate(std::slice::from_ref(theta))[0];
            assert!((value - single).abs() <= 1e-12 * criterion.before());
        }
        assert_eq!(batch, criterion.evaluate(&candidates));
        assert!(criterion.evaluate::<Vec<f64>>(&[]).is_empty());
    }
}
