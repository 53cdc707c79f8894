//! What makes a movement good: the alphabet of optimal design.

use nalgebra::{Cholesky, DMatrix, DVector};

use super::Weights;
use crate::{
    kinematics::{Chain, TangentLayout, jacobian::jacobian},
    sensing::isotropic,
};

/// What is to become small (Atkinson, Donev, Tobias: *Optimum Experimental Designs*, 2007).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Optimality {
    /// tr(W P), the mean squared error of the parameters: the paper's.
    #[default]
    A,
    /// ½ ln det P, the entropy of the parameters in nats. W does not matter.
    D,
    /// The greatest eigenvalue of W^½ P W^½, the squared error of what is known worst.
    E,
    /// Mean of tr(H P Hᵀ) over the workspace, the squared error of predicted markers, m². W does not matter.
    I,
}

/// ½ ln det P; infinite if P is not positive.
pub(super) fn half_log_determinant(covariance: &DMatrix<f64>) -> f64 {
    Cholesky::new(covariance.clone())
        .map_or(f64::INFINITY, |cholesky| cholesky.l_dirty().diagonal().iter().map(|x| x.ln()).sum())
}

/// Mean of HᵀH over the workspace.
pub(super) fn prediction_metric(chain: &Chain, layout: &TangentLayout, workspace: &[Vec<f64>]) -> DMatrix<f64> {
    let m = layout.dimension();
    let sum = workspace.iter().fold(DMatrix::zeros(m, m), |sum, theta| {
        let (_, h) = jacobian(chain, layout, theta);
        sum + h.transpose() * h
    });
    sum / workspace.len().max(1) as f64
}

/// Steps of the power iteration.
const STEPS: usize = 24;

/// The greatest eigenvalue of W^½ (P − Gᵀ S⁻¹ G) W^½ by power iteration; `update` holds Gᵀ and S.
pub(super) fn greatest_eigenvalue(
    covariance: &DMatrix<f64>,
    weights: &Weights,
    update: Option<(&DMatrix<f64>, nalgebra::Matrix3<f64>)>,
) -> f64 {
    let m = covariance.nrows();
    let root = DVector::from_fn(m, |k, _| weights.of(k).sqrt());
    let inverse = update.and_then(|(gain, s)| Some((gain, s.cholesky()?.inverse())));
    // Not a symmetric start, which could be orthogonal to the eigenvector.
    let mut v = DVector::from_fn(m, |k, _| 1.0 + 0.37 * (k as f64).sin()).normalize();
    let mut value = 0.0;
    for _ in 0..STEPS {
        let scaled = v.component_mul(&root);
        let mut next = covariance * &scaled;
        if let Some((gain, inverse)) = &inverse {
            next -= *gain * (inverse * (gain.transpose() * &scaled));
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

/// Of S = H P Hᵀ + r I: ½ ln det(S / r), the information that a marker brings, nats.
pub(super) fn information(spread: &nalgebra::Matrix3<f64>, noise_m2: f64) -> f64 {
    0.5 * ((spread + isotropic(noise_m2)) / noise_m2).determinant().max(f64::MIN_POSITIVE).ln()
}
