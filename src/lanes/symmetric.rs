//! A symmetric matrix times the rows of groups.

use fearless_simd::{Level, Simd, SimdBase, SimdFloat, dispatch};

use super::{GROUP, Lanes, load, splat, store};

/// H P of every candidate: `rows` hold m × d rows of lanes for each [group](GROUP), P is symmetric (m × m).
///
/// Unlike a general product it packs nothing, so that few candidates cost little.
pub fn times(level: Level, d: usize, rows: &[f64], p: &[f64]) -> Vec<f64> {
    let mut found = vec![0.0; rows.len()];
    dispatch!(level, simd => write_times(simd, d, (rows, p), &mut found));
    found
}

/// The same, written to `found`.
#[inline(always)]
pub fn write_times<S: Simd>(simd: S, d: usize, (rows, p): (&[f64], &[f64]), found: &mut [f64]) {
    let (m, stride) = (p.len().isqrt(), d * GROUP);
    let of_group = (m * stride).max(1);
    for (rows, found) in rows.chunks_exact(of_group).zip(found.chunks_exact_mut(of_group)) {
        for lane in (0..GROUP).step_by(Lanes::<S>::LEN) {
            for equation in (0..d).step_by(3) {
                let strip = Strip { m, stride, first: equation * GROUP + lane };
                match d - equation {
                    1 => strip.multiply::<S, 1>(simd, (rows, p), found),
                    2 => strip.multiply::<S, 2>(simd, (rows, p), found),
                    _ => strip.multiply::<S, 3>(simd, (rows, p), found),
                }
            }
        }
    }
}

/// A few equations of a register full of candidates.
struct Strip {
    m: usize,
    /// Numbers of a coordinate.
    stride: usize,
    /// Where the first equation of the first candidate stands among those.
    first: usize,
}

impl Strip {
    #[inline(always)]
    fn multiply<S: Simd, const E: usize>(&self, simd: S, given: (&[f64], &[f64]), found: &mut [f64]) {
        let fours = self.m / 4 * 4;
        for k in (0..fours).step_by(4) {
            self.block::<S, E, 4>(simd, given, k, found);
        }
        for k in fours..self.m {
            self.block::<S, E, 1>(simd, given, k, found);
        }
    }

    /// K coordinates from `k` on, of E equations: as many sums as fit into registers.
    #[inline(always)]
    fn block<S: Simd, const E: usize, const K: usize>(
        &self,
        simd: S,
        (rows, p): (&[f64], &[f64]),
        k: usize,
        found: &mut [f64],
    ) {
        let mut sums = [[splat(simd, 0.0); E]; K];
        for (row, column) in rows.chunks_exact(self.stride).zip(p.chunks_exact(self.m)) {
            let (row, column) = (&row[self.first..][..(E - 1) * GROUP + Lanes::<S>::LEN], &column[k..k + K]);
            let mut h = [splat(simd, 0.0); E];
            for (e, h) in h.iter_mut().enumerate() {
                *h = load(simd, row, e * GROUP);
            }
            for (sums, p) in sums.iter_mut().zip(column) {
                let p = splat(simd, *p);
                for (sum, h) in sums.iter_mut().zip(h) {
                    *sum = p.mul_add(h, *sum);
                }
            }
        }
        for (i, sums) in sums.into_iter().enumerate() {
            for (e, sum) in sums.into_iter().enumerate() {
                store::<S>(sum, found, (k + i) * self.stride + self.first + e * GROUP);
            }
        }
    }
}

/// P x of a few x alone, which stand in `columns` one behind the other, m numbers each: lanes run along P's columns.
pub fn times_few(level: Level, columns: &[f64], p: &[f64], m: usize) -> Vec<f64> {
    let mut found = vec![0.0; columns.len()];
    dispatch!(level, simd => {
        let pairs = columns.chunks_exact(m.max(1)).zip(found.chunks_exact_mut(m.max(1)));
        for (x, found) in pairs { along(simd, x, p, found) }
    });
    found
}

/// Two registers of sums at a time, then one number after the other.
#[inline(always)]
fn along<S: Simd>(simd: S, x: &[f64], p: &[f64], found: &mut [f64]) {
    let (m, width) = (x.len(), 2 * Lanes::<S>::LEN);
    for first in (0..m / width * width).step_by(width) {
        // Even columns and odd ones: four sums in turn, that none waits for itself.
        let mut sums = [[splat(simd, 0.0); 2]; 2];
        for (x, columns) in x.chunks(2).zip(p.chunks(2 * m)) {
            for ((x, column), sums) in x.iter().zip(columns.chunks_exact(m)).zip(&mut sums) {
                let x = splat(simd, *x);
                sums[0] = x.mul_add(load(simd, column, first), sums[0]);
                sums[1] = x.mul_add(load(simd, column, first + Lanes::<S>::LEN), sums[1]);
            }
        }
        store::<S>(sums[0][0] + sums[1][0], found, first);
        store::<S>(sums[0][1] + sums[1][1], found, first + Lanes::<S>::LEN);
    }
    for row in m / width * width..m {
        found[row] = x.iter().zip(p[row * m..].iter()).map(|(x, p)| x * p).sum();
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::lanes::{groups, levels};

    #[test]
    fn products_are_those_of_linear_algebra() {
        let mut rng = ChaCha8Rng::seed_from_u64(8);
        for (d, count, m) in
            [(0, 4, 4), (1, 1, 4), (2, 5, 7), (3, 9, 24), (3, 1, 35), (4, 17, 5), (6, 9, 13), (8, 4, 3), (3, 3, 0)]
        {
            let root = DMatrix::from_fn(m, m, |_, _| rng.random_range(-1.0..1.0));
            let p = &root * root.transpose();
            let rows: Vec<f64> = (0..groups(count) * m * d * GROUP).map(|_| rng.random_range(-1.0..1.0)).collect();
            for level in levels() {
                let found = times(level, d, &rows, p.as_slice());
                for candidate in 0..count {
                    let at = |row, k| ((candidate / GROUP * m + k) * d + row) * GROUP + candidate % GROUP;
                    let h = DMatrix::from_fn(d, m, |row, k| rows[at(row, k)]);
                    let apart = DMatrix::from_fn(d, m, |row, k| found[at(row, k)]) - &h * &p;
                    assert!(apart.iter().all(|x| x.abs() < 1e-12), "{level:?} {d} {count} {m}");
                    let alone = times_few(level, h.transpose().as_slice(), p.as_slice(), m);
                    let apart = DMatrix::from_vec(m, d, alone) - &p * h.transpose();
                    assert!(apart.iter().all(|x| x.abs() < 1e-12), "{level:?} {d} {m}");
                }
            }
        }
    }
}
