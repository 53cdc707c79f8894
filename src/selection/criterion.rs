//! The A-criterion: the expected posterior error after one more observation.
//!
//! With the future observation simulated at the current estimate, (7) becomes
//!
//! ```text
//! C(θ) = tr(W P_T) = tr(W P) − tr(S⁻¹ G W Gᵀ),    G = H P,   S = G Hᵀ + R
//! ```
//!
//! W weighs the parameters (see [`Weights`]). The right side needs no posterior: for B candidates the Jacobians stack
//! into one m × 3B matrix, and one product with P serves them all.
//!
//! Where a head watches, the gain is weighed by the chance p(θ) that the marker is seen (see [`Visibility`]):
//! `C = tr(W P) − p(θ) tr(S⁻¹ G W Gᵀ)`, which is the expectation over both outcomes, as a miss leaves P as it is.
//!
//! The criterion adds square metres and square radians. W decides what a radian is worth.

use nalgebra::{DMatrix, DVector, Dyn, Matrix3, Point3, U3};

use super::{Optimality, SelectionError, Visibility, optimality};
use crate::{
    estimation::Belief,
    kinematics::{Chain, Quantity, TangentLayout, jacobian},
    sensing::isotropic,
};

/// How the criterion compares metres with radians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CriterionUnits {
    /// One radian counts as this many metres: w = 1 for a direction, 1/L² for a point. The paper's implicit L is 1 m.
    CharacteristicLength(f64),
    /// Every parameter in units of its prior standard deviation σ₀: w = 1/σ₀².
    Prior,
}

/// The diagonal of W, one weight per tangent coordinate.
#[derive(Clone, Debug, PartialEq)]
pub struct Weights(DVector<f64>);

impl Weights {
    /// The weights of `layout` in the given units; `prior_sd` holds the prior standard deviation of every coordinate.
    pub fn new(units: CriterionUnits, layout: &TangentLayout, prior_sd: &DVector<f64>) -> Self {
        let weight = |(index, quantity): (usize, &Quantity)| match (units, quantity) {
            (CriterionUnits::Prior, _) => prior_sd[index].powi(-2),
            (CriterionUnits::CharacteristicLength(_), Quantity::Direction) => 1.0,
            (CriterionUnits::CharacteristicLength(length), _) => length.powi(-2),
        };
        let quantities = layout.quantities();
        Self(DVector::from_iterator(quantities.len(), quantities.iter().enumerate().map(weight)))
    }

    /// The weight of one tangent coordinate.
    pub(crate) fn of(&self, coordinate: usize) -> f64 {
        self.0[coordinate]
    }

    /// tr(W P).
    pub fn trace(&self, covariance: &DMatrix<f64>) -> f64 {
        self.0.iter().zip(covariance.diagonal().iter()).map(|(w, p)| w * p).sum()
    }
}

/// How a head that watches enters the criterion.
#[derive(Clone, Copy, Debug)]
pub enum Sight<'a> {
    /// The gain times the chance of being seen; not finite where that is certainly 0. The second field holds the
    /// limits of the joint box.
    Chance(&'a Visibility, &'a [(f64, f64)]),
    /// The naive form, for comparison: the plain criterion, not finite unless the *predicted* marker is in view.
    Predicted(&'a Visibility),
}

/// The A-criterion under one belief.
#[derive(Clone)]
pub struct ACriterion<'a> {
    chain: &'a Chain,
    layout: &'a TangentLayout,
    noise_m2: f64,
    covariance: &'a DMatrix<f64>,
    weights: &'a Weights,
    trace: f64,
    sight: Option<Sight<'a>>,
    /// The covariance that visibility is judged by, if it is another than that of the criterion.
    unsure: Option<&'a DMatrix<f64>>,
    optimality: Optimality,
    /// Mean of HᵀH over the workspace, for criterion I.
    metric: Option<DMatrix<f64>>,
}

/// What a belief predicts of the marker after a movement.
pub(super) struct Prediction {
    /// h(x, θ).
    pub marker: Point3<f64>,
    /// H P Hᵀ, m².
    pub spread: Matrix3<f64>,
    /// G W Gᵀ.
    pub leverage: Matrix3<f64>,
    /// Gᵀ (m × 3), for criterion E.
    pub gain: Option<DMatrix<f64>>,
    /// p(θ), the chance that it is seen.
    pub chance: f64,
}

/// What one movement would teach, under one belief.
#[derive(Clone, Debug, PartialEq)]
pub struct Appraisal {
    /// C(θ); tr(W P) itself where the marker is certainly out of view.
    pub criterion: f64,
    /// tr(W P) − C(θ).
    pub gain: f64,
    /// The predicted marker h(x̂, θ), metres.
    pub marker: Point3<f64>,
    /// Its covariance H P Hᵀ, m².
    pub marker_covariance: Matrix3<f64>,
    /// The believed chance that it is seen; 1 where no head watches.
    pub chance: f64,
}

/// Candidates per batch product: enough to fill the matrix kernel, few enough to share among cores.
const CHUNK: usize = 32;

/// The values of all candidates, in order, a chunk at a time: on several cores with the feature `parallel`.
pub(super) fn in_chunks<C: Sync>(candidates: &[C], evaluate: impl Fn(&[C]) -> Vec<f64> + Sync) -> Vec<f64> {
    #[cfg(feature = "parallel")]
    if candidates.len() > CHUNK {
        use rayon::prelude::*;
        return candidates.par_chunks(CHUNK).flat_map_iter(&evaluate).collect();
    }
    candidates.chunks(CHUNK).flat_map(evaluate).collect()
}

impl<'a> ACriterion<'a> {
    /// The criterion at `belief`, which must hold a covariance.
    pub fn new(belief: &'a Belief, weights: &'a Weights) -> Result<Self, SelectionError> {
        let covariance = belief.covariance.as_ref().ok_or(SelectionError::NoCovariance)?;
        Ok(Self::over(belief, &belief.chain, covariance, weights))
    }

    /// The criterion under another chain and covariance than the belief's own.
    pub(super) fn over(
        belief: &'a Belief,
        chain: &'a Chain,
        covariance: &'a DMatrix<f64>,
        weights: &'a Weights,
    ) -> Self {
        let trace = weights.trace(covariance);
        Self {
            chain,
            layout: &belief.layout,
            noise_m2: belief.noise_m2,
            covariance,
            weights,
            trace,
            sight: None,
            unsure: None,
            optimality: Optimality::A,
            metric: None,
        }
    }

    /// The same where a head watches.
    pub fn watched(self, sight: Sight<'a>) -> Self {
        Self { sight: Some(sight), ..self }
    }

    /// The same with visibility judged by another covariance: by today's, where the criterion is that of a plan.
    pub(super) fn unsure(self, covariance: &'a DMatrix<f64>) -> Self {
        Self { unsure: Some(covariance), ..self }
    }

    /// The same by another optimality.
    pub(super) fn by(self, optimality: Optimality, workspace: &[Vec<f64>]) -> Self {
        let (mut metric, covariance) = (None, self.covariance);
        let trace = match optimality {
            Optimality::A => self.weights.trace(covariance),
            Optimality::D => optimality::half_log_determinant(covariance),
            Optimality::E => optimality::greatest_eigenvalue(covariance, self.weights, None),
            Optimality::I => {
                let of_predictions = optimality::prediction_metric(self.chain, self.layout, workspace);
                let trace = of_predictions.dot(covariance);
                metric = Some(of_predictions);
                trace
            }
        };
        Self { optimality, trace, metric, ..self }
    }

    /// By how much a marker with innovation covariance `s` lowers the criterion; NaN if `s` is not positive.
    pub(super) fn gain(&self, prediction: &Prediction, s: &Matrix3<f64>) -> f64 {
        match self.optimality {
            Optimality::A | Optimality::I => s.cholesky().map_or(f64::NAN, |s| s.solve(&prediction.leverage).trace()),
            Optimality::D => optimality::information(&prediction.spread, self.noise_m2),
            Optimality::E => prediction.gain.as_ref().map_or(f64::NAN, |gain| {
                self.trace - optimality::greatest_eigenvalue(self.covariance, self.weights, Some((gain, *s)))
            }),
        }
    }

    /// tr(W P), the criterion before any further observation.
    pub fn trace(&self) -> f64 {
        self.trace
    }

    /// C(θ) of every candidate, in order. Chunks run on several cores with the feature `parallel`; the values do not
    /// depend on how many.
    pub fn evaluate<C: AsRef<[f64]> + Sync>(&self, candidates: &[C]) -> Vec<f64> {
        in_chunks(candidates, |chunk| self.evaluate_chunk(chunk))
    }

    /// The criterion of one candidate and what it rests on; an error if it is not a number.
    pub fn appraise(&self, candidate: &[f64]) -> Result<Appraisal, SelectionError> {
        let (marker, h) = jacobian::jacobian(self.chain, self.layout, candidate);
        let spread = &h * self.covariance * h.transpose();
        let marker_covariance = spread.fixed_view::<3, 3>(0, 0).into_owned();
        let chance = self.chance(candidate, &marker, &marker_covariance);
        let value = self.evaluate(&[candidate]).first().copied().filter(|value| value.is_finite());
        let criterion = match value {
            Some(value) => value,
            None if chance == 0.0 && self.trace.is_finite() => self.trace,
            None => return Err(SelectionError::NoFiniteCriterion),
        };
        Ok(Appraisal { criterion, gain: self.trace - criterion, marker, marker_covariance, chance })
    }

    fn evaluate_chunk<C: AsRef<[f64]>>(&self, candidates: &[C]) -> Vec<f64> {
        let noise = isotropic(self.noise_m2);
        let value = |prediction: Prediction| {
            if prediction.chance == 0.0 {
                return f64::INFINITY;
            }
            let gain = |s: nalgebra::Cholesky<f64, U3>| s.solve(&prediction.leverage).trace();
            (prediction.spread + noise).cholesky().map_or(f64::INFINITY, |s| self.trace - prediction.chance * gain(s))
        };
        self.predictions(candidates).into_iter().map(value).collect()
    }

    /// What the belief predicts of the marker at every candidate.
    pub(super) fn predictions<C: AsRef<[f64]>>(&self, candidates: &[C]) -> Vec<Prediction> {
        let m = self.layout.dimension();
        let mut stacked = DMatrix::zeros(m, 3 * candidates.len());
        let markers: Vec<Point3<f64>> = (candidates.iter().enumerate())
            .map(|(index, candidate)| {
                let columns = stacked.generic_view_mut((0, 3 * index), (Dyn(m), U3));
                jacobian::jacobian_transposed_into(self.chain, self.layout, candidate.as_ref(), columns)
            })
            .collect();
        let gains = self.covariance * &stacked;
        let unsure = self.unsure.filter(|_| self.sight.is_some()).map(|covariance| covariance * &stacked);
        (candidates.iter().zip(markers).enumerate())
            .map(|(index, (candidate, marker))| {
                let h_t = stacked.fixed_columns::<3>(3 * index);
                let g_t = gains.fixed_columns::<3>(3 * index);
                let (mut spread, mut leverage) = (Matrix3::zeros(), Matrix3::zeros());
                for k in 0..m {
                    let (h, g) = (h_t.row(k), g_t.row(k));
                    spread += h.transpose() * g;
                    leverage += g.transpose() * g * self.weights.0[k];
                }
                let spread = (spread + spread.transpose()) * 0.5;
                if let Some(metric) = &self.metric {
                    leverage = (g_t.transpose() * (metric * g_t)).fixed_view::<3, 3>(0, 0).into_owned();
                }
                let gain = (self.optimality == Optimality::E)
                    .then(|| DMatrix::from_column_slice(m, 3, g_t.into_owned().as_slice()));
                let doubt = unsure.as_ref().map_or(spread, |gains| {
                    let doubt = (h_t.transpose() * gains.fixed_columns::<3>(3 * index)).into_owned();
                    (doubt + doubt.transpose()) * 0.5
                });
                let chance = self.chance(candidate.as_ref(), &marker, &doubt);
                Prediction { marker, spread, leverage, gain, chance }
            })
            .collect()
    }

    /// p(θ), given the distribution of the predicted marker; 1 where no head watches.
    fn chance(&self, candidate: &[f64], marker: &Point3<f64>, spread: &Matrix3<f64>) -> f64 {
        match self.sight {
            None => 1.0,
            Some(Sight::Predicted(visibility)) => f64::from(visibility.head().sees(marker)),
            Some(Sight::Chance(visibility, limits)) => visibility.chance(&scaled(candidate, limits), marker, spread),
        }
    }
}

/// A configuration as its place in the joint box, scaled to the unit cube.
pub(super) fn scaled(configuration: &[f64], limits: &[(f64, f64)]) -> Vec<f64> {
    configuration.iter().zip(limits).map(|(q, (lower, upper))| (q - lower) / (upper - lower)).collect()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::kinematics::laws::random_chain;

    fn random_belief(seed: u64) -> (Belief, Weights, ChaCha8Rng) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let chain = random_chain(&mut rng, 6);
        let layout = Arc::new(TangentLayout::new(&chain.joints, &[], true));
        let m = layout.dimension();
        let root = DMatrix::from_fn(m, m, |_, _| rng.random_range(-0.5..0.5));
        let covariance = &root * root.transpose() + DMatrix::identity(m, m) * 1e-3;
        let prior_sd = DVector::from_fn(m, |_, _| rng.random_range(0.1..2.0));
        let units =
            if seed.is_multiple_of(2) { CriterionUnits::Prior } else { CriterionUnits::CharacteristicLength(0.3) };
        let weights = Weights::new(units, &layout, &prior_sd);
        (Belief { chain, layout, covariance: Some(covariance), noise_m2: 1e-2, alternatives: Vec::new() }, weights, rng)
    }

    /// The posterior that the criterion abbreviates, built the long way.
    fn trace_of_posterior(belief: &Belief, weights: &Weights, theta: &[f64]) -> f64 {
        let p = belief.covariance.as_ref().expect("a covariance");
        let (_, h) = jacobian::jacobian(&belief.chain, &belief.layout, theta);
        let information = p.clone().try_inverse().expect("positive") + h.transpose() * &h / belief.noise_m2;
        weights.trace(&information.try_inverse().expect("positive"))
    }

    #[test]
    fn equals_the_weighted_trace_of_the_posterior() {
        for seed in 0..40 {
            let (belief, weights, mut rng) = random_belief(seed);
            let criterion = ACriterion::new(&belief, &weights).expect("a covariance");
            let candidates: Vec<Vec<f64>> =
                (0..7).map(|_| (0..6).map(|_| rng.random_range(-2.0..2.0)).collect()).collect();
            for (value, theta) in criterion.evaluate(&candidates).iter().zip(&candidates) {
                let expected = trace_of_posterior(&belief, &weights, theta);
                assert!((value - expected).abs() < 1e-8 * criterion.trace(), "seed {seed}: {value} {expected}");
                assert!(*value <= criterion.trace());
            }
        }
    }

    #[test]
    fn batches_equal_single_evaluations_to_the_last_bit_of_the_sum() {
        let (belief, weights, mut rng) = random_belief(7);
        let criterion = ACriterion::new(&belief, &weights).expect("a covariance");
        let candidates: Vec<Vec<f64>> =
            (0..150).map(|_| (0..6).map(|_| rng.random_range(-2.0..2.0)).collect()).collect();
        let batch = criterion.evaluate(&candidates);
        for (value, theta) in batch.iter().zip(&candidates) {
            let single = criterion.evaluate(std::slice::from_ref(theta))[0];
            assert!((value - single).abs() <= 1e-12 * criterion.trace());
        }
        assert_eq!(batch, criterion.evaluate(&candidates));
    }

    #[test]
    fn weights_follow_the_units() {
        let chain = random_chain(&mut ChaCha8Rng::seed_from_u64(9), 5);
        let layout = TangentLayout::new(&chain.joints, &[], true);
        let sd = DVector::from_element(layout.dimension(), 0.5);
        assert!(Weights::new(CriterionUnits::Prior, &layout, &sd).0.iter().all(|w| *w == 4.0));
        let weights = Weights::new(CriterionUnits::CharacteristicLength(0.1), &layout, &sd);
        let marker = layout.marker().expect("learned");
        assert!((weights.0[marker.start] - 100.0).abs() < 1e-9);
        assert_eq!(weights.0[layout.direction(0).expect("learned").start], 1.0);
    }
}
