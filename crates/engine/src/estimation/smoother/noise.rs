//! The scales of noise, one for each kind.
//!
//! A scale that is not stated is learned by restricted maximum likelihood. A stated one is a guess: either it holds, or it is
//! off by a factor of which next to nothing is known,
//!
//! ```text
//! ln ev(holds)  = ln P(holds) − ½ χ²
//! ln ev(is off) = ln P(is off) + ln Γ((a+ν)/2) − ln Γ(a/2) + (a/2) ln(a/2) − ((a+ν)/2) ln((a + χ²)/2),    a = 2
//! ```
//!
//! with χ² the squared residuals in nominal σ and ν the equations that no parameter accounts for; the second is ½χ² with s²
//! integrated out under an inverse χ² prior of a degrees of freedom (Gelman et al., *Bayesian Data Analysis*, 3.2).

use super::{
    Smoother,
    marginalised::Quadratic,
    mode::Mode,
    posterior::{Fit, Posterior, STACKED},
};
use crate::{
    elementary::{exp, ln},
    model::Layout,
    sensing::{Noise, Occasion, log_sum},
};

/// ν: the number of equations for which the scale so far counts.
const NOISE_WEIGHT: f64 = 3.0;
/// The most rounds in which scales and modes are found in turn.
const NOISE_ROUNDS: usize = 4;
/// The least scale of unknown noise, in nominal σ.
pub(super) const LEAST_SCALE: f64 = 1e-3;
/// The most, as a multiple of what the prior expects, by which a first reading's distance from the guess is attributed to
/// noise.
const EXPECTED: f64 = 3.0;
/// P(holds): the prior probability that noise is as large as stated.
const HOLDS: f64 = 0.9;
/// a.
const VAGUENESS: f64 = 2.0;
/// The most equations for which the noise learned before a change of the body counts.
const REMEMBERED: f64 = 100.0;

/// Squared residuals of one kind of noise, in nominal σ, and the equations that no parameter accounts for.
#[derive(Clone, Copy, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct Left {
    pub squared: f64,
    pub free: f64,
}

impl Left {
    fn and(self, other: Self) -> Self {
        Self { squared: self.squared + other.squared, free: self.free + other.free }
    }

    /// These residuals, scaled down to at most this many equations.
    fn at_most(self, most: f64) -> Self {
        let share = if self.free > most { most / self.free } else { 1.0 };
        Self { squared: self.squared * share, free: self.free * share }
    }

    /// The logarithms of the evidence that noise is as stated, and that it is off.
    fn evidence(self) -> [f64; 2] {
        [ln(HOLDS) - 0.5 * self.squared, ln(1.0 - HOLDS) + log_off(self.squared, self.free)]
    }

    /// s of stated noise: 1 as far as that holds, and what the residuals say as far as it is off.
    fn scale(self) -> f64 {
        let [holds, off] = self.evidence();
        let chance = 1.0 / (1.0 + exp(off - holds));
        (chance + (1.0 - chance) * (VAGUENESS + self.squared) / (VAGUENESS + self.free)).sqrt()
    }
}

/// The logarithm of the evidence of χ² with ν degrees of freedom and an unknown scale.
fn log_off(squared: f64, free: f64) -> f64 {
    let (a, sum) = (0.5 * VAGUENESS, 0.5 * (VAGUENESS + free));
    libm::lgamma(sum) - libm::lgamma(a) + a * ln(a) - sum * ln(0.5 * (VAGUENESS + squared))
}

/// The evidence that tells larger noise from another cause of large residuals.
#[derive(Clone, Copy, Debug)]
pub(super) struct NoiseEvidence {
    /// χ² in assumed σ, and ν.
    left: Left,
    /// χ² in nominal σ by χ², and Σ ν ln s; `None` where some scale is not stated.
    told: Option<(f64, f64)>,
}

impl NoiseEvidence {
    /// The gain in evidence when χ², in assumed σ, falls by `lowered`.
    pub fn gain(&self, lowered: f64) -> f64 {
        let Self { left: Left { squared, free }, told } = *self;
        // Of a reading nothing but its noise is left.
        let rest = (squared - lowered).max(0.0);
        let of = |squared: f64| {
            let off = log_off(squared, free);
            let Some((nominal, scales)) = told else { return off };
            let (a, b) = (ln(HOLDS) - 0.5 * nominal * squared, ln(1.0 - HOLDS) + off - scales);
            log_sum(a, b)
        };
        of(rest) - of(squared)
    }
}

impl Smoother {
    /// Begins a scale with that of the first readings' residuals at the guess, but not beyond what the prior allows for.
    pub(super) fn begin_noise(&mut self) {
        let first: Vec<usize> = (0..self.unknown.len()).filter(|noise| self.is_unheard(*noise)).collect();
        if first.is_empty() {
            return;
        }
        for noise in first {
            if let Some(scale) = self.first_scale(noise) {
                self.posterior.scales[noise] = scale.max(LEAST_SCALE);
            }
        }
    }

    /// The residual of the latest reading with a kind of noise at the guess, per equation, but at least the nominal one; `None` where there
    /// is no prediction.
    fn first_scale(&self, noise: usize) -> Option<f64> {
        let (channel, part) =
            self.posterior.measurement_model.noises().get(noise).map(|noise| (noise.channel, noise.part.clone()))?;
        let mut seen = self.posterior.measurements.last()?.clone();
        let readings = seen.observation.readings.iter_mut().enumerate();
        readings.filter(|(other, _)| *other != channel).for_each(|(_, reading)| *reading = None);
        let (guess, layout) = (self.posterior.prior.guess(), &self.belief.layout);
        let equations = self.nominal.equations_of(guess, layout, &seen.positions, &seen.observation);
        let present = seen.observation.equations();
        // What is absent has left its reading of one part.
        let part = if present < seen.observation.numbers() { 0..present } else { part };
        if part.is_empty() || equations.residual.len() < part.end {
            return None;
        }
        let (rows, residual) = (equations.rows.columns_range(part.clone()), equations.residual.rows_range(part));
        let d = residual.len() as f64;
        let expected = (self.posterior.prior.covariance() * rows).dot(&rows) / d;
        // A reading that the guess explains, as where a socket is placed by it, does not tell that there is no noise.
        Some((residual.norm_squared() / d).sqrt().clamp(1.0, EXPECTED * (1.0 + expected).sqrt()))
    }

    /// Whether a kind of noise is not stated and its first reading has just come.
    fn is_unheard(&self, noise: usize) -> bool {
        self.unknown[noise] && self.remembered[noise].free == 0.0 && self.noise_seen(noise) == 1
    }

    /// The number of readings so far with a kind of noise.
    fn noise_seen(&self, noise: usize) -> usize {
        let channel = self.nominal.noises()[noise].channel;
        let seen = self.posterior.measurements.iter();
        let marginalised = self.posterior.marginalised.as_ref().map_or(0, |marginalised| marginalised.count);
        marginalised + seen.filter(|seen| seen.observation.readings.get(channel).is_some_and(Option::is_some)).count()
    }

    /// The residuals of the heaviest mode by kind of noise, those before the body changed included.
    fn left(&self) -> Option<Vec<Left>> {
        self.left_by(&self.posterior, self.hypotheses.modes.first()?)
    }

    /// The residuals of a mode of another posterior, by kind of noise.
    fn left_by(&self, posterior: &Posterior, mode: &Mode) -> Option<Vec<Left>> {
        let absorbed = posterior.absorbed(mode, &self.belief.layout)?;
        let fits = posterior.fit(&mode.state, &self.belief.layout);
        let of = |(((fit, absorbed), before), noise): (((Fit, f64), &Left), &Noise)| {
            if self.nominal.sensors()[noise.channel].subject().occasion == Occasion::Beforehand {
                // It is known as well as it is said to be: no movement tells more of it.
                return Left::default();
            }
            Left { squared: fit.squared, free: (fit.equations - absorbed).max(0.0) }.and(*before)
        };
        let lefts = fits.into_iter().zip(absorbed).zip(&self.remembered).zip(self.nominal.noises());
        Some(lefts.map(of).collect())
    }

    /// Keeps what the readings say of noise, for when they are dropped.
    pub(super) fn remember_noise(&mut self, before: &Posterior, mode: &Mode) {
        if let Some(left) = self.left_by(before, mode) {
            self.remembered = left.into_iter().map(|left| left.at_most(REMEMBERED)).collect();
        }
    }

    /// The evidence that tells larger noise from another cause of large residuals, at a mode of a posterior.
    pub(super) fn noise_evidence(&self, posterior: &Posterior, mode: &Mode) -> NoiseEvidence {
        let lefts = self.left_by(posterior, mode).unwrap_or_default();
        let mut left = Left::default();
        let (mut nominal, mut scales) = (0.0, 0.0);
        for (of, scale) in lefts.iter().zip(&self.posterior.scales) {
            left = left.and(Left { squared: of.squared / (scale * scale), free: of.free });
            nominal += of.squared;
            scales += of.free * ln(*scale);
        }
        let is_told = !lefts.iter().zip(&self.unknown).any(|(of, unknown)| *unknown && of.free > 0.0);
        let by = if left.squared > 0.0 { nominal / left.squared } else { 1.0 };
        NoiseEvidence { left, told: is_told.then_some((by, scales)) }
    }

    /// The mean scale of the unknown noises in the same unit, each by its free equations; `None` of one that has no equal.
    fn scales_of_alike(&self, left: &[Left]) -> Vec<Option<f64>> {
        let unit = |noise: usize| {
            let Noise { channel, part } = &self.nominal.noises()[noise];
            self.nominal.sensors()[*channel].nominal(part.start).1
        };
        let of = |noise: usize| {
            let is_alike =
                |other: &usize| self.unknown[*other] && left[*other].free > 0.0 && unit(*other) == unit(noise);
            let alike: Vec<usize> = (0..left.len()).filter(is_alike).collect();
            let (squares, free) = alike.iter().fold((0.0, 0.0), |(squares, free), other| {
                (squares + left[*other].free * self.posterior.scales[*other].powi(2), free + left[*other].free)
            });
            (alike.len() > 1).then(|| (squares / free).sqrt())
        };
        (0..left.len()).map(of).collect()
    }

    /// Learns the scales of noise. Of noise that is not known by restricted maximum likelihood at the heaviest mode: the mean
    /// square of the residuals over the equations that no parameter absorbs,
    ///
    /// ```text
    /// s² = (Σ w ‖r‖² + ν s₀²) / (Σ w d − tr(Λₙ P) + ν),    ν = 3
    /// ```
    ///
    /// with s₀ the scale so far, so that it does not jump while there are hardly more equations than parameters. Of several unknown
    /// noises in the same unit s₀² is the mean of theirs, by their free equations: of three markers with few readings one would else
    /// be explained by all parameters and count as exact, the others as coarse. Stated noise
    /// stays as stated until that is unlikely and one hypothesis explains the readings.
    pub(super) fn learn_noise(&mut self) {
        let layout = self.belief.layout.clone();
        let before = self.posterior.scales.clone();
        let joints_before = self.joint_factor();
        for _ in 0..NOISE_ROUNDS {
            let Some(left) = self.left() else { return };
            let is_alone = self.hypotheses.modes.len() == 1;
            let alike = self.scales_of_alike(&left);
            let mut change = 0.0_f64;
            for noise in 0..left.len() {
                let free = left[noise].free;
                let scale = if self.unknown[noise] {
                    if self.noise_seen(noise) == 0 {
                        continue;
                    }
                    self.degrees_of_freedom[noise] = free;
                    // With equations to spare it may change as often as the modes follow.
                    let own = if free > NOISE_WEIGHT { self.posterior.scales[noise] } else { before[noise] };
                    let from = alike[noise].unwrap_or(own);
                    ((left[noise].squared + NOISE_WEIGHT * from * from) / (free + NOISE_WEIGHT)).sqrt()
                } else if is_alone {
                    left[noise].scale()
                } else {
                    continue;
                };
                let scale = scale.max(LEAST_SCALE);
                if scale.is_finite() {
                    change = change.max(ln(scale / self.posterior.scales[noise]).abs());
                    self.posterior.scales[noise] = scale;
                }
            }
            change = change.max(self.learn_joint_noise(joints_before));
            if change < 1e-3 {
                return;
            }
            let modes = self.hypotheses.clone();
            self.hypotheses.follow(&self.posterior, &layout);
            self.hypotheses.condense(self.settings.kept, &layout);
            if self.hypotheses.modes.is_empty() {
                // With scales so small that the equations are singular there is no mode: those before stay.
                (self.hypotheses, self.posterior.scales) = (modes, before);
                return;
            }
        }
    }
}

impl Posterior {
    /// The number of equations, by kind of noise, that the parameters absorb: tr(Λₙ P), with Λₙ its share of the information.
    pub fn absorbed(&self, mode: &Mode, layout: &Layout) -> Option<Vec<f64>> {
        if let Some(joints) = &self.joints {
            let (kept, _) = self.joint_shares(self.loss.into(), joints, mode, layout);
            return Some(
                kept.iter()
                    .zip(self.marginalised_shares(mode, layout)?)
                    .map(|(kept, marginalised)| kept + marginalised)
                    .collect(),
            );
        }
        let mut noises = vec![Quadratic::nothing(layout.dimension()); self.scales.len()];
        let known = self.known.chunks(STACKED);
        for measurements in known.chain(self.measurements.chunks(STACKED)) {
            let (of, _) = self.quadratics(&mode.state, layout, measurements);
            noises.iter_mut().zip(of).for_each(|(into, of)| into.add(of));
        }
        if let Some(marginalised) = &self.marginalised {
            let (carried, _) = marginalised.carried(&mode.state, layout)?;
            noises.iter_mut().zip(carried).for_each(|(into, of)| into.information += of.information);
        }
        let covariance = mode.covariance();
        let of = |(noise, scale): (&Quadratic, &f64)| noise.information.dot(&covariance) / (scale * scale);
        Some(noises.iter().zip(&self.scales).map(of).collect())
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::DMatrix;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    use super::*;
    use crate::{
        estimation::{Estimator, HypothesisSettings},
        model::{Block, Layout, Prior, random::random_arm},
        sensing::{Loss, MeasurementModel, Observation, Position, Sensor},
    };

    const SIGMA: f64 = 1e-3;
    const JOINTS: usize = 6;

    /// The scales that are learned of three markers on one hand, whose noise is so many σ.
    fn scales(seed: u64, rows: usize, noise: [f64; 3]) -> Vec<f64> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut guess = random_arm(&mut rng, JOINTS);
        guess.targets = vec![guess.targets[0].clone(); 3];
        let blocks = (0..JOINTS).map(Block::Axis).chain([Block::Base]).chain((0..3).map(Block::Target));
        let layout = Layout::new(&guess, blocks);
        let m = layout.dimension();
        let mut covariance = DMatrix::from_diagonal_element(m, m, 1e-4);
        covariance.view_mut((0, 0), (6, 6)).fill_diagonal(0.3);
        let prior = Prior::around(guess, &layout, covariance).expect("a prior");
        let truth = prior.draw(&layout, &mut rng);
        let measurement_model =
            MeasurementModel::new((0..3).map(|target| Sensor::even(Position { target }, SIGMA)).collect());
        let observe = |_| {
            let theta: Vec<f64> = (0..JOINTS).map(|_| rng.random_range(-1.5..1.5)).collect();
            let v: Vec<f64> = (0..9).map(|i| noise[i / 3] * rng.sample::<f64, _>(StandardNormal)).collect();
            let observation = measurement_model.observe(&truth, &theta, &v);
            (theta, observation)
        };
        let seen: Vec<(Vec<f64>, Observation)> = (0..rows).map(observe).collect();
        let settings = HypothesisSettings { kept: 2, spawned: 2 };
        let mut smoother = Smoother::new(prior, Arc::new(layout), Arc::new(measurement_model), settings, rng)
            .with_loss(Loss::MIXTURE)
            .with_unknown_noise(vec![true; 3]);
        let rows: Vec<(&[f64], &Observation)> = seen.iter().map(|(theta, it)| (theta.as_slice(), it)).collect();
        smoother.absorb_all(&rows, &[]).expect("absorbed");
        smoother.noise().iter().map(|noise| noise.scale).collect()
    }

    /// Of eight movements, 72 equations for 45 parameters, no marker is explained by all parameters at the cost of the others.
    #[test]
    fn no_marker_takes_all_parameters_for_itself() {
        for seed in 1001..1041 {
            let scales = scales(seed, 8, [1.0; 3]);
            assert!(scales.iter().all(|scale| (0.5..2.0).contains(scale)), "seed {seed}: {scales:.2?}");
        }
    }

    /// A marker that is coarser than the others is found to be.
    #[test]
    fn markers_may_differ() {
        for seed in 1001..1011 {
            let scales = scales(seed, 40, [1.0, 5.0, 1.0]);
            assert!((3.5..6.5).contains(&scales[1]), "seed {seed}: {scales:.2?}");
            assert!(scales[0] < 1.6 && scales[2] < 1.6, "seed {seed}: {scales:.2?}");
        }
    }
}
