//! How many independent equations there are.

use nalgebra::{DMatrix, SVD};

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
