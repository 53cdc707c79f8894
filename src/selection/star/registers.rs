//! What is computed of stars in registers, whose lanes run across tangent coordinates. Of vectors per coordinate, `wide` numbers
//! of one dimension stand before those of the next.

use std::ops::Range;

use fearless_simd::{Simd, SimdBase, SimdFloat};

use super::OWN;
use crate::{
    lanes::{Aligned, GROUP, Lanes, load, sin_cos, splat, store, sums},
    model::Stage,
};

/// Sines and cosines of all angles.
#[inline(always)]
pub fn turn_all<S: Simd>(simd: S, count: usize, [angles, sines, cosines]: &mut [Vec<f64>; 3]) {
    for first in (0..count).step_by(Lanes::<S>::LEN) {
        let (sin, cos) = sin_cos::<S>(load(simd, angles, first));
        store::<S>(sin, sines, first);
        store::<S>(cos, cosines, first);
    }
}

/// For every stage P h summed over its columns and those behind it; 0 behind the last.
#[inline(always)]
pub fn sum_behind<S: Simd>(simd: S, wide: usize, stages: &[Stage], given: (&[f64], &[[f64; 3]]), behind: &mut [f64]) {
    let width = Lanes::<S>::LEN;
    let threes = wide / (3 * width) * 3 * width;
    for at in (0..threes).step_by(3 * width) {
        sum_registers::<S, 3>(simd, [wide, at], stages, given, behind);
    }
    for at in (threes..wide).step_by(width) {
        sum_registers::<S, 1>(simd, [wide, at], stages, given, behind);
    }
}

/// K registers of it: as many sums at a time as do not wait for each other.
#[inline(always)]
fn sum_registers<S: Simd, const K: usize>(
    simd: S,
    [wide, at]: [usize; 2],
    stages: &[Stage],
    (p, h): (&[f64], &[[f64; 3]]),
    behind: &mut [f64],
) {
    let width = Lanes::<S>::LEN;
    let mut sums = [[splat(simd, 0.0); 3]; K];
    for stage in (0..=stages.len()).rev() {
        if let Some(of) = stages.get(stage) {
            for column in of.coordinates.clone() {
                let (p, [x, y, z]) = (&p[column * wide + at..][..K * width], h[column]);
                let [x, y, z] = [splat(simd, x), splat(simd, y), splat(simd, z)];
                for (k, [of_x, of_y, of_z]) in sums.iter_mut().enumerate() {
                    let p = load(simd, p, k * width);
                    *of_x = p.mul_add(x, *of_x);
                    *of_y = p.mul_add(y, *of_y);
                    *of_z = p.mul_add(z, *of_z);
                }
            }
        }
        for row in 0..3 {
            let behind = &mut behind[(stage * 3 + row) * wide + at..][..K * width];
            for (k, sums) in sums.iter().enumerate() {
                store::<S>(sums[row], behind, k * width);
            }
        }
    }
}

/// Adds P b of what drifts in a few stages.
#[inline(always)]
pub fn drift<S: Simd>(simd: S, wide: usize, stages: &[Stage], (p, b): (&[f64], &[[f64; 3]]), to: &mut [f64]) {
    let (to_x, others) = to.split_at_mut(wide);
    let (to_y, to_z) = others.split_at_mut(wide);
    for at in (0..wide).step_by(Lanes::<S>::LEN) {
        let [mut x, mut y, mut z] = [load(simd, to_x, at), load(simd, to_y, at), load(simd, to_z, at)];
        for stage in stages {
            for column in stage.drifting.clone() {
                let (p, b) = (load(simd, p, column * wide + at), b[column]);
                x = p.mul_add(splat(simd, b[0]), x);
                y = p.mul_add(splat(simd, b[1]), y);
                z = p.mul_add(splat(simd, b[2]), z);
            }
        }
        store::<S>(x, to_x, at);
        store::<S>(y, to_y, at);
        store::<S>(z, to_z, at);
    }
}

/// The same vector in all lanes.
#[inline(always)]
pub fn splat_all<S: Simd>(simd: S, [x, y, z]: [f64; 3]) -> [Lanes<S>; 3] {
    [splat(simd, x), splat(simd, y), splat(simd, z)]
}

/// v + b × d.
#[inline(always)]
fn plus_cross<S: Simd>(v: [Lanes<S>; 3], b: [Lanes<S>; 3], d: [Lanes<S>; 3]) -> [Lanes<S>; 3] {
    let [[vx, vy, vz], [bx, by, bz], [x, y, z]] = [v, b, d];
    [by.mul_add(z, (-bz).mul_add(y, vx)), bz.mul_add(x, (-bx).mul_add(z, vy)), bx.mul_add(y, (-by).mul_add(x, vz))]
}

/// What every register of a ray is made of.
pub struct Moved<'a, S: Simd> {
    pub simd: S,
    pub wide: usize,
    pub rotation: [[Lanes<S>; 3]; 3],
    pub shift: [Lanes<S>; 3],
    /// h' of the joint's axis, and P of its coordinates, of which so many are learned; those that are not count for nothing.
    pub axis: [[Lanes<S>; 3]; OWN],
    pub p: [&'a [f64]; OWN],
    pub of_axis: usize,
    /// The same of what corrects its reading.
    pub terms: &'a [[f64; 3]],
    pub p_of_terms: &'a [f64],
    /// h and b.
    pub across: &'a [Aligned; 2],
    pub sums: [&'a [f64]; 4],
    pub weights: &'a [f64],
}

/// The upper triangles of H P Hᵀ and G W Gᵀ.
type Entries<S> = [[Lanes<S>; 6]; 2];

impl<S: Simd> Moved<'_, S> {
    #[inline(always)]
    fn load(&self, numbers: &[f64], at: usize) -> [Lanes<S>; 3] {
        let numbers = &numbers[at..at + 2 * self.wide + Lanes::<S>::LEN];
        [load(self.simd, numbers, 0), load(self.simd, numbers, self.wide), load(self.simd, numbers, 2 * self.wide)]
    }

    /// h' of coordinates before the joint.
    #[inline(always)]
    fn before(&self, at: usize) -> [Lanes<S>; 3] {
        let [h, b] = self.across;
        plus_cross::<S>(self.load(h, at), self.load(b, at), self.shift)
    }

    /// h' of coordinates behind it.
    #[inline(always)]
    fn behind(&self, at: usize) -> [Lanes<S>; 3] {
        let zero = splat(self.simd, 0.0);
        self.turned(self.load(&self.across[0], at), [zero, zero, zero])
    }

    /// h' of a register in which there are coordinates of the joint itself.
    #[inline(always)]
    fn at_joint(&self, at: usize, own: Range<usize>) -> [Lanes<S>; 3] {
        let (simd, width) = (self.simd, Lanes::<S>::LEN);
        let ones = |until: usize| load(simd, &STEP, GROUP - until.saturating_sub(at).min(width));
        let (is_before, is_not_behind) = (ones(own.start), ones(own.end));
        let is_behind = splat(simd, 1.0) - is_not_behind;
        let (before, behind) = (self.before(at), self.behind(at));
        let mut moved = [splat(simd, 0.0); 3];
        for row in 0..3 {
            moved[row] = before[row].mul_add(is_before, behind[row] * is_behind);
        }
        for (coordinate, column) in own.clone().zip(&self.axis[..self.of_axis]) {
            self.place(at, coordinate, *column, &mut moved);
        }
        for (coordinate, column) in own.skip(self.of_axis).zip(self.terms) {
            self.place(at, coordinate, splat_all(simd, *column), &mut moved);
        }
        moved
    }

    /// Adds a column where its coordinate stands in the register, if it does.
    #[inline(always)]
    fn place(&self, at: usize, coordinate: usize, column: [Lanes<S>; 3], moved: &mut [Lanes<S>; 3]) {
        if (at..at + Lanes::<S>::LEN).contains(&coordinate) {
            let is_it = load(self.simd, &UNIT, GROUP - (coordinate - at));
            for (moved, x) in moved.iter_mut().zip(column) {
                *moved = is_it.mul_add(x, *moved);
            }
        }
    }

    /// R v + sum.
    #[inline(always)]
    fn turned(&self, v: [Lanes<S>; 3], mut sum: [Lanes<S>; 3]) -> [Lanes<S>; 3] {
        for (sum, r) in sum.iter_mut().zip(&self.rotation) {
            *sum = v[0].mul_add(r[0], v[1].mul_add(r[1], v[2].mul_add(r[2], *sum)));
        }
        sum
    }

    /// Adds what a register of coordinates with these h' contributes.
    #[inline(always)]
    fn add(&self, at: usize, h: [Lanes<S>; 3], entries: &mut Entries<S>) {
        let (simd, [all, from_here, behind, drifting]) = (self.simd, self.sums);
        let (all, not_before) = (self.load(all, at), self.load(from_here, at));
        let before = [all[0] - not_before[0], all[1] - not_before[1], all[2] - not_before[2]];
        let mut g = plus_cross::<S>(before, self.load(drifting, at), self.shift);
        g = self.turned(self.load(behind, at), g);
        for (p, column) in self.p.iter().zip(&self.axis) {
            let p = load(simd, p, at);
            for (g, x) in g.iter_mut().zip(column) {
                *g = p.mul_add(*x, *g);
            }
        }
        for (index, column) in self.terms.iter().enumerate() {
            let p = load(simd, self.p_of_terms, index * self.wide + at);
            for (g, x) in g.iter_mut().zip(column) {
                *g = p.mul_add(splat(simd, *x), *g);
            }
        }
        let w = load(simd, self.weights, at);
        let weighted = [g[0] * w, g[1] * w, g[2] * w];
        let [spreads, leverages] = entries;
        let mut entry = 0;
        for (column, g) in g.iter().enumerate() {
            for (h, weighted) in h.iter().zip(&weighted).take(column + 1) {
                spreads[entry] = h.mul_add(*g, spreads[entry]);
                leverages[entry] = weighted.mul_add(*g, leverages[entry]);
                entry += 1;
            }
        }
    }

    /// H P Hᵀ and G W Gᵀ, of which the coordinates `own` are the joint's.
    #[inline(always)]
    pub fn multiply(&self, own: &Range<usize>) -> [[f64; 6]; 2] {
        let width = Lanes::<S>::LEN;
        let zero = splat(self.simd, 0.0);
        let mut entries = [[zero; 6]; 2];
        let (begin, end) = (own.start / width * width, own.end.next_multiple_of(width));
        for at in (0..begin).step_by(width) {
            self.add(at, self.before(at), &mut entries);
        }
        for at in (begin..end).step_by(width) {
            self.add(at, self.at_joint(at, own.clone()), &mut entries);
        }
        for at in (end..self.wide).step_by(width) {
            self.add(at, self.behind(at), &mut entries);
        }
        let [[a, b, c, d, e, f], [u, v, w, x, y, z]] = entries;
        let [s11, s12, s22, s13, s23, s33, l11, l12] = sums::<S>([a, b, c, d, e, f, u, v]);
        let [l22, l13, l23, l33, ..] = sums::<S>([w, x, y, z, zero, zero, zero, zero]);
        [[s11, s12, s22, s13, s23, s33], [l11, l12, l22, l13, l23, l33]]
    }
}

/// Ones, then zeros.
const STEP: [f64; 2 * GROUP] = {
    let mut step = [0.0; 2 * GROUP];
    let mut index = 0;
    while index < GROUP {
        step[index] = 1.0;
        index += 1;
    }
    step
};

/// A one among zeros.
const UNIT: [f64; 2 * GROUP] = {
    let mut unit = [0.0; 2 * GROUP];
    unit[GROUP] = 1.0;
    unit
};
