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
//!   Where a head watches, only movements after which it sees the marker are candidates.
//! * *Counting.* As many equations as unknowns: ⌈m/3⌉ movements, three numbers each. A yardstick, not a bound.

mod design;
mod report;

pub use design::Design;
pub use report::{BestDesign, Stretch, best_designs};

use nalgebra::{Cholesky, DMatrix, DVector, Dyn, OMatrix, U3};

use crate::{
    kinematics::{Chain, TangentLayout, jacobian::jacobian},
    selection::Weights,
    sensing::Head,
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
    /// The head that watches; `None` if the marker is always seen.
    pub head: Option<Head>,
    /// Standard deviation of the prior per tangent coordinate.
    pub prior_sd: DVector<f64>,
    /// Standard deviation of the sensor per coordinate, metres.
    pub sigma_m: f64,
    /// W.
    pub weights: Weights,
}

/// Movements after which there are as many equations as unknowns, three per movement.
pub fn movements_by_counting(parameters: usize) -> usize {
    parameters.div_ceil(3)
}

impl Limits {
    /// Λ₀, the information of the prior.
    pub fn prior(&self) -> DMatrix<f64> {
        DMatrix::from_diagonal(&self.prior_sd.map(|sd| sd.powi(-2)))
    }

    /// HᵀH/σ², the information of one movement at the truth; nothing of a marker that the head does not see.
    pub fn information(&self, configuration: &[f64]) -> DMatrix<f64> {
        match self.seen(configuration) {
            Some(h) => h.transpose() * &h / self.sigma_m.powi(2),
            None => DMatrix::zeros(self.layout.dimension(), self.layout.dimension()),
        }
    }

    /// H at the truth; `None` where the marker is not seen.
    fn seen(&self, configuration: &[f64]) -> Option<OMatrix<f64, U3, Dyn>> {
        let (marker, h) = jacobian(&self.truth, &self.layout, configuration);
        self.head.is_none_or(|head| head.sees(&marker)).then_some(h)
    }

    /// tr(W F⁻¹), the bound on the error of whoever has collected the information F; `None` if that is singular.
    pub fn bound(&self, information: &DMatrix<f64>) -> Option<f64> {
        Some(self.weights.trace(&Cholesky::new(information.clone())?.inverse()))
    }
}
