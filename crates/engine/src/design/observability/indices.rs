//! The observability indices O1 … O5.

use nalgebra::DMatrix;

use crate::{
    elementary::{exp, ln},
    model::eigen,
};

/// Observability indices: they measure how well a set of postures conditions an identification, by the singular values σ₁ ≥ … ≥ σₘ
/// of its Jacobian, n postures stacked, whitened by the noise and with parameters in units of their prior standard deviations.
/// Without a unit; all are better the greater they are. Collected and compared by Y. Sun and J. M. Hollerbach, "Observability Index
/// Selection for Robot Calibration", ICRA 2008.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Indices {
    /// (σ₁ σ₂ … σₘ)^{1/m} / √n (Borm and Menq 1991): criterion D.
    pub o1: f64,
    /// σₘ / σ₁ (Driels and Pathre 1990): the inverse of the condition number.
    pub o2: f64,
    /// σₘ (Nahvi, Hollerbach and Hayward 1994): criterion E.
    pub o3: f64,
    /// σₘ² / σ₁ (Nahvi and Hollerbach 1996): the noise amplification index.
    pub o4: f64,
    /// 1 / (1/σ₁ + 1/σ₂ + … + 1/σₘ) (Sun and Hollerbach 2008): kin of criterion A.
    pub o5: f64,
}

impl Indices {
    /// The indices of `postures` movements whose scaled information is JᵀJ (m × m), over the `rank` directions that can be
    /// determined: σ of the others is nothing, and would make every index nothing.
    pub fn of(information: &DMatrix<f64>, rank: usize, postures: usize) -> Self {
        if rank == 0 {
            return Self::default();
        }
        let Some(eigen) = eigen(information.clone()) else { return Self::default() };
        let mut squares: Vec<f64> = eigen.eigenvalues.iter().copied().collect();
        squares.sort_by(|a, b| b.total_cmp(a));
        let singular: Vec<f64> = squares.iter().take(rank).map(|square| square.max(0.0).sqrt()).collect();
        let (Some(greatest), Some(least)) = (singular.first().copied(), singular.last().copied()) else {
            return Self::default();
        };
        if least == 0.0 {
            return Self::default();
        }
        let logarithms = singular.iter().map(|sigma| ln(*sigma)).sum::<f64>();
        Self {
            o1: exp(logarithms / singular.len() as f64) / (postures.max(1) as f64).sqrt(),
            o2: least / greatest,
            o3: least,
            o4: least * least / greatest,
            o5: singular.iter().map(|sigma| sigma.recip()).sum::<f64>().recip(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// J = [3 0; 0 2; 0 0] over two postures, and the same turned: σ are 3 and 2.
    #[test]
    fn two_by_two_worked_by_hand() {
        let expected = [6.0_f64.sqrt() / 2.0_f64.sqrt(), 2.0 / 3.0, 2.0, 4.0 / 3.0, 6.0 / 5.0];
        let turn = DMatrix::from_row_slice(2, 2, &[0.6, -0.8, 0.8, 0.6]);
        let plain = DMatrix::from_row_slice(2, 2, &[9.0, 0.0, 0.0, 4.0]);
        for information in [plain.clone(), &turn * plain * turn.transpose()] {
            let Indices { o1, o2, o3, o4, o5 } = Indices::of(&information, 2, 2);
            for (found, wanted) in [o1, o2, o3, o4, o5].into_iter().zip(expected) {
                assert!((found - wanted).abs() < 1e-12, "{found} {wanted}");
            }
        }
    }

    #[test]
    fn what_cannot_be_determined_does_not_count() {
        let information = DMatrix::from_row_slice(3, 3, &[9.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 4.0]);
        assert_eq!(Indices::of(&information, 2, 2).o2, 2.0 / 3.0);
        assert_eq!(Indices::of(&information, 3, 2), Indices::default(), "of so much nothing is determined");
        assert_eq!(Indices::of(&DMatrix::zeros(0, 0), 0, 0), Indices::default());
    }
}
