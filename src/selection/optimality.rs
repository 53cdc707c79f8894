//! What makes a movement good: the alphabet of optimal design.

use nalgebra::{Cholesky, DMatrix, DVector};

use super::Weights;
use crate::model::{Layout, State, jacobian};

/// What is to become small (Atkinson, Donev, Tobias: *Optimum Experimental Designs*, 2007).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Optimality {
    /// tr(W P), the mean squared error of the parameters: the paper's.
    #[default]
    A,
    /// ½ ln det P, the entropy of the parameters in nats. W does not matter.
    D,
    /// The greatest eigenvalue of W^½ (P − Gᵀ S⁻¹ G) W^½ by power iteration; `update` holds Gᵀ and S⁻¹.
pub(super) fn greatest_eigenvalue(
    covariance: &DMatrix<f64>,
    weights: &Weights,
    update: Option<&(DMatrix<f64>, DMatrix<f64>)>,
) -> f64 {
    let m = covariance.nrows();
    let root = weights.roots();
    // Not a symmetric start, which could be orthogonal to the eigenvector.
    let mut v = DVector::from_fn(m, |k, _| 1.0 + 0.37 * (k as f64).sin()).normalize();
    let mut value = 0.0;
    for _ in 0..STEPS {
        let scaled = v.component_mul(&root);
        let mut next = covariance * &scaled;
        if let Some((gain, inverse)) = update {
            next -= gain * (inverse * gain.tr_mul(&scaled));
        }
        next.component_mul_assign(&root);
        value = next.norm();
        if value <= 0.0 || !value.is_finite() {
            break;
        }
        v = next / value;
    }
    value
}
