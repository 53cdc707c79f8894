//! Simulated arms that answer movements: for measurements of the search, and for its tests.

use std::f64::consts::PI;

use body_schema_engine::{
    kinematics::{Joint, JointKind, Line},
    normal::StandardNormal,
};
use nalgebra::{Isometry3, Point3, UnitQuaternion, UnitVector3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::{
    data::{Column, Data, Reading, Row, Target},
    robot::{Driven, Held, Robot},
};

/// What is measured of a simulated arm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Measured {
    /// The pose of the hand, with this noise of its rotation, rad.
    Pose(f64),
    /// So many markers on the hand, up to four.
    Markers(usize),
}

/// A simulated arm with its columns: those of its joints in any order, copies, and others that move nothing.
#[derive(Clone, Debug)]
pub struct Arm {
    /// The truth.
    pub robot: Robot,
    /// Titles, targets, and no rows.
    pub blank: Data,
    /// The limits of the columns that can be commanded, rad or m.
    pub limits: Vec<Option<(f64, f64)>>,
    /// What the other columns read.
    extras: Vec<(usize, Extra)>,
    noise_m: f64,
    measured: Measured,
    rng: ChaCha8Rng,
    count: usize,
}

#[derive(Clone, Copy, Debug)]
enum Extra {
    Copy(usize, f64),
    Time,
    Temperature,
}

impl Arm {
    /// A random arm of so many joints, one of them prismatic if `slides`. Half of its axes are parallel to those of the frame, the others point
    /// anywhere. `noise_m` is that of every coordinate of a place.
    pub fn random(seed: u64, joints: usize, slides: bool, measured: Measured, noise_m: f64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let direction = |rng: &mut ChaCha8Rng| loop {
            let vector = if rng.random::<f64>() < 0.5 {
                let sign = if rng.random::<f64>() < 0.5 { 1.0 } else { -1.0 };
                Vector3::ith(rng.random_range(0..3), sign)
            } else {
                Vector3::from_fn(|_, _| rng.sample::<f64, _>(StandardNormal))
            };
            if let Some(direction) = UnitVector3::try_new(vector, 0.1) {
                break direction;
            }
        };
        let sliding = slides.then(|| rng.random_range(0..joints));
        // The joints' columns, a copy of one in the other unit, time and temperature, shuffled.
        let mut order: Vec<usize> = (0..joints + 3).collect();
        for index in (1..order.len()).rev() {
            order.swap(index, rng.random_range(0..=index));
        }
        let column_of = |of: usize| order.iter().position(|at| *at == of).unwrap_or(0);
        let mut columns = vec![Column { title: String::new(), kind: None, factor: 1.0 }; joints + 3];
        let mut limits = vec![None; joints + 3];
        let (mut at, mut driven) = (Point3::new(0.2, -0.1, 0.3), Vec::new());
        for joint in 0..joints {
            let w = direction(&mut rng);
            let column = column_of(joint);
            let is_slide = sliding == Some(joint);
            let (low, high) = if is_slide {
                (0.0, rng.random_range(0.2..0.4))
            } else {
                let reach = rng.random_range(1.2..2.6);
                (-reach, reach)
            };
            columns[column].title = format!("motor_{}", (b'a' + column as u8) as char);
            limits[column] = Some((low, high));
            let axis = if is_slide { Joint::Prismatic(w) } else { Joint::Revolute(Line { point: at, direction: w }) };
            driven.push(Driven::new(column, joint.checked_sub(1), axis));
            let across = Vector3::from_fn(|_, _| rng.sample::<f64, _>(StandardNormal)).normalize();
            at += across * rng.random_range(0.1..0.35);
        }
        let copied = driven.iter().find(|joint| joint.axis.kind() == JointKind::Revolute).map_or(0, Driven::column);
        let mut extras = Vec::new();
        for (index, extra) in [Extra::Copy(copied, 180.0 / PI), Extra::Time, Extra::Temperature].into_iter().enumerate()
        {
            let column = column_of(joints + index);
            columns[column].title = ["encoder_copy", "time", "temperature"][index].to_owned();
            extras.push((column, extra));
        }
        let turn = UnitQuaternion::from_scaled_axis(Vector3::from_fn(|_, _| rng.sample::<f64, _>(StandardNormal)));
        let home = Isometry3::from_parts(at.into(), turn);
        let corners = [[0.06, 0.0, 0.0], [-0.06, 0.04, 0.0], [0.0, -0.06, 0.03], [0.0, 0.02, -0.06]];
        let held = |home: Isometry3<f64>, is_pose: bool| Held { carrier: joints.checked_sub(1), home, is_pose };
        let (targets, named): (Vec<Held>, Vec<Target>) = match measured {
            Measured::Pose(_) => (vec![held(home, true)], vec![Target { name: "hand".to_owned(), is_pose: true }]),
            Measured::Markers(count) => corners[..count.min(4)]
                .iter()
                .enumerate()
                .map(|(index, corner)| {
                    let point = home * Point3::from(Vector3::from(*corner));
                    let home = Isometry3::translation(point.x, point.y, point.z);
                    (held(home, false), Target { name: format!("m{}", index + 1), is_pose: false })
                })
                .unzip(),
        };
        let robot = Robot { middle: vec![0.0; joints + 3], joints: driven, targets };
        let blank = Data { columns, targets: named, rows: Vec::new() };
        Self { robot, blank, limits, extras, noise_m, measured, rng, count: 0 }
    }

    /// Moves to a posture, and gives the row that is measured there. What cannot be commanded is ignored in `positions`.
    pub fn measure(&mut self, positions: &[f64]) -> Row {
        let mut row = self.exact(positions);
        for reading in row.readings.iter_mut().flatten() {
            let shift = Vector3::from_fn(|_, _| self.rng.sample::<f64, _>(StandardNormal)) * self.noise_m;
            let turn = Vector3::from_fn(|_, _| self.rng.sample::<f64, _>(StandardNormal));
            match (reading, self.measured) {
                (Reading::Pose(pose), Measured::Pose(sigma)) => {
                    pose.translation.vector += shift;
                    pose.rotation = UnitQuaternion::from_scaled_axis(turn * sigma) * pose.rotation;
                }
                (Reading::Pose(pose), Measured::Markers(_)) => pose.translation.vector += shift,
                (Reading::Point(point), _) => *point += shift,
            }
        }
        row
    }

    /// The row of a posture without noise.
    pub fn exact(&mut self, positions: &[f64]) -> Row {
        let mut positions = positions.to_vec();
        for (column, extra) in &self.extras {
            positions[*column] = match extra {
                Extra::Copy(of, factor) => positions[*of] * factor,
                Extra::Time => 12.0 * self.count as f64 + self.rng.random_range(0.0..3.0),
                Extra::Temperature => 31.0 + self.rng.random_range(0.0..2.0),
            };
        }
        self.count += 1;
        let found = self.robot.predict(&positions);
        let readings = self.blank.targets.iter().zip(found).map(|(target, found)| {
            Some(if target.is_pose { Reading::Pose(found) } else { Reading::Point(found.translation.vector.into()) })
        });
        Row { line: self.count + 1, readings: readings.collect(), positions }
    }

    /// A posture drawn within the limits.
    pub fn draw(&mut self) -> Vec<f64> {
        let Self { limits, rng, .. } = self;
        limits.iter().map(|limits| limits.map_or(0.0, |(low, high)| rng.random_range(low..high))).collect()
    }

    /// Whether a robot has the structure of this one, up to the order of neighbours that commute, to which no movement makes a difference.
    pub fn has_structure_of(&self, found: &Robot) -> bool {
        crate::equivalence::are_equivalent(&self.robot, found)
    }
}
