//! The pass along the tree: where every joint is at a few postures, and what turns behind it. All kinematics of the engine come from it.
//!
//! Every joint has a frame: its axis w is the third direction, the basis b₁, b₂ of the axis' chart are the others, and its
//! origin is the pivot v. Between a joint's frame and that of a joint that it carries lie a fixed rotation and a fixed arm, so that
//! with E the frame before the joint turns by θ, F the same after, and q its origin,
//!
//! ```text
//! F = E rot₃(θ),     E⁺ = F (BᵀB⁺),     q⁺ = q + F Bᵀ(v⁺ − v)
//! ```
//!
//! It is written once for [`Numbers`] of any kind. Functions are handed lanes, hence `#[inline(always)]`, and no closures.

use nalgebra::{Isometry3, Matrix3, Point3, Vector3};

use super::{
    Correction, Joint, JointKind, Numbers, Tree, chart,
    correction::{Reading, read},
    passed::{Passed, Turned},
};

/// A rotation, and a vector in metres: a frame, or what lies between two frames.
pub type Placed = (Matrix3<f64>, Vector3<f64>);

/// The joints of a robot, to be passed at many postures.
#[derive(Clone, Debug)]
pub struct Kernel {
    tree: Tree,
    /// The pose of the robot's base in the frame of the measurements.
    base: Isometry3<f64>,
    /// The joints; `None` where it was not asked for.
    joints: Vec<Option<Step>>,
}

#[derive(Clone, Debug)]
struct Step {
    kind: JointKind,
    correction: Correction,
    /// Whether the sine and cosine of the reading are needed.
    needs_sine: bool,
    /// B and v of the joint's axis.
    rest: Placed,
    /// BᵀB⁺ and Bᵀ(v⁺ − v) from the joint that carries it; E and q if the base carries it.
    from: Placed,
}

impl Kernel {
    /// The joints of a robot whose base is at `base`, each with its correction; of those alone that are `asked` for with all that carry
    /// them. `needs_sine` marks the joints whose readings need sine and cosine for more than the correction.
    pub fn new(
        tree: &Tree,
        base: &Isometry3<f64>,
        (joints, corrections): (&[Joint], &[Correction]),
        asked: impl Fn(usize) -> bool,
        needs_sine: impl Fn(usize) -> bool,
    ) -> Self {
        let mut steps: Vec<Option<Step>> = Vec::with_capacity(joints.len());
        for (index, (joint, correction)) in joints.iter().zip(corrections).enumerate() {
            if !asked(index) {
                steps.push(None);
                continue;
            }
            let pivot = joint.line().map_or_else(Vector3::zeros, |line| line.point.coords);
            let (w, basis) = (joint.direction(), chart::basis(&joint.direction()));
            let frame = Matrix3::from_columns(&[basis.column(0).into_owned(), basis.column(1).into_owned(), *w]);
            let from = match tree.parent(index).and_then(|parent| steps[parent].as_ref()) {
                None => (base.rotation.to_rotation_matrix().matrix() * frame, (base * Point3::from(pivot)).coords),
                Some(Step { rest: (before, origin), .. }) => (before.tr_mul(&frame), before.tr_mul(&(pivot - origin))),
            };
            let needs_sine = correction.needs_sine() || needs_sine(index);
            let (kind, correction, rest) = (joint.kind(), *correction, (frame, pivot));
            steps.push(Some(Step { kind, correction, needs_sine, rest, from }));
        }
        Self { tree: tree.clone(), base: *base, joints: steps }
    }

    /// The tree.
    pub fn tree(&self) -> &Tree {
        &self.tree
    }

    /// A point (metres, at θ = 0) and the axes of its link in the frame of the joint that carries the link, as [`Walk::place`] takes
    /// them; on the base, where both are for good.
    pub fn fixed(&self, link: usize, x: &Point3<f64>) -> Placed {
        match link.checked_sub(1).and_then(|joint| self.joints.get(joint)?.as_ref()) {
            None => (*self.base.rotation.to_rotation_matrix().matrix(), (self.base * x).coords),
            Some(Step { rest: (frame, pivot), .. }) => (frame.transpose(), frame.tr_mul(&(x.coords - pivot))),
        }
    }

    /// Begins a pass.
    #[inline(always)]
    pub fn walk<N: Numbers>(&self, numbers: N) -> Walk<N> {
        let (frame, pivot) = (numbers.rotation(&Matrix3::identity()), numbers.vector(&Vector3::zeros()));
        Walk { numbers, passed: Passed::with_room(numbers, self.joints.len()), frame, pivot }
    }
}

/// A pass along the tree of a [`Kernel`] at a few postures, up to some joint.
#[derive(Clone, Debug)]
pub struct Walk<N: Numbers> {
    numbers: N,
    /// The joints passed so far.
    pub passed: Passed<N>,
    /// F and q of the last joint passed.
    frame: N::Rotation,
    pivot: N::Vector,
}

impl<N: Numbers> Walk<N> {
    /// Goes back to the base.
    #[inline(always)]
    pub fn restart(&mut self) {
        self.passed.count = 0;
    }

    /// Passes the next joint, or leaves it out if it was not asked for, with a reading of each posture; `given` is how far the joint gives way to loads, rad or m, if it does.
    #[inline(always)]
    pub fn step(&mut self, kernel: &Kernel, reading: N::Number, given: Option<N::Number>) {
        let (index, numbers) = (self.passed.count, self.numbers);
        let Some(step) = &kernel.joints[index] else {
            self.passed.count += 1;
            return;
        };
        let (rotation, arm) = &step.from;
        match kernel.tree.parent(index) {
            None => (self.frame, self.pivot) = (numbers.rotation(rotation), numbers.vector(arm)),
            Some(parent) => {
                if parent + 1 != index {
                    (self.frame, self.pivot) = self.passed.frame(parent);
                }
                self.pivot = self.pivot + N::times(&self.frame, arm);
                self.frame = N::then(&self.frame, rotation);
            }
        }
        let reading = read::<N>(reading, step.needs_sine);
        let unloaded = step.correction.unloaded(numbers, reading);
        let theta = given.map_or(unloaded, |given| unloaded + given);
        let turned = step.turn((reading, theta), &mut self.frame, &mut self.pivot);
        self.passed.push(&turned);
    }

    /// The position (metres) of something that is [fixed](Kernel::fixed) to the link of the last joint, and the axes of
    /// that link.
    #[inline(always)]
    pub fn place(&self, (axes, x): &Placed) -> (N::Vector, N::Rotation) {
        if self.passed.count == 0 {
            return (self.numbers.vector(x), self.numbers.rotation(axes));
        }
        (self.pivot + N::times(&self.frame, x), N::then(&self.frame, axes))
    }

    /// The same of a link that was passed before.
    #[inline(always)]
    pub fn place_on(&self, link: usize, (axes, x): &Placed) -> (N::Vector, N::Rotation) {
        let Some(joint) = link.checked_sub(1) else {
            return (self.numbers.vector(x), self.numbers.rotation(axes));
        };
        let (frame, pivot) = self.passed.frame(joint);
        (pivot + N::times(&frame, x), N::then(&frame, axes))
    }
}

impl Step {
    /// Turns or slides a joint's frame E to θ.
    #[inline(always)]
    fn turn<N: Numbers>(
        &self,
        (reading, theta): (Reading<N>, N::Number),
        frame: &mut N::Rotation,
        pivot: &mut N::Vector,
    ) -> Turned<N> {
        let [e1, e2, axis] = N::columns(frame);
        let (swept, basis) = match self.kind {
            JointKind::Revolute => {
                let (sin, cos) = N::sin_cos(theta);
                *frame = N::turned(frame, sin, cos);
                let [f1, f2, _] = N::columns(frame);
                ([e1 - f1, e2 - f2], [f1, f2])
            }
            JointKind::Prismatic => {
                *pivot = *pivot + N::scaled(axis, theta);
                ([N::scaled(e1, theta), N::scaled(e2, theta)], [e1, e2])
            }
        };
        Turned { swept, axis, basis, pivot: *pivot, reading }
    }
}
