//! The joints that a walk along the tree has passed.

use nalgebra::Vector3;

use super::{JointKind, Numbers, Plain, Twist, correction::Reading};
use crate::simd::Aligned;

/// A joint's axes and pivot at a few postures: d₁, d₂, f₃ and q; for a prismatic joint θ e₁ and θ e₂ take the place of
/// d₁ and d₂.
pub struct Turned<N: Numbers> {
    pub swept: [N::Vector; 2],
    pub axis: N::Vector,
    /// f₁ and f₂.
    pub basis: [N::Vector; 2],
    pub pivot: N::Vector,
    /// The joint's reading, its sine and cosine.
    pub reading: Reading<N>,
}

impl Turned<Plain> {
    /// `Ad ξ`: the twist by which the joint moves what it carries, per unit of its position.
    #[inline]
    pub fn twist(&self, kind: JointKind) -> Twist {
        match kind {
            JointKind::Revolute => Twist { linear: self.pivot.cross(&self.axis), angular: self.axis },
            JointKind::Prismatic => Twist { linear: self.axis, angular: Vector3::zeros() },
        }
    }

    /// The twists of what the joint carries, one for each tangent coordinate of its axis:
    ///
    /// ```text
    /// point        (d₁, 0), (d₂, 0)
    /// direction    (q × d₂, d₂), (−q × d₁, −d₁)       revolute
    ///              (θ e₁, 0), (θ e₂, 0)               prismatic
    /// ```
    #[inline]
    pub fn axis_twists(&self, kind: JointKind, mut each: impl FnMut(usize, Twist)) {
        let ([d1, d2], nothing) = (self.swept, Vector3::zeros());
        each(0, Twist { linear: d1, angular: nothing });
        each(1, Twist { linear: d2, angular: nothing });
        if kind == JointKind::Revolute {
            each(2, Twist { linear: self.pivot.cross(&d2), angular: d2 });
            each(3, Twist { linear: d1.cross(&self.pivot), angular: -d1 });
        }
    }
}

/// How many vectors are stored per joint; its reading counts as one.
const VECTORS: usize = 7;

/// The joints that a walk along the tree has passed, at a few postures.
#[derive(Clone, Debug)]
pub struct Passed<N: Numbers> {
    of: N,
    numbers: Aligned,
    /// The number of joints passed.
    pub count: usize,
}

/// Where the components of one of a joint's vectors are.
#[inline(always)]
fn at<N: Numbers>(vector: usize) -> [usize; 3] {
    [3 * vector * N::COUNT, (3 * vector + 1) * N::COUNT, (3 * vector + 2) * N::COUNT]
}

impl<N: Numbers> Passed<N> {
    /// No joints yet, with room for `joints` of them.
    #[inline(always)]
    pub fn with_room(numbers: N, joints: usize) -> Self {
        Self { of: numbers, numbers: Aligned::zeros(joints * 3 * VECTORS * N::COUNT), count: 0 }
    }

    /// Adds the next joint.
    #[inline(always)]
    pub fn push(&mut self, turned: &Turned<N>) {
        let numbers = &mut self.numbers[self.count * 3 * VECTORS * N::COUNT..][..3 * VECTORS * N::COUNT];
        let Turned { swept: [d1, d2], axis, basis: [f1, f2], pivot, reading } = *turned;
        N::store(d1, numbers, at::<N>(0));
        N::store(d2, numbers, at::<N>(1));
        N::store(axis, numbers, at::<N>(2));
        N::store(f1, numbers, at::<N>(3));
        N::store(f2, numbers, at::<N>(4));
        N::store(pivot, numbers, at::<N>(5));
        N::store(N::join(reading), numbers, at::<N>(6));
        self.count += 1;
    }

    /// The joint at an index.
    #[inline(always)]
    pub fn at(&self, index: usize) -> Turned<N> {
        let numbers = &self.numbers[index * 3 * VECTORS * N::COUNT..][..3 * VECTORS * N::COUNT];
        Turned {
            swept: [self.of.load(numbers, at::<N>(0)), self.of.load(numbers, at::<N>(1))],
            axis: self.of.load(numbers, at::<N>(2)),
            basis: [self.of.load(numbers, at::<N>(3)), self.of.load(numbers, at::<N>(4))],
            pivot: self.of.load(numbers, at::<N>(5)),
            reading: N::components(self.of.load(numbers, at::<N>(6))),
        }
    }

    /// F and q of the joint at an index.
    #[inline(always)]
    pub fn frame(&self, index: usize) -> (N::Rotation, N::Vector) {
        let Turned { axis, basis: [f1, f2], pivot, .. } = self.at(index);
        (N::of_columns([f1, f2, axis]), pivot)
    }
}
