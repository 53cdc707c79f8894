//! Sums of squares: HᵀH and Hᵀr of many rows. They stand in blocks of as many rows each, in a block the columns of H one behind
//! the other; or [row by row](add_row_squares).

use fearless_simd::{Level, Simd, SimdBase, dispatch, f64x4};
use nalgebra::{DMatrix, DVector};

/// The number of numbers in a register, however wide it could be: sums are split by it, so that they have the same bits
/// everywhere.
const WIDTH: usize = 4;
/// A tile of HᵀH: each number that is read serves several products.
const DOWN: usize = 4;
const ACROSS: usize = 2;

/// Adds HᵀH to the lower triangle of `information` (the upper triangle is meaningless afterwards) and Hᵀr to `negative_gradient`; H has
/// as many rows as `residuals`, in blocks of `length`, a multiple of [`GROUP`](crate::simd::GROUP).
pub(super) fn add_squares(
    level: Level,
    (rows, residuals): (&[f64], &[f64]),
    length: usize,
    information: &mut DMatrix<f64>,
    negative_gradient: &mut DVector<f64>,
) {
    dispatch!(level, simd => {
        squares(simd, rows, length, information.nrows(), information.as_mut_slice());
        for (rows, residuals) in rows.chunks_exact(length * negative_gradient.len()).zip(residuals.chunks_exact(length)) {
            for (column, sum) in rows.chunks_exact(length).zip(negative_gradient.iter_mut()) {
                *sum += dot(simd, column, residuals);
            }
        }
    });
}

/// HᵀH of a single block of m columns, whose length is a multiple of [`GROUP`](crate::simd::GROUP).
pub(super) fn squared(level: Level, rows: &[f64], m: usize) -> DMatrix<f64> {
    let mut product = DMatrix::zeros(m, m);
    dispatch!(level, simd => squares(simd, rows, rows.len() / m.max(1), m, product.as_mut_slice()));
    product.fill_upper_triangle_with_lower_triangle();
    product
}

/// Adds HᵀH to the lower triangle of `information` (m × m; the upper triangle is meaningless afterwards); the rows of H, m numbers each,
/// stand one behind the other.
pub(super) fn add_row_squares(level: Level, rows: &[f64], information: &mut DMatrix<f64>) {
    let m = information.nrows();
    if m == 0 {
        return;
    }
    dispatch!(level, simd => row_squares(simd, rows, m, information.as_mut_slice()));
}

/// Adds squares row by row, by tiles of 4 columns and 8, 4 or 1 coordinates: every sum runs over the rows in their
/// order.
#[inline(always)]
fn row_squares<S: Simd>(simd: S, rows: &[f64], m: usize, sums: &mut [f64]) {
    for right in (0..m).step_by(DOWN) {
        let mut left = right;
        while left + 2 * WIDTH <= m {
            row_tile::<S, 2>(simd, rows, [m, left, right], sums);
            left += 2 * WIDTH;
        }
        while left + WIDTH <= m {
            row_tile::<S, 1>(simd, rows, [m, left, right], sums);
            left += WIDTH;
        }
        for (left, right) in (left..m).flat_map(|left| (right..m.min(right + DOWN)).map(move |right| (left, right))) {
            let sum: f64 = rows.chunks_exact(m).fold(0.0, |sum, row| sum + row[left] * row[right]);
            sums[right * m + left] += sum;
        }
    }
}

/// REGISTERS registers of coordinates from `left` on, of 4 columns from `right` on.
#[inline(always)]
fn row_tile<S: Simd, const REGISTERS: usize>(simd: S, rows: &[f64], [m, left, right]: [usize; 3], sums: &mut [f64]) {
    let mut tile = [[f64x4::splat(simd, 0.0); REGISTERS]; DOWN];
    // Beyond the last column it is taken again, and forgotten.
    let columns: [usize; DOWN] = std::array::from_fn(|k| (right + k).min(m - 1));
    for row in rows.chunks_exact(m) {
        let mut a = [f64x4::splat(simd, 0.0); REGISTERS];
        for (k, a) in a.iter_mut().enumerate() {
            *a = load(simd, row, left + k * WIDTH);
        }
        for (tile, column) in tile.iter_mut().zip(columns) {
            let b = f64x4::splat(simd, row[column]);
            for (sum, a) in tile.iter_mut().zip(a) {
                *sum = a * b + *sum;
            }
        }
    }
    for (found, column) in tile.iter().zip(right..m) {
        for (k, found) in found.iter().enumerate() {
            let first = column * m + left + k * WIDTH;
            for (sum, found) in sums[first..first + WIDTH].iter_mut().zip(found.as_slice()) {
                *sum += found;
            }
        }
    }
}

/// Adds HᵀH to the lower triangle of `sums` (m × m), by tiles; what is above the diagonal means nothing.
#[inline(always)]
fn squares<S: Simd>(simd: S, rows: &[f64], length: usize, m: usize, sums: &mut [f64]) {
    for right in (0..m).step_by(ACROSS) {
        for left in (right / DOWN * DOWN..m).step_by(DOWN) {
            let mut tile = [[f64x4::splat(simd, 0.0); ACROSS]; DOWN];
            for block in rows.chunks_exact((m * length).max(1)) {
                // Beyond the last column it is taken again, and forgotten.
                let column = |index: usize| &block[index.min(m - 1) * length..][..length];
                let b = [column(right), column(right + 1)];
                let a = [column(left), column(left + 1), column(left + 2), column(left + 3)];
                for first in (0..length).step_by(WIDTH) {
                    let b = [load(simd, b[0], first), load(simd, b[1], first)];
                    for (a, tile) in a.iter().zip(&mut tile) {
                        let a = load(simd, a, first);
                        tile[0] = a * b[0] + tile[0];
                        tile[1] = a * b[1] + tile[1];
                    }
                }
            }
            let few = DOWN.min(m - left);
            for (across, column) in sums.chunks_exact_mut(m).skip(right).take(ACROSS).enumerate() {
                for (sum, found) in column[left..left + few].iter_mut().zip(&tile) {
                    *sum += added(found[across]);
                }
            }
        }
    }
}

/// Σ aᵢ bᵢ of as many numbers as fill lanes.
#[inline(always)]
fn dot<S: Simd>(simd: S, a: &[f64], b: &[f64]) -> f64 {
    let mut sum = f64x4::splat(simd, 0.0);
    for first in (0..a.len()).step_by(WIDTH) {
        sum = load(simd, a, first) * load(simd, b, first) + sum;
    }
    added(sum)
}

#[inline(always)]
fn load<S: Simd>(simd: S, numbers: &[f64], first: usize) -> f64x4<S> {
    f64x4::from_slice(simd, &numbers[first..first + WIDTH])
}

/// The sum of the numbers of a register.
#[inline(always)]
fn added<S: Simd>(of: f64x4<S>) -> f64 {
    let of = of.as_slice();
    (of[0] + of[1]) + (of[2] + of[3])
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::simd::levels;

    #[test]
    fn squares_row_by_row_are_those_of_linear_algebra_whatever_the_instructions() {
        let mut rng = ChaCha8Rng::seed_from_u64(1004);
        for (m, count) in [(1, 1), (3, 7), (4, 4), (5, 30), (8, 3), (11, 20), (13, 9), (27, 64), (41, 50)] {
            let h = DMatrix::from_fn(m, count, |_, _| rng.random_range(-1.0..1.0));
            let start = DMatrix::from_fn(m, m, |_, _| rng.random_range(-1.0..1.0));
            let expected = (&start + &h * h.transpose()).lower_triangle();
            for level in levels() {
                let mut found = start.clone();
                add_row_squares(level, h.as_slice(), &mut found);
                assert_eq!(found.lower_triangle(), expected, "{level:?} {m} {count}");
            }
        }
    }

    #[test]
    fn squares_are_those_of_linear_algebra() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        for (blocks, length, m) in [(1, 8, 1), (2, 8, 2), (1, 16, 3), (3, 8, 5), (2, 40, 24), (4, 24, 27)] {
            let h: Vec<f64> = (0..blocks * length * m).map(|_| rng.random_range(-1.0..1.0)).collect();
            let r = DVector::from_fn(blocks * length, |_, _| rng.random_range(-1.0..1.0));
            let whole =
                DMatrix::from_fn(blocks * length, m, |row, k| h[(row / length * m + k) * length + row % length]);
            for level in levels() {
                let (mut information, mut negative_gradient) = (DMatrix::identity(m, m), DVector::zeros(m));
                add_squares(level, (&h, r.as_slice()), length, &mut information, &mut negative_gradient);
                information.fill_upper_triangle_with_lower_triangle();
                let expected = whole.tr_mul(&whole) + DMatrix::identity(m, m);
                assert!((&information - expected).amax() < 1e-13 * r.len() as f64, "{level:?} {blocks} {length} {m}");
                assert!(
                    (negative_gradient - whole.tr_mul(&r)).amax() < 1e-13 * r.len() as f64,
                    "{level:?} {blocks} {length} {m}"
                );
                if blocks == 1 {
                    let product = squared(level, &h, m);
                    assert!((product - whole.tr_mul(&whole)).amax() < 1e-13 * r.len() as f64);
                }
            }
        }
    }
}
