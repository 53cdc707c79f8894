//! What is left of a prediction per candidate: small symmetric matrices, of a [group](GROUP) of candidates side by side.
//!
//! Entry (i, j), i ≤ j, of a group stands in one row of lanes, at row `j (j + 1)/2 + i`.

use fearless_simd::{Level, Select, Simd, SimdBase, dispatch};

use crate::simd::{Aligned, GROUP, Lanes, Run, groups, load, runs, splat, store};

/// Different entries of a symmetric matrix of d rows.
pub(super) fn entries(d: usize) -> usize {
    d * (d + 1) / 2
}

/// Where an entry of a candidate's matrix of d rows stands.
pub(super) fn place(d: usize, row: usize, column: usize, candidate: usize) -> usize {
    let of_group = candidate / GROUP * entries(d);
    (of_group + entry(row.min(column), row.max(column))) * GROUP + candidate % GROUP
}

#[inline(always)]
fn entry(row: usize, column: usize) -> usize {
    column * (column + 1) / 2 + row
}

/// Σₖ wₖ aₖ bₖᵀ of all candidates, which must be symmetric: `a` and `b` hold m × d rows of lanes for each group, and without
/// `weights` wₖ = 1.
pub(super) fn products(
    level: Level,
    [m, d, candidates]: [usize; 3],
    a: &[f64],
    b: &[f64],
    weights: Option<&[f64]>,
) -> Aligned {
    let (of_group, of_found) = (m * d * GROUP, entries(d) * GROUP);
    let mut found = Aligned::zeros(groups(candidates) * of_found);
    for Run { level, groups, candidates } in runs(level, candidates) {
        let place = groups.start * of_group..groups.end * of_group;
        let found = &mut found[groups.start * of_found..groups.end * of_found];
        let both = a[place.clone()].chunks_exact(of_group.max(1)).zip(b[place].chunks_exact(of_group.max(1)));
        let each = both.zip(found.chunks_exact_mut(of_found.max(1)));
        dispatch!(level, simd => match d {
            3 => for ((a, b), found) in each { three(simd, candidates, (a, b, weights), found) },
            _ => for ((a, b), found) in each { pairs(simd, [d, candidates], (a, b, weights), found) },
        });
    }
    found
}

#[inline(always)]
fn weight(weights: Option<&[f64]>, k: usize) -> f64 {
    weights.map_or(1.0, |weights| weights[k])
}

/// Of three equations: what is read once serves all six entries.
#[inline(always)]
fn three<S: Simd>(simd: S, candidates: usize, (a, b, weights): (&[f64], &[f64], Option<&[f64]>), found: &mut [f64]) {
    let row = |first: usize| [first, GROUP + first, 2 * GROUP + first];
    for first in (0..candidates).step_by(Lanes::<S>::LEN) {
        let mut sums = [splat(simd, 0.0); 6];
        for (k, (a, b)) in a.chunks_exact(3 * GROUP).zip(b.chunks_exact(3 * GROUP)).enumerate() {
            let w = splat(simd, weight(weights, k));
            let [x, y, z] = row(first);
            let a = [load(simd, a, x), load(simd, a, y), load(simd, a, z)];
            let b = [load(simd, b, x) * w, load(simd, b, y) * w, load(simd, b, z) * w];
            for column in 0..3 {
                for row in 0..=column {
                    let sum = &mut sums[entry(row, column)];
                    *sum = a[row] * b[column] + *sum;
                }
            }
        }
        for (sum, found) in sums.iter().zip(found.chunks_exact_mut(GROUP)) {
            store::<S>(*sum, found, first);
        }
    }
}

/// Of any number of equations, entry by entry.
#[inline(always)]
fn pairs<S: Simd>(
    simd: S,
    [d, candidates]: [usize; 2],
    (a, b, weights): (&[f64], &[f64], Option<&[f64]>),
    found: &mut [f64],
) {
    for column in 0..d {
        for row in 0..=column {
            let found = &mut found[entry(row, column) * GROUP..][..GROUP];
            for first in (0..candidates).step_by(Lanes::<S>::LEN) {
                let mut sum = splat(simd, 0.0);
                for (k, (a, b)) in a.chunks_exact(d * GROUP).zip(b.chunks_exact(d * GROUP)).enumerate() {
                    let w = splat(simd, weight(weights, k));
                    let (a, b) = (load(simd, a, row * GROUP + first), load(simd, b, column * GROUP + first));
                    sum = a * (b * w) + sum;
                }
                store::<S>(sum, found, first);
            }
        }
    }
}

/// tr(S⁻¹ L) of every candidate, S = spread + I; NaN where S is not positive.
pub(super) fn traces(level: Level, d: usize, spreads: &[f64], leverages: &[f64]) -> Vec<f64> {
    let of_group = (entries(d) * GROUP).max(1);
    let mut found = vec![0.0; spreads.len() / of_group * GROUP];
    let groups = spreads.chunks_exact(of_group).zip(leverages.chunks_exact(of_group));
    let groups = groups.zip(found.chunks_exact_mut(GROUP));
    dispatch!(level, simd => match d {
        3 => {
            let zeros = [[splat(simd, 0.0); 6]; 2];
            for (matrices, found) in groups { eliminate_all(simd, 3, matrices, zeros, found) }
        }
        _ => for (matrices, found) in groups {
            let zeros = [vec![splat(simd, 0.0); entries(d)], vec![splat(simd, 0.0); entries(d)]];
            eliminate_all(simd, d, matrices, zeros, found);
        },
    });
    found
}

#[inline(always)]
fn eliminate_all<S: Simd, M: AsMut<[Lanes<S>]>>(
    simd: S,
    d: usize,
    (spreads, leverages): (&[f64], &[f64]),
    [mut s, mut l]: [M; 2],
    found: &mut [f64],
) {
    let (s, l) = (s.as_mut(), l.as_mut());
    for first in (0..GROUP).step_by(Lanes::<S>::LEN) {
        for index in 0..s.len() {
            s[index] = load(simd, spreads, index * GROUP + first);
            l[index] = load(simd, leverages, index * GROUP + first);
        }
        for row in 0..d {
            s[entry(row, row)] += 1.0;
        }
        store::<S>(eliminate(simd, d, s, l), found, first);
    }
}

/// tr(S⁻¹ L), eliminating one equation after the other: with the first pivot p = S₁₁ and the first column c = S₂₁/p,
///
/// ```text
/// tr(S⁻¹ L) = L₁₁/p + tr(S'⁻¹ L'),     S' = S₂₂ − c p cᵀ,     L' = L₂₂ − c L₁₂ − L₂₁ cᵀ + c L₁₁ cᵀ
/// ```
///
/// which is Cholesky's factorisation of S and as stable. NaN in the lanes where a pivot is not positive.
#[inline(always)]
fn eliminate<S: Simd>(simd: S, d: usize, s: &mut [Lanes<S>], l: &mut [Lanes<S>]) -> Lanes<S> {
    let mut trace = splat(simd, 0.0);
    for pivot in 0..d {
        let p = s[entry(pivot, pivot)];
        let inverse = p.simd_gt(0.0).select(splat(simd, 1.0) / p, splat(simd, f64::NAN));
        let own = l[entry(pivot, pivot)];
        trace = own * inverse + trace;
        for column in pivot + 1..d {
            let c = s[entry(pivot, column)] * inverse;
            for row in pivot + 1..=column {
                let r = s[entry(pivot, row)] * inverse;
                let place = entry(row, column);
                s[place] -= r * s[entry(pivot, column)];
                let crossed = r * l[entry(pivot, column)] + c * l[entry(pivot, row)];
                l[place] = (r * c) * own + (l[place] - crossed);
            }
        }
    }
    trace
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::simd::levels;

    /// Products and traces against nalgebra's, for as many equations as one likes and any number of candidates, at every level.
    #[test]
    fn small_matrices_are_those_of_linear_algebra() {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        for (d, count, m) in [(1, 1, 4), (2, 5, 7), (3, 1, 9), (3, 32, 24), (3, 7, 5), (6, 9, 12), (8, 4, 3)] {
            let a: Vec<f64> = (0..groups(count) * m * d * GROUP).map(|_| rng.random_range(-1.0..1.0)).collect();
            let weights: Vec<f64> = (0..m).map(|k| 0.5 + k as f64).collect();
            let of = |candidate: usize| {
                let at = |row, k| ((candidate / GROUP * m + k) * d + row) * GROUP + candidate % GROUP;
                DMatrix::from_fn(d, m, |row, k| a[at(row, k)])
            };
            for level in levels() {
                let (spreads, leverages) = (
                    products(level, [m, d, count], &a, &a, None),
                    products(level, [m, d, count], &a, &a, Some(&weights)),
                );
                let traces = traces(level, d, &spreads, &leverages);
                for (candidate, trace) in traces.iter().take(count).enumerate() {
                    let a = of(candidate);
                    let (spread, w) =
                        (&a * a.transpose(), DMatrix::from_fn(m, m, |i, j| if i == j { weights[i] } else { 0.0 }));
                    for row in 0..d {
                        for column in 0..d {
                            let found = spreads[place(d, row, column, candidate)];
                            assert!((found - spread[(row, column)]).abs() < 1e-12, "{level:?} {d} {count}");
                        }
                    }
                    let s = spread + DMatrix::identity(d, d);
                    let expected = s.cholesky().expect("positive").solve(&(&a * w * a.transpose())).trace();
                    assert!((trace - expected).abs() < 1e-11 * expected, "{level:?} {d} {count}: {trace} {expected}");
                }
            }
        }
    }

    #[test]
    fn what_is_not_positive_has_no_trace() {
        for level in levels() {
            // S is diag(1, 1), diag(1, 0), diag(−1, 1) and [1 2; 2 1], and the same again.
            let spreads = [[0.0, 0.0, -2.0, 0.0], [0.0, 0.0, 0.0, 2.0], [0.0, -1.0, 0.0, 0.0]];
            let spreads = spreads.map(|row| [row, row]);
            let found = traces(level, 2, spreads.as_flattened().as_flattened(), &[1.0; 3 * GROUP]);
            assert_eq!((found[0], found[4]), (2.0, 2.0));
            assert!((1..8).filter(|lane| lane % 4 > 0).all(|lane| found[lane].is_nan()), "{level:?}: {found:?}");
        }
    }
}
