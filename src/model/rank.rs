//! How many independent equations there are, and what they leave open.

use nalgebra::{DMatrix, DVector, SVD, SymmetricEigen};

/// Singular values of the scaled Jacobian below this share of the greatest count as none.
const NEGLIGIBLE: f64 = 1e-7;

/// The rank of a Jacobian with its columns scaled to one length.
pub fn rank(h: &DMatrix<f64>) -> usize {
    if h.is_empty() {
        return 0;
    }
    let mut scaled = h.clone();
    for mut column in scaled.column_iter_mut() {
        let length = column.norm();
        if length > 0.0 {
            column /= length;
        }
    }
    let singular = SVD::new(scaled, false, false).singular_values;
    let greatest = singular.amax();
    singular.iter().filter(|value| greatest > 0.0 && **value > NEGLIGIBLE * greatest).count()
}

/// Eigenvalues of the scaled information HᵀH below this share of the greatest count as none: singular values of H below a
/// millionth.
const NO_INFORMATION: f64 = 1e-12;

/// N, an orthonormal basis of what an information (m × m) does not determine (m × k), found with its diagonal scaled to 1;
/// without columns where the information is no number.
pub fn null_space(information: &DMatrix<f64>) -> DMatrix<f64> {
    let m = information.nrows();
    if m == 0 {
        return DMatrix::zeros(0, 0);
    }
    let scale = information.diagonal().map(|x| if x > 0.0 { x.sqrt().recip() } else { 1.0 });
    let scaled = information.component_mul(&(&scale * scale.transpose()));
    if !scaled.iter().all(|x| x.is_finite()) {
        return DMatrix::zeros(m, 0);
    }
    let eigen = SymmetricEigen::new(scaled);
    let greatest = eigen.eigenvalues.amax().max(f64::MIN_POSITIVE);
    let free: Vec<DVector<f64>> = (0..m)
        .filter(|k| eigen.eigenvalues[*k] < NO_INFORMATION * greatest)
        .map(|k| eigen.eigenvectors.column(k).component_mul(&scale))
        .collect();
    if free.is_empty() { DMatrix::zeros(m, 0) } else { DMatrix::from_columns(&free).qr().q() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_count_whatever_their_units() {
        let h = DMatrix::from_row_slice(3, 3, &[1.0, 2e9, 3.0, 0.5, 1e9, 7.0, 2.0, 4e9, -1.0]);
        assert_eq!(rank(&h), 2, "the second column is the first in another unit");
        assert_eq!(rank(&DMatrix::from_diagonal_element(4, 4, 1e-12)), 4);
        assert_eq!((rank(&DMatrix::zeros(3, 2)), rank(&DMatrix::zeros(0, 2))), (0, 0));
    }
}
