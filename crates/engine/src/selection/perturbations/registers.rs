//! What is computed of perturbations in registers, whose lanes run across tangent coordinates. Of vectors per coordinate, `wide` numbers
//! of one dimension stand before those of the next.

use std::ops::Range;

use fearless_simd::{Simd, SimdBase};
use nalgebra::Vector3;

use super::OWN;
use crate::{
    model::Stage,
    simd::{Aligned, GROUP, GroupSum, Lanes, Rotations, Vector, load, sin_cos, splat, store},
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
pub fn sum_behind<S: Simd>(
    simd: S,
    wide: usize,
    stages: &[Stage],
    given: (&[f64], &[Vector3<f64>]),
    behind: &mut [f64],
) {
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
    (p, h): (&[f64], &[Vector3<f64>]),
    behind: &mut [f64],
) {
    let width = Lanes::<S>::LEN;
    let mut sums = [Vector::splat(simd, &Vector3::zeros()); K];
    for stage in (0..=stages.len()).rev() {
        if let Some(of) = stages.get(stage) {
            for column in of.coordinates.clone() {
                let (p, h) = (&p[column * wide + at..][..K * width], Vector::splat(simd, &h[column]));
                for (k, sum) in sums.iter_mut().enumerate() {
                    *sum = h.scaled_onto(load(simd, p, k * width), *sum);
                }
            }
        }
        let behind = &mut behind[stage * 3 * wide + at..][..2 * wide + K * width];
        for (k, sum) in sums.iter().enumerate() {
            sum.store(behind, [k * width, wide + k * width, 2 * wide + k * width]);
        }
    }
}

/// Adds P b of what drifts in a few stages.
#[inline(always)]
pub fn drift<S: Simd>(simd: S, wide: usize, stages: &[Stage], (p, b): (&[f64], &[Vector3<f64>]), to: &mut [f64]) {
    for at in (0..wide).step_by(Lanes::<S>::LEN) {
        let places = [at, wide + at, 2 * wide + at];
        let mut sum = Vector::load(simd, to, places);
        for stage in stages {
            for column in stage.drifting.clone() {
                sum = Vector::splat(simd, &b[column]).scaled_onto(load(simd, p, column * wide + at), sum);
            }
        }
        sum.store(to, places);
    }
}

/// What every register of a ray is made of.
pub struct Moved<'a, S: Simd> {
    pub simd: S,
    pub wide: usize,
    pub rotation: Rotations<S>,
    pub shift: Vector<S>,
    /// h' of the joint's axis, and P of its coordinates, of which so many are learned; those that are not count for nothing.
    pub axis: [Vector<S>; OWN],
    pub p: [&'a [f64]; OWN],
    pub of_axis: usize,
    /// The same of what corrects its reading.
    pub terms: &'a [Vector3<f64>],
    pub p_of_terms: &'a [f64],
    /// h and b.
    pub across: &'a [Aligned; 2],
    pub sums: [&'a [f64]; 4],
    pub weights: &'a [f64],
}

/// The upper triangles of H P Hᵀ and G W Gᵀ.
type Entries<S> = [[GroupSum<S>; 6]; 2];

impl<S: Simd> Moved<'_, S> {
    #[inline(always)]
    fn load(&self, numbers: &[f64], at: usize) -> Vector<S> {
        Vector::load(self.simd, numbers, [at, self.wide + at, 2 * self.wide + at])
    }

    /// h' of coordinates before the joint.
    #[inline(always)]
    fn before(&self, at: usize) -> Vector<S> {
        let [h, b] = self.across;
        self.load(b, at).cross_onto(self.shift, self.load(h, at))
    }

    /// h' of coordinates behind it.
    #[inline(always)]
    fn behind(&self, at: usize) -> Vector<S> {
        self.rotation.times_onto(self.load(&self.across[0], at), Vector::splat(self.simd, &Vector3::zeros()))
    }

    /// h' of a register in which there are coordinates of the joint itself.
    #[inline(always)]
    fn at_joint(&self, at: usize, own: Range<usize>) -> Vector<S> {
        let (simd, width) = (self.simd, Lanes::<S>::LEN);
        let ones = |until: usize| load(simd, &STEP, GROUP - until.saturating_sub(at).min(width));
        let (is_before, is_not_behind) = (ones(own.start), ones(own.end));
        let is_behind = splat(simd, 1.0) - is_not_behind;
        let mut moved = self.before(at).scaled_onto(is_before, self.behind(at).scaled(is_behind));
        for (coordinate, column) in own.clone().zip(&self.axis[..self.of_axis]) {
            moved = self.placed(at, coordinate, *column, moved);
        }
        for (coordinate, column) in own.skip(self.of_axis).zip(self.terms) {
            moved = self.placed(at, coordinate, Vector::splat(simd, column), moved);
        }
        moved
    }

    /// The same with a column where its coordinate stands in the register, if it does.
    #[inline(always)]
    fn placed(&self, at: usize, coordinate: usize, column: Vector<S>, moved: Vector<S>) -> Vector<S> {
        if !(at..at + Lanes::<S>::LEN).contains(&coordinate) {
            return moved;
        }
        column.scaled_onto(load(self.simd, &UNIT, GROUP - (coordinate - at)), moved)
    }

    /// Adds what a register of coordinates with these h' contributes.
    #[inline(always)]
    fn add(&self, at: usize, h: Vector<S>, entries: &mut Entries<S>) {
        let (simd, [all, from_here, behind, drifting]) = (self.simd, self.sums);
        let before = self.load(all, at) - self.load(from_here, at);
        let mut g = self.load(drifting, at).cross_onto(self.shift, before);
        g = self.rotation.times_onto(self.load(behind, at), g);
        for (p, column) in self.p.iter().zip(&self.axis) {
            g = column.scaled_onto(load(simd, p, at), g);
        }
        for (index, column) in self.terms.iter().enumerate() {
            let p = load(simd, self.p_of_terms, index * self.wide + at);
            g = Vector::splat(simd, column).scaled_onto(p, g);
        }
        let (weighted, [spreads, leverages]) = (g.scaled(load(simd, self.weights, at)), entries);
        let mut entry = 0;
        for (column, g) in g.0.iter().enumerate() {
            for (h, weighted) in h.0.iter().zip(&weighted.0).take(column + 1) {
                spreads[entry].add_product(at, *h, *g);
                leverages[entry].add_product(at, *weighted, *g);
                entry += 1;
            }
        }
    }

    /// H P Hᵀ and G W Gᵀ, of which the coordinates `own` are the joint's.
    #[inline(always)]
    pub fn multiply(&self, own: &Range<usize>) -> [[f64; 6]; 2] {
        let width = Lanes::<S>::LEN;
        let mut entries = [[GroupSum::zero(self.simd); 6]; 2];
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
        entries.map(|triangle| triangle.map(|sum| sum.total()))
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
