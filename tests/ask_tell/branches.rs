//! Sessions with a robot whose joints branch, and which is measured by nothing but itself.

use body_schema::{
    ask_tell::{Ask, Observation, Session},
    calibration::Silent,
    model::{Frame, State},
};
use nalgebra::Point3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use serde_json::{Value, json};

use crate::{
    ask_tell::{
        channels::agrees,
        robot::{open, put_off},
    },
    calibrate::axes_alone,
};

/// A torso with two arms and a head that carries a camera.
const URDF: &str = include_str!("../../crates/calibration/src/laws/two_arms.urdf");
/// The corners of a tag of 8 cm, metres.
const TAG: [[f64; 3]; 4] = [[-0.04, -0.04, 0.0], [0.04, -0.04, 0.0], [0.04, 0.04, 0.0], [-0.04, 0.04, 0.0]];
/// Of the camera, pixels.
const FOCAL: f64 = 900.0;
const SIZE: [f64; 2] = [1280.0, 960.0];

fn tag(name: &str, link: &str) -> Value {
    json!({ "name": name, "link": link, "at_m": [0, 0, 0], "rpy_deg": [0, 0, 0], "points_m": TAG,
            "known": { "to_m": 0.02, "to_deg": 5.0 } })
}

/// A calibration of these keys beside those of the robot.
fn calibration(robot: Value, keys: Value) -> Value {
    let mut all = json!({
        "prior": { "direction_rad": 0.02, "point_m": 0.005 },
        "smoother": { "hypotheses": 2, "spawned": 1 },
        "selection": { "evaluations": 60, "ahead": 4 },
        "robot": { "urdf": URDF },
    });
    all["robot"].as_object_mut().expect("an object").extend(robot.as_object().expect("an object").clone());
    all.as_object_mut().expect("an object").extend(keys.as_object().expect("an object").clone());
    all
}

/// The eye on the head that sees a tag on the left hand.
fn eye() -> Value {
    json!({
        "camera": [{ "name": "eye", "link": "head_camera", "at_m": [0, 0, 0], "rpy_deg": [0, 0, 0], "size_px": SIZE,
                     "focal_px": [FOCAL, FOCAL], "known": { "to_m": 0.01, "to_deg": 5.0 } }],
        "target": [tag("tag", "left_hand")],
        "sensor": { "channel": "pixels", "camera": "eye", "target": "tag", "sigma_px": 0.3 },
        "prediction": { "of": "tag", "in": "eye" },
        "view": { "servo": ["head_pan", "head_tilt"], "visible_pose_deg": [20, 10, -60, 0, 40, 20] },
    })
}

/// A robot that is not quite as a session believes at its start.
struct Robot {
    truth: State,
    names: Vec<String>,
    rng: ChaCha8Rng,
}

impl Robot {
    /// As [`put_off`] has it; joints of these names are as described.
    fn of(session: &Session, exact: &[&str], seed: u64) -> Self {
        let robot = &session.scenario().robot;
        let (mut truth, names) = (robot.state.clone(), robot.names.clone());
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        put_off(&mut truth, |joint| exact.contains(&names[joint].as_str()), &mut rng);
        Self { truth, names, rng }
    }

    /// Noise of a standard deviation.
    fn noise(&mut self, sigma: f64) -> f64 {
        sigma * self.rng.sample::<f64, _>(StandardNormal)
    }

    /// Moves as is suggested, and tells what `measured` makes of the posture.
    fn moves(&mut self, session: &mut Session, measured: impl Fn(&mut Self, &[f64]) -> Value) {
        let next = session.suggest(&Ask::default(), None).expect("one").suggestions.remove(0);
        let theta: Vec<f64> = self.names.iter().map(|name| next.configuration[name]).collect();
        let measurements = serde_json::from_value(measured(self, &theta)).expect("channels");
        let told = Observation { suggestion_id: Some(next.id), configuration: next.configuration, measurements };
        session.observe(told, None).unwrap_or_else(|error| panic!("{error}"));
    }

    /// The corners of the first target in the picture of the first camera; null where one is not in it.
    fn picture(&mut self, theta: &[f64]) -> Value {
        let place = self.truth.relative(Frame::Target(0), Frame::Device(0), theta);
        let mut corners = Vec::new();
        for corner in TAG {
            let at = place * Point3::from(corner);
            let uv = [FOCAL * at.x / at.z + 0.5 * SIZE[0], FOCAL * at.y / at.z + 0.5 * SIZE[1]];
            if at.z < 0.1 || uv.iter().zip(SIZE).any(|(x, size)| !(0.0..size).contains(x)) {
                return json!({ "eye_tag": null });
            }
            corners.push(uv.map(|x| x + self.noise(0.3)));
        }
        json!({ "eye_tag": corners })
    }
}

/// How far a session believes the tag from where the eye sees it, where it sees it: the mean, metres.
fn misses(session: &Session, robot: &mut Robot) -> f64 {
    let believed = session.belief().expect("a belief").state.clone();
    let limits = session.scenario().robot.limits.clone();
    let mut rng = ChaCha8Rng::seed_from_u64(99);
    let mut errors = Vec::new();
    while errors.len() < 50 {
        let theta = limits.draw(&mut rng);
        if robot.picture(&theta)["eye_tag"].is_null() {
            continue;
        }
        let at = |state: &State| state.relative(Frame::Target(0), Frame::Device(0), &theta).translation.vector;
        errors.push((at(&believed) - at(&robot.truth)).norm());
    }
    errors.iter().sum::<f64>() / errors.len() as f64
}

/// Nothing is measured from outside: an eye sees the hand, to which the neck turns. What is suggested is seen, the hand is known to the eye
/// far better than before, and what the session writes is read by `calibrate` as it is meant.
#[test]
fn a_robot_that_sees_its_own_hand_learns_by_asking() {
    let mut session = open(calibration(json!({}), eye()));
    let mut robot = Robot::of(&session, &[], 1001);
    let joints = ["left_shoulder_pan", "left_shoulder_lift", "left_elbow", "left_roll", "head_pan", "head_tilt"];
    let mut named: Vec<&str> = robot.names.iter().map(String::as_str).collect();
    named.sort_unstable();
    let mut wanted = joints.to_vec();
    wanted.sort_unstable();
    // Neither the trunk nor the other arm moves one before the other.
    assert_eq!(named, wanted);
    let before = misses(&session, &mut robot);
    for _ in 0..16 {
        robot.moves(&mut session, Robot::picture);
    }
    let unseen =
        session.observations().iter().filter(|told| told.observation.measurements["eye_tag"].is_null()).count();
    let after = misses(&session, &mut robot);
    assert!(unseen <= 3 && after < 0.004 && after < 0.2 * before, "{unseen} unseen, {before} m, then {after} m");
    agrees(&session);
    let replayed = Session::from_json(&session.to_json()).expect("its own");
    assert_eq!(replayed.belief().map(|it| &it.state), session.belief().map(|it| &it.state));
}

/// A joint of a branch that is held moves, and stays where the description has it; the others are learned, and so they are in a calibration
/// of what was told.
#[test]
fn what_is_held_of_a_branch_stays() {
    let held = ["left_elbow", "head_tilt"];
    let mut session = open(calibration(json!({ "hold": held }), eye()));
    let start = session.scenario().robot.state.clone();
    let mut robot = Robot::of(&session, &held, 1002);
    for _ in 0..14 {
        robot.moves(&mut session, Robot::picture);
    }
    let believed = session.belief().expect("a belief").state.clone();
    for (index, name) in robot.names.iter().enumerate() {
        let stays = believed.joints[index] == start.joints[index];
        assert_eq!(stays, held.contains(&name.as_str()), "{name}");
    }
    let angles: Vec<f64> =
        session.observations().iter().map(|told| told.observation.configuration["left_elbow"]).collect();
    let (least, most) = angles.iter().fold((f64::MAX, f64::MIN), |(a, b), q| (a.min(*q), b.max(*q)));
    assert!(most - least > 0.5, "it is held as it is described, not where it stands: {angles:?}");
    let (calibration, _) = session.calibrate(&axes_alone(), &Silent).expect("calibrated");
    for joint in &calibration.report.joints {
        let is_held = held.contains(&joint.name.as_str());
        assert_eq!(joint.learned, !is_held, "{}", joint.name);
        assert_eq!(joint.turn_deg == [0.0; 3], is_held, "{joint:?}");
    }
    let after = misses(&session, &mut robot);
    assert!(after < 0.004, "{after} m");
}

/// Of a finger of one hand and a plate in the other its height above the plate and its distance are measured, two numbers a movement. Both are
/// predicted better than before, wherever the hands are, and nobody asks where the robot stands.
#[test]
fn a_hand_that_is_measured_from_the_other_is_known_by_it() {
    let mut finger = tag("finger", "right_hand");
    finger.as_object_mut().expect("an object").remove("points_m");
    let mut plate = tag("plate", "left_hand");
    plate.as_object_mut().expect("an object").remove("points_m");
    let mut session = open(calibration(
        json!({}),
        json!({
            "target": [finger, plate],
            "sensor": [
                { "channel": "depth", "target": "finger", "in": "plate", "sigma_m": 0.0005 },
                { "channel": "distance", "target": "finger", "to": "plate", "sigma_m": 0.0005 },
            ],
            "prediction": { "of": "finger", "in": "plate" },
        }),
    ));
    let mut robot = Robot::of(&session, &[], 1003);
    let between =
        |state: &State, theta: &[f64]| state.relative(Frame::Target(0), Frame::Target(1), theta).translation.vector;
    let titles: Vec<String> = session.channels().iter().map(|channel| channel.name.clone()).collect();
    assert_eq!(titles, ["plate_finger_depth", "plate_finger_distance"]);
    let error = |session: &Session, robot: &Robot| {
        let believed = &session.belief().expect("a belief").state;
        let mut rng = ChaCha8Rng::seed_from_u64(98);
        let limits = session.scenario().robot.limits.clone();
        let of = |theta: Vec<f64>| {
            let (is, believed) = (between(&robot.truth, &theta), between(believed, &theta));
            (is.z - believed.z).abs() + (is.norm() - believed.norm()).abs()
        };
        (0..100).map(|_| of(limits.draw(&mut rng))).sum::<f64>() / 100.0
    };
    let before = error(&session, &robot);
    for _ in 0..14 {
        robot.moves(&mut session, |robot, theta| {
            let at = between(&robot.truth, theta);
            let (depth, distance) = (at.z + robot.noise(5e-4), at.norm() + robot.noise(5e-4));
            json!({ "plate_finger_depth": depth, "plate_finger_distance": distance })
        });
    }
    let after = error(&session, &robot);
    assert!(after < 0.25 * before, "{before} m, then {after} m");
    agrees(&session);
}
