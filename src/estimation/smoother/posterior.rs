//! The posterior: prior and all measurements so far, as a cost on chains.
//!
//! ```text
//! E(x) = prior(x) + Σᵢ ‖yᵢ − h(x, θᵢ)‖² / 2r + ½ (δ − δ̂)ᵀ Λ (δ − δ̂)
//! ```
//!
//! The last term stands for measurements whose linearisation has settled: Λ = Σ HᵀH/r collects them in the chart at
//! the chain where they were linearised, δ are the coordinates of x there.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Point3, U3};

use super::prior::Prior;
use crate::kinematics::{Chain, TangentLayout, jacobian::jacobian_transposed_into};

/// A movement and the marker that was seen after it.
#[derive(Clone, Debug)]
pub(super) struct Measurement {
    pub positions: Vec<f64>,
    pub marker: Point3<f64>,
}

/// Measurements as a quadratic in the chart at `chain`.
#[derive(Clone, Debug)]
pub(super) struct Settled {
    pub chain: Chain,
    /// Λ, m × m.
    pub information: DMatrix<f64>,
    /// Λ δ̂.
    pub vector: DVector<f64>,
    /// The quadratic's cost at δ = 0.
    pub cost: f64,
    /// How many measurements it holds.
    pub count: usize,
}

/// Everything that is known.
#[derive(Clone, Debug)]
pub(super) struct Posterior {
    pub prior: Prior,
    pub pins: Chain,
    pub noise_m2: f64,
    pub measurements: Vec<Measurement>,
    pub settled: Option<Settled>,
}

/// The normal equations of the posterior at a chain: `information · step = descent`.
pub(super) struct Normal {
    pub cost: f64,
    pub information: DMatrix<f64>,
    pub descent: DVector<f64>,
}

impl Posterior {
    pub fn new(prior: Prior, noise_m2: f64) -> Self {
        Self { pins: prior.pins(), prior, noise_m2, measurements: Vec::new(), settled: None }
    }

    /// How many markers were seen.
    pub fn count(&self) -> usize {
        self.measurements.len() + self.settled.as_ref().map_or(0, |settled| settled.count)
    }

    /// E(x); infinite where x is too far from where settled measurements were linearised.
    pub fn cost(&self, chain: &Chain, layout: &TangentLayout) -> f64 {
        let errors: f64 = (self.measurements.iter())
            .map(|seen| (seen.marker - chain.marker_at(&seen.positions)).norm_squared())
            .sum();
        let settled = self.settled.as_ref().map_or(0.0, |settled| {
            settled.chain.local(layout, chain).map_or(f64::INFINITY, |delta| {
                settled.cost + 0.5 * delta.dot(&(&settled.information * &delta)) - settled.vector.dot(&delta)
            })
        });
        self.prior.cost(chain, &self.pins, layout, None) + 0.5 * errors / self.noise_m2 + settled
    }

    /// The part of the cost at `chain` that is due to the data alone: twice it is χ² distributed at the truth.
    pub fn data_cost(&self, chain: &Chain, layout: &TangentLayout) -> f64 {
        self.cost(chain, layout) - self.prior.cost(chain, &self.pins, layout, None)
    }

    /// The normal equations at `chain`, linearised there; `None` outside the chart of settled measurements.
    pub fn normal(&self, chain: &Chain, layout: &TangentLayout) -> Option<Normal> {
        let m = layout.dimension();
        let (mut information, mut descent, data) = self.linearised(chain, layout, &self.measurements);
        let mut cost = data;
        cost += self.prior.cost(chain, &self.pins, layout, Some((&mut information, &mut descent)));
        if let Some(settled) = &self.settled {
            let delta = settled.chain.local(layout, chain)?;
            // Coordinates in the chart of the settled ones move by J⁻¹ per coordinate in the chart at x.
            let inverse = settled.chain.transport(layout, &delta).try_inverse()?;
            let pulled = &settled.information * &delta;
            cost += settled.cost + 0.5 * delta.dot(&pulled) - settled.vector.dot(&delta);
            information += inverse.transpose() * &settled.information * &inverse;
            descent += inverse.transpose() * (&settled.vector - pulled);
        }
        debug_assert_eq!(information.nrows(), m);
        Some(Normal { cost, information, descent })
    }

    /// Σ HᵀH/r, Σ Hᵀ(y − h)/r and the cost of some measurements at `chain`.
    pub fn linearised(
        &self,
        chain: &Chain,
        layout: &TangentLayout,
        measurements: &[Measurement],
    ) -> (DMatrix<f64>, DVector<f64>, f64) {
        let m = layout.dimension();
        let mut stacked = DMatrix::zeros(m, 3 * measurements.len());
        let mut residuals = DVector::zeros(3 * measurements.len());
        for (index, seen) in measurements.iter().enumerate() {
            let columns = stacked.generic_view_mut((0, 3 * index), (Dyn(m), U3));
            let predicted = jacobian_transposed_into(chain, layout, &seen.positions, columns);
            residuals.fixed_rows_mut::<3>(3 * index).copy_from(&(seen.marker - predicted));
        }
        let cost = 0.5 * residuals.norm_squared() / self.noise_m2;
        let information = &stacked * stacked.transpose() / self.noise_m2;
        (information, stacked * residuals / self.noise_m2, cost)
    }

    /// Moves the oldest `count` measurements into the quadratic, linearised at `chain`.
    pub fn settle(&mut self, count: usize, chain: &Chain, layout: &TangentLayout) {
        let old: Vec<Measurement> = self.measurements.drain(..count.min(self.measurements.len())).collect();
        let (mut information, mut vector, mut cost) = self.linearised(chain, layout, &old);
        let mut total = old.len();
        if let Some(before) = self.settled.take() {
            let moved = before.chain.local(layout, chain).and_then(|delta| {
                let inverse = before.chain.transport(layout, &delta).try_inverse()?;
                Some((delta, inverse))
            });
            // What cannot be carried over is kept by nobody: the chart ends 90 deg away, where nothing settles.
            if let Some((delta, inverse)) = moved {
                let pulled = &before.information * &delta;
                cost += before.cost + 0.5 * delta.dot(&pulled) - before.vector.dot(&delta);
                vector += inverse.transpose() * (&before.vector - pulled);
                information += inverse.transpose() * &before.information * inverse;
                total += before.count;
            }
        }
        self.settled = Some(Settled { chain: chain.clone(), information, vector, cost, count: total });
    }
}

/// A local minimum of the posterior's cost, found by Levenberg–Marquardt, and the Gaussian there (Laplace).
#[derive(Clone, Debug)]
pub(super) struct Mode {
    pub chain: Chain,
    pub cost: f64,
    pub information: DMatrix<f64>,
    /// P, the inverse of the information.
    pub covariance: DMatrix<f64>,
    /// −E − ½ ln det Λ: the logarithm of its share of the evidence, but for what all modes have in common.
    pub log_evidence: f64,
    /// The largest step of the last search, in standard deviations: how far it was from the minimum when it began.
    pub weight: f64,
}

/// When a search ends.
#[derive(Clone, Copy, Debug)]
pub(super) struct Effort {
    /// Steps at most, accepted or not.
    pub steps: usize,
    /// It has converged when a step promises to lower the cost by less than this.
    pub tolerance: f64,
    /// It is given up when, half way through, the cost is still above this.
    pub hopeless: f64,
}

/// The largest turn (rad) or shift (m) of one step.
const LONGEST_STEP: f64 = 0.7;

impl Posterior {
    /// The local minimum that Levenberg–Marquardt reaches from `start`, and the Gaussian there.
    ///
    /// Steps solve `(Λ + λ diag Λ) δ = descent`; λ follows the ratio of found to predicted descent (Nielsen's rule).
    pub fn mode(&self, start: &Chain, layout: &TangentLayout, effort: Effort) -> Option<Mode> {
        let mut chain = start.slid_towards(&self.pins);
        let mut normal = self.normal(&chain, layout)?;
        let (mut lambda, mut growth) = (1e-3, 2.0);
        for step in 0..effort.steps {
            if step == effort.steps / 2 && normal.cost > effort.hopeless {
                return None;
            }
            let mut damped = normal.information.clone();
            for k in 0..damped.nrows() {
                damped[(k, k)] *= 1.0 + lambda;
            }
            let mut delta = Cholesky::new(damped)?.solve(&normal.descent);
            let longest = delta.amax();
            if longest > LONGEST_STEP {
                delta *= LONGEST_STEP / longest;
            }
            let predicted = delta.dot(&normal.descent) - 0.5 * delta.dot(&(&normal.information * &delta));
            if !predicted.is_finite() {
                return None;
            }
            let next = chain.retract(layout, &delta).slid_towards(&self.pins);
            let cost = self.cost(&next, layout);
            let ratio = (normal.cost - cost) / predicted;
            if ratio > 0.0 {
                chain = next;
                normal = self.normal(&chain, layout)?;
                lambda = (lambda * (1.0 - (2.0 * ratio - 1.0).powi(3)).max(1.0 / 3.0)).max(1e-9);
                growth = 2.0;
            } else {
                lambda *= growth;
                growth *= 2.0;
            }
            if predicted < effort.tolerance || lambda > 1e12 {
                break;
            }
        }
        Mode::at(chain, normal)
    }
}

impl Mode {
    fn at(chain: Chain, normal: Normal) -> Option<Self> {
        let Normal { cost, information, .. } = normal;
        let cholesky = Cholesky::new(information.clone())?;
        let log_determinant = 2.0 * cholesky.l_dirty().diagonal().iter().map(|x| x.ln()).sum::<f64>();
        let log_evidence = -cost - 0.5 * log_determinant;
        if !log_evidence.is_finite() {
            return None;
        }
        Some(Self { chain, cost, information, covariance: cholesky.inverse(), log_evidence, weight: 0.0 })
    }
}
