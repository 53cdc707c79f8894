//! A smoother over all measurements, with several hypotheses.
//!
//! Recursive least squares linearises every measurement once, at the estimate of that moment, and can never take it
//! back. The smoother keeps the measurements and looks for the state that explains them all (maximum a posteriori),
//!
//! ```text
//! x̂ = argmin E(x),    E(x) = prior(x) + ½ Σᵢ ‖yᵢ − h(x, θᵢ)‖²      (whitened)
//! P = (prior information + Σᵢ HᵢᵀHᵢ)⁻¹  at x̂                      (Laplace's approximation)
//! ```
//!
//! by Levenberg–Marquardt on the manifold, with H linearised anew wherever the estimate has moved. E has many local
//! minima as long as there are few data, so it keeps a weighted set of them (`hypotheses`): the belief is the
//! heaviest, the others are its [alternatives](Belief::alternatives).
//!
//! Once only one hypothesis is left and the old measurements are as good as linear within its spread, they are
//! compressed into a quadratic, so that a step costs the same whatever the number of movements.

mod batch;
mod change_point;
mod changed_body;
#[cfg(test)]
mod changes;
mod factor;
mod gauge;
mod gram;
mod hypotheses;
#[cfg(test)]
mod joint_laws;
mod joint_scale;
mod joints;
mod jump;
#[cfg(test)]
mod known;
#[cfg(test)]
mod laws;
mod marginalised;
mod mode;
mod model_error;
mod noise;
mod normal;
mod points;
mod posterior;
mod prior_scale;
mod robust;
mod shared;
mod stored;
mod wider_prior;

use std::sync::Arc;

use rand_chacha::ChaCha8Rng;

pub use hypotheses::HypothesisSettings;

use hypotheses::Hypotheses;
use mode::StoppingCriteria;
use noise::Left;
use posterior::{Measurement, Posterior};
use prior_scale::Scaled;

use super::{Alternative, Belief, EstimationError, Estimator, Misfit, NoiseFit, NoiseReport, ReadingReport, Update};
use crate::{
    model::{Layout, Prior},
    sensing::{Loss, MeasurementModel, Observation},
};

/// The maximum a posteriori state given everything that was seen, with its rivals.
#[derive(Clone, Debug)]
pub struct Smoother {
    belief: Belief,
    posterior: Posterior,
    hypotheses: Hypotheses,
    settings: HypothesisSettings,
    rng: ChaCha8Rng,
    /// The prior before the first movement, whatever has been dropped since.
    original: Prior,
    /// Whether measurements from before a change of the body are dropped.
    forgets: bool,
    /// The number of movements absorbed so far, misses included.
    movements: u64,
    /// The reports on readings that are no longer looked at one by one. Shared with what a step begins from.
    past: Arc<Vec<ReadingReport>>,
    /// The measurement model with its nominal noise.
    nominal: Arc<MeasurementModel>,
    /// Whether the scale of each kind of noise is learned.
    unknown: Vec<bool>,
    /// Degrees of freedom of each kind of noise: equations that no parameter absorbs.
    degrees_of_freedom: Vec<f64>,
    /// What dropped readings said of each kind of noise.
    remembered: Vec<Left>,
    /// The movement at which a change of the body was last noticed.
    changed_at: Option<u64>,
    /// The movement at which a change was reported whose account is still awaited.
    told_at: Option<u64>,
    misfit: Option<Misfit>,
    /// Whether the robot may be further off than the prior says.
    doubts_prior: bool,
    /// The factor by which the prior of axes has become wider than stated, and the movement at which that was last
    /// tried.
    widened: f64,
    prior_doubted_at: u64,
    /// The prior along a chain, if its scales are learned.
    scaled: Option<Scaled>,
    /// f², the factor of the covariance by the errors that targets of one link share.
    shared: f64,
}

/// The number of stable steps, without a new hypothesis, after which none are searched for.
const STABLE: usize = 6;
/// The effort of the search for another body that explains surprising readings.
const THOROUGH: StoppingCriteria<'_> =
    StoppingCriteria { steps: 60, tolerance: 1e-8, hopeless: f64::INFINITY, known: &[] };
/// The movement number of what is known before the first movement.
const BEFOREHAND: u64 = 0;
/// The number of measurements kept as they are; beyond it the older half is compressed.
const KEPT: usize = 60;

impl Smoother {
    /// Starts from `prior`; `measurement_model` whitens by the noise that is assumed, `rng` serves the search for hypotheses.
    pub fn new(
        prior: Prior,
        layout: Arc<Layout>,
        measurement_model: Arc<MeasurementModel>,
        settings: HypothesisSettings,
        rng: ChaCha8Rng,
    ) -> Self {
        let posterior_prior = prior.clone();
        let posterior = Posterior::new(prior, measurement_model.clone());
        let (nominal, unknown) = (measurement_model.clone(), vec![false; measurement_model.noises().len()]);
        let (degrees_of_freedom, remembered) = (vec![0.0; unknown.len()], vec![Left::default(); unknown.len()]);
        let mut smoother = Self {
            belief: Belief::new(posterior.prior.guess().clone(), layout, measurement_model),
            posterior,
            hypotheses: Hypotheses::default(),
            settings,
            rng,
            original: posterior_prior,
            forgets: true,
            movements: 0,
            past: Arc::default(),
            nominal,
            unknown,
            degrees_of_freedom,
            remembered,
            changed_at: None,
            told_at: None,
            misfit: None,
            doubts_prior: false,
            widened: 1.0,
            prior_doubted_at: 0,
            scaled: None,
            shared: 1.0,
        };
        smoother.begin();
        smoother.publish();
        smoother
    }

    /// This smoother with a loss other than least squares. With a robust one a surprising reading is taken for an outlier;
    /// only several in a row that agree with each other are a changed body.
    pub fn with_loss(mut self, loss: Loss) -> Self {
        self.posterior.loss = loss;
        self
    }

    /// This smoother without forgetting, for a body that never changes: alarms are still raised, but nothing is
    /// dropped.
    pub fn never_forgetting(self) -> Self {
        Self { forgets: false, ..self }
    }

    /// This smoother for a robot that may be further off than the prior says: the prior is widened where that has more
    /// evidence.
    pub fn doubting_prior(self) -> Self {
        Self { doubts_prior: true, ..self }
    }

    /// This smoother with some kinds of noise unknown (in the order of [`MeasurementModel::noises`]): the σ of the measurement model is then only a unit,
    /// and its scale is learned with the rest.
    pub fn with_unknown_noise(mut self, unknown: Vec<bool>) -> Self {
        self.unknown = unknown;
        self.unknown.resize(self.nominal.noises().len(), false);
        self
    }

    /// This smoother with an observation of the robot's equipment that is known before any movement and depends on no
    /// posture.
    pub fn with_prior_observation(mut self, observation: Observation) -> Self {
        let positions = vec![0.0; self.belief.state.joints.len()];
        self.posterior.known.push(Measurement { positions, observation, movement: BEFOREHAND });
        let layout = self.belief.layout.clone();
        self.hypotheses.follow(&self.posterior, &layout);
        self.hypotheses.condense(self.settings.kept, &layout);
        self.publish();
        self
    }

    /// The modes before any measurement: the guess, or without one draws of the prior.
    fn begin(&mut self) {
        let layout = self.belief.layout.clone();
        let once = StoppingCriteria { steps: 0, tolerance: 0.0, hopeless: f64::INFINITY, known: &[] };
        let prior = &self.posterior.prior;
        let starts = if prior.is_vague() {
            (0..self.settings.kept.max(1)).map(|_| prior.draw(&layout, &mut self.rng)).collect()
        } else {
            vec![prior.guess().clone()]
        };
        let modes = starts.iter().filter_map(|start| self.posterior.mode(start, &layout, once).ok());
        self.hypotheses.modes = modes.collect();
        self.hypotheses.condense(self.settings.kept, &layout);
    }

    fn publish(&mut self) {
        let Some((best, rest)) = self.hypotheses.modes.split_first() else { return };
        if self.learns_noise() || self.posterior.scales.iter().any(|scale| *scale != 1.0) {
            let joints = self.posterior.joints.as_ref().map(|joints| Arc::new(joints.noise.clone()));
            let measurement_model = self.nominal.scaled(&self.posterior.scales);
            self.belief.measurement_model = Arc::new(measurement_model.with_joint_noise(joints));
        }
        self.belief.state = best.state.clone();
        let covariance = best.covariance();
        self.shared = self.shared_errors(&best.state, &covariance);
        self.belief.covariance = Some(covariance * self.shared);
        self.belief.alternatives = rest
            .iter()
            .map(|mode| Alternative {
                weight: mode.weight,
                state: mode.state.clone(),
                covariance: mode.covariance() * self.shared,
            })
            .collect();
        self.belief.model_error_m = self.model_error_m();
    }

    /// Whether one hypothesis has explained everything alone for some time.
    fn is_settled(&self) -> bool {
        self.hypotheses.stable_steps >= STABLE
    }

    /// Whether there are as many independent equations as parameters; where some parameters can never be determined,
    /// whether there are twice as many equations.
    fn is_determined(&self) -> bool {
        let (state, layout) = (&self.belief.state, &self.belief.layout);
        let m = layout.dimension();
        let equations = self.posterior.equations(state, layout);
        equations >= 2.0 * m as f64 || (equations >= m as f64 && self.posterior.rank(state, layout) >= m)
    }

    /// Whether noise alone explains the residuals of normal readings at the heaviest hypothesis: Σ w ‖r‖² ~ χ² with Σ w d degrees of
    /// freedom at most, within five standard deviations.
    ///
    /// Outliers are left out: each is weighed down until its square is as large as that of a normal reading, but it counts for no
    /// equation, and many of them would look like a misfit. Marginalised readings are left out too: they were explained when they
    /// were marginalised.
    fn explains(&self) -> bool {
        let (posterior, state) = (&self.posterior, &self.belief.state);
        let all = posterior.known_readings(state).chain(posterior.readings(state));
        let normal = all.filter(|reading| reading.weight > 0.5);
        let (cost, degrees) = normal.fold((0.0, 0.0), |(cost, degrees), reading| {
            let (squared, equations) = (reading.residual_sigmas.powi(2), reading.equations as f64);
            (cost + reading.weight * squared, degrees + reading.weight * equations)
        });
        cost <= degrees + 5.0 * (2.0 * degrees).sqrt()
    }
}

impl Estimator for Smoother {
    fn boxed(&self) -> Box<dyn Estimator> {
        Box::new(self.clone())
    }

    fn belief(&self) -> &Belief {
        &self.belief
    }

    fn correct(&mut self, positions: &[f64], observation: &Observation) -> Result<Update, EstimationError> {
        if observation.is_miss() {
            self.movements += 1;
            return Ok(Update::default());
        }
        // All or nothing: an observation that ends it leaves no trace. What is past goes along, so that adding to it copies nothing.
        let (known, past) = (self.past.len(), std::mem::take(&mut self.past));
        let mut revised = Self { past, ..self.clone() };
        let update = revised.absorb(positions, observation);
        match update {
            Ok(_) => *self = revised,
            Err(_) => {
                self.past = revised.past;
                Arc::make_mut(&mut self.past).truncate(known);
            }
        }
        update
    }

    fn stored(&self) -> Option<Vec<u8>> {
        self.to_stored()
    }

    fn restored(&self, stored: &[u8]) -> Option<Box<dyn Estimator>> {
        Some(Box::new(self.with_stored(stored)?))
    }

    fn misfit(&self) -> Option<Misfit> {
        self.misfit
    }

    fn noise(&self) -> Vec<NoiseReport> {
        let noises = self.nominal.noises().iter().zip(&self.unknown).zip(&self.posterior.scales);
        let unknown = noises.filter(|((_, unknown), _)| **unknown);
        unknown
            .map(|((noise, _), scale)| NoiseReport { channel: noise.channel, first: noise.part.start, scale: *scale })
            .collect()
    }

    fn reading_sigmas(&self) -> Vec<f64> {
        let joints = self.posterior.joints.as_ref().filter(|joints| joints.unknown);
        joints.map_or_else(Vec::new, |joints| joints.noise.sigmas().to_vec())
    }

    fn readings(&self) -> Vec<ReadingReport> {
        if !self.posterior.loss.is_robust() {
            return Vec::new();
        }
        let (posterior, state) = (&self.posterior, &self.belief.state);
        let known = posterior.known_readings(state);
        known.chain(self.past.iter().copied()).chain(posterior.readings(state)).collect()
    }

    fn latest_readings(&self, movement: u64) -> Vec<ReadingReport> {
        if !self.posterior.loss.is_robust() {
            return Vec::new();
        }
        // What was dropped in the same step is the end of what is past.
        let past = self.past.iter().rev().take_while(|reading| reading.movement >= movement).copied();
        let mut latest: Vec<ReadingReport> = past.filter(|reading| reading.movement == movement).collect();
        latest.reverse();
        latest.extend(self.posterior.readings_after(movement, &self.belief.state));
        latest
    }
}

impl Smoother {
    fn absorb(&mut self, positions: &[f64], observation: &Observation) -> Result<Update, EstimationError> {
        let nis = self.belief.nis(positions, observation);
        let layout = self.belief.layout.clone();
        self.movements += 1;
        let (positions, observation) = (positions.to_vec(), observation.clone());
        self.posterior.measurements.push(Measurement { positions, observation, movement: self.movements });
        self.begin_noise();
        self.hypotheses.follow(&self.posterior, &layout);
        self.doubt_estimate();
        if !self.is_settled() || self.hypotheses.modes.is_empty() {
            self.hypotheses.spawn(self.settings.spawned, &self.posterior, &layout, &mut self.rng);
        }
        self.hypotheses.condense(self.settings.kept, &layout);
        // Before the noise is learned: it would take a change for larger noise.
        let change = self.notices_change();
        let change_noticed = change.is_some() && !self.is_revising() && self.told_at.is_none();
        if let Some(change) = change {
            self.noticed(&change);
        }
        self.learn_noise();
        self.doubt_noise(&[]);
        if self.doubts_prior {
            self.doubt_prior();
        }
        self.learn_scales();
        if self.hypotheses.modes.is_empty() {
            return Err(EstimationError::Diverged(self.hypotheses.why()));
        }
        self.publish();
        // What costs most is asked last.
        if self.belief.alternatives.is_empty() && self.explains() && self.is_determined() {
            self.hypotheses.stable_steps += 1;
            if self.is_settled() && self.told_at.is_none() && self.posterior.measurements.len() > KEPT {
                let first = self.posterior.measurements[KEPT / 2].movement;
                let settling = self.posterior.readings(&self.belief.state).take_while(|it| it.movement < first);
                Arc::make_mut(&mut self.past).extend(settling);
                self.posterior.settle_joints(KEPT / 2, &self.hypotheses.modes[0], &layout);
                self.posterior.marginalise(KEPT / 2, &self.belief.state, &layout);
            }
        } else {
            self.hypotheses.stable_steps = 0;
        }
        Ok(Update { nis, change_noticed })
    }
}
