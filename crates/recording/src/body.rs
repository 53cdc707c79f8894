//! The body around an arm: a human figure, or a pedestal.

use nalgebra::{Isometry3, Point3, Vector3};

use super::{
    limb::{Gazing, Limb, Limbs},
    solid::Capsule,
};
use body_schema_engine::model::State;
use body_schema_wire::{Description, JointDescription};

/// The colour of a body: lighter than the true arm, and visible on light and on dark backgrounds.
const BODY: [u8; 3] = [0xD6, 0xDA, 0xE0];
/// Opacity of a trunk that is part of the learned chain, such that the joints within it are visible.
const GLASS: u8 = 70;
/// A body, in the frame of the measurements; lengths in metres.
#[derive(Clone, Debug, Default)]
pub(super) struct Figure {
    /// The fixed parts.
    pub(super) fixed: Vec<Capsule>,
    /// The base under a pedestal.
    pub(super) base: Option<Capsule>,
    /// The parts that move with the true arm's trunk …
    pub(super) trunk: Vec<Capsule>,
    /// … on this link, 0 being the base.
    pub(super) carried_by: usize,
    /// The head that moves with a neck of the robot's own, and the link that carries it.
    pub(super) head: Vec<Capsule>,
    pub(super) head_link: usize,
    /// The point where the arm begins.
    pub(super) shoulder: Point3<f64>,
    /// The distance from there to the marker along the outstretched arm.
    pub(super) reach_m: f64,
    /// Height of the ground.
    pub(super) ground_m: f64,
    /// The place of the name.
    pub(super) name: Point3<f64>,
}

impl Figure {
    /// The body of a scenario's robot, whose arm is known or believed to be this one. `stands` says where the base link of a
    /// described robot is, and whether it has shapes of its own.
    pub(super) fn of(description: &Description, arm: &State, stands: Option<(&Isometry3<f64>, bool)>) -> Self {
        match description.body {
            Some(body_schema_wire::Body::Humanoid) => {
                let limbs = Limbs::of(&description.joints, arm);
                Self::beginning(&limbs).humanoid(arm, &limbs, description)
            }
            None => Self::below(&description.joints, arm, stands),
        }
    }

    /// What is below this arm: what is between its base link and it, for a described robot, or else a pedestal; and what leads from
    /// there to other limbs on the base.
    pub(super) fn below(joints: &[JointDescription], arm: &State, stands: Option<(&Isometry3<f64>, bool)>) -> Self {
        let limbs = Limbs::of(joints, arm);
        let figure = Self::beginning(&limbs);
        let has_shapes = stands.is_some_and(|(_, has_shapes)| has_shapes);
        let figure = match stands {
            Some((base, has_shapes)) => figure.standing(base, has_shapes),
            None => figure.pedestal(),
        };
        let beside = if has_shapes { Vec::new() } else { limbs.beside(arm) };
        figure.branching(limbs.arm.first().and_then(|first| arm.joints[first].line()).map(|line| line.point), &beside)
    }

    /// The point where an arm begins, and its reach.
    fn beginning(limbs: &Limbs) -> Self {
        let Limb { trunk, shoulder, reach_m, .. } = limbs.arm;
        // An arm of one joint may be a single point.
        let reach_m = if reach_m > 1e-3 { reach_m } else { 1.0 };
        Self { carried_by: trunk, shoulder, reach_m, ..Self::default() }
    }

    /// This figure with rods on the base from where the arm stands to where other limbs do.
    fn branching(mut self, stands: Option<Point3<f64>>, others: &[Point3<f64>]) -> Self {
        let [red, green, blue] = BODY;
        let from = stands.unwrap_or(self.shoulder);
        let rod = |to: &Point3<f64>| Capsule {
            from,
            to: *to,
            radius_m: 0.05 * self.reach_m,
            colour: [red, green, blue, 255],
        };
        self.fixed.extend(others.iter().map(rod));
        self
    }

    /// A figure of this arm's size, whose right arm it is: x ahead, y to the left, z up.
    fn humanoid(mut self, arm: &State, limbs: &Limbs, description: &Description) -> Self {
        let Self { shoulder, reach_m: a, carried_by, .. } = self;
        let has_waist = carried_by > 0;
        let first = limbs.arm.first().and_then(|first| arm.joints[first].line());
        let waist = first.map(|line| line.point).filter(|_| has_waist);
        let half_width = waist.map_or(0.34 * a, |waist| (waist.y - shoulder.y).abs().max(0.2 * a));
        let middle =
            Point3::new(waist.map_or(shoulder.x - 0.03 * a, |waist| waist.x), shoulder.y + half_width, shoulder.z);
        let hips = waist.unwrap_or(middle - Vector3::z() * (0.82 * a));
        let head = match &description.head {
            Some(head) => Point3::from(head.position_m),
            None => middle + Vector3::new(0.03, 0.0, 0.46) * a,
        };
        let alpha = if has_waist { GLASS } else { 255 };
        let rod = |from: Point3<f64>, to: Point3<f64>, radius: f64, alpha: u8| {
            let [red, green, blue] = BODY;
            Capsule { from, to, radius_m: radius * a, colour: [red, green, blue, alpha] }
        };
        let at = |base: Point3<f64>, x: f64, y: f64, z: f64| base + Vector3::new(x, y, z) * a;
        let left = Point3::new(shoulder.x, middle.y + half_width, shoulder.z);
        self.trunk = vec![
            rod(at(hips, 0.0, 0.0, if has_waist { 0.12 } else { 0.2 }), at(middle, 0.0, 0.0, -0.14), 0.19, alpha),
            // Shoulders.
            rod(
                at(middle, 0.0, half_width / a - 0.1, -0.05),
                at(middle, 0.0, 0.1 - half_width / a, -0.05),
                0.09,
                alpha,
            ),
        ];
        match limbs.head(arm) {
            // The robot's own head goes where its neck turns it; the camera is in its face.
            Some(Gazing { camera, link, neck }) => {
                self.trunk.push(rod(at(middle, 0.0, 0.0, 0.0), neck, 0.06, alpha));
                let centre = camera * Point3::new(0.0, 0.0, -0.12 * a);
                self.head = vec![rod(at(centre, 0.0, 0.0, -0.03), at(centre, 0.0, 0.0, 0.03), 0.13, GLASS)];
                self.head_link = link;
            }
            None => {
                self.trunk.push(rod(at(middle, 0.0, 0.0, 0.0), at(head, 0.0, 0.0, -0.1), 0.06, 255));
                self.trunk.push(rod(at(head, 0.0, 0.0, -0.035), at(head, 0.0, 0.0, 0.045), 0.135, 255));
            }
        }
        if !limbs.has_another_arm() {
            // The arm that is not learned hangs.
            self.trunk.push(rod(left, at(left, 0.0, 0.06, -0.42), 0.055, 255));
            self.trunk.push(rod(at(left, 0.0, 0.06, -0.42), at(left, 0.12, 0.04, -0.84), 0.045, 255));
        }
        let hip = 0.14;
        self.fixed = vec![rod(at(hips, 0.0, -0.07, 0.0), at(hips, 0.0, 0.07, 0.0), 0.15, 255)];
        for side in [-hip, hip] {
            self.fixed.push(rod(at(hips, 0.0, side, -0.05), at(hips, 0.0, side, -1.2), 0.085, 255));
            self.fixed.push(rod(at(hips, 0.0, side, -1.22), at(hips, 0.14, side, -1.24), 0.06, 255));
        }
        if !has_waist {
            self.fixed.append(&mut self.trunk);
        }
        self.ground_m = hips.z - 1.3 * a;
        // On the ground before the feet, where nothing is behind it: above the head it would lie over raised arms.
        self.name = at(hips, 0.3, -0.35, -1.26);
        self
    }

    /// A column from the base link to where the arm begins, on a plate, unless the base link has shapes of its own.
    fn standing(mut self, base: &Isometry3<f64>, has_shapes: bool) -> Self {
        let Self { shoulder, reach_m: a, .. } = self;
        let [red, green, blue] = BODY;
        let foot = Point3::from(base.translation.vector);
        let rod = |from: Point3<f64>, to: Point3<f64>, radius: f64| Capsule {
            from,
            to,
            radius_m: radius * a,
            colour: [red, green, blue, 255],
        };
        if !has_shapes {
            self.base = Some(rod(foot, foot + base * Vector3::z() * (0.03 * a), 0.13));
            let column = |from: f64, to: f64, radius: f64| {
                rod(foot + from * (shoulder - foot), foot + to * (shoulder - foot), radius)
            };
            if self.carried_by > 0 {
                self.fixed = vec![column(0.0, 0.55, 0.085)];
                self.trunk = vec![column(0.1, 1.0, 0.062)];
            } else {
                self.fixed = vec![column(0.0, 1.0, 0.062)];
            }
        }
        self.ground_m = foot.z;
        self.name = foot + Vector3::new(0.3, -0.42, 0.03) * a;
        self
    }

    /// A pedestal below the first joint, for a robot that is only an arm.
    fn pedestal(mut self) -> Self {
        let Self { shoulder, reach_m: a, .. } = self;
        let [red, green, blue] = BODY;
        let rod = |from: [f64; 3], to: [f64; 3], radius: f64| Capsule {
            from: shoulder + Vector3::from(from) * a,
            to: shoulder + Vector3::from(to) * a,
            radius_m: radius * a,
            colour: [red, green, blue, 255],
        };
        // Where a joint lifts the arm, an inner column goes with it.
        let column = |from: f64, to: f64, radius: f64| rod([0.0, 0.0, from], [0.0, 0.0, to], radius);
        self.base = Some(column(-1.0, -0.8, 0.3));
        if self.carried_by > 0 {
            self.fixed = vec![column(-0.85, -0.4, 0.17)];
            self.trunk = vec![column(-0.75, -0.12, 0.12)];
        } else {
            self.fixed = vec![column(-0.85, -0.14, 0.12)];
        }
        self.ground_m = shoulder.z - 1.0 * a;
        self.name = shoulder + Vector3::new(0.3, -0.42, -0.97) * a;
        self
    }
}
