//! Robust scales of noise, taken from most of the readings.
//!
//! With least squares, one reading of −9999 decides how large noise is, and with noise that large nothing is an outlier; a few
//! readings that happen to be exact make it so small that all others are outliers. So scales that are learned are doubted wherever
//! most readings scatter much less, or much more, than the scale says: the median of their squares, over the median of χ², is a scale
//! that no minority of readings changes, whatever its size. From there modes are searched with Huber's loss, the scale in turn with
//! them (an M-estimator with a scale of its own; Huber and Ronchetti, *Robust Statistics*, 7.8), and then with the usual loss. The
//! result with more evidence is kept,
//!
//! ```text
//! ln p = −E − ½ ln det Λ − Σ q d ln s − Σ (1 − q) d ln s₊
//! ```
//!
//! with q the chance that a reading of d equations is normal, and s₊ the larger of the two scales: where outliers are, they are as
//! far apart by both.

use super::{
    Smoother, THOROUGH,
    mode::Mode,
    noise::LEAST_SCALE,
    posterior::{Fit, Posterior},
};
use crate::{
    elementary::ln,
    model::{Layout, Links, State},
    most::middle,
    sensing::{Graduated, Loss, present},
};

/// The ratio below which the scatter of most readings puts a learned scale in doubt.
const DOUBTFUL: f64 = 0.4;
/// The degrees of freedom from which on most readings tell a scale.
const LEAST_DEGREES: f64 = 6.0;
/// The most rounds in which modes and scales are found in turn.
const ROUNDS: usize = 12;
/// The change of a scale below which it has converged.
const FOUND: f64 = 0.02;
/// The multiple of the median residual within which least squares hold; beyond it a reading pulls as much as one at this
/// distance.
const FAR: f64 = 10.0;

/// The median of χ² of d degrees of freedom (Wilson and Hilferty).
fn median_square(d: usize) -> f64 {
    let d = d as f64;
    d * (1.0 - 2.0 / (9.0 * d)).powi(3)
}

impl Posterior {
    /// A loss that is least squares for all readings but those far from where most are.
    pub fn least_squares(&self, state: &State) -> Graduated {
        let mut squares = Vec::new();
        let mut links = Links::new(state);
        for seen in &self.measurements {
            self.residuals(links.at(&seen.positions), seen, |channel, whitened| {
                squares.push(self.squared(channel, whitened) / present(whitened) as f64);
            });
        }
        let width = FAR * middle(squares).unwrap_or_default().sqrt().max(1.0);
        // Where numbers end there is nothing to be robust against.
        if width.is_finite() { Graduated { loss: Loss::Huber, width } } else { Loss::None.into() }
    }

    /// The scale of most readings at `state`, by kind of noise; `None` where there are none.
    fn common_scales(&self, state: &State) -> Vec<Option<f64>> {
        let mut squares = vec![Vec::new(); self.scales.len()];
        let mut links = Links::new(state);
        for seen in &self.measurements {
            self.residuals(links.at(&seen.positions), seen, |channel, whitened| {
                for (noise, part) in self.noises(channel) {
                    let whitened = whitened[part].iter().filter(|x| !x.is_nan());
                    let (square, d) = whitened.fold((0.0, 0), |(sum, d), x| (sum + x * x, d + 1));
                    squares[noise].push(square / median_square(d));
                }
            });
        }
        squares.into_iter().map(|squares| middle(squares).map(f64::sqrt)).collect()
    }
}

impl Smoother {
    /// Doubts the estimate where the latest readings look like outliers although nothing is settled: a guess that is off by thousands
    /// of σ would reject everything. A mode is then searched from the estimate with a wide loss, beside the modes there are.
    pub(super) fn doubt_estimate(&mut self) {
        let Some(best) = self.hypotheses.modes.iter().max_by(|a, b| a.log_evidence.total_cmp(&b.log_evidence)) else {
            return;
        };
        if !self.posterior.loss.is_robust() || self.is_settled() {
            return;
        }
        let is_rejected = self.posterior.readings_after(self.movements, &best.state).any(|it| it.weight < 0.5);
        let found = is_rejected.then(|| self.posterior.mode_from_afar(&best.state, &self.belief.layout, THOROUGH));
        self.hypotheses.modes.extend(found.and_then(Result::ok));
    }

    /// Learns the scales again from those of most readings, where these differ much, beginning at the heaviest mode and at
    /// `starts`; returns whether the result has more evidence, and was kept.
    pub(super) fn doubt_noise(&mut self, starts: &[&State]) -> bool {
        if !self.posterior.loss.is_robust() || !self.unknown.contains(&true) {
            return false;
        }
        let layout = self.belief.layout.clone();
        let best = self.hypotheses.modes.first();
        let is_doubtful = best.is_none_or(|mode| {
            // Where most readings are taken for outliers, hardly any equation is left that would tell by how much.
            self.is_exceeded(&self.common(mode, &layout))
                || self.falls_short(&self.posterior.common_scales(&mode.state))
        }) || starts.iter().any(|start| self.is_exceeded(&self.posterior.common_scales(start)));
        if !is_doubtful {
            return false;
        }
        let starts = best.map(|mode| &mode.state).into_iter().chain(starts.iter().copied());
        let tried: Vec<Self> = starts.filter_map(|start| self.by_most_readings(start, &layout)).collect();
        let mut revised = false;
        for trial in tried {
            if self.hypotheses.modes.is_empty() || trial.evidence_beside(self) > self.evidence_beside(&trial) {
                (self.posterior, self.hypotheses, self.degrees_of_freedom) =
                    (trial.posterior, trial.hypotheses, trial.degrees_of_freedom);
                revised = true;
            }
        }
        revised
    }

    /// Whether a learned scale is much larger than that of most readings.
    fn is_exceeded(&self, common: &[Option<f64>]) -> bool {
        self.is_off(common, |common, scale| common < DOUBTFUL * scale)
    }

    /// Whether a learned scale is much smaller than that of most readings, which are then taken for outliers.
    fn falls_short(&self, common: &[Option<f64>]) -> bool {
        self.is_off(common, |common, scale| scale < DOUBTFUL * common)
    }

    fn is_off(&self, common: &[Option<f64>], is_off: impl Fn(f64, f64) -> bool) -> bool {
        let mut scales = common.iter().zip(&self.posterior.scales).zip(&self.unknown);
        scales.any(|((common, scale), unknown)| *unknown && common.is_some_and(|common| is_off(common, *scale)))
    }

    /// Sets the learned scales to those of most readings, where these are known.
    fn take_scales(&mut self, common: Vec<Option<f64>>) {
        for ((scale, common), unknown) in self.posterior.scales.iter_mut().zip(common).zip(&self.unknown) {
            if let (Some(common), true) = (common, *unknown) {
                *scale = common.max(LEAST_SCALE);
            }
        }
    }

    /// The scales of most readings at a mode, corrected for what parameters absorb; `None` where hardly any degrees of freedom are
    /// left.
    fn common(&self, mode: &Mode, layout: &Layout) -> Vec<Option<f64>> {
        let Some(absorbed) = self.posterior.absorbed(mode, layout) else { return Vec::new() };
        let equations = self.posterior.fit(&mode.state, layout).into_iter().map(|fit| fit.equations);
        let common = self.posterior.common_scales(&mode.state).into_iter();
        let of = |((common, absorbed), equations): ((Option<f64>, f64), f64)| {
            let degrees_of_freedom = equations - absorbed;
            common
                .filter(|_| degrees_of_freedom >= LEAST_DEGREES)
                .map(|common| common * (equations / degrees_of_freedom).sqrt())
        };
        common.zip(absorbed).zip(equations).map(of).collect()
    }

    /// Learns from a start where most readings are explained.
    fn by_most_readings(&self, start: &State, layout: &Layout) -> Option<Self> {
        let mut trial = self.clone();
        let loss = std::mem::replace(&mut trial.posterior.loss, Loss::Huber);
        let mut state = start.clone();
        // As far as parameters have not explained anything yet, what is left of the readings is no noise.
        trial.take_scales(self.posterior.common_scales(start));
        for _ in 0..ROUNDS {
            let mode = trial.posterior.mode(&state, layout, THOROUGH).ok()?;
            let before = trial.posterior.scales.clone();
            trial.take_scales(trial.common(&mode, layout));
            state = mode.state;
            let change = before.iter().zip(&trial.posterior.scales).map(|(a, b)| ln(a / b).abs()).fold(0.0, f64::max);
            if change < FOUND {
                break;
            }
        }
        trial.posterior.loss = loss;
        let mode = trial.posterior.mode(&state, layout, THOROUGH).ok()?;
        trial.hypotheses.modes.insert(0, mode);
        trial.hypotheses.follow(&trial.posterior, layout);
        trial.hypotheses.condense(self.settings.kept, layout);
        trial.learn_noise();
        (!trial.hypotheses.modes.is_empty()).then_some(trial)
    }

    /// The logarithm of the evidence of the heaviest mode and its scales, compared with those of another.
    pub(super) fn evidence_beside(&self, other: &Self) -> f64 {
        let Some(mode) = self.hypotheses.modes.first() else { return f64::NEG_INFINITY };
        let fits = self.posterior.fit(&mode.state, &self.belief.layout);
        let all = self.posterior.equations_by_noise();
        let of = |((fit, all), (scale, other)): ((&Fit, f64), (&f64, &f64))| {
            let normal = fit.equations;
            -normal * ln(*scale) - (all - normal).max(0.0) * ln(scale.max(*other))
        };
        let scales = self.posterior.scales.iter().zip(&other.posterior.scales);
        mode.log_evidence + fits.iter().zip(all).zip(scales).map(of).sum::<f64>()
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::{DMatrix, Vector3};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::{
        estimation::{Estimator, HypothesisSettings},
        model::{Block, Prior, random::random_arm},
        sensing::{MeasurementModel, Observation},
    };

    const SIGMA: f64 = 3e-4;

    /// Arms whose axes are off by their prior, their base by a metre, and exact readings but for noise.
    fn case(seed: u64, rows: usize) -> (State, Vec<(Vec<f64>, Observation)>, impl Fn() -> Smoother) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let guess = random_arm(&mut rng, 4);
        let layout = Layout::new(&guess, (0..4).map(Block::Axis).chain([Block::Base, Block::Target(0)]));
        let m = layout.dimension();
        let mut covariance = DMatrix::from_diagonal_element(m, m, 1e-4);
        covariance.view_mut((0, 0), (6, 6)).fill_diagonal(0.3);
        let prior = Prior::around(guess, &layout, covariance).expect("a prior");
        let truth = prior.draw(&layout, &mut rng);
        let measurement_model = MeasurementModel::tracker(SIGMA);
        let seen = (0..rows).map(|_| seen_by(&measurement_model, &truth, 1.0, &mut rng)).collect();
        let (layout, assumed) = (Arc::new(layout), Arc::new(measurement_model.assuming(SIGMA * 2.0)));
        let smoother = move || {
            let settings = HypothesisSettings { kept: 8, spawned: 8 };
            let rng = ChaCha8Rng::seed_from_u64(seed + 1);
            Smoother::new(prior.clone(), layout.clone(), assumed.clone(), settings, rng)
                .with_loss(Loss::MIXTURE)
                .with_unknown_noise(vec![true])
        };
        (truth, seen, smoother)
    }

    /// One that searches hardly any other hypothesis, with noise as it is told or learned from that.
    fn plain(
        prior: Prior,
        layout: Layout,
        measurement_model: &Arc<MeasurementModel>,
        spawned: usize,
        unknown: bool,
    ) -> Smoother {
        let settings = HypothesisSettings { kept: 2, spawned };
        Smoother::new(prior, Arc::new(layout), measurement_model.clone(), settings, ChaCha8Rng::seed_from_u64(1))
            .with_loss(Loss::MIXTURE)
            .with_unknown_noise(vec![unknown])
    }

    /// A movement, and what is seen of it with so many σ of noise.
    fn seen_by(
        measurement_model: &MeasurementModel,
        truth: &State,
        size: f64,
        rng: &mut ChaCha8Rng,
    ) -> (Vec<f64>, Observation) {
        let theta: Vec<f64> = (0..4).map(|_| rng.random_range(-1.5..1.5)).collect();
        let v: Vec<f64> = (0..3).map(|_| size * rng.sample::<f64, _>(rand_distr::StandardNormal)).collect();
        let observation = measurement_model.observe(truth, &theta, &v);
        (theta, observation)
    }

    fn of(seen: &[(Vec<f64>, Observation)]) -> Vec<(&[f64], &Observation)> {
        seen.iter().map(|(theta, observation)| (theta.as_slice(), observation)).collect()
    }

    fn worst(smoother: &Smoother, truth: &State, seen: &[(Vec<f64>, Observation)]) -> f64 {
        let state = &smoother.belief().state;
        seen.iter().map(|(theta, _)| (state.marker_at(theta) - truth.marker_at(theta)).norm()).fold(0.0, f64::max)
    }

    type Ruin = (&'static str, fn(Vector3<f64>) -> Vector3<f64>);

    /// What stands in tables for what was not seen, and readings in other units.
    fn gross() -> [Ruin; 6] {
        [
            ("-9999", |_| Vector3::repeat(-9999.0)),
            ("zeros", |_| Vector3::zeros()),
            ("millimetres", |it| it * 1e3),
            ("inches", |it| it / 0.0254),
            ("1e12", |it| Vector3::new(it.x, 1e12, it.z)),
            ("3 cm", |it| it + Vector3::new(0.0, 0.0, 0.03)),
        ]
    }

    /// One row of any size among thirty changes neither what is learned nor how large noise is, at once and one by one.
    #[test]
    fn a_row_of_any_size_changes_nothing() {
        for seed in 1..=8 {
            let (truth, seen, smoother) = case(seed, 30);
            let mut without = smoother();
            without.absorb_all(&of(&seen), &[]).expect("absorbed");
            let right = worst(&without, &truth, &seen);
            assert!(right < 5.0 * SIGMA && without.noise()[0].scale < 0.8, "seed {seed}: {right} m");
            for (index, (name, ruin)) in gross().into_iter().enumerate() {
                for at in [0, 2 + 3 * index, 29] {
                    let mut seen = seen.clone();
                    let reading = seen[at].1.readings[0].as_mut().expect("seen");
                    let ruined = ruin(Vector3::from_column_slice(reading));
                    reading.copy_from_slice(ruined.as_slice());
                    let rest: Vec<_> =
                        seen.iter().enumerate().filter(|(it, _)| *it != at).map(|(_, it)| it.clone()).collect();
                    let (mut with, mut singly, mut less) = (smoother(), smoother(), smoother());
                    less.absorb_all(&of(&rest), &[]).expect("absorbed");
                    with.absorb_all(&of(&seen), &[]).expect("absorbed");
                    for (theta, observation) in of(&seen) {
                        singly.correct(theta, observation).expect("absorbed");
                    }
                    for (how, found) in [("at once", &with), ("one by one", &singly)] {
                        let (scale, wanted) = (found.noise()[0].scale, less.noise()[0].scale);
                        let apart = worst(found, &less.belief().state, &rest);
                        let outliers: Vec<u64> =
                            found.readings().iter().filter(|it| it.weight < 0.5).map(|it| it.movement).collect();
                        let said = format!(
                            "seed {seed}, {name} at {at}, {how}: {apart} m, {scale} for {wanted}, {outliers:?}"
                        );
                        assert!(apart < 0.05 * SIGMA + 0.05 * worst(&less, &truth, &rest), "{said}");
                        assert!((scale / wanted - 1.0).abs() < 0.05, "{said}");
                        assert_eq!(outliers, [at as u64 + 1], "{said}");
                    }
                }
            }
        }
    }

    /// A guess that is off by thousands of σ rejects nothing for ever, though no other hypothesis is searched: targets that are
    /// known to decimetres and readings to tenths of a millimetre, with σ told and learned.
    #[test]
    fn a_guess_that_is_far_off_rejects_nothing() {
        for (seed, unknown) in (1..=6).flat_map(|seed| [(seed, false), (seed, true)]) {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let guess = random_arm(&mut rng, 4);
            let layout = Layout::new(&guess, (0..4).map(Block::Axis).chain([Block::Target(0)]));
            let mut deviations = nalgebra::DVector::from_element(layout.dimension(), 1e-4);
            let target = layout.block(Block::Target(0)).expect("learned");
            deviations.rows_mut(target.start, 3).fill(0.5);
            let prior = Prior::with_deviations(guess, &layout, &deviations).expect("a prior");
            let truth = prior.draw(&layout, &mut rng);
            let measurement_model = Arc::new(MeasurementModel::tracker(1e-4));
            let mut smoother = plain(prior, layout, &measurement_model, 0, unknown);
            for _ in 0..12 {
                let (theta, observation) = seen_by(&measurement_model, &truth, 1.0, &mut rng);
                smoother.correct(&theta, &observation).expect("absorbed");
            }
            let outliers = smoother.readings().iter().filter(|it| it.weight < 0.5).count();
            let theta = [0.3, -0.7, 1.1, 0.2];
            let apart = (smoother.belief().state.marker_at(&theta) - truth.marker_at(&theta)).norm();
            assert!(outliers == 0 && apart < 1e-3, "seed {seed}, σ unknown {unknown}: {outliers} outliers, {apart} m");
        }
    }

    /// An arm that is as described, which is known to a centimetre, and noise that is to be learned.
    fn described_exactly(seed: u64) -> (State, Arc<MeasurementModel>, Smoother, ChaCha8Rng) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let truth = random_arm(&mut rng, 4);
        let layout = Layout::new(&truth, (0..4).map(Block::Axis));
        let deviations = nalgebra::DVector::from_element(layout.dimension(), 1e-2);
        let prior = Prior::with_deviations(truth.clone(), &layout, &deviations).expect("a prior");
        let measurement_model = Arc::new(MeasurementModel::tracker(SIGMA));
        let smoother = plain(prior, layout, &measurement_model, 1, true);
        (truth, measurement_model, smoother, rng)
    }

    /// A first reading that the guess explains to the last digit does not tell that there is no noise, so that all others were outliers.
    #[test]
    fn a_first_reading_without_an_error_rejects_no_other() {
        for seed in 1..=6 {
            let (truth, measurement_model, mut smoother, mut rng) = described_exactly(seed);
            for movement in 0..30 {
                let size = if movement == 0 { 0.0 } else { 1.0 };
                let (theta, observation) = seen_by(&measurement_model, &truth, size, &mut rng);
                smoother.correct(&theta, &observation).expect("absorbed");
                let outliers = smoother.readings().iter().filter(|it| it.weight < 0.5).count();
                assert_eq!(outliers, 0, "seed {seed}, movement {movement}");
            }
            let scale = smoother.noise()[0].scale;
            assert!((0.7..1.4).contains(&scale), "seed {seed}: {scale}");
        }
    }

    /// Nor do the first ten, as of a sensor that repeats what it has been told: once there are more of the others than of these, it is
    /// these that tell how large noise is.
    #[test]
    fn many_readings_without_an_error_do_not_reject_those_after() {
        for seed in 1001..=1006 {
            let (truth, measurement_model, mut smoother, mut rng) = described_exactly(seed);
            for movement in 0..40 {
                let size = if movement < 10 { 0.0 } else { 1.0 };
                let (theta, observation) = seen_by(&measurement_model, &truth, size, &mut rng);
                smoother.correct(&theta, &observation).expect("absorbed");
            }
            let outliers = smoother.readings().iter().filter(|it| it.weight < 0.5).count();
            let scale = smoother.noise()[0].scale;
            assert!(outliers == 0 && (0.6..1.4).contains(&scale), "seed {seed}: {outliers} outliers, {scale}");
        }
    }
}
