//! Rows of postures that differ from one in a single joint, as those by which DIRECT divides a rectangle do.
//!
//! Turning joint j by δ turns all that is behind it by R = exp(δ [f₃]×) about its pivot, and moves the point by Δ. Of the columns at
//! the posture in the middle, then, those of joints behind j become R h, those of joints before it change by what moving the
//! point changes, b × Δ, and only j's own are others:
//!
//! ```text
//! h' = h + b × Δ   before j,       b = 0, 0, d₂, −d₁ of an axis, f₃ of what is added to θ
//! h' = R h         behind j
//! ```
//!
//! Where joint j slides, R = 1 and Δ = δ f₃.

use std::ops::Range;

use fearless_simd::Simd;
use nalgebra::{Matrix3, Vector3};

use super::{Learned, Outputs, Passed, Points, Term, Whitening};
use crate::{
    kinematics::{
        JointKind, Plain,
        correction::{LOADS, read},
    },
    simd::{Aligned, GROUP},
};

/// Numbers of a joint: f₁, f₂, f₃ and its pivot.
const NUMBERS: usize = 12;

/// The tangent coordinates in the order in which a walk along the chain comes to them.
pub struct Passage {
    /// Which coordinate comes at each place.
    pub order: Vec<usize>,
    /// Those of the base, of every joint before the point, and of what is on its link.
    pub stages: Vec<Stage>,
}

/// What a walk along the chain comes to at one place of it.
pub struct Stage {
    /// Its coordinates, as places in the order.
    pub coordinates: Range<usize>,
    /// Those of them whose columns change as the point moves.
    pub drifting: Range<usize>,
    /// How many of them belong to the axis, and come first.
    pub of_axis: usize,
}

/// A few postures at the centres of perturbations.
#[derive(Default)]
pub struct Centres {
    /// Where the point is, metres.
    places: Vec<f64>,
    rows: Aligned,
    joints: Aligned,
}

/// One centre of those looked up.
#[derive(Clone, Copy)]
pub struct Centre<'a> {
    points: &'a Points,
    of: &'a Centres,
    index: usize,
}

/// A joint that is before the point, at the posture in the middle of a perturbation.
pub struct Pivot<'a> {
    joint: &'a Learned,
    weight: f64,
    /// h of its first two coordinates, if its axis is learned.
    columns: [Vector3<f64>; 2],
    basis: [Vector3<f64>; 2],
    axis: Vector3<f64>,
    /// From there to the point, metres.
    arm: Vector3<f64>,
    /// f₃ × arm, and f₃ × that.
    across: [Vector3<f64>; 2],
}

/// How the columns change when a joint moves.
pub struct Ray {
    /// R, of what is behind the joint.
    pub rotation: Matrix3<f64>,
    /// Δ, metres.
    pub shift: Vector3<f64>,
    /// h' of the joint's axis, as far as it is learned; else 0.
    pub axis: [Vector3<f64>; 4],
}

impl Points {
    /// How a walk passes the chain to the point; `None` where there is not just one, measured alike in all directions, or where a joint
    /// before it is of another branch.
    pub fn passage(&self) -> Option<Passage> {
        let [place] = self.places.as_slice() else { return None };
        if self.moving(place).count() < place.link {
            return None;
        }
        let Whitening::Even(_) = place.whitening else { return None };
        let (mut order, mut stages) = (Vec::with_capacity(self.dimension), Vec::new());
        let mut pass = |coordinates: &mut dyn Iterator<Item = usize>, fixed: usize, of_axis: usize| {
            let first = order.len();
            order.extend(coordinates);
            let drifting = order.len().min(first + fixed)..order.len();
            stages.push(Stage { coordinates: first..order.len(), drifting, of_axis });
        };
        pass(&mut self.base.iter().flat_map(|(start, _)| *start..start + 6), 3, 0);
        for joint in &self.joints[..place.link] {
            let is_revolute = joint.kind == JointKind::Revolute;
            let axis = joint.axis.map_or(0..0, |start| start..start + if is_revolute { 4 } else { 2 });
            let (of_axis, terms) = (axis.len(), joint.terms.iter().map(|(coordinate, _)| *coordinate));
            let fixed = if is_revolute { of_axis.min(2) } else { of_axis + joint.terms.len() };
            pass(&mut axis.chain(terms), fixed, of_axis);
        }
        pass(&mut place.own.iter().flat_map(|start| *start..start + 3), 3, 0);
        let mut is_passed = vec![false; self.dimension];
        order.iter().for_each(|&coordinate| is_passed[coordinate] = true);
        order.extend((0..self.dimension).filter(|&coordinate| !is_passed[coordinate]));
        Some(Passage { order, stages })
    }

    /// Looks up postures, which are to be the middle of perturbations; of those points that have a [`passage`](Self::passage).
    #[inline(always)]
    pub fn look_up<S: Simd, C: AsRef<[f64]>>(&self, simd: S, postures: &[C], centres: &mut Centres) {
        let groups = crate::simd::groups(postures.len());
        let Centres { places, rows, joints } = centres;
        // Where nothing is written, nothing ever was.
        places.resize(3 * postures.len(), 0.0);
        rows.ensure(groups * self.dimension * 3 * GROUP);
        joints.ensure(groups * self.joints.len() * NUMBERS * GROUP);
        self.pass(simd, postures, places, Outputs::Centres(rows, joints));
    }

    /// How much joint `joint` moves from one reading to another, rad or m.
    pub fn travel(&self, joint: usize, from: f64, to: f64) -> f64 {
        let correction = &self.joints[joint].correction;
        correction.position(to) - correction.position(from)
    }
}

/// Keeps what rays need of joints at a few postures of a group.
#[inline(always)]
pub(super) fn keep<S: Simd>(passed: &Passed<S>, joints: &mut [f64], first: usize) {
    for (index, numbers) in joints.chunks_exact_mut(NUMBERS * GROUP).enumerate().take(passed.count) {
        let turned = passed.at(index);
        let [f1, f2] = turned.basis;
        f1.store(numbers, [first, GROUP + first, 2 * GROUP + first]);
        f2.store(numbers, [3 * GROUP + first, 4 * GROUP + first, 5 * GROUP + first]);
        turned.axis.store(numbers, [6 * GROUP + first, 7 * GROUP + first, 8 * GROUP + first]);
        turned.pivot.store(numbers, [9 * GROUP + first, 10 * GROUP + first, 11 * GROUP + first]);
    }
}

impl Centres {
    /// The centre of this index among those looked up.
    pub fn at<'a>(&'a self, points: &'a Points, index: usize) -> Centre<'a> {
        Centre { points, of: self, index }
    }
}

impl Centre<'_> {
    fn weight(&self) -> f64 {
        match self.points.places[0].whitening {
            Whitening::Even(weight) => weight,
            Whitening::Full(_) => f64::NAN,
        }
    }

    fn place(&self) -> Vector3<f64> {
        Vector3::from_column_slice(&self.of.places[3 * self.index..3 * self.index + 3])
    }

    /// h of tangent coordinates, in this order.
    #[inline(always)]
    pub fn columns<'a>(&'a self, order: &'a [usize]) -> impl Iterator<Item = Vector3<f64>> + 'a {
        let rows = &self.of.rows[self.index / GROUP * self.points.dimension * 3 * GROUP + self.index % GROUP..];
        order.iter().map(|coordinate| {
            let numbers = &rows[coordinate * 3 * GROUP..][..=2 * GROUP];
            Vector3::new(numbers[0], numbers[GROUP], numbers[2 * GROUP])
        })
    }

    /// One of a joint's vectors.
    #[inline(always)]
    fn vector(&self, joint: usize, which: usize) -> Vector3<f64> {
        let joints = self.points.joints.len();
        let first = ((self.index / GROUP * joints + joint) * NUMBERS + 3 * which) * GROUP + self.index % GROUP;
        let numbers = &self.of.joints[first..=first + 2 * GROUP];
        Vector3::new(numbers[0], numbers[GROUP], numbers[2 * GROUP])
    }

    /// b of the drifting coordinates of a stage, in their order, where `h` are the columns of all of its coordinates.
    #[inline(always)]
    pub fn drifts(&self, stage: usize, readings: &[f64], h: &[Vector3<f64>], mut found: impl FnMut(Vector3<f64>)) {
        let Some(index) = stage.checked_sub(1) else {
            // Turning the base is as much for the point as moving it is for the base.
            (0..h.len().min(3)).for_each(|k| found(h[k]));
            return;
        };
        let before = &self.points.joints[..self.points.places[0].link];
        let Some(joint) = before.get(index).filter(|joint| joint.kind == JointKind::Revolute) else { return };
        if joint.axis.is_some() {
            found(h[1]);
            found(-h[0]);
        }
        if !joint.terms.is_empty() {
            let axis = self.vector(index, 2) * self.weight();
            for (_, term) in &joint.terms {
                found(axis * factor(*term, readings[index]));
            }
        }
    }

    /// A joint that is before the point, of whose coordinates `h` are the columns.
    #[inline(always)]
    pub fn pivot(&self, joint: usize, h: &[Vector3<f64>]) -> Pivot<'_> {
        let [axis, pivot] = [2, 3].map(|which| self.vector(joint, which));
        let arm = self.place() - pivot;
        let across = axis.cross(&arm);
        Pivot {
            joint: &self.points.joints[joint],
            weight: self.weight(),
            columns: [0, 1].map(|k| h.get(k).copied().unwrap_or_default()),
            basis: [0, 1].map(|which| self.vector(joint, which)),
            axis,
            arm,
            across: [across, axis.cross(&across)],
        }
    }
}

impl Pivot<'_> {
    /// What becomes of all when the joint moves to another reading, by a way (rad or m) or an angle of this sine and cosine; h' of
    /// what corrects its reading is put to `terms`.
    #[inline(always)]
    pub fn ray(&self, reading: f64, [travel, sin, cos]: [f64; 3], terms: &mut Vec<Vector3<f64>>) -> Ray {
        let (is_revolute, [f1, f2], [h1, h2]) = (self.joint.kind == JointKind::Revolute, self.basis, self.columns);
        let mut axis = [Vector3::zeros(); 4];
        let (rotation, shift, arm) = if is_revolute {
            let [across, inward] = self.across;
            let shift = across * sin + inward * (1.0 - cos);
            let arm = self.arm + shift;
            if self.joint.axis.is_some() {
                let (bent, swung) = (self.weight * (1.0 - cos), self.weight * sin);
                let d1 = h1 + f1 * bent - f2 * swung;
                let d2 = h2 + f2 * bent + f1 * swung;
                axis = [d1, d2, d2.cross(&arm), arm.cross(&d1)];
            }
            (rotation(&self.axis, sin, cos), shift, arm)
        } else {
            if self.joint.axis.is_some() {
                let further = self.weight * travel;
                (axis[0], axis[1]) = (h1 + f1 * further, h2 + f2 * further);
            }
            (Matrix3::identity(), self.axis * travel, self.arm)
        };
        terms.clear();
        if !self.joint.terms.is_empty() {
            let velocity = self.weight * if is_revolute { self.axis.cross(&arm) } else { self.axis };
            terms.extend(self.joint.terms.iter().map(|(_, term)| velocity * factor(*term, reading)));
        }
        Ray { rotation, shift, axis }
    }
}

/// The factor f of a term at a reading.
fn factor(term: Term, reading: f64) -> f64 {
    term.factor(Plain, read::<Plain>(reading, term.needs_sine()), &[0.0; LOADS]).0
}

/// exp(δ [axis]×) for an angle of that sine and cosine.
fn rotation(axis: &Vector3<f64>, sin: f64, cos: f64) -> Matrix3<f64> {
    let (w, s, k) = (axis, axis * sin, axis * (1.0 - cos));
    Matrix3::new(
        cos + k.x * w.x,
        k.x * w.y - s.z,
        k.x * w.z + s.y,
        k.y * w.x + s.z,
        cos + k.y * w.y,
        k.y * w.z - s.x,
        k.z * w.x - s.y,
        k.z * w.y + s.x,
        cos + k.z * w.z,
    )
}
