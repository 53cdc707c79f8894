//! Designs: which movements teach most, and what data allow.
//!
//! Everything here is evaluated at the true parameters, for judges; only the observability is computed before anything is known of
//! them.
//!
//! * *What the data allow.* With F = Λ₀ + Σ HᵀH (H whitened), the information of the prior and of the data collected,
//!   linearised at the truth, F⁻¹ is the covariance that a learner with this prior and these data would have if the model
//!   were linear, as it nearly is once the error is small; what is shown is tr(W F⁻¹). It is no theorem about any
//!   estimator: the bound of Cramér and Rao knows no prior, and that of van Trees averages the information over it, while
//!   this one takes it at one truth. A learner whose guess happens to be good can be better.
//! * *The best data.* Among all sets of N movements, the A-optimal design minimises that trace. Solved for movements
//!   with real-valued multiplicities N pᵢ (an approximate design: no whole-numbered one is better) by exchange
//!   (Fedorov 1972): a pose that the sensitivity
//!
//!   ```text
//!   φ(θ) = N tr(H M⁻¹ W M⁻¹ Hᵀ),    M = Λ₀ + N Σ pᵢ HᵢᵀHᵢ
//!   ```
//!
//!   favours most joins the design, and the shares are balanced by Newton's method over the simplex. By the equivalence
//!   theorem (Kiefer and Wolfowitz 1960) the design is optimal where φ nowhere exceeds Σ pᵢ φᵢ, and its trace is above the
//!   optimum by at most the difference.
//!   Only movements after which something is seen are candidates, and what a channel does not see tells nothing (`visible` of
//!   the [measurement model](crate::sensing::MeasurementModel)).
//! * *Before any measurement* ([`observability`]): what can be determined at all, and how well by how many movements, at the robot as
//!   it is described.
//! * *Counting.* As many independent equations as there are directions that can be determined. A yardstick, not a bound.

mod balance;
mod best;
mod candidates;
mod counting;
#[cfg(test)]
mod laws;
pub mod observability;
mod search;
mod sensitivity;

pub use best::{BestDesign, Stretch, best_designs};
pub use counting::{General, general_movements, movements_by_counting};
pub use search::Design;
#[cfg(feature = "testing")]
#[doc(hidden)]
pub use search::DesignSearch;

use std::sync::Arc;

use nalgebra::{Cholesky, DMatrix};

use crate::{
    estimation::Belief,
    kinematics::JointBox,
    model::{Layout, State},
    selection::Weights,
    sensing::{Head, MeasurementModel},
};

/// A design problem: the truth, and the movements that are possible there.
#[derive(Clone, Debug)]
pub struct Problem {
    /// The true state.
    pub truth: State,
    /// Which of its parameters are learned.
    pub layout: Layout,
    /// What is measured, whitened by its true noise.
    pub measurement_model: Arc<MeasurementModel>,
    /// Joint limits.
    pub limits: JointBox,
    /// The head that watches; `None` if the sensors see what they see by themselves.
    pub head: Option<Head>,
    /// A posture (rad or m) at which something is said to be seen, where not everything is.
    pub visible_pose: Option<Vec<f64>>,
    /// Λ₀, the information of the prior.
    pub prior: DMatrix<f64>,
    /// W.
    pub weights: Weights,
}

impl Problem {
    /// HᵀH, the information of one movement at the truth, from the channels that see something there.
    pub fn information(&self, configuration: &[f64]) -> DMatrix<f64> {
        match self.seen(configuration) {
            Some(rows) => &rows * rows.transpose(),
            None => DMatrix::zeros(self.layout.dimension(), self.layout.dimension()),
        }
    }

    /// Hᵀ at the truth (m × d), zero where a channel sees nothing; `None` where none sees anything.
    fn seen(&self, configuration: &[f64]) -> Option<DMatrix<f64>> {
        self.measurement_model.visible_jacobian(self.head.as_ref(), &self.truth, &self.layout, configuration)
    }

    /// Whether each channel reads.
    fn visible(&self, configuration: &[f64]) -> Vec<bool> {
        self.measurement_model.visible(self.head.as_ref(), &self.truth, configuration)
    }

    /// Whether anything is seen.
    fn sees(&self, configuration: &[f64]) -> bool {
        self.visible(configuration).contains(&true)
    }

    /// The covariance F⁻¹ that the information F allows, in the chart at the truth; `None` if F is singular.
    pub fn allowed(&self, information: &DMatrix<f64>) -> Option<Belief> {
        let covariance = Cholesky::new(information.clone())?.inverse();
        let at_truth = Belief::new(self.truth.clone(), Arc::new(self.layout.clone()), self.measurement_model.clone());
        Some(at_truth.with_covariance(covariance))
    }
}
