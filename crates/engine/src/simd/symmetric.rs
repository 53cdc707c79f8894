//! A symmetric matrix times the rows of groups.

use fearless_simd::{Level, Simd, SimdBase, dispatch};

use super::{Aligned, GROUP, Lanes, Run, load, runs, splat, store};

/// H P of all candidates, of d equations each: `rows` hold m × d rows of lanes for each [group](GROUP), P is symmetric (m × m).
///
/// Unlike a general product it packs nothing, so that few candidates cost little.
pub fn times(level: Level, [d, candidates]: [usize; 2], rows: &[f64], p: &[f64]) -> Aligned {
    let mut found = Aligned::zeros(rows.len());
    let of_group = p.len().isqrt() * d * GROUP;
    for Run { level, groups, candidates } in runs(level, candidates) {
        let place = groups.start * of_group..groups.end * of_group;
        let (rows, found) = (&rows[place.clone()], &mut found[place]);
        dispatch!(level, simd => write_times(simd, [d, candidates], (rows, p), found));
    }
    found
}

/// Writes to `found` what [`times`] returns; every group holds `candidates`.
#[inline(always)]
pub fn write_times<S: Simd>(simd: S, [d, candidates]: [usize; 2], (rows, p): (&[f64], &[f64]), found: &mut [f64]) {
    let (m, stride) = (p.len().isqrt(), d * GROUP);
    let of_group = (m * stride).max(1);
    for (rows, found) in rows.chunks_exact(of_group).zip(found.chunks_exact_mut(of_group)) {
        for lane in (0..candidates).step_by(Lanes::<S>::LEN) {
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
                    *sum = p * h + *sum;
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

/// P x for a few vectors x, which stand in `columns` one after the other, m numbers each: lanes run along P's columns.
pub fn times_few(level: Level, columns: &[f64], p: &[f64], m: usize) -> Vec<f64> {
    let mut found = vec![0.0; columns.len()];
    let together = 3 * m.max(1);
    dispatch!(level, simd => {
        for (columns, found) in columns.chunks(together).zip(found.chunks_mut(together)) {
            match columns.len() / m.max(1) {
                1 => along::<_, 1>(simd, columns, p, found),
                2 => along::<_, 2>(simd, columns, p, found),
                _ => along::<_, 3>(simd, columns, p, found),
            }
        }
    });
    found
}

/// Of E columns: two registers of sums of each at a time, then one, then one number after the other.
#[inline(always)]
fn along<S: Simd, const E: usize>(simd: S, columns: &[f64], p: &[f64], found: &mut [f64]) {
    let (m, width) = (columns.len() / E, Lanes::<S>::LEN);
    let twos = m / (2 * width) * 2 * width;
    let ones = m / width * width;
    (0..twos).step_by(2 * width).for_each(|first| sums_from::<S, E, 2>(simd, first, (columns, p), found));
    (twos..ones).step_by(width).for_each(|first| sums_from::<S, E, 1>(simd, first, (columns, p), found));
    for (x, found) in columns.chunks_exact(m.max(1)).zip(found.chunks_exact_mut(m.max(1))) {
        for (row, found) in found.iter_mut().enumerate().skip(ones) {
            *found = x.iter().zip(p.iter().skip(row).step_by(m)).fold(0.0, |sum, (x, p)| x * p + sum);
        }
    }
}

/// W registers of every column's product, from a row on.
#[inline(always)]
fn sums_from<S: Simd, const E: usize, const W: usize>(
    simd: S,
    first: usize,
    (columns, p): (&[f64], &[f64]),
    found: &mut [f64],
) {
    let m = columns.len() / E;
    let mut sums = [[splat(simd, 0.0); W]; E];
    for (k, p) in p.chunks_exact(m).enumerate() {
        let p = &p[first..first + W * Lanes::<S>::LEN];
        for (e, sums) in sums.iter_mut().enumerate() {
            let x = splat(simd, columns[e * m + k]);
            for (w, sum) in sums.iter_mut().enumerate() {
                *sum = x * load(simd, p, w * Lanes::<S>::LEN) + *sum;
            }
        }
    }
    for (e, sums) in sums.into_iter().enumerate() {
        for (w, sum) in sums.into_iter().enumerate() {
            store::<S>(sum, found, e * m + first + w * Lanes::<S>::LEN);
        }
    }
}

/// P + c Σ x xᵀ for a few vectors x, which stand in `columns` one after the other, m numbers each.
pub fn add_few_squares(level: Level, columns: &[f64], c: f64, p: &mut [f64]) {
    let m = p.len().isqrt().max(1);
    dispatch!(level, simd => {
        for columns in columns.chunks(3 * m) {
            match columns.len() / m {
                1 => add_squares::<_, 1>(simd, columns, c, p),
                2 => add_squares::<_, 2>(simd, columns, c, p),
                _ => add_squares::<_, 3>(simd, columns, c, p),
            }
        }
    });
}

/// Both triangles, all of them in lanes: of c xᵢ xⱼ and c xⱼ xᵢ the factors are the same two numbers but for the sign where c is ±1,
/// so that P stays symmetric to the last bit.
#[inline(always)]
fn add_squares<S: Simd, const E: usize>(simd: S, columns: &[f64], c: f64, p: &mut [f64]) {
    let (m, width) = (columns.len() / E, Lanes::<S>::LEN);
    let whole = m / width * width;
    // What is left of each column, in a register of its own.
    let mut rest = [[0.0; GROUP]; E];
    for (rest, column) in rest.iter_mut().zip(columns.chunks_exact(m)) {
        rest[..m - whole].copy_from_slice(&column[whole..]);
    }
    for (index, p) in p.chunks_exact_mut(m).enumerate() {
        let mut factors = [splat(simd, 0.0); E];
        for (e, factor) in factors.iter_mut().enumerate() {
            *factor = splat(simd, c * columns[e * m + index]);
        }
        for first in (0..whole).step_by(width) {
            let mut sum = load(simd, p, first);
            for (e, factor) in factors.iter().enumerate() {
                sum = load(simd, columns, e * m + first) * *factor + sum;
            }
            store::<S>(sum, p, first);
        }
        if whole < m {
            let mut last = [0.0; GROUP];
            last[..m - whole].copy_from_slice(&p[whole..]);
            let mut sum = load(simd, &last, 0);
            for (rest, factor) in rest.iter().zip(&factors) {
                sum = load(simd, rest, 0) * *factor + sum;
            }
            store::<S>(sum, &mut last, 0);
            p[whole..].copy_from_slice(&last[..m - whole]);
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::simd::{groups, levels};

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
                let found = times(level, [d, count], &rows, p.as_slice());
                for candidate in 0..count {
                    let at = |row, k| ((candidate / GROUP * m + k) * d + row) * GROUP + candidate % GROUP;
                    let h = DMatrix::from_fn(d, m, |row, k| rows[at(row, k)]);
                    let apart = DMatrix::from_fn(d, m, |row, k| found[at(row, k)]) - &h * &p;
                    assert!(apart.iter().all(|x| x.abs() < 1e-12), "{level:?} {d} {count} {m}");
                    let alone = times_few(level, h.transpose().as_slice(), p.as_slice(), m);
                    let apart = DMatrix::from_vec(m, d, alone) - &p * h.transpose();
                    assert!(apart.iter().all(|x| x.abs() < 1e-12), "{level:?} {d} {m}");
                    let mut more = p.clone();
                    add_few_squares(level, h.transpose().as_slice(), -1.0, more.as_mut_slice());
                    assert_eq!(more, more.transpose(), "{level:?} {d} {m}");
                    let apart = more - (&p - h.tr_mul(&h));
                    assert!(apart.iter().all(|x| x.abs() < 1e-12), "{level:?} {d} {m}");
                }
            }
        }
    }
}
