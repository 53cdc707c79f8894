//! What the poses of the bodies do when the parameters of a robot change: see [`fit`](crate::fit()).

use body_schema_engine::kinematics::{Joint, chart};
use nalgebra::{Isometry3, Point3, Vector3};

use crate::robot::Robot;

/// A twist: what is at p moves by ω × p + u.
#[derive(Clone, Copy)]
struct Moves {
    turn: Vector3<f64>,
    shift: Vector3<f64>,
}

impl Moves {
    /// Ad of a motion.
    fn carried(&self, motion: &Isometry3<f64>) -> Self {
        let turn = motion.rotation * self.turn;
        Self { turn, shift: motion.rotation * self.shift - turn.cross(&motion.translation.vector) }
    }

    fn minus(&self, other: &Self) -> Self {
        Self { turn: self.turn - other.turn, shift: self.shift - other.shift }
    }

    fn at(&self, point: &Point3<f64>) -> Vector3<f64> {
        self.turn.cross(&point.coords) + self.shift
    }
}

/// The twists by which the parameters of all joints move what is behind them at a posture, joint by joint.
fn twists(robot: &Robot, positions: &[f64], motions: &[Isometry3<f64>], twists: &mut Vec<Moves>) {
    twists.clear();
    let zero = Vector3::zeros();
    for joint in &robot.joints {
        let before = joint.parent.map_or(Isometry3::identity(), |parent| motions[parent]);
        let position = joint.position(positions, &robot.middle);
        let own = joint.axis.exp(position);
        let ratio = match &joint.axis {
            Joint::Revolute(line) => {
                let basis = chart::basis(&line.direction);
                for column in 0..2 {
                    let eta = Moves { turn: zero, shift: basis.column(column).into_owned() };
                    twists.push(eta.minus(&eta.carried(&own)).carried(&before));
                }
                for column in 0..2 {
                    let turn = line.direction.cross(&basis.column(column));
                    let eta = Moves { turn, shift: line.point.coords.cross(&turn) };
                    twists.push(eta.minus(&eta.carried(&own)).carried(&before));
                }
                let turn = line.direction.into_inner();
                Moves { turn, shift: line.point.coords.cross(&turn) }
            }
            Joint::Prismatic(direction) => {
                let basis = chart::basis(direction);
                for column in 0..2 {
                    let shift = basis.column(column) * position;
                    twists.push(Moves { turn: zero, shift }.carried(&before));
                }
                Moves { turn: zero, shift: direction.into_inner() }
            }
        };
        for drive in joint.drives.iter().filter(|drive| drive.is_free) {
            let by = positions[drive.column] - robot.middle[drive.column];
            let scaled = Moves { turn: ratio.turn * by, shift: ratio.shift * by };
            twists.push(scaled.carried(&before));
        }
    }
}

/// The first parameter of every joint and of every target, and their number.
pub(crate) fn offsets(robot: &Robot) -> (Vec<usize>, Vec<usize>, usize) {
    let mut at = 0;
    let mut joints = Vec::new();
    for joint in &robot.joints {
        joints.push(at);
        at += joint.axis.degrees_of_freedom() + joint.drives.iter().filter(|drive| drive.is_free).count();
    }
    let mut targets = Vec::new();
    for held in &robot.targets {
        targets.push(at);
        at += if held.is_pose { 6 } else { 3 };
    }
    (joints, targets, at)
}

/// The whitened Jacobian's rows of one target at a posture: (parameter, derivative of the place, of the rotation).
pub(crate) type Entries = Vec<(usize, Vector3<f64>, Vector3<f64>)>;

/// Where every target is at a posture, and how the parameters move it: metres and radians per tangent coordinate.
pub(crate) fn jacobians(robot: &Robot, positions: &[f64]) -> Vec<(Isometry3<f64>, Entries)> {
    let motions = robot.motions(positions);
    let (joints, targets, _) = offsets(robot);
    let mut moves = Vec::new();
    twists(robot, positions, &motions, &mut moves);
    let of = |(index, held): (usize, &crate::robot::Held)| {
        let motion = held.carrier.map_or(Isometry3::identity(), |joint| motions[joint]);
        let found = motion * held.home;
        let point = Point3::from(found.translation.vector);
        let mut entries = Entries::new();
        let mut at = held.carrier;
        while let Some(joint) = at {
            let end = joints.get(joint + 1).copied().unwrap_or(moves.len());
            let of_joint =
                (joints[joint]..end).map(|parameter| (parameter, moves[parameter].at(&point), moves[parameter].turn));
            entries.extend(of_joint);
            at = robot.joints[joint].parent;
        }
        for axis in 0..3 {
            let unit = motion.rotation * Vector3::ith(axis, 1.0);
            entries.push((targets[index] + axis, unit, Vector3::zeros()));
            if held.is_pose {
                entries.push((targets[index] + 3 + axis, Vector3::zeros(), unit));
            }
        }
        (found, entries)
    };
    robot.targets.iter().enumerate().map(of).collect()
}
