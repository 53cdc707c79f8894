//! The body around an arm: a human figure, or a pedestal.

use nalgebra::{Isometry3, Point3, Vector3};

use super::solid::Capsule;
use body_schema_engine::model::State;
use body_schema_wire::{Description, JointDescription};

/// The colour of a body: lighter than the true arm, and visible on light and on dark backgrounds.
const BODY: [u8; 3] = [0xD6, 0xDA, 0xE0];
/// Opacity of a trunk that is part of the learned chain, such that the joints within it are visible.
const GLASS: u8 = 70;
/// The beginnings of names of joints that are in the trunk.
const TRUNK: [&str; 2] = ["torso", "chest"];

/// A body, in the frame of the measurements; lengths in metres.
#[derive(Clone, Debug, Default)]
pub(super) struct Figure {
    /// The fixed parts.
    pub(super) fixed: Vec<Capsule>,
    /// The base under a pedestal.
    pub(super) base: Option<Capsule>,
    /// The parts that move with the true arm's trunk …
    pub(super) trunk: Vec<Capsule>,
    /// … after this many joints.
    pub(super) carried_by: usize,
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
                Self::beginning(&description.joints, arm).humanoid(arm, description)
            }
            None => Self::below(&description.joints, arm, stands),
        }
    }

    /// What is below this arm: what is between its base link and it, for a described robot, or else a pedestal.
    pub(super) fn below(joints: &[JointDescription], arm: &State, stands: Option<(&Isometry3<f64>, bool)>) -> Self {
        let figure = Self::beginning(joints, arm);
        match stands {
            Some((base, has_shapes)) => figure.standing(base, has_shapes),
            None => figure.pedestal(),
        }
    }

    /// The point where an arm of these joints begins, and its reach.
    fn beginning(joints: &[JointDescription], arm: &State) -> Self {
        let name = |index: usize| joints.get(index).map_or("", |joint| joint.name.as_str());
        let carried_by =
            (0..arm.joints.len()).take_while(|index| TRUNK.iter().any(|trunk| name(*index).starts_with(trunk))).count();
        let points: Vec<(usize, Point3<f64>)> =
            (arm.joints.iter().enumerate()).filter_map(|(index, joint)| Some((index, joint.line()?.point))).collect();
        let begins = (points.iter()).find(|(index, _)| name(*index).starts_with("shoulder"));
        let begins = begins.or(points.iter().find(|(index, _)| *index >= carried_by));
        let (first, shoulder) = begins.copied().unwrap_or((0, arm.marker()));
        let arm_points: Vec<Point3<f64>> =
            points.iter().filter(|(index, _)| *index >= first).map(|(_, point)| *point).chain([arm.marker()]).collect();
        let reach_m: f64 = arm_points.windows(2).map(|ends| (ends[1] - ends[0]).norm()).sum();
        // An arm of one joint may be a single point.
        let reach_m = if reach_m > 1e-3 { reach_m } else { 1.0 };
        Self { carried_by, shoulder, reach_m, ..Self::default() }
    }

    /// A figure of this arm's size, whose right arm it is: x ahead, y to the left, z up.
    fn humanoid(mut self, arm: &State, description: &Description) -> Self {
        let Self { shoulder, reach_m: a, carried_by, .. } = self;
        let has_waist = carried_by > 0;
        let waist = arm.joints.first().and_then(|joint| joint.line()).map(|line| line.point).filter(|_| has_waist);
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
            // Shoulders, neck and head.
            rod(
                at(middle, 0.0, half_width / a - 0.1, -0.05),
                at(middle, 0.0, 0.1 - half_width / a, -0.05),
                0.09,
                alpha,
            ),
            rod(at(middle, 0.0, 0.0, 0.0), at(head, 0.0, 0.0, -0.1), 0.06, 255),
            rod(at(head, 0.0, 0.0, -0.035), at(head, 0.0, 0.0, 0.045), 0.135, 255),
            // The arm that is not learned hangs.
            rod(left, at(left, 0.0, 0.06, -0.42), 0.055, 255),
            rod(at(left, 0.0, 0.06, -0.42), at(left, 0.12, 0.04, -0.84), 0.045, 255),
        ];
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
