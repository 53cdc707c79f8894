//! The criterion under several hypotheses: the expectation in (7) taken seriously.
//!
//! A belief with alternatives is a mixture of chains xⱼ with weights πⱼ and covariances Pⱼ. Its error has two parts,
//! the spread within the hypotheses and that between them:
//!
//! ```text
//! tr(W P) = Σⱼ πⱼ tr(W Pⱼ) + Σⱼ<ₖ πⱼ πₖ ‖xⱼ − xₖ‖²_W
//! ```
//!
//! A movement shrinks the first as in [`ACriterion`], and the second as far as it tells the hypotheses apart. For two
//! hypotheses that predict the marker as N(hⱼ, Sⱼ) and N(hₖ, Sₖ) the chance of confusing them falls with the
//! Bhattacharyya distance,
//!
//! ```text
//! C(θ) = Σⱼ πⱼ [tr(W Pⱼ) − pⱼ tr(Sⱼ⁻¹ Gⱼ W Gⱼᵀ)] + Σⱼ<ₖ πⱼ πₖ ‖xⱼ − xₖ‖²_W (1 − p̄ (1 − e^{−B}))
//! B = ⅛ (hⱼ − hₖ)ᵀ S̄⁻¹ (hⱼ − hₖ),   S̄ = (Sⱼ + Sₖ)/2
//! ```
//!
//! so both parts are in the same units, and nothing is left to tune between them. pⱼ is the chance of being seen.

use nalgebra::{Matrix3, Point3};

use super::{
    ACriterion, Optimality, SelectionError, Sight, Weights,
    criterion::{Prediction, in_chunks},
};
use crate::{
    estimation::Belief,
    kinematics::{Chain, Joint, TangentLayout},
    sensing::isotropic,
};

/// The criterion under a belief and its alternatives.
pub struct Outlook<'a> {
    hypotheses: Vec<(f64, ACriterion<'a>)>,
    /// Pairs of hypotheses, and πⱼ πₖ ‖xⱼ − xₖ‖²_W.
    pairs: Vec<(usize, usize, f64)>,
    noise_m2: f64,
    trace: f64,
}

/// Hypotheses that the criterion looks at, the heaviest ones.
const CONSIDERED: usize = 8;

impl<'a> Outlook<'a> {
    /// The criterion at `belief`, which must hold a covariance; `workspace` serves criterion I alone.
    pub fn new(
        belief: &'a Belief,
        weights: &'a Weights,
        optimality: Optimality,
        workspace: &[Vec<f64>],
    ) -> Result<Self, SelectionError> {
        let mut hypotheses = vec![(belief.weight(), ACriterion::new(belief, weights)?)];
        let mut chains = vec![&belief.chain];
        for alternative in belief.alternatives.iter().take(CONSIDERED - 1) {
            let criterion = ACriterion::over(belief, &alternative.chain, &alternative.covariance, weights);
            hypotheses.push((alternative.weight, criterion));
            chains.push(&alternative.chain);
        }
        if optimality != Optimality::A {
            let by = |(weight, criterion): (f64, ACriterion<'a>)| (weight, criterion.by(optimality, workspace));
            hypotheses = hypotheses.into_iter().map(by).collect();
        }
        let total: f64 = hypotheses.iter().map(|(weight, _)| weight).sum();
        hypotheses.iter_mut().for_each(|(weight, _)| *weight /= total);
        let mut pairs = Vec::new();
        for k in 0..chains.len() {
            for j in 0..k {
                let distance = match optimality {
                    Optimality::A | Optimality::E => squared_distance(chains[j], chains[k], &belief.layout, weights),
                    Optimality::I => apart(chains[j], chains[k], workspace),
                    Optimality::D => 1.0,
                };
                pairs.push((j, k, hypotheses[j].0 * hypotheses[k].0 * distance));
            }
        }
        if optimality == Optimality::D {
            // Which hypothesis holds is worth the entropy of the weights, in shares of the pairs.
            let entropy: f64 = hypotheses.iter().map(|(weight, _)| -weight * weight.max(f64::MIN_POSITIVE).ln()).sum();
            let sum: f64 = pairs.iter().map(|pair| pair.2).sum();
            pairs.iter_mut().filter(|_| sum > 0.0).for_each(|pair| pair.2 *= entropy / sum);
        }
        let within: f64 = hypotheses.iter().map(|(weight, criterion)| weight * criterion.trace()).sum();
        let trace = within + pairs.iter().map(|pair| pair.2).sum::<f64>();
        Ok(Self { hypotheses, pairs, noise_m2: belief.noise_m2, trace })
    }

    /// The same with visibility judged by what `today` believes.
    pub(super) fn unsure(mut self, today: &'a Belief) -> Self {
        let others = today.alternatives.iter().map(|alternative| Some(&alternative.covariance));
        let covariances = std::iter::once(today.covariance.as_ref()).chain(others);
        for ((_, criterion), covariance) in self.hypotheses.iter_mut().zip(covariances) {
            if let Some(covariance) = covariance {
                *criterion = criterion.clone().unsure(covariance);
            }
        }
        self
    }

    /// The same after movements that will have told the pairs of hypotheses apart by these B.
    pub(super) fn told(mut self, told: &[f64]) -> Self {
        for (pair, told) in self.pairs.iter_mut().zip(told) {
            let still = pair.2 * (-told).exp();
            self.trace -= pair.2 - still;
            pair.2 = still;
        }
        self
    }

    /// The chance of being seen under every hypothesis, and B of every pair, at one candidate.
    pub(super) fn expectations(&self, candidate: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let predicted: Vec<Prediction> =
            self.hypotheses.iter().flat_map(|(_, criterion)| criterion.predictions(&[candidate])).collect();
        let covariances: Vec<Matrix3<f64>> = predicted.iter().map(|prediction| self.covariance(prediction)).collect();
        let told = self.pairs.iter().map(|&(j, k, _)| {
            let chance = 0.5 * (predicted[j].chance + predicted[k].chance);
            let told =
                told_apart(&predicted[j].marker, &predicted[k].marker, &((covariances[j] + covariances[k]) * 0.5));
            -(-(chance * told).min(1.0 - 1e-12)).ln_1p()
        });
        (predicted.iter().map(|prediction| prediction.chance).collect(), told.collect())
    }

    /// S of a hypothesis.
    fn covariance(&self, prediction: &Prediction) -> Matrix3<f64> {
        prediction.spread + isotropic(self.noise_m2)
    }

    /// The same where a head watches.
    pub fn watched(mut self, sight: Sight<'a>) -> Self {
        self.hypotheses = self.hypotheses.into_iter().map(|(weight, c)| (weight, c.watched(sight))).collect();
        self
    }

    /// tr(W P) of the mixture, the criterion before any further observation.
    pub fn trace(&self) -> f64 {
        self.trace
    }

    /// C(θ) of every candidate, in order. The values do not depend on the number of cores.
    pub fn evaluate<C: AsRef<[f64]> + Sync>(&self, candidates: &[C]) -> Vec<f64> {
        in_chunks(candidates, |chunk| self.evaluate_chunk(chunk))
    }

    fn evaluate_chunk<C: AsRef<[f64]>>(&self, candidates: &[C]) -> Vec<f64> {
        let predictions: Vec<Vec<Prediction>> =
            self.hypotheses.iter().map(|(_, criterion)| criterion.predictions(candidates)).collect();
        (0..candidates.len())
            .map(|index| {
                let predicted: Vec<&Prediction> = predictions.iter().map(|of| &of[index]).collect();
                self.value(&predicted)
            })
            .collect()
    }

    fn value(&self, predicted: &[&Prediction]) -> f64 {
        if predicted.iter().all(|prediction| prediction.chance == 0.0) {
            return f64::INFINITY;
        }
        let covariances: Vec<Matrix3<f64>> = predicted.iter().map(|prediction| self.covariance(prediction)).collect();
        let mut gain = 0.0;
        for (((weight, criterion), prediction), s) in self.hypotheses.iter().zip(predicted).zip(&covariances) {
            let taught = criterion.gain(prediction, s);
            if !taught.is_finite() {
                return f64::INFINITY;
            }
            gain += weight * prediction.chance * taught;
        }
        for &(j, k, between) in &self.pairs {
            let told =
                told_apart(&predicted[j].marker, &predicted[k].marker, &((covariances[j] + covariances[k]) * 0.5));
            gain += between * 0.5 * (predicted[j].chance + predicted[k].chance) * told;
        }
        self.trace - gain
    }
}

/// 1 − e^{−B}.
fn told_apart(a: &Point3<f64>, b: &Point3<f64>, covariance: &Matrix3<f64>) -> f64 {
    let difference = a - b;
    covariance.cholesky().map_or(0.0, |s| -(-0.125 * difference.dot(&s.solve(&difference))).exp_m1())
}

/// ‖x − x'‖²_W: squared angles between directions and squared distances between axis points and markers, weighted like
/// tangent coordinates.
fn squared_distance(a: &Chain, b: &Chain, layout: &TangentLayout, weights: &Weights) -> f64 {
    let mut sum = 0.0;
    for (index, (a, b)) in a.joints.iter().zip(&b.joints).enumerate() {
        if let Some(directions) = layout.direction(index) {
            sum += weights.of(directions.start) * a.direction().angle(&b.direction()).powi(2);
        }
        if let (Joint::Revolute(a), Joint::Revolute(b), Some(points)) = (a, b, layout.point(index)) {
            sum += weights.of(points.start) * (a.point - b.point).norm_squared();
        }
    }
    sum + layout.marker().map_or(0.0, |range| weights.of(range.start) * (a.marker - b.marker).norm_squared())
}

/// Mean squared distance of predicted markers over the workspace, m².
fn apart(a: &Chain, b: &Chain, workspace: &[Vec<f64>]) -> f64 {
    let sum: f64 = workspace.iter().map(|theta| (a.marker_at(theta) - b.marker_at(theta)).norm_squared()).sum();
    sum / workspace.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::{DMatrix, DVector};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::{
        estimation::Alternative,
        kinematics::{jacobian::jacobian, laws::random_chain},
        selection::{CriterionUnits, plan::Plan},
    };

    fn case(seed: u64) -> (Belief, Weights, Vec<Vec<f64>>) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let chain = random_chain(&mut rng, 4);
        let layout = Arc::new(TangentLayout::new(&chain.joints, &[], false));
        let m = layout.dimension();
        let root = DMatrix::from_fn(m, m, |_, _| rng.random_range(-0.3..0.3));
        let covariance = &root * root.transpose() + DMatrix::identity(m, m) * 1e-3;
        let weights = Weights::new(CriterionUnits::CharacteristicLength(0.5), &layout, &DVector::from_element(m, 1.0));
        let candidates = (0..40).map(|_| (0..4).map(|_| rng.random_range(-2.0..2.0)).collect()).collect();
        let belief = Belief { chain, layout, covariance: Some(covariance), noise_m2: 1e-3, alternatives: Vec::new() };
        (belief, weights, candidates)
    }

    /// Every criterion against the posterior, built the long way.
    #[test]
    fn one_hypothesis_is_judged_by_its_posterior() {
        for seed in 0..10 {
            let (belief, weights, candidates) = case(seed);
            let p = belief.covariance.clone().expect("kept");
            for optimality in [Optimality::A, Optimality::D, Optimality::E, Optimality::I] {
                let outlook = Outlook::new(&belief, &weights, optimality, &candidates[30..]).expect("a covariance");
                for (value, theta) in outlook.evaluate(&candidates[..10]).iter().zip(&candidates) {
                    let (_, h) = jacobian(&belief.chain, &belief.layout, theta);
                    let information = p.clone().try_inverse().expect("positive") + h.transpose() * &h / 1e-3;
                    let posterior = information.try_inverse().expect("positive");
                    let root = DMatrix::from_fn(p.nrows(), p.nrows(), |i, j| f64::from(i == j) * weights.of(i).sqrt());
                    let expected = match optimality {
                        Optimality::A => weights.trace(&posterior),
                        Optimality::D => 0.5 * posterior.determinant().ln(),
                        Optimality::E => (&root * &posterior * &root).symmetric_eigenvalues().max(),
                        Optimality::I => {
                            let after = Belief { covariance: Some(posterior), ..belief.clone() };
                            let spread = |theta: &Vec<f64>| after.marker_covariance(theta).expect("kept").trace();
                            candidates[30..].iter().map(spread).sum::<f64>() / 10.0
                        }
                    };
                    // The power iteration of E comes near from below.
                    let tolerance = if optimality == Optimality::E { 0.05 } else { 1e-6 };
                    let scale = expected.abs().max(1e-3);
                    assert!((value - expected).abs() < tolerance * scale, "{seed} {optimality:?}: {value} {expected}");
                }
            }
        }
    }

    /// Between two exactly known rivals only telling them apart counts: where both predict the same marker a movement
    /// is worth nothing, and where they differ by far it settles the matter.
    #[test]
    fn rivals_are_worth_telling_apart() {
        let (mut belief, weights, candidates) = case(3);
        let m = belief.layout.dimension();
        let tiny = DMatrix::identity(m, m) * 1e-12;
        let chain = belief.chain.retract(&belief.layout, &DVector::from_element(m, 0.3));
        belief.covariance = Some(tiny.clone());
        belief.alternatives = vec![Alternative { weight: 0.4, chain: chain.clone(), covariance: tiny }];
        let outlook = Outlook::new(&belief, &weights, Optimality::A, &[]).expect("a covariance");
        // θ = 0 shows the marker where it is known to be.
        let nothing = outlook.evaluate(&[vec![0.0; 4]])[0];
        assert!((nothing - outlook.trace()).abs() < 1e-6 * outlook.trace());
        for (theta, value) in candidates.iter().zip(outlook.evaluate(&candidates)) {
            let apart = (chain.marker_at(theta) - belief.chain.marker_at(theta)).norm();
            assert!(value <= outlook.trace());
            assert!(apart < 0.5 || value < 0.01 * outlook.trace(), "{apart} m apart: {value}");
        }
    }

    /// A pose added to a plan and taken out again leaves the belief as it was.
    #[test]
    fn plans_are_updated_and_downdated_exactly() {
        for seed in 0..10 {
            let (belief, weights, candidates) = case(seed);
            let now = Plan::new(&belief, 4);
            let mut plan = now.clone();
            for theta in &candidates[..5] {
                plan.add(theta.clone(), vec![0.8], Vec::new());
            }
            let trace = |plan: &Plan| weights.trace(plan.after.covariance.as_ref().expect("kept"));
            assert!(trace(&plan) < trace(&now));
            (0..5).for_each(|_| drop(plan.remove(0)));
            let change = (trace(&plan) / trace(&now) - 1.0).abs();
            // What cancels leaves its rounding, magnified by how far the updates had shrunk P.
            assert!(change < 1e-5, "seed {seed}: {change:e}");
        }
    }
}
