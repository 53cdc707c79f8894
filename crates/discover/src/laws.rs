//! What holds for every robot.

use body_schema_engine::{kinematics::Joint, sensing::Loss};
use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use proptest::prelude::*;

use crate::{
    commute,
    data::{Data, Reading},
    discover,
    fit::{descend, noise_of, retract},
    jacobian::jacobians,
    robot::Robot,
    simulated::{Arm, Measured},
};

fn rows(arm: &mut Arm, rows: usize) -> Data {
    let mut data = arm.blank.clone();
    for _ in 0..rows {
        let positions = arm.draw();
        data.rows.push(arm.measure(&positions));
    }
    data
}

fn distance(one: &Robot, other: &Robot, positions: &[f64]) -> f64 {
    let pairs = one.predict(positions).into_iter().zip(other.predict(positions));
    pairs
        .map(|(one, other)| {
            (one.translation.vector - other.translation.vector).norm() + one.rotation.angle_to(&other.rotation)
        })
        .fold(0.0, f64::max)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, failure_persistence: None, ..ProptestConfig::default() })]

    /// The Jacobian is the derivative of predictions.
    #[test]
    fn jacobians_are_derivatives(seed in 0_u64..10_000) {
        let mut arm = Arm::random(seed, 5, true, Measured::Pose(0.01), 1e-3);
        let mut robot = arm.robot.clone();
        robot.joints[2].drives[0].is_free = true;
        let positions = arm.draw();
        let found = jacobians(&robot, &positions);
        let step = 1e-6;
        for parameter in 0..robot.parameters() {
            let moved = |by: f64| {
                let mut moved = robot.clone();
                let mut delta = vec![0.0; robot.parameters()];
                delta[parameter] = by;
                retract(&mut moved, &delta);
                moved.predict(&positions)[0]
            };
            let (up, down) = (moved(step), moved(-step));
            let place = (up.translation.vector - down.translation.vector) / (2.0 * step);
            let turn = (up.rotation * down.rotation.inverse()).scaled_axis() / (2.0 * step);
            let ours: (Vector3<f64>, Vector3<f64>) = found[0].1.iter().filter(|entry| entry.0 == parameter)
                .fold((Vector3::zeros(), Vector3::zeros()), |sum, entry| (sum.0 + entry.1, sum.1 + entry.2));
            prop_assert!((place - ours.0).norm() < 1e-5 && (turn - ours.1).norm() < 1e-5, "{parameter}");
        }
    }

    /// Axes written at another posture are the same robot.
    #[test]
    fn rebasing_changes_no_prediction(seed in 0_u64..10_000) {
        let mut arm = Arm::random(seed, 6, true, Measured::Pose(0.01), 1e-3);
        let (middle, positions) = (arm.draw(), arm.draw());
        prop_assert!(distance(&arm.robot, &arm.robot.rebased(&middle), &positions) < 1e-9);
    }

    /// Joints that commute may be swapped, others may not.
    #[test]
    fn only_joints_that_commute_may_be_swapped(seed in 0_u64..10_000, kind in 0..4) {
        let mut arm = Arm::random(seed, 4, false, Measured::Pose(0.01), 1e-3);
        let Joint::Revolute(line) = arm.robot.joints[1].axis else { unreachable!() };
        arm.robot.joints[2].axis = match kind {
            0 => Joint::Revolute(line.slid(0.2)),
            1 => Joint::Prismatic(line.direction),
            _ => arm.robot.joints[2].axis,
        };
        if kind == 3 {
            arm.robot.joints[1].axis = Joint::Prismatic(line.direction);
            arm.robot.joints[2].axis = Joint::Prismatic(arm.robot.joints[2].axis.direction());
        }
        let mut joints = arm.robot.joints.clone();
        joints.swap(1, 2);
        let swapped = crate::chain::chained(&arm.robot, joints);
        let postures: Vec<Vec<f64>> = (0..8).map(|_| arm.draw()).collect();
        let apart = postures.iter().map(|positions| distance(&arm.robot, &swapped, positions)).fold(0.0, f64::max);
        let says = commute(&arm.robot.joints[1].axis, &arm.robot.joints[2].axis, 1e-6, 1e-6);
        prop_assert_eq!(says, apart < 1e-9);
        prop_assert_eq!(says, crate::are_equivalent(&arm.robot, &swapped));
    }
}

/// The descent ends where the data are explained.
#[test]
fn a_disturbed_robot_is_fitted_back() {
    let mut arm = Arm::random(1, 5, true, Measured::Pose(1e-5), 1e-5);
    let data = rows(&mut arm, 30);
    let mut robot = arm.robot.rebased(&data.middle());
    let delta: Vec<f64> = (0..robot.parameters()).map(|index| 0.03 * ((index * 7 % 5) as f64 - 2.0)).collect();
    retract(&mut robot, &delta);
    let noise = noise_of(&data, &robot);
    descend(&data, &mut robot, &noise, Loss::None, 60);
    assert!(noise_of(&data, &robot).place_m < 1e-4);
}

/// Neither the order of columns, nor their titles and units, nor the frame of the measurements change what is found.
#[test]
fn the_structure_does_not_depend_on_how_it_is_written() {
    let mut arm = Arm::random(3, 4, true, Measured::Pose(0.005), 2e-3);
    let data = rows(&mut arm, 40);
    let chain = |data: &Data| -> Vec<String> {
        let robot = discover(data).expect("a robot").fit.robot;
        robot.joints.iter().map(|joint| data.columns[joint.column()].title.clone()).collect()
    };
    let plain = chain(&data);
    assert_eq!(plain.len(), 4);
    let mut turned = data.clone();
    let frame = Isometry3::new(Vector3::new(1.0, -2.0, 0.5), Vector3::new(0.4, 1.1, -0.7));
    for reading in turned.rows.iter_mut().flat_map(|row| row.readings.iter_mut().flatten()) {
        if let Reading::Pose(pose) = reading {
            *pose = frame * *pose;
        }
    }
    assert_eq!(chain(&turned), plain);
    let mut shuffled = data.clone();
    shuffled.columns.reverse();
    shuffled.rows.iter_mut().for_each(|row| row.positions.reverse());
    assert_eq!(chain(&shuffled), plain);
}

/// Columns in degrees and millimetres are read as their titles say.
#[test]
fn units_are_those_of_titles() {
    let text = "lift_mm,elbow_deg,note,speed_(rpm),x_mm,y,z,rx,ry,rz\n100,90,a,1,1000,2,3,0,0,1\n";
    let read = crate::read(text).expect("a table");
    assert_eq!(read.data.rows[0].positions, [0.1, std::f64::consts::FRAC_PI_2]);
    let Some(Reading::Pose(pose)) = read.data.rows[0].readings[0] else { panic!("a pose") };
    assert!((pose.translation.vector - Vector3::new(1.0, 2.0, 3.0)).norm() < 1e-12);
    assert!(pose.rotation.angle_to(&UnitQuaternion::from_scaled_axis(Vector3::z())) < 1e-12);
    assert_eq!(read.remarks.len(), 2, "{:?}", read.remarks);
    crate::read("a,b\n1,2\n").expect_err("no place");
}
