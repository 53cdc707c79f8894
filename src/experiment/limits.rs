//! How well any learner could do: the limits to draw beside the curves.
//!
//! Judges only: all of this is computed at the true parameters.
//!
//! * *The data's own bound.* With F = Λ₀ + Σ HᵀH/σ², the information of the prior and of the data collected, at the
//!   truth, no unbiased estimator has a smaller error covariance than F⁻¹ (Cramér and Rao; with a prior van Trees).
//!   The bound shown is tr(W F⁻¹). A learner near it makes the most of its data.
//! * *The best data.* Among all sets of N movements, the A-optimal design minimises that bound. Solved for movements
//!   with real-valued multiplicities N pᵢ (an approximate design: a bound for every whole-numbered one) by exchange
//!   (Fedorov 1972): a pose that the sensitivity
//!
//!   ```text
//!   φ(θ) = N tr(H M⁻¹ W M⁻¹ Hᵀ) / σ²,    M = Λ₀ + N Σ pᵢ HᵢᵀHᵢ / σ²
//!   ```
//!
//!   favours most joins the design, and the weights are balanced by pᵢ ← pᵢ √φᵢ / Σ pⱼ √φⱼ (Silvey, Titterington and
//!   Torsney 1978). By the equivalence theorem (Kiefer and Wolfowitz 1960) the design is optimal where φ nowhere
//!   exceeds Σ pᵢ φᵢ, and its trace is above the optimum by at most the difference.
//! * *Counting.* As many equations as unknowns: ⌈m/3⌉ movements, three numbers each. A yardstick, not a bound.

use nalgebra::{Cholesky, DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::{
    kinematics::{Chain, TangentLayout, jacobian::jacobian},
    optimize::{Polish, polish},
    selection::Weights,
};

/// A problem whose limits are asked for: the truth, and what may be done there.
#[derive(Clone, Debug)]
pub struct Limits {
    /// The true chain.
    pub truth: Chain,
    /// Which of its parameters are learned.
    pub layout: TangentLayout,
    /// Joint limits, rad or m.
    pub limits: Vec<(f64, f64)>,
    /// Standard deviation of the prior per tangent coordinate.
    pub prior_sd: DVector<f64>,
    /// Standard deviation of the sensor per coordinate, metres.
    pub sigma_m: f64,
    /// W.
    pub weights: Weights,
}

/// An approximate A-optimal design.
#[derive(Clone, Debug)]
pub struct Design {
    /// Its poses, rad or m.
    pub poses: Vec<Vec<f64>>,
    /// The share of each in all movements.
    pub shares: Vec<f64>,
    /// tr(W M⁻¹).
    pub trace: f64,
    /// By how much the trace may exceed the optimum, as a fraction of it: the gap of the equivalence theorem over all
    /// candidates, polished.
    pub gap: f64,
}

/// Candidates inside the joint box, on its faces and on its corners, each.
const CANDIDATES: usize = 1500;
/// Candidates polished in every exchange.
const POLISHED: usize = 6;
const EXCHANGES: usize = 60;
const BALANCING: usize = 150;
/// Poses with a smaller share leave the design.
const NEGLIGIBLE: f64 = 1e-5;

/// Movements after which there are as many equations as unknowns, three per movement.
pub fn movements_by_counting(parameters: usize) -> usize {
    parameters.div_ceil(3)
}

impl Limits {
    /// Λ₀, the information of the prior.
    pub fn prior(&self) -> DMatrix<f64> {
        DMatrix::from_diagonal(&self.prior_sd.map(|sd| sd.powi(-2)))
    }

    /// HᵀH/σ², the information of one seen movement at the truth.
    pub fn information(&self, configuration: &[f64]) -> DMatrix<f64> {
        let (_, h) = jacobian(&self.truth, &self.layout, configuration);
        h.transpose() * &h / self.sigma_m.powi(2)
    }

    /// tr(W F⁻¹), the bound on the error of whoever has collected the information F; `None` if that is singular.
    pub fn bound(&self, information: &DMatrix<f64>) -> Option<f64> {
        Some(self.weights.trace(&Cholesky::new(information.clone())?.inverse()))
    }

    /// The best design of `movements` movements, to within `gap` of the optimum or as near as it came. `None` for a
    /// sensor without noise.
    pub fn best_design(&self, movements: usize, gap: f64) -> Option<Design> {
        let mut search = Search::new(self, movements);
        for _ in 0..EXCHANGES {
            let state = search.state()?;
            let found = search.favoured(&state);
            let best = found.iter().map(|(_, sensitivity)| *sensitivity).fold(0.0, f64::max);
            let excess = best - state.mean;
            if excess <= gap * state.trace {
                return Some(search.design(&state, excess));
            }
            let joined = found.into_iter().filter(|(_, sensitivity)| *sensitivity > state.mean);
            search.join(joined.map(|(pose, _)| pose).collect());
            search.balance()?;
        }
        let state = search.state()?;
        let best = search.favoured(&state).into_iter().map(|(_, sensitivity)| sensitivity).fold(0.0, f64::max);
        Some(search.design(&state, best - state.mean))
    }
}

/// A design on its way.
struct Search<'a> {
    problem: &'a Limits,
    movements: f64,
    /// In the unit cube.
    candidates: Vec<Vec<f64>>,
    poses: Vec<Vec<f64>>,
    information: Vec<DMatrix<f64>>,
    shares: Vec<f64>,
}

struct State {
    trace: f64,
    /// N M⁻¹ W M⁻¹.
    sensitivity: DMatrix<f64>,
    /// Σ pᵢ φᵢ.
    mean: f64,
}

impl<'a> Search<'a> {
    fn new(problem: &'a Limits, movements: usize) -> Self {
        let n = problem.limits.len();
        // A fixed stream of its own: limits depend on no seed.
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let mut candidates = Vec::with_capacity(3 * CANDIDATES);
        for at_bounds in [0.0, 0.5, 1.0] {
            for _ in 0..CANDIDATES {
                let coordinate = |_| {
                    let x: f64 = rng.random();
                    if rng.random::<f64>() < at_bounds { x.round() } else { x }
                };
                candidates.push((0..n).map(coordinate).collect::<Vec<f64>>());
            }
        }
        let mut search = Self {
            problem,
            movements: movements as f64,
            candidates,
            poses: Vec::new(),
            information: Vec::new(),
            shares: Vec::new(),
        };
        let start = search.candidates.iter().step_by(3 * CANDIDATES / 100).cloned().collect();
        search.join(start);
        search
    }

    fn scaled(&self, point: &[f64]) -> Vec<f64> {
        point.iter().zip(&self.problem.limits).map(|(x, (lower, upper))| lower + x * (upper - lower)).collect()
    }

    /// Adds poses, with a small share each.
    fn join(&mut self, points: Vec<Vec<f64>>) {
        if points.is_empty() {
            return;
        }
        let share = if self.shares.is_empty() { 1.0 } else { 0.1 } / points.len() as f64;
        let rest = 1.0 - share * points.len() as f64;
        self.shares.iter_mut().for_each(|other| *other *= rest);
        for point in points {
            let pose = self.scaled(&point);
            self.information.push(self.problem.information(&pose));
            self.poses.push(pose);
            self.shares.push(share);
        }
    }

    fn state(&self) -> Option<State> {
        let mut m = self.problem.prior();
        for (information, share) in self.information.iter().zip(&self.shares) {
            m += information * (share * self.movements);
        }
        let inverse = Cholesky::new(m)?.inverse();
        let weights = &self.problem.weights;
        let mut weighted = inverse.clone();
        for (k, mut row) in weighted.row_iter_mut().enumerate() {
            row *= weights.of(k);
        }
        let sensitivity = &inverse * weighted * self.movements;
        let mean = self.sensitivities(&sensitivity).zip(&self.shares).map(|(phi, share)| phi * share).sum();
        Some(State { trace: weights.trace(&inverse), sensitivity, mean })
    }

    fn sensitivities<'b>(&'b self, sensitivity: &'b DMatrix<f64>) -> impl Iterator<Item = f64> + 'b {
        self.information.iter().map(|information| information.dot(sensitivity))
    }

    /// The candidates of the greatest sensitivity, polished, with it.
    fn favoured(&self, state: &State) -> Vec<(Vec<f64>, f64)> {
        let Limits { truth, layout, sigma_m, .. } = self.problem;
        let phi = |point: &[f64]| {
            let (_, h) = jacobian(truth, layout, &self.scaled(point));
            (&h * &state.sensitivity).dot(&h) / sigma_m.powi(2)
        };
        let mut values: Vec<(f64, usize)> =
            self.candidates.iter().enumerate().map(|(index, point)| (phi(point), index)).collect();
        values.sort_by(|a, b| b.0.total_cmp(&a.0));
        let settings = Polish { steps: 40, tolerance: 1e-6 };
        let polished = values.iter().take(POLISHED).map(|(_, index)| {
            let evaluate = |points: &[Vec<f64>]| points.iter().map(|point| -phi(point)).collect();
            let (point, value) = polish(&self.candidates[*index], settings, evaluate);
            (point, -value)
        });
        polished.collect()
    }

    /// Balances the shares, and drops poses without one.
    fn balance(&mut self) -> Option<()> {
        for _ in 0..BALANCING {
            let state = self.state()?;
            let roots: Vec<f64> = self.sensitivities(&state.sensitivity).map(|phi| phi.max(0.0).sqrt()).collect();
            let total: f64 = roots.iter().zip(&self.shares).map(|(root, share)| root * share).sum();
            self.shares.iter_mut().zip(&roots).for_each(|(share, root)| *share *= root / total);
        }
        let kept: Vec<bool> = self.shares.iter().map(|share| *share >= NEGLIGIBLE).collect();
        let mut keep = kept.iter();
        self.poses.retain(|_| *keep.next().unwrap_or(&true));
        let mut keep = kept.iter();
        self.information.retain(|_| *keep.next().unwrap_or(&true));
        let mut keep = kept.iter();
        self.shares.retain(|_| *keep.next().unwrap_or(&true));
        let total: f64 = self.shares.iter().sum();
        self.shares.iter_mut().for_each(|share| *share /= total);
        Some(())
    }

    fn design(self, state: &State, excess: f64) -> Design {
        Design { poses: self.poses, shares: self.shares, trace: state.trace, gap: (excess / state.trace).max(0.0) }
    }
}
