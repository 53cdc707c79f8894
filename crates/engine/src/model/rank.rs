//! The number of independent equations, and the directions that they leave open.

use nalgebra::{DMatrix, DVector, Dyn, SVD, SymmetricEigen};

/// Iterations of a decomposition for each row, at most: some five are enough.
const ITERATIONS: usize = 1000;

/// Eigenvalues and eigenvectors of a symmetric matrix; `None` if an entry is not finite, on which the search would not end.
pub fn eigen(matrix: DMatrix<f64>) -> Option<SymmetricEigen<f64, Dyn>> {
    if !matrix.iter().all(|x| x.is_finite()) {
        return None;
    }
    let rows = matrix.nrows();
    if rows == 0 {
        return Some(SymmetricEigen { eigenvectors: matrix, eigenvalues: DVector::zeros(0) });
    }
    SymmetricEigen::try_new(matrix, f64::EPSILON, ITERATIONS * rows)
}

/// The singular value decomposition, with U if asked for; `None` if an entry is not finite or the matrix is empty.
pub fn singular(matrix: DMatrix<f64>, with_u: bool) -> Option<SVD<f64, Dyn, Dyn>> {
    if matrix.is_empty() || !matrix.iter().all(|x| x.is_finite()) {
        return None;
    }
    let iterations = ITERATIONS * matrix.nrows().max(matrix.ncols());
    SVD::try_new(matrix, with_u, false, 5.0 * f64::EPSILON, iterations)
}

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
    // What is no number is independent of nothing.
    let Some(singular) = singular(scaled, false).map(|svd| svd.singular_values) else { return 0 };
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
    let Some(eigen) = eigen(scaled) else { return DMatrix::zeros(m, 0) };
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

    /// Whatever stands in a matrix, its decomposition ends.
    #[test]
    fn what_is_no_number_has_no_decomposition() {
        for x in [f64::NAN, f64::INFINITY, -f64::INFINITY] {
            let mut matrix = DMatrix::identity(4, 4);
            (matrix[(1, 2)], matrix[(2, 1)]) = (x, x);
            assert!(eigen(matrix.clone()).is_none() && singular(matrix.clone(), true).is_none());
            assert_eq!((rank(&matrix), null_space(&matrix).ncols()), (0, 0), "{x}");
        }
        for x in [1e-320, 1e308, f64::MIN_POSITIVE] {
            let matrix = DMatrix::from_diagonal_element(4, 4, x);
            let _ = (eigen(matrix.clone()), singular(matrix.clone(), true), rank(&matrix), null_space(&matrix));
        }
        assert_eq!(eigen(DMatrix::zeros(0, 0)).expect("nothing").eigenvalues.len(), 0);
        assert_eq!(null_space(&DMatrix::zeros(0, 0)).shape(), (0, 0));
    }
}
