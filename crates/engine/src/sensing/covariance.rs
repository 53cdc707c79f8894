//! Full covariances of noise: the check that one is positive, its root, and what is whitened by it.

use nalgebra::{DMatrix, Matrix3};

use crate::numeric_range::is_positive;

/// The shape of a covariance Σ = L Lᵀ (d × d) with σ² = tr Σ/d.
#[derive(Debug, PartialEq)]
pub(super) struct Shape {
    /// L/σ, lower triangular.
    root: DMatrix<f64>,
    /// Its inverse.
    inverse: DMatrix<f64>,
}

/// How small σ of one coordinate may be beside the largest, and along any direction beside those of the coordinates: below, rounding
/// decides on it.
const THINNEST: f64 = 1e-6;

impl Shape {
    /// σ and the shape of a covariance; `None` unless it is symmetric and positive, by more than rounding, and its standard
    /// deviations are numbers by which readings can be divided.
    pub fn of(covariance: &DMatrix<f64>) -> Option<(f64, Self)> {
        let root = root(covariance)?;
        let sigma = (covariance.trace() / covariance.nrows() as f64).sqrt();
        let root = root / sigma;
        let inverse = root.clone().try_inverse()?;
        Some((sigma, Self { root, inverse }))
    }

    /// d.
    pub fn equations(&self) -> usize {
        self.root.nrows()
    }

    /// Replaces d columns of m numbers by L/σ times them.
    pub fn multiply(&self, columns: &mut [f64]) {
        multiply(&self.root, columns);
    }

    /// Replaces d columns of m numbers by (L/σ)⁻¹ times them.
    pub fn divide(&self, columns: &mut [f64]) {
        multiply(&self.inverse, columns);
    }

    /// (L/σ)⁻¹ of three equations.
    pub fn inverse_of_point(&self) -> Matrix3<f64> {
        Matrix3::from_fn(|row, column| self.inverse[(row, column)])
    }
}

/// Replaces d columns of m numbers by those that a lower triangular matrix (d × d) makes of them.
fn multiply(lower: &DMatrix<f64>, columns: &mut [f64]) {
    let d = lower.nrows();
    let m = columns.len() / d;
    // Of the rows before it alone does a row become another, so the last is first.
    for row in (0..d).rev() {
        let (before, from) = columns.split_at_mut(row * m);
        for (index, x) in from[..m].iter_mut().enumerate() {
            let sum: f64 = (0..row).map(|k| lower[(row, k)] * before[k * m + index]).sum();
            *x = sum + lower[(row, row)] * *x;
        }
    }
}

/// L, lower triangular, of a covariance Σ = L Lᵀ; `None` unless Σ is symmetric and positive, by more than rounding, and its standard
/// deviations are numbers by which readings can be divided.
fn root(covariance: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    // Of what is no number the largest says nothing.
    if covariance.is_empty() || !covariance.is_square() || !covariance.iter().all(|x| x.is_finite()) {
        return None;
    }
    let deviations = covariance.diagonal().map(f64::sqrt);
    if !deviations.iter().all(|sigma| is_positive(*sigma)) || deviations.min() < THINNEST * deviations.max() {
        return None;
    }
    let scaled = covariance.component_div(&(&deviations * deviations.transpose()));
    let is_symmetric = (&scaled - scaled.transpose()).amax() <= 1e-9;
    let mut root = scaled.cholesky().filter(|_| is_symmetric)?.unpack();
    let is_thick = root.diagonal().iter().all(|x| *x >= THINNEST);
    root.row_iter_mut().zip(&deviations).for_each(|(mut row, sigma)| row *= *sigma);
    is_thick.then_some(root)
}

#[cfg(test)]
mod tests {
    use nalgebra::DVector;

    use super::*;

    const BAD: [f64; 9] = [0.0, -0.0, -1.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e-310, 1e-30, 1e300];

    #[test]
    fn a_covariance_is_positive_or_none() {
        let sound = DMatrix::from_diagonal(&DVector::from_column_slice(&[1e-6, 4e-6, 1e-12]));
        let l = root(&sound).expect("positive");
        assert!((&l * l.transpose() - &sound).amax() < 1e-18);
        for (place, bad) in (0..9).flat_map(|place| BAD.map(|bad| (place, bad))) {
            let mut covariance = sound.clone();
            covariance[place] = bad;
            // Beside the diagonal nothing, and next to nothing, is no correlation.
            let is_same = place % 4 != 0 && bad.abs() < 1e-20;
            assert_eq!(root(&covariance).is_some(), is_same, "{place} {bad}");
            assert_eq!(Shape::of(&covariance).is_some(), is_same);
        }
        let flat = DMatrix::from_fn(3, 3, |row, column| if row == column { 1.0 } else { 1.0 - 1e-15 });
        assert_eq!((root(&flat), root(&-sound)), (None, None));
        assert_eq!((root(&DMatrix::identity(0, 0)), root(&DMatrix::identity(2, 3))), (None, None));
    }

    /// What has a covariance has none once it is divided by its root, and is the same again once it is multiplied.
    #[test]
    fn a_shape_is_that_of_its_covariance() {
        let d = 6;
        let square = DMatrix::from_fn(d, d, |row, column| ((row * row + 3 * column) % 7) as f64 - 2.5);
        let covariance = &square * square.transpose() + DMatrix::identity(d, d) * 0.1;
        let (sigma, shape) = Shape::of(&covariance).expect("positive");
        let mut l = DMatrix::identity(d, d);
        // Row after row, so that the columns are those of the transpose.
        shape.multiply(l.as_mut_slice());
        let l = l.transpose() * sigma;
        assert!((&l * l.transpose() - &covariance).amax() < 1e-9 * covariance.amax());
        let mut divided = (l.transpose() / sigma).as_slice().to_vec();
        shape.divide(&mut divided);
        assert!((DMatrix::from_column_slice(d, d, &divided) - DMatrix::identity(d, d)).amax() < 1e-9);
    }
}
