//! A smoother over all measurements, with several hypotheses.
//!
//! Recursive least squares linearises every measurement once, at the estimate of that moment, and can never take it
//! back. The smoother keeps the measurements and looks for the chain that explains them all (maximum a posteriori),
//!
//! ```text
//! x̂ = argmin E(x),    E(x) = prior(x) + Σᵢ ‖yᵢ − h(x, θᵢ)‖² / 2r
//! P = (prior information + Σᵢ HᵢᵀHᵢ / r)⁻¹  at x̂          (Laplace's approximation)
//! ```
//!
//! by Levenberg–Marquardt on the manifold, with H linearised anew wherever the estimate has moved. E has many local
//! minima as long as there are few data, so it keeps a weighted set of them (`hypotheses`): the belief is the
//! heaviest, the others are its [alternatives](Belief::alternatives).
//!
//! Once only one hypothesis is left and the old measurements are as good as linear within its spread, they are
//! compressed into a quadratic, so that a step costs the same whatever the number of movements.

mod hypotheses;
#[cfg(test)]
mod laws;
mod posterior;
mod prior;

use std::sync::Arc;

use rand_chacha::ChaCha8Rng;

pub use hypotheses::HypothesisSettings;
pub use prior::Prior;
pub(crate) use prior::anywhere;

use hypotheses::Hypotheses;
use posterior::{Measurement, Posterior};

use super::{Alternative, Belief, ChangeDetector, EstimationError, Estimator, Update};
use crate::{
    kinematics::{TangentLayout, jacobian::jacobian},
    sensing::{Observation, isotropic},
};

/// The maximum a posteriori chain given everything that was seen, with its rivals.
#[derive(Clone, Debug)]
pub struct Smoother {
    belief: Belief,
    posterior: Posterior,
    hypotheses: Hypotheses,
    settings: HypothesisSettings,
    rng: ChaCha8Rng,
    changes: ChangeDetector,
}

/// Steps without a new hypothesis after which none are searched for any more.
const CALM: usize = 6;
/// A normalised innovation squared that the old body hardly explains: χ²₃ at 99 %.
const SURPRISING: f64 = 11.3;
/// Measurements that are kept as they are; beyond these the older half is compressed.
const KEPT: usize = 60;

impl Smoother {
    /// Starts from `prior`; `noise_m2` is the sensor's variance per coordinate, `rng` serves the search for hypotheses.
    pub fn new(
        prior: Prior,
        layout: Arc<TangentLayout>,
        noise_m2: f64,
        settings: HypothesisSettings,
        rng: ChaCha8Rng,
    ) -> Self {
        let posterior = Posterior::new(prior, noise_m2);
        let belief = Belief {
            chain: posterior.prior.start().clone(),
            layout,
            covariance: None,
            noise_m2,
            alternatives: Vec::new(),
        };
        let mut smoother = Self {
            belief,
            posterior,
            hypotheses: Hypotheses::default(),
            settings,
            rng,
            changes: ChangeDetector::honest(),
        };
        smoother.begin();
        smoother.publish();
        smoother
    }

    /// The modes before any measurement: the guess, or without one draws of the prior.
    fn begin(&mut self) {
        let layout = self.belief.layout.clone();
        let once = posterior::Effort { steps: 0, tolerance: 0.0, hopeless: f64::INFINITY };
        let starts = match &self.posterior.prior {
            Prior::Around { guess, .. } => vec![guess.clone()],
            prior @ Prior::Within { .. } => {
                (0..self.settings.kept.max(1)).map(|_| prior.draw(&layout, &mut self.rng)).collect()
            }
        };
        let modes = starts.iter().filter_map(|start| self.posterior.mode(start, &layout, once));
        self.hypotheses.modes = modes.collect();
        self.hypotheses.condense(self.settings.kept, &layout);
    }

    fn publish(&mut self) {
        let Some((best, rest)) = self.hypotheses.modes.split_first() else { return };
        self.belief.chain = best.chain.clone();
        self.belief.covariance = Some(best.covariance.clone());
        self.belief.alternatives = rest
            .iter()
            .map(|mode| Alternative {
                weight: mode.weight,
                chain: mode.chain.clone(),
                covariance: mode.covariance.clone(),
            })
            .collect();
    }

    /// Normalised innovation squared of a marker under the heaviest hypothesis.
    fn nis(&self, positions: &[f64], measured: &nalgebra::Point3<f64>) -> Option<f64> {
        let covariance = self.belief.covariance.as_ref()?;
        let (predicted, h) = jacobian(&self.belief.chain, &self.belief.layout, positions);
        let spread = (&h * covariance * h.transpose()).fixed_view::<3, 3>(0, 0).into_owned();
        let innovation = measured - predicted;
        let s = (spread + isotropic(self.belief.noise_m2)).cholesky()?;
        Some(innovation.dot(&s.solve(&innovation))).filter(|nis| nis.is_finite())
    }

    /// Whether one hypothesis has explained everything alone for some time.
    fn is_settled(&self) -> bool {
        self.hypotheses.calm >= CALM
    }

    /// Drops what was measured before the body changed. The estimate stays as a guess, with half the deviations that
    /// the prior had; of the measurements the latest stay, those that the old body does not explain.
    fn forget(&mut self) {
        let surprising = (self.posterior.measurements.iter().rev())
            .take_while(|seen| self.nis(&seen.positions, &seen.marker).is_some_and(|nis| nis > SURPRISING))
            .count();
        let recent = self.posterior.measurements.split_off(self.posterior.measurements.len() - surprising);
        let layout = &self.belief.layout;
        let deviations = self.posterior.prior.deviations(layout) * 0.5;
        let prior = Prior::Around { guess: self.belief.chain.clone(), deviations };
        self.posterior = Posterior::new(prior, self.belief.noise_m2);
        self.posterior.measurements = recent;
        self.hypotheses.calm = 0;
        self.changes.reset();
    }

    /// Whether the data cost of the heaviest hypothesis is what noise alone explains, 2E ~ χ² with 3n degrees of
    /// freedom at most: within five standard deviations.
    fn explains(&self) -> bool {
        let degrees = 3.0 * self.posterior.count() as f64;
        let cost = 2.0 * self.posterior.data_cost(&self.belief.chain, &self.belief.layout);
        cost <= degrees + 5.0 * (2.0 * degrees).sqrt()
    }
}

impl Estimator for Smoother {
    fn belief(&self) -> &Belief {
        &self.belief
    }

    fn update(&mut self, positions: &[f64], observation: &Observation) -> Result<Update, EstimationError> {
        let Some(measured) = observation.position() else { return Ok(Update::default()) };
        if !measured.coords.iter().all(|x| x.is_finite()) {
            return Err(EstimationError::Diverged("a measurement was not a finite number"));
        }
        let nis = self.nis(positions, measured);
        let layout = self.belief.layout.clone();
        self.posterior.measurements.push(Measurement { positions: positions.to_vec(), marker: *measured });
        // Before the belief is settled its innovations say little about the body.
        let change_noticed = self.is_settled() && nis.is_some_and(|nis| self.changes.observe(nis));
        if change_noticed {
            self.forget();
        }
        self.hypotheses.follow(&self.posterior, &layout);
        if !self.is_settled() {
            self.hypotheses.spawn(self.settings.spawned, &self.posterior, &layout, &mut self.rng);
        }
        self.hypotheses.condense(self.settings.kept, &layout);
        if self.hypotheses.modes.is_empty() {
            return Err(EstimationError::Diverged("no hypothesis explains the measurements"));
        }
        self.publish();
        let determined = 3 * self.posterior.count() >= layout.dimension();
        if determined && self.belief.alternatives.is_empty() && self.explains() {
            self.hypotheses.calm += 1;
            if self.is_settled() && self.posterior.measurements.len() > KEPT {
                self.posterior.settle(KEPT / 2, &self.belief.chain, &layout);
            }
        } else {
            self.hypotheses.calm = 0;
        }
        Ok(Update { nis: nis.map(|nis| (nis, 3)), change_noticed })
    }
}
