//! Where a bounded quasi-Newton search goes next: along −B g, both restricted to the coordinates that are not pressed against a
//! bound of the unit cube (Bertsekas 1982), B being the BFGS estimate of the inverse Hessian.

use nalgebra::{DMatrix, DVector};

/// The longest first step of a coordinate.
const FIRST_STEP: f64 = 0.15;

/// A direction of descent.
pub(super) struct Aim {
    pub direction: DVector<f64>,
    /// 1 for coordinates that are not pressed against a bound.
    pub free: DVector<f64>,
    /// Whether it is Newton's, or the steepest.
    pub is_newton: bool,
}

/// Where to go from `x`; `None` if nothing is lower nearby.
pub(super) fn aim(x: &[f64], gradient: &DVector<f64>, inverse_hessian: Option<&DMatrix<f64>>) -> Option<Aim> {
    let pressed = |k: usize| (x[k] <= 0.0 && gradient[k] >= 0.0) || (x[k] >= 1.0 && gradient[k] <= 0.0);
    let free = DVector::from_fn(x.len(), |k, _| f64::from(!pressed(k)));
    let restricted = gradient.component_mul(&free);
    let steepness = restricted.amax();
    // Where finite values differ by more than the greatest number, no direction can be computed.
    if steepness == 0.0 || !steepness.is_finite() {
        return None;
    }
    let newton = inverse_hessian.map(|b| -(b * &restricted).component_mul(&free));
    let newton = newton.filter(|d| d.dot(&restricted) < 0.0 && d.iter().all(|d| d.is_finite()));
    let is_newton = newton.is_some();
    let direction = newton.unwrap_or_else(|| &restricted * (-FIRST_STEP / steepness));
    Some(Aim { direction, free, is_newton })
}

/// The BFGS update of the inverse Hessian; as it was, where the curvature along the step is not positive.
pub(super) fn updated(
    before: Option<DMatrix<f64>>,
    step: &DVector<f64>,
    change: &DVector<f64>,
) -> Option<DMatrix<f64>> {
    let curvature = step.dot(change);
    if curvature <= 1e-12 * step.norm() * change.norm() {
        return before;
    }
    let n = step.len();
    let mut b = before.unwrap_or_else(|| DMatrix::identity(n, n) * (curvature / change.norm_squared()));
    // (I − s yᵀ/c) B (I − y sᵀ/c) + s sᵀ/c, multiplied out.
    let carried = &b * change;
    let own = (1.0 + change.dot(&carried) / curvature) / curvature;
    b.ger(own, step, step, 1.0);
    b.ger(-1.0 / curvature, &carried, step, 1.0);
    b.ger(-1.0 / curvature, step, &carried, 1.0);
    Some(b)
}

/// The estimate after a descent over a ridge, where the slope steepened along the step: B + σ s sᵀ, with σ such that the next
/// step goes on along s by as much as a first one, while the other directions keep what was learned of them.
pub(super) fn lengthened(
    before: Option<DMatrix<f64>>,
    step: &DVector<f64>,
    gradient: &DVector<f64>,
) -> Option<DMatrix<f64>> {
    let mut b = before?;
    let slope = step.dot(gradient);
    let sigma = FIRST_STEP / (step.amax() * -slope);
    if sigma > 0.0 && sigma.is_finite() {
        b.ger(sigma, step, step, 1.0);
    }
    Some(b)
}
