//! Feasible sets: the postures that may be proposed.
//!
//! [`Constraints`] say what a robot must not do, whatever it would teach: where its joints may be, where it must not be in
//! space, what it has refused, how far it may move at once. They are judged by the robot's nominal description in the frame
//! of its nominal base, in which whoever draws a box draws it, never by what a learner believes. So they are the same for
//! all learners, do not change as these learn, and tell them nothing of the truth.
//!
//! Every policy chooses within a [`Scope`], what may be proposed now. Searches evaluate nothing that is not feasible: such a
//! centre has no value, takes that of a feasible neighbour in DIRECT (Gablonsky 2001, §3.5; see
//! [`optimize`](crate::optimize)), and is never chosen.

mod clearance;
mod feasible_sample;
mod hull;
mod obstacle;
mod outline;
mod scope;
mod veto;
mod violation;

pub use clearance::Clearance;
pub use hull::Hull;
pub use obstacle::Obstacle;
pub use outline::Outline;
pub use scope::{Domain, Scope};
pub use veto::Vetoes;
pub use violation::{Infeasible, Tally, Violation};

use crate::kinematics::JointBox;

/// What movements are bound to. Without any of it everything inside the joint limits is feasible.
#[derive(Clone, Debug, PartialEq)]
pub struct Constraints {
    /// The joints' names, base first, to name what is violated.
    joints: Vec<String>,
    /// The robot's own limits.
    limits: JointBox,
    /// Tighter limits; the robot's own for a joint that has none.
    pub tightened: JointBox,
    /// Boxes that no part of the outline may be in, and no link may cross.
    pub obstacles: Vec<Obstacle>,
    /// The least height (z) of every part of the outline that moves, metres.
    pub minimum_height: Option<f64>,
    /// How near links may come to one another; see [`hold_apart`](Self::hold_apart).
    pub clearance: Option<Clearance>,
    /// What boxes, height and clearance are judged by.
    pub outline: Outline,
    /// The only postures that may be proposed, rad or m per joint.
    pub allowed: Option<Vec<Vec<f64>>>,
    /// How far each joint may move in one movement, rad or m; infinite for one that is not bound.
    pub greatest_travel: Vec<f64>,
    /// What a movement costs in units of the criterion per rad or m of its [travel](travel).
    pub price: f64,
    /// The posture before the first movement, rad or m per joint; without it the first movement is free.
    pub start: Option<Vec<f64>>,
    vetoes: Vetoes,
}

impl Constraints {
    /// None yet, for a robot of these joints and limits; `outline` is what boxes and height will be judged by.
    pub fn new(joints: Vec<String>, limits: JointBox, outline: Outline) -> Self {
        Self {
            greatest_travel: vec![f64::INFINITY; joints.len()],
            joints,
            tightened: limits.clone(),
            limits,
            obstacles: Vec::new(),
            minimum_height: None,
            clearance: None,
            outline,
            allowed: None,
            price: 0.0,
            start: None,
            vetoes: Vetoes::default(),
        }
    }

    /// None, for a robot of these limits of which nothing else is known: something to add vetoes to.
    pub fn none(limits: JointBox) -> Self {
        let joints = (0..limits.dimension()).map(|joint| joint.to_string()).collect();
        Self::new(joints, limits, Outline::default())
    }

    /// Excludes the neighbourhood of a posture that a robot has refused (see [`Vetoes`]). Tells its radius in the unit joint
    /// box.
    pub fn veto(&mut self, posture: &[f64]) -> f64 {
        self.vetoes.add(&self.limits, posture)
    }

    /// The first constraint that a movement from `from` (nowhere known, without it) to `posture` violates.
    pub fn violation(&self, from: Option<&[f64]>, posture: &[f64]) -> Option<Violation> {
        self.violations(from, posture).next()
    }

    /// Whether a movement is feasible.
    pub fn allow(&self, from: Option<&[f64]>, posture: &[f64]) -> bool {
        self.violation(from, posture).is_none()
    }

    /// All that a movement violates, the cheapest to find first: O(joints × boxes), and with a clearance
    /// O(joints²), for all.
    pub fn violations(&self, from: Option<&[f64]>, posture: &[f64]) -> impl Iterator<Item = Violation> {
        let of_joints = (0..posture.len()).flat_map(move |joint| self.at_joint(joint, from, posture[joint]));
        let listed = std::iter::once_with(|| (!self.is_listed(posture)).then_some(Violation::NotAllowed));
        let vetoed = || self.vetoes.exclude(&self.limits, posture).then_some(Violation::Vetoed);
        let in_space = std::iter::once_with(|| self.in_space(posture));
        of_joints.chain(listed.chain(std::iter::once_with(vetoed)).flatten()).chain(in_space.flatten())
    }

    /// What one joint violates.
    fn at_joint(&self, joint: usize, from: Option<&[f64]>, position: f64) -> impl Iterator<Item = Violation> {
        let (lower, upper) = (self.tightened.lower(joint), self.tightened.upper(joint));
        let is_tighter = (lower, upper) != (self.limits.lower(joint), self.limits.upper(joint));
        let is_outside = is_tighter && !(lower..=upper).contains(&position);
        let (by, greatest) = (from.map_or(0.0, |from| (position - from[joint]).abs()), self.greatest_travel[joint]);
        let name = || self.joints[joint].clone();
        let outside = is_outside.then(|| Violation::Limits { joint: name(), position, lower, upper });
        let far = by > greatest * (1.0 + ROUNDING);
        outside.into_iter().chain(far.then(|| Violation::Travel { joint: name(), by, greatest }))
    }

    /// What the outline violates.
    fn in_space(&self, posture: &[f64]) -> Vec<Violation> {
        let mut found = Vec::new();
        if self.obstacles.is_empty() && self.minimum_height.is_none() && self.clearance.is_none() {
            return found;
        }
        let links = self.outline.frames(posture);
        let points = self.outline.on(&links);
        for (index, part) in self.outline.moving() {
            let (part, height) = (|| part.to_owned(), points[index].z);
            let least = self.minimum_height.filter(|least| height < *least);
            found.extend(least.map(|least| Violation::Height { part: part(), height, least }));
            let inside = self.obstacles.iter().filter(|obstacle| obstacle.contains(&points[index]));
            found.extend(inside.map(|obstacle| Violation::Inside { part: part(), obstacle: obstacle.name.clone() }));
        }
        for ([from, to], part) in self.outline.links() {
            let crossed = self.obstacles.iter().filter(|obstacle| obstacle.meets(&points[from], &points[to]));
            let crosses = |obstacle: &Obstacle| (part.to_owned(), obstacle.name.clone());
            found.extend(crossed.map(crosses).map(|(part, obstacle)| Violation::Crosses { part, obstacle }));
        }
        found.extend(self.too_near(&links));
        found
    }

    /// Whether a posture is one of the list, if there is one, but for what rounding it for people does to it.
    fn is_listed(&self, posture: &[f64]) -> bool {
        let Some(allowed) = &self.allowed else { return true };
        let is_near = |(joint, (a, b)): (usize, (&f64, &f64))| {
            (a - b).abs() <= JointBox::ROUNDING * (self.limits.upper(joint) - self.limits.lower(joint))
        };
        allowed.iter().any(|allowed| allowed.iter().zip(posture).enumerate().all(is_near))
    }
}

/// What is forgiven a travel that was computed as a difference of positions, as a share of it.
const ROUNDING: f64 = 1e-9;

/// The travel of a movement: of how far its joints move the greatest, rad or m. It is the time that the movement takes where
/// all joints move together at the same speed.
pub fn travel(from: &[f64], to: &[f64]) -> f64 {
    from.iter().zip(to).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}
