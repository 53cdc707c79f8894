//! The posterior: prior and all measurements so far, as a cost on states.
//!
//! ```text
//! E(x) = prior(x) + ½ Σᵢ ‖yᵢ − h(x, θᵢ)‖² + ½ (δ − δ̂)ᵀ Λ (δ − δ̂)
//! ```
//!
//! with whitened residuals. The last term stands for measurements whose linearisation has settled: Λ = Σ HᵀH collects
//! them in the chart at the state where they were linearised, δ are the coordinates of x there.

use std::sync::Arc;

use nalgebra::{Cholesky, DMatrix, DVector};

use crate::{
    model::{Layout, Pass, Prior, State, rank},
    sensing::{Observation, Rig},
};

/// A movement and what was seen after it.
#[derive(Clone, Debug)]
pub(super) struct Measurement {
    pub positions: Vec<f64>,
    pub observation: Observation,
}

/// Measurements as a quadratic in the chart at `state`.
#[derive(Clone, Debug)]
pub(super) struct Settled {
    pub state: State,
    /// Λ, m × m.
    pub information: DMatrix<f64>,
    /// Λ δ̂.
    pub vector: DVector<f64>,
    /// The quadratic's cost at δ = 0.
    pub cost: f64,
    /// How many equations it holds.
    pub equations: usize,
    /// How many measurements.
    pub count: usize,
}

/// Everything that is known.
#[derive(Clone, Debug)]
pub(super) struct Posterior {
    pub prior: Prior,
    pub pins: State,
    pub rig: Arc<Rig>,
    pub measurements: Vec<Measurement>,
    pub settled: Option<Settled>,
}

/// The normal equations of the posterior at a state: `information · step = descent`.
pub(super) struct Normal {
    pub cost: f64,
    pub information: DMatrix<f64>,
    pub descent: DVector<f64>,
}

impl Posterior {
    pub fn new(prior: Prior, rig: Arc<Rig>) -> Self {
        Self { pins: prior.pins(), prior, rig, measurements: Vec::new(), settled: None }
    }

    /// How many measurements there were.
    #[cfg(test)]
    pub fn count(&self) -> usize {
        self.measurements.len() + self.settled.as_ref().map_or(0, |settled| settled.count)
    }

    /// How many equations they brought.
    pub fn equations(&self) -> usize {
        let kept: usize = self.measurements.iter().map(|seen| seen.observation.equations()).sum();
        kept + self.settled.as_ref().map_or(0, |settled| settled.equations)
    }

    /// How many independent equations the measurements are that have not settled; all settled ones count as independent.
    pub fn rank(&self, state: &State, layout: &Layout) -> usize {
        let (rows, _) = self.stacked(state, layout, &self.measurements);
        rank(&rows.transpose()) + self.settled.as_ref().map_or(0, |settled| settled.equations)
    }

    /// E(x); infinite where x is too far from where settled measurements were linearised. Axes are written with their
    /// points nearest to the pins.
    pub fn cost(&self, state: &State, layout: &Layout) -> f64 {
        self.prior.cost(state, None) + self.data_cost(state, layout)
    }

    /// The part of the cost at `state` that is due to the data alone: twice it is χ² distributed at the truth.
    pub fn data_cost(&self, state: &State, layout: &Layout) -> f64 {
        let errors: f64 = (self.measurements.iter())
            .map(|seen| self.rig.squared_error(state, &seen.positions, &seen.observation))
            .sum();
        let settled = self.settled.as_ref().map_or(0.0, |settled| {
            settled.state.local(layout, state).map_or(f64::INFINITY, |delta| {
                settled.cost + 0.5 * delta.dot(&(&settled.information * &delta)) - settled.vector.dot(&delta)
            })
        });
        0.5 * errors + settled
    }

    /// The normal equations at `state`, linearised there; `None` outside the chart of settled measurements.
    pub fn normal(&self, state: &State, layout: &Layout) -> Option<Normal> {
        let (mut information, mut descent, data) = self.linearised(state, layout, &self.measurements);
        let mut cost = data;
        cost += self.prior.cost(state, Some((&mut information, &mut descent)));
        if let Some(settled) = &self.settled {
            let (carried, vector, value) = settled.carried(state, layout)?;
            information += carried;
            descent += vector;
            cost += value;
        }
        Some(Normal { cost, information, descent })
    }

    /// Σ HᵀH, Σ Hᵀ(y − h) and the cost of some measurements at `state`.
    pub fn linearised(
        &self,
        state: &State,
        layout: &Layout,
        measurements: &[Measurement],
    ) -> (DMatrix<f64>, DVector<f64>, f64) {
        let (stacked, residuals) = self.stacked(state, layout, measurements);
        let information = &stacked * stacked.transpose();
        let cost = 0.5 * residuals.norm_squared();
        (information, stacked * residuals, cost)
    }

    /// Hᵀ and y − h of some measurements, one beside the other.
    fn stacked(&self, state: &State, layout: &Layout, measurements: &[Measurement]) -> (DMatrix<f64>, DVector<f64>) {
        let m = layout.dimension();
        let equations = measurements.iter().map(|seen| seen.observation.equations()).sum();
        let mut stacked = DMatrix::zeros(m, equations);
        let mut residuals = DVector::zeros(equations);
        let mut pass = Pass::new(state, layout);
        let mut at = 0;
        for seen in measurements {
            pass.at(&seen.positions);
            let d = seen.observation.equations();
            let rows = &mut stacked.as_mut_slice()[at * m..(at + d) * m];
            self.rig.linearise(&pass, &seen.observation, rows, &mut residuals.as_mut_slice()[at..at + d]);
            at += d;
        }
        (stacked, residuals)
    }

    /// Moves the oldest `count` measurements into the quadratic, linearised at `state`.
    pub fn settle(&mut self, count: usize, state: &State, layout: &Layout) {
        let old: Vec<Measurement> = self.measurements.drain(..count.min(self.measurements.len())).collect();
        let (mut information, mut vector, mut cost) = self.linearised(state, layout, &old);
        let mut total = old.len();
        let mut equations = old.iter().map(|seen| seen.observation.equations()).sum();
        if let Some(before) = self.settled.take() {
            // What cannot be carried over is kept by nobody: the chart ends 90 deg away, where nothing settles.
            if let Some((carried, pull, value)) = before.carried(state, layout) {
                cost += value;
                vector += pull;
                information += carried;
                total += before.count;
                equations += before.equations;
            }
        }
        self.settled = Some(Settled { state: state.clone(), information, vector, cost, equations, count: total });
    }
}

impl Settled {
    /// The quadratic in the chart at `state`: its information there, its descent and its cost.
    ///
    /// A change of chart moves δ by `D = ∂ local(settled, retract(state, ε))/∂ε` at ε = 0. It is not the inverse of the
    /// transport at δ: a line is pinned, and its pivot in `state` need not be where a retraction from the settled state
    /// would leave it, so that turning it also shifts it.
    fn carried(&self, state: &State, layout: &Layout) -> Option<(DMatrix<f64>, DVector<f64>, f64)> {
        let delta = self.state.local(layout, state)?;
        let change = self.state.change_of_chart(layout, state)?;
        let pulled = &self.information * &delta;
        let cost = self.cost + 0.5 * delta.dot(&pulled) - self.vector.dot(&delta);
        let information = change.transpose() * &self.information * &change;
        Some((information, change.transpose() * (&self.vector - pulled), cost))
    }
}

/// A local minimum of the posterior's cost, found by Levenberg–Marquardt, and the Gaussian there (Laplace).
#[derive(Clone, Debug)]
pub(super) struct Mode {
    pub state: State,
    pub cost: f64,
    pub information: DMatrix<f64>,
    /// P, the inverse of the information.
    pub covariance: DMatrix<f64>,
    /// −E − ½ ln det Λ: the logarithm of its share of the evidence, but for what all modes have in common.
    pub log_evidence: f64,
    /// Its share of the evidence, once that is told.
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
    pub fn mode(&self, start: &State, layout: &Layout, effort: Effort) -> Option<Mode> {
        let mut state = start.slid_towards(&self.pins);
        let mut normal = self.normal(&state, layout)?;
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
            let next = state.retract(layout, &delta).slid_towards(&self.pins);
            let cost = self.cost(&next, layout);
            let ratio = (normal.cost - cost) / predicted;
            if ratio > 0.0 {
                state = next;
                normal = self.normal(&state, layout)?;
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
        Mode::at(state, normal)
    }
}

impl Mode {
    fn at(state: State, normal: Normal) -> Option<Self> {
        let Normal { cost, information, .. } = normal;
        let cholesky = Cholesky::new(information.clone())?;
        let log_determinant = 2.0 * cholesky.l_dirty().diagonal().iter().map(|x| x.ln()).sum::<f64>();
        let log_evidence = -cost - 0.5 * log_determinant;
        if !log_evidence.is_finite() {
            return None;
        }
        Some(Self { state, cost, information, covariance: cholesky.inverse(), log_evidence, weight: 0.0 })
    }
}
