//! How far a movement tells two hypotheses apart: by the Bhattacharyya distance of the readings that they predict, of which the
//! [mixture criterion](super::MixtureCriterion) tells what it is for.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use crate::{elementary::exp_m1, sensing::MeasurementModel};

/// From this distance on, what two hypotheses are confused by is lost in rounding.
const FAR_APART: f64 = 40.0;

/// 1 − e^{−B}.
pub(super) fn share(distance: f64) -> f64 {
    if distance > FAR_APART { 1.0 } else { -exp_m1(-distance) }
}

/// What is made of B = ⅛ δᵀ S̄⁻¹ δ and of u = S̄⁻¹ δ, by the readings that two hypotheses predict, δ apart, by how much each
/// of them counts, and the mean of their H P Hᵀ, entry by entry; `None` where S̄ is not positive.
pub(super) fn bhattacharyya<T>(
    measurement_model: &MeasurementModel,
    readings: [&[f64]; 2],
    counts: impl Fn(usize) -> f64,
    spread: impl Fn(usize, usize) -> f64,
    found: impl FnOnce(f64, &[f64]) -> T,
) -> Option<T> {
    let mean = |row: usize, column: usize| spread(row, column) + if row == column { 1.0 } else { 0.0 };
    let d = readings[0].len();
    // Most often a point in space.
    if d == 3 {
        let mut apart = Vector3::zeros();
        measurement_model.difference(readings[0], readings[1], apart.as_mut_slice());
        apart.iter_mut().enumerate().for_each(|(row, x)| *x *= counts(row));
        let u = Matrix3::from_fn(mean).cholesky()?.solve(&apart);
        return Some(found(0.125 * apart.dot(&u), u.as_slice()));
    }
    let mut apart = DVector::zeros(d);
    measurement_model.difference(readings[0], readings[1], apart.as_mut_slice());
    apart.iter_mut().enumerate().for_each(|(row, x)| *x *= counts(row));
    // Of what neither sees, like absent points of a body, nothing is to be solved.
    let told: Vec<usize> = (0..d).filter(|row| apart[*row] != 0.0 || spread(*row, *row) != 0.0).collect();
    // The decomposition reads what is below the diagonal.
    let below = |row: usize, column: usize| if row >= column { mean(told[row], told[column]) } else { 0.0 };
    let solved = DMatrix::from_fn(told.len(), told.len(), below).cholesky()?.solve(&apart.select_rows(&told));
    let mut u = DVector::zeros(d);
    told.iter().zip(solved.iter()).for_each(|(row, x)| u[*row] = *x);
    Some(found(0.125 * apart.dot(&u), u.as_slice()))
}
