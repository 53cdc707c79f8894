//! What makes a movement good: the alphabet of optimal design.

use nalgebra::{Cholesky, DMatrix, DVector};

use super::Weights;
use crate::{
    elementary::{ln, sin},
    model::{Layout, State, Workspace, eigen},
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
        .map_or(f64::INFINITY, |cholesky| cholesky.l_dirty().diagonal().iter().map(|x| ln(*x)).sum())
}

/// Mean of HᵀH over the workspace, H being the marker's (m).
pub(super) fn prediction_metric(state: &State, layout: &Layout, workspace: &Workspace) -> DMatrix<f64> {
    let jacobian = workspace.jacobian(state, layout);
    jacobian.tr_mul(&jacobian) / workspace.configurations.len().max(1) as f64
}

/// Steps of Lanczos' iteration.
const STEPS: usize = 16;

/// The greatest eigenvalue of W^½ (P − Gᵀ S⁻¹ G) W^½, by Lanczos' iteration with full reorthogonalisation (Golub and Van
/// Loan, *Matrix Computations*, §10.3): from below, and near. `update` holds Gᵀ and S⁻¹.
pub(super) fn greatest_eigenvalue(
    covariance: &DMatrix<f64>,
    weights: &Weights,
    update: Option<&(DMatrix<f64>, DMatrix<f64>)>,
) -> f64 {
    let m = covariance.nrows();
    let root = weights.roots();
    let steps = STEPS.min(m);
    let mut basis: Vec<DVector<f64>> = Vec::with_capacity(steps);
    let mut projected = DMatrix::zeros(steps, steps);
    // Not a symmetric start, which could be orthogonal to the eigenvector.
    let mut v = DVector::from_fn(m, |k, _| 1.0 + 0.37 * sin(k as f64)).normalize();
    for step in 0..steps {
        let scaled = v.component_mul(&root);
        let mut next = covariance * &scaled;
        if let Some((gain, inverse)) = update {
            next -= gain * (inverse * gain.tr_mul(&scaled));
        }
        next.component_mul_assign(&root);
        projected[(step, step)] = v.dot(&next);
        basis.push(v);
        for _ in 0..2 {
            for known in &basis {
                next.axpy(-known.dot(&next), known, 1.0);
            }
        }
        let length = next.norm();
        if step + 1 == steps || length <= 1e-14 * projected[(step, step)].abs() || !length.is_finite() {
            break;
        }
        projected[(step + 1, step)] = length;
        projected[(step, step + 1)] = length;
        v = next / length;
    }
    let found = projected.view((0, 0), (basis.len(), basis.len())).into_owned();
    eigen(found).map_or(f64::NAN, |eigen| eigen.eigenvalues.max())
}
