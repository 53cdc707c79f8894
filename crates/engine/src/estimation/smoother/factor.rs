//! Cholesky's factor of a positive matrix, Λ = L Lᵀ, four columns at a time.
//!
//! ```text
//! L₁₁ L₁₁ᵀ = Λ₁₁ − L₁₀ L₁₀ᵀ,     L₂₁ = (Λ₂₁ − L₂₀ L₁₀ᵀ) L₁₁⁻ᵀ
//! ```
//!
//! with the columns on the left computed before (Golub and Van Loan, *Matrix Computations*, §4.2). All that is read lies one
//! behind the other in columns, and every number that is read serves several products. Registers hold four numbers, however
//! wide they could be: a corner of L is then as wide as it is high, and L no larger than it must be.

use fearless_simd::{Level, Simd, SimdBase, dispatch, f64x4};
use nalgebra::{DMatrix, DVector};

use super::gram::squared;
use crate::{elementary::ln, simd::GROUP};

/// The number of columns that are computed together, and of numbers in a register.
const WIDTH: usize = 4;

/// L, its columns one behind the other; rows and columns beyond the matrix are those of the identity.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub(super) struct Factor {
    #[serde(skip, default = "Level::new")]
    level: Level,
    /// Rows of the matrix.
    m: usize,
    /// Rows and columns of L.
    n: usize,
    l: Vec<f64>,
}

impl Factor {
    /// Factors a symmetric matrix whose diagonal is multiplied by 1 + `damping`; `None` if that is not positive
    /// definite.
    pub fn new(level: Level, matrix: &DMatrix<f64>, damping: f64) -> Option<Self> {
        let m = matrix.nrows();
        let n = m.next_multiple_of(WIDTH);
        Self { level, m, n, l: vec![0.0; n * n] }.anew(matrix, damping)
    }

    /// Factors another matrix with as many rows, in the memory of this one.
    pub fn anew(mut self, matrix: &DMatrix<f64>, damping: f64) -> Option<Self> {
        let Self { level, m, n, ref mut l } = self;
        // What is above the diagonal is zero.
        for (index, column) in l.chunks_exact_mut(n.max(1)).enumerate() {
            if index < m {
                column[index..m].copy_from_slice(&matrix.as_slice()[index * m + index..(index + 1) * m]);
                column[index] *= 1.0 + damping;
            } else {
                column[index] = 1.0;
            }
        }
        dispatch!(level, simd => factorise(simd, n, l)).then_some(self)
    }

    /// ln det Λ.
    pub fn log_determinant(&self) -> f64 {
        2.0 * (0..self.m).map(|k| ln(self.l[k * self.n + k])).sum::<f64>()
    }

    /// Λ⁻¹ b.
    pub fn solve(&self, b: &DVector<f64>) -> DVector<f64> {
        let mut x = vec![0.0; self.n];
        x[..self.m].copy_from_slice(b.as_slice());
        dispatch!(self.level, simd => {
            forward(simd, self.n, &self.l, 0, &mut x);
            backward(simd, self.n, &self.l, &mut x);
        });
        x.truncate(self.m);
        DVector::from_vec(x)
    }

    /// Λ⁻¹ = L⁻ᵀ L⁻¹.
    pub fn inverse(&self) -> DMatrix<f64> {
        let length = self.m.next_multiple_of(GROUP);
        let mut columns = vec![0.0; length * self.m];
        dispatch!(self.level, simd => {
            for (index, column) in columns.chunks_exact_mut(length.max(1)).enumerate() {
                column[index] = 1.0;
                forward(simd, self.n, &self.l, index, &mut column[..self.n]);
            }
        });
        squared(self.level, &columns, self.m)
    }
}

/// Turns the lower triangle of a matrix of `n` rows, a multiple of [`WIDTH`], into L; returns whether it is positive
/// definite.
#[inline(always)]
fn factorise<S: Simd>(simd: S, n: usize, l: &mut [f64]) -> bool {
    for start in (0..n).step_by(WIDTH) {
        let (left, rest) = l.split_at_mut(start * n);
        let panel = &mut rest[..WIDTH * n];
        for row in (start..n).step_by(2 * WIDTH) {
            // The last row of lanes may have none beside it, and is taken twice.
            let beside = (row + WIDTH).min(n - WIDTH);
            subtract(simd, n, left, panel, start, [row, beside]);
        }
        if !corner(n, panel, start) {
            return false;
        }
        for row in (start + WIDTH..n).step_by(WIDTH) {
            let mut found = [f64x4::splat(simd, 0.0); WIDTH];
            for column in 0..WIDTH {
                let mut x = f64x4::from_slice(simd, &panel[column * n + row..][..WIDTH]);
                for (before, found) in found.iter().enumerate().take(column) {
                    x -= *found * panel[before * n + start + column];
                }
                x *= 1.0 / panel[column * n + start + column];
                x.store_slice(&mut panel[column * n + row..][..WIDTH]);
                found[column] = x;
            }
        }
    }
    true
}

/// Subtracts from four columns, in two rows of lanes, the products of the columns on the left.
#[inline(always)]
fn subtract<S: Simd>(simd: S, n: usize, left: &[f64], panel: &mut [f64], start: usize, rows: [usize; 2]) {
    let mut sums = [[f64x4::splat(simd, 0.0); 2]; WIDTH];
    for column in left.chunks_exact(n) {
        let x = [
            f64x4::from_slice(simd, &column[rows[0]..rows[0] + WIDTH]),
            f64x4::from_slice(simd, &column[rows[1]..rows[1] + WIDTH]),
        ];
        for (factor, sums) in column[start..start + WIDTH].iter().zip(&mut sums) {
            let factor = f64x4::splat(simd, *factor);
            sums[0] = x[0] * factor + sums[0];
            sums[1] = x[1] * factor + sums[1];
        }
    }
    let distinct = if rows[0] == rows[1] { 1 } else { 2 };
    for (column, sums) in panel.chunks_exact_mut(n).zip(&sums) {
        for (row, sum) in rows.iter().zip(sums).take(distinct) {
            let place = &mut column[*row..*row + WIDTH];
            (f64x4::from_slice(simd, place) - *sum).store_slice(place);
        }
    }
}

/// The factor of the four rows on the diagonal; returns whether they are positive definite.
#[inline(always)]
fn corner(n: usize, panel: &mut [f64], start: usize) -> bool {
    for column in 0..WIDTH {
        let at = |row: usize, column: usize| column * n + start + row;
        let mut pivot = panel[at(column, column)];
        for before in 0..column {
            pivot -= panel[at(column, before)] * panel[at(column, before)];
        }
        if pivot.is_nan() || pivot <= 0.0 {
            return false;
        }
        let root = pivot.sqrt();
        panel[at(column, column)] = root;
        for row in column + 1..WIDTH {
            let mut x = panel[at(row, column)];
            for before in 0..column {
                x -= panel[at(row, before)] * panel[at(column, before)];
            }
            panel[at(row, column)] = x / root;
            panel[at(column, row)] = 0.0;
        }
    }
    true
}

/// x ← L⁻¹ x, whose first numbers up to `first` are zero.
#[inline(always)]
fn forward<S: Simd>(simd: S, n: usize, l: &[f64], first: usize, x: &mut [f64]) {
    for (index, column) in l.chunks_exact(n.max(1)).enumerate().skip(first) {
        let value = x[index] / column[index];
        let factor = f64x4::splat(simd, value);
        // What of the column is above the diagonal is zero.
        let lanes = index / WIDTH * WIDTH;
        for (x, column) in x[lanes..].chunks_exact_mut(WIDTH).zip(column[lanes..].chunks_exact(WIDTH)) {
            (f64x4::from_slice(simd, x) - f64x4::from_slice(simd, column) * factor).store_slice(x);
        }
        x[index] = value;
    }
}

/// x ← L⁻ᵀ x.
#[inline(always)]
fn backward<S: Simd>(simd: S, n: usize, l: &[f64], x: &mut [f64]) {
    for (index, column) in l.chunks_exact(n.max(1)).enumerate().rev() {
        let lanes = index / WIDTH * WIDTH;
        let own = x[index];
        x[index] = 0.0;
        // In turn, that none waits for itself.
        let mut sums = [f64x4::splat(simd, 0.0); 4];
        for (x, column) in x[lanes..].chunks(4 * WIDTH).zip(column[lanes..].chunks(4 * WIDTH)) {
            let pairs = x.chunks_exact(WIDTH).zip(column.chunks_exact(WIDTH));
            for ((x, column), sum) in pairs.zip(&mut sums) {
                *sum = f64x4::from_slice(simd, column) * f64x4::from_slice(simd, x) + *sum;
            }
        }
        let sum = (sums[0] + sums[1]) + (sums[2] + sums[3]);
        let found: f64 = sum.as_slice().iter().sum();
        x[index] = (own - found) / column[index];
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::simd::levels;

    /// Against nalgebra's, of every size up to 13 and some larger, at every level.
    #[test]
    fn factors_are_those_of_linear_algebra() {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        for m in (1..14).chain([24, 29, 48, 80]) {
            let root = DMatrix::from_fn(m, m, |_, _| rng.random_range(-1.0..1.0));
            let matrix = &root * root.transpose() + DMatrix::identity(m, m) * 0.1;
            let b = DVector::from_fn(m, |_, _| rng.random_range(-1.0..1.0));
            let mut damped = matrix.clone();
            (0..m).for_each(|k| damped[(k, k)] *= 1.3);
            let expected = damped.clone().cholesky().expect("positive");
            for level in levels() {
                let factor = Factor::new(level, &matrix, 0.3).expect("positive");
                assert!((factor.solve(&b) - expected.solve(&b)).amax() < 1e-11, "{level:?} {m}");
                assert!((factor.inverse() - expected.inverse()).amax() < 1e-11, "{level:?} {m}");
                assert!((factor.log_determinant() - expected.determinant().ln()).abs() < 1e-9, "{level:?} {m}");
            }
        }
    }

    #[test]
    fn what_is_not_positive_has_no_factor() {
        for (m, place) in [(1, 0), (4, 3), (9, 4), (9, 8)] {
            for bad in [0.0, -1.0, f64::NAN] {
                let mut matrix = DMatrix::identity(m, m);
                matrix[(place, place)] = bad;
                assert!(Factor::new(Level::new(), &matrix, 0.0).is_none(), "{m} {place} {bad}");
            }
        }
        let singular = DMatrix::from_element(5, 5, 1.0);
        assert!(Factor::new(Level::new(), &singular, 0.0).is_none());
    }
}
