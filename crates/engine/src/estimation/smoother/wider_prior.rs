//! Widening the prior of a description that is further off than stated.
//!
//! A prior that is too narrow pulls the estimate away from what was measured, and the noise seems large. That is a wrong account wherever
//! the same readings are explained to their nominal noise by axes that are further off. So while noise is larger than is usual, the prior
//! of axes and of zeros is tried with several times its deviations, from the nominal noise on, and of the accounts that one is kept which
//! has most evidence,
//!
//! ```text
//! ln p = −E − ½ ln det Λ − ½ ln det P₀ − Σ q d ln s + ln P(f)
//! ```
//!
//! with f the factor, and the rest as in [`robust`](super::robust). The wider prior must do with the nominal noise, or less: with few
//! equations it would explain them to any noise. A prior is only ever widened: that a description is better than stated is no reason to
//! trust it more.

use nalgebra::DMatrix;

use super::{Smoother, THOROUGH};
use crate::{elementary::ln, model::Block};

/// The factors by which a description may be further off than stated.
const FACTORS: [f64; 3] = [1.0, 3.0, 10.0];
/// ln P(f) of a factor larger than the one so far.
const LOG_CHANCE: f64 = -3.0;
/// The multiple of its nominal size beyond which noise is larger than usual.
const UNUSUAL: f64 = 2.0;
/// Movements between two trials, as a share of those so far.
const SHARE: u64 = 8;

impl Smoother {
    /// Widens the prior of axes and zeros where that explains more.
    pub(super) fn doubt_prior(&mut self) {
        let is_large = self.posterior.scales.iter().any(|scale| *scale > UNUSUAL);
        let is_due = self.movements >= self.prior_doubted_at + 1 + self.prior_doubted_at / SHARE;
        if !is_large || !is_due || self.scaled.is_some() || self.posterior.prior.is_vague() {
            return;
        }
        self.prior_doubted_at = self.movements;
        // With the prior as it is, too: noise may be too large for another reason.
        let factors = FACTORS.into_iter().filter(|factor| *factor >= self.widened);
        let trials: Vec<(f64, Self)> = factors.filter_map(|factor| self.with_wider_prior(factor)).collect();
        let more =
            |(gain, trial): (f64, Self)| (gain + trial.evidence_beside(self) - self.evidence_beside(&trial), trial);
        let best = trials.into_iter().map(more).max_by(|a, b| a.0.total_cmp(&b.0));
        if let Some((_, trial)) = best.filter(|(more, _)| *more > 0.0) {
            *self = trial;
            self.learn_noise();
        }
    }

    /// This smoother with the prior of axes and zeros widened by `factor`, and what that adds to the evidence beside the
    /// likelihood; `None` if no mode is found.
    fn with_wider_prior(&self, factor: f64) -> Option<(f64, Self)> {
        let layout = self.belief.layout.clone();
        let is_described = |block: &Block| matches!(block, Block::Axis(_) | Block::Offset(_));
        let places: Vec<usize> =
            layout.blocks().filter(|(block, _)| is_described(block)).flat_map(|(_, place)| place).collect();
        if places.is_empty() {
            return None;
        }
        let by = factor / self.widened;
        let covariance = self.posterior.prior.covariance();
        let size = |k: usize| if places.contains(&k) { by } else { 1.0 };
        let wider =
            DMatrix::from_fn(covariance.nrows(), covariance.ncols(), |i, j| covariance[(i, j)] * size(i) * size(j));
        let mut trial = self.clone();
        trial.posterior.prior = self.posterior.prior.with_covariance(&layout, wider).ok()?;
        trial.posterior.scales.iter_mut().for_each(|scale| *scale = scale.min(1.0));
        trial.widened = factor;
        let start = &self.hypotheses.modes.first()?.state;
        trial.hypotheses.modes = vec![trial.posterior.mode_from_afar(start, &layout, THOROUGH).ok()?];
        let chance = if by > 1.0 { LOG_CHANCE } else { 0.0 };
        Some((chance - places.len() as f64 * ln(by), trial))
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::{DMatrix, DVector};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::{
        estimation::{Estimator, HypothesisSettings},
        model::{Layout, Prior, State, random::random_arm},
        sensing::{Loss, MeasurementModel},
    };

    const SIGMA: f64 = 5e-4;
    const JOINTS: usize = 5;
    const MOVEMENTS: usize = 24;

    /// An arm that is described so many times as badly as is said, and what is believed of it after some random movements.
    fn learned(seed: u64, off: f64, loss: Loss) -> (State, Smoother) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let guess = random_arm(&mut rng, JOINTS);
        let layout = Layout::new(&guess, (0..JOINTS).map(Block::Axis).chain([Block::Base, Block::Target(0)]));
        let mut deviations = DVector::from_element(layout.dimension(), 0.3);
        let axes = layout.blocks().filter(|(block, _)| matches!(block, Block::Axis(_)));
        axes.flat_map(|(_, place)| place).for_each(|k| deviations[k] = 5e-3);
        let prior = Prior::with_deviations(guess.clone(), &layout, &deviations).expect("a prior");
        let mut truth = prior.draw(&layout, &mut rng);
        let wide = Prior::with_deviations(guess, &layout, &(&deviations * off)).expect("a prior");
        truth.joints = wide.draw(&layout, &mut rng).joints;
        let measurement_model = Arc::new(MeasurementModel::tracker(SIGMA));
        let settings = HypothesisSettings { kept: 4, spawned: 4 };
        let mut smoother = Smoother::new(prior, Arc::new(layout), measurement_model.clone(), settings, rng.clone())
            .with_loss(loss)
            .with_unknown_noise(vec![true])
            .doubting_prior();
        for _ in 0..MOVEMENTS {
            let theta: Vec<f64> = (0..JOINTS).map(|_| rng.random_range(-1.5..1.5)).collect();
            let noise: Vec<f64> = (0..3).map(|_| rng.sample(rand_distr::StandardNormal)).collect();
            smoother.correct(&theta, &measurement_model.observe(&truth, &theta, &noise)).expect("absorbed");
        }
        (truth, smoother)
    }

    /// Mean distance of predicted and true marker at new postures, m.
    fn error(truth: &State, state: &State, rng: &mut ChaCha8Rng) -> f64 {
        let one = |_| {
            let theta: Vec<f64> = (0..JOINTS).map(|_| rng.random_range(-1.5..1.5)).collect();
            (state.marker_at(&theta) - truth.marker_at(&theta)).norm()
        };
        (0..100).map(one).sum::<f64>() / 100.0
    }

    /// A description that is eight times as far off as was said does not look like noise of millimetres, nor is what it hides expected.
    #[test]
    fn a_description_far_off_is_not_taken_for_noise() {
        for (seed, loss) in (1001..=1006).flat_map(|seed| [(seed, Loss::None), (seed, Loss::MIXTURE)]) {
            let (truth, smoother) = learned(seed, 8.0, loss);
            let scale = smoother.noise()[0].scale;
            let found = error(&truth, &smoother.belief().state, &mut ChaCha8Rng::seed_from_u64(1));
            let said = format!("seed {seed}, {loss:?}: {found} m, {scale} of the noise");
            assert!(found < 4.0 * SIGMA && (0.5..1.6).contains(&scale), "{said}");
            assert!(smoother.model_error_m() < SIGMA, "{said}");
        }
    }

    /// One that is as good as was said stays so.
    #[test]
    fn a_description_as_good_as_said_stays_so() {
        for seed in 1001..=1012 {
            let (_, smoother) = learned(seed, 1.0, Loss::MIXTURE);
            assert_eq!(smoother.widened, 1.0, "seed {seed}");
        }
    }

    /// What is widened is the prior of axes alone.
    #[test]
    fn the_prior_of_other_blocks_stays() {
        let (_, smoother) = learned(1001, 8.0, Loss::MIXTURE);
        assert!(smoother.widened > 1.0);
        let layout = smoother.belief().layout.clone();
        let (before, after) = (smoother.original.covariance(), smoother.posterior.prior.covariance());
        let expected = DMatrix::from_fn(before.nrows(), before.ncols(), |i, j| {
            let of_axis =
                |k: usize| layout.blocks().any(|(block, place)| matches!(block, Block::Axis(_)) && place.contains(&k));
            let size = |k| if of_axis(k) { smoother.widened } else { 1.0 };
            before[(i, j)] * size(i) * size(j)
        });
        assert!((after - &expected).amax() < 1e-12 * expected.amax());
    }
}
