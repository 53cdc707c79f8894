//! The criterion under several hypotheses: the expectation in (7) taken seriously.
//!
//! A belief with alternatives is a mixture of states xⱼ with weights πⱼ and covariances Pⱼ. Its error has two parts,
//! the spread within the hypotheses and that between them:
//!
//! ```text
//! tr(W P) = Σⱼ πⱼ tr(W Pⱼ) + Σⱼ<ₖ πⱼ πₖ ‖xⱼ − xₖ‖²_W
//! ```
//!
//! A movement shrinks the first as in [`Criterion`], and the second as far as it tells the hypotheses apart. For two
//! hypotheses that predict the readings as N(hⱼ, Sⱼ) and N(hₖ, Sₖ) the chance of confusing them falls with the
//! Bhattacharyya distance, of which the term of the means counts here (the other, of the covariances, is small where these
//! are alike),
//!
//! ```text
//! C(θ) = Σⱼ πⱼ [tr(W Pⱼ) − pⱼ tr(Sⱼ⁻¹ Gⱼ W Gⱼᵀ)] + Σⱼ<ₖ πⱼ πₖ ‖xⱼ − xₖ‖²_W (1 − p̄ (1 − e^{−B}))
//! B = ⅛ (hⱼ − hₖ)ᵀ S̄⁻¹ (hⱼ − hₖ),   S̄ = (Sⱼ + Sₖ)/2
//! ```
//!
//! so both parts are in the same units, and nothing is left to tune between them. pⱼ is the chance of being seen.

use std::sync::Arc;

use nalgebra::DMatrix;

use super::{
    Appraisal, Criterion, Optimality, SelectionError, Sight, Weights,
    criterion::{Shown, Slope},
    prediction::{Predictions, told_apart},
    setting::Setting,
    views::Views,
};
use crate::{
    elementary::{exp, ln, ln_1p},
    estimation::Belief,
    model::Workspace,
    parallel::{in_chunks, in_turn},
    sensing::MeasurementModel,
};

/// The criterion under a belief and its alternatives.
pub struct MixtureCriterion<'a> {
    hypotheses: Vec<(f64, Criterion<'a>)>,
    /// Pairs of hypotheses, and πⱼ πₖ ‖xⱼ − xₖ‖²_W.
    pairs: Vec<(usize, usize, f64)>,
    measurement_model: &'a MeasurementModel,
    before: f64,
}

/// What is expected of one movement.
#[derive(Default)]
pub(super) struct Expected {
    /// By hypothesis the chance that it is seen.
    pub chances: Vec<f64>,
    /// By pair of hypotheses how far it tells them apart, B.
    pub told: Vec<f64>,
    /// By hypothesis Hᵀ, whitened, where that is known already.
    pub rows: Option<Vec<DMatrix<f64>>>,
}

impl<'a> MixtureCriterion<'a> {
    /// The criterion at `belief`, which must hold a covariance, under all its hypotheses; `workspace` serves criterion I
    /// alone. [`Belief::truncate`] leaves the heaviest.
    ///
    /// # Errors
    ///
    /// [`SelectionError::NoCovariance`] if the belief holds no covariance.
    pub fn new(
        belief: &'a Belief,
        weights: &'a Weights,
        optimality: Optimality,
        workspace: &Workspace,
    ) -> Result<Self, SelectionError> {
        Self::over(belief, weights, optimality, workspace, &Setting::new(belief, weights, optimality, workspace))
    }

    /// The same where the hypotheses stand as they do in `setting`.
    pub(super) fn over(
        belief: &'a Belief,
        weights: &'a Weights,
        optimality: Optimality,
        workspace: &Workspace,
        setting: &Setting,
    ) -> Result<Self, SelectionError> {
        let covariance = belief.covariance.as_ref().ok_or(SelectionError::NoCovariance)?;
        let others = belief.alternatives.iter().map(|of| (of.weight, &of.state, &of.covariance));
        let all = std::iter::once((belief.weight(), &belief.state, covariance)).chain(others);
        let hypotheses: Vec<(f64, Criterion<'a>)> = all
            .zip(&setting.points)
            .map(|((weight, state, covariance), points)| {
                let criterion = Criterion::measuring(points.clone(), belief, state, covariance, weights);
                (weight, if optimality == Optimality::A { criterion } else { criterion.by(optimality, workspace) })
            })
            .collect();
        let pairs = setting.pairs.clone();
        let within: f64 = hypotheses.iter().map(|(weight, criterion)| weight * criterion.before()).sum();
        let before = within + pairs.iter().map(|pair| pair.2).sum::<f64>();
        Ok(Self { hypotheses, pairs, measurement_model: &belief.measurement_model, before })
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
            let still = pair.2 * exp(-told);
            self.before -= pair.2 - still;
            pair.2 = still;
        }
        self
    }

    /// What is expected of one candidate.
    pub(super) fn expectations(&self, candidate: &[f64]) -> Expected {
        let certain = || vec![1.0; self.hypotheses.len()];
        if self.pairs.is_empty() && self.hypotheses.iter().all(|(_, criterion)| criterion.sees_all()) {
            return Expected { chances: certain(), ..Expected::default() };
        }
        let shown = self.hypotheses.iter().map(|(_, criterion)| criterion.shown(candidate));
        if let Some(shown) = shown.collect::<Option<Vec<Shown<'_>>>>() {
            let distance = |&(j, k, _): &(usize, usize, f64)| shown[j].distance(&shown[k], self.measurement_model);
            let told = self.pairs.iter().map(|pair| distance(pair).min(-ln(CONFUSED))).collect();
            return Expected { chances: certain(), told, rows: Some(shown.iter().map(Shown::rows).collect()) };
        }
        let predicted = self.predictions(&[candidate]);
        let told = self.pairs.iter().map(|&(j, k, _)| {
            let chance = 0.5 * (predicted[j].chance(0) + predicted[k].chance(0));
            let told = told_apart(self.measurement_model, &predicted[j], &predicted[k], 0);
            -ln_1p(-(chance * told).min(1.0 - CONFUSED))
        });
        let chances = predicted.iter().map(|prediction| prediction.chance(0)).collect();
        Expected { chances, told: told.collect(), rows: None }
    }

    /// The same where a head watches.
    pub fn watched(mut self, sight: Sight<'a>) -> Self {
        self.hypotheses = self.hypotheses.into_iter().map(|(weight, c)| (weight, c.watched(Some(sight)))).collect();
        self
    }

    /// The same with what states drawn from every hypothesis would see.
    pub(super) fn watched_by(mut self, sight: Sight<'a>, views: &[Option<Arc<Views>>]) -> Self {
        let pairs = self.hypotheses.into_iter().zip(views);
        self.hypotheses = pairs.map(|((weight, c), views)| (weight, c.watched_by(sight, views.clone()))).collect();
        self
    }

    /// The criterion of the mixture before any further observation; tr(W P) for criterion A.
    pub fn before(&self) -> f64 {
        self.before
    }

    /// C(θ) of every candidate, in order. The values do not depend on the number of cores.
    pub fn evaluate<C: AsRef<[f64]> + Sync>(&self, candidates: &[C]) -> Vec<f64> {
        in_chunks(candidates, |chunk| self.evaluate_chunk(chunk))
    }

    /// The same on this thread alone.
    pub fn evaluate_here<C: AsRef<[f64]>>(&self, candidates: &[C]) -> Vec<f64> {
        in_turn(candidates, |chunk| self.evaluate_chunk(chunk))
    }

    /// The criterion of one candidate and what it rests on; the marker is predicted by the estimate.
    ///
    /// # Errors
    ///
    /// [`SelectionError::NoFiniteCriterion`] if the criterion at the candidate is not finite, unless the marker is
    /// certainly out of view there.
    pub fn appraise(&self, candidate: &[f64]) -> Result<Appraisal, SelectionError> {
        let (_, estimate) = self.hypotheses.first().ok_or(SelectionError::NoCovariance)?;
        let value = self.evaluate(&[candidate]).first().copied().unwrap_or(f64::NAN);
        estimate.appraisal(candidate, self.before, value)
    }

    /// Whether derivatives by the joints' readings are to be had. They are not where something may stay unseen, where something
    /// else than points is measured, and by criterion E: there only differences tell.
    pub(super) fn has_slope(&self) -> bool {
        self.hypotheses.iter().all(|(_, criterion)| criterion.has_slope())
    }

    /// C(θ) of a candidate, and its derivative by every joint's reading (rad or m); `None` without [slopes](Self::has_slope), and
    /// where the value is no number.
    pub(super) fn slope(&self, candidate: &[f64]) -> Option<(f64, Vec<f64>)> {
        let slopes = self.hypotheses.iter().map(|(weight, criterion)| criterion.slope(*weight, candidate));
        let mut slopes = slopes.collect::<Option<Vec<Slope<'_>>>>()?;
        let mut gain: f64 = self.hypotheses.iter().zip(&slopes).map(|((weight, _), slope)| weight * slope.gain()).sum();
        for &(j, k, between) in self.pairs_left() {
            let (before, rest) = slopes.split_at_mut(k);
            gain += between * before[j].tell_apart(&mut rest[0], self.measurement_model, between);
        }
        let mut gradient = vec![0.0; candidate.len()];
        slopes.iter_mut().for_each(|slope| slope.add_to(&mut gradient));
        Some((self.before - gain, gradient))
    }

    /// Pairs of hypotheses of which it still counts whether they are told apart.
    fn pairs_left(&self) -> impl Iterator<Item = &(usize, usize, f64)> {
        self.pairs.iter().filter(|pair| pair.2 > SPENT * self.before)
    }

    fn predictions<C: AsRef<[f64]>>(&self, candidates: &[C]) -> Vec<Predictions> {
        self.hypotheses.iter().map(|(_, criterion)| criterion.predictions(candidates)).collect()
    }

    fn evaluate_chunk<C: AsRef<[f64]>>(&self, candidates: &[C]) -> Vec<f64> {
        let predicted = self.predictions(candidates);
        let gains: Vec<Vec<f64>> =
            self.hypotheses.iter().zip(&predicted).map(|((_, criterion), of)| criterion.gains(of)).collect();
        (0..candidates.len()).map(|index| self.value(&predicted, &gains, index)).collect()
    }

    fn value(&self, predicted: &[Predictions], gains: &[Vec<f64>], index: usize) -> f64 {
        if predicted.iter().all(|of| of.chance(index) == 0.0) {
            return f64::INFINITY;
        }
        let mut gain = 0.0;
        for (((weight, _), of), gains) in self.hypotheses.iter().zip(predicted).zip(gains) {
            if !gains[index].is_finite() {
                return f64::INFINITY;
            }
            gain += weight * of.chance(index) * gains[index];
        }
        for &(j, k, between) in self.pairs_left() {
            let told = told_apart(self.measurement_model, &predicted[j], &predicted[k], index);
            gain += between * 0.5 * (predicted[j].chance(index) + predicted[k].chance(index)) * told;
        }
        self.before - gain
    }
}

/// The chance that two hypotheses are confused after one movement is never less.
const CONFUSED: f64 = 1e-12;
/// What is left between two hypotheses that a plan will have told apart counts for nothing, below this share of the criterion:
/// rounding is a hundred times as much.
const SPENT: f64 = 1e-18;

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::{DMatrix, DVector};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::{
        estimation::Alternative,
        model::{Layout, random::random_arm},
        selection::{CriterionUnits, plan::Plan},
    };

    fn case(seed: u64) -> (Belief, Weights, Vec<Vec<f64>>) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let state = random_arm(&mut rng, 4);
        let layout = Arc::new(Layout::of_arm(&state, &[], false));
        let m = layout.dimension();
        let root = DMatrix::from_fn(m, m, |_, _| rng.random_range(-0.3..0.3));
        let covariance = &root * root.transpose() + DMatrix::identity(m, m) * 1e-3;
        let weights = Weights::new(CriterionUnits::CharacteristicLength(0.5), &layout, &DVector::from_element(m, 1.0));
        let candidates = (0..40).map(|_| (0..4).map(|_| rng.random_range(-2.0..2.0)).collect()).collect();
        let belief = Belief::new(state, layout, Arc::new(MeasurementModel::tracker(0.03))).with_covariance(covariance);
        (belief, weights, candidates)
    }

    /// Between two exactly known rivals only telling them apart counts: where both predict the same marker a movement
    /// is worth nothing, and where they differ by far it settles the matter.
    #[test]
    fn rivals_are_worth_telling_apart() {
        let (mut belief, weights, candidates) = case(3);
        let m = belief.layout.dimension();
        let tiny = DMatrix::identity(m, m) * 1e-12;
        let rival = belief.state.retract(&belief.layout, &DVector::from_element(m, 0.3));
        belief.covariance = Some(tiny.clone());
        belief.alternatives = vec![Alternative { weight: 0.4, state: rival.clone(), covariance: tiny }];
        let mixture =
            MixtureCriterion::new(&belief, &weights, Optimality::A, &Workspace::default()).expect("a covariance");
        // θ = 0 shows the marker where it is known to be.
        let nothing = mixture.evaluate(&[vec![0.0; 4]])[0];
        assert!((nothing - mixture.before()).abs() < 1e-6 * mixture.before());
        for (theta, value) in candidates.iter().zip(mixture.evaluate(&candidates)) {
            let apart = (rival.marker_at(theta) - belief.state.marker_at(theta)).norm();
            assert!(value <= mixture.before());
            assert!(apart < 0.5 || value < 0.01 * mixture.before(), "{apart} m apart: {value}");
        }
    }

    fn rivals(belief: &Belief) -> Vec<Alternative> {
        let covariance = belief.covariance.as_ref().expect("kept") * 0.01;
        let rival = |by: f64| {
            let state = belief.state.retract(&belief.layout, &DVector::from_element(belief.layout.dimension(), by));
            Alternative { weight: 0.3, state, covariance: covariance.clone() }
        };
        [0.02, -0.1].map(rival).to_vec()
    }

    /// What a plan expects of points is what predictions of any sensor say.
    #[test]
    fn points_are_expected_as_any_reading_is() {
        for seed in 0..5 {
            let (mut belief, weights, candidates) = case(seed);
            belief.alternatives = rivals(&belief);
            let mixture =
                MixtureCriterion::new(&belief, &weights, Optimality::A, &Workspace::default()).expect("a covariance");
            for theta in &candidates[..8] {
                let Expected { chances, told, rows } = mixture.expectations(theta);
                assert_eq!((chances.as_slice(), told.len()), (&[1.0; 3][..], 3));
                let predicted = mixture.predictions(&[theta]);
                for (&(j, k, _), told) in mixture.pairs.iter().zip(told) {
                    let confused = 1.0 - told_apart(mixture.measurement_model, &predicted[j], &predicted[k], 0);
                    assert!(((-told).exp() - confused).abs() < 1e-9, "{told} {confused}");
                }
                let states = [&belief.state, &belief.alternatives[0].state, &belief.alternatives[1].state];
                for (state, rows) in states.into_iter().zip(rows.expect("of points")) {
                    assert!((rows - belief.measurement_model.jacobian(state, &belief.layout, theta)).amax() < 1e-9);
                }
            }
        }
    }

    /// The derivative by every joint is that of central differences, with and without rivals; criterion E has none.
    #[test]
    fn gradients_are_those_of_central_differences() {
        for (seed, optimality) in
            (0..12).map(|seed| (seed, [Optimality::A, Optimality::D, Optimality::I][seed as usize % 3]))
        {
            let (mut belief, weights, candidates) = case(seed);
            let workspace = Workspace::from(candidates.clone());
            if seed % 2 == 1 {
                belief.alternatives = rivals(&belief);
            }
            let mixture = MixtureCriterion::new(&belief, &weights, optimality, &workspace).expect("a covariance");
            for theta in &candidates[..5] {
                let (value, gradient) = mixture.slope(theta).expect("of points");
                let apart = (value - mixture.evaluate(&[theta])[0]).abs();
                assert!(apart < 1e-10 * mixture.before().abs(), "{seed} {optimality:?}: {value}, {apart:e} apart");
                for (joint, slope) in gradient.iter().enumerate() {
                    let moved = [1e-5, -1e-5].map(|step| {
                        let mut moved = theta.clone();
                        moved[joint] += step;
                        moved
                    });
                    let values = mixture.evaluate(&moved);
                    let difference = (values[0] - values[1]) / 2e-5;
                    let scale = mixture.before().abs() + slope.abs();
                    assert!((slope - difference).abs() < 1e-5 * scale, "{seed} {optimality:?}: {slope} {difference}");
                }
            }
            let worst = MixtureCriterion::new(&belief, &weights, Optimality::E, &workspace).expect("a covariance");
            assert!(worst.slope(&candidates[0]).is_none());
        }
    }

    /// A pose added to a plan and taken out again leaves the belief as it was, also where the sensor is so good that a
    /// downdate would cancel all digits.
    #[test]
    fn plans_are_updated_and_downdated_exactly() {
        for (seed, sigma) in (0..30).map(|seed| (seed, [0.03, 1e-4, 1e-6][seed as usize % 3])) {
            let (mut belief, weights, candidates) = case(seed);
            belief.measurement_model = Arc::new(MeasurementModel::tracker(sigma));
            let now = Plan::new(&belief, 4);
            let mut plan = now.clone();
            for theta in &candidates[..5] {
                plan.add(theta.clone(), Expected { chances: vec![0.8], ..Expected::default() });
            }
            let trace = |plan: &Plan| weights.trace(plan.after.covariance.as_ref().expect("kept"));
            assert!(trace(&plan) < trace(&now));
            for index in 0..5 {
                let mut without = plan.clone();
                without.remove(index);
                if let Some(told) = plan.trace_without(index, &weights) {
                    let wanted = trace(&without);
                    assert!((told - wanted).abs() < 1e-9 * wanted, "seed {seed}: {told:e} {wanted:e}");
                }
            }
            (0..5).for_each(|_| drop(plan.remove(0)));
            let change = (trace(&plan) / trace(&now) - 1.0).abs();
            // What cancels leaves its rounding, magnified by how far the updates had shrunk P.
            assert!(change < 1e-5, "seed {seed}: {change:e}");
        }
    }
}
