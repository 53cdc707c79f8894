//! A robot that is not quite as its URDF says, and what it tells.

use std::collections::BTreeMap;

use body_schema::{
    ask_tell::{Observation, Session, Setup, Suggestion},
    kinematics::{Joint, JointBox},
    model::{Place, State},
    robot::Urdf,
};
use nalgebra::{Isometry3, Point3, Rotation3, UnitVector3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use serde_json::{Value, json};

pub fn open(calibration: Value) -> Session {
    Session::open(Setup::new(calibration)).unwrap_or_else(|error| panic!("{error}"))
}

/// An arm of three joints, with short searches.
pub fn quick() -> Value {
    let joint = |name: &str, parent: &str, child: &str, xyz: &str, axis: &str| {
        format!(
            "<joint name=\"{name}\" type=\"revolute\"><origin xyz=\"{xyz}\"/><parent link=\"{parent}\"/><child link=\"{child}\"/>\
             <axis xyz=\"{axis}\"/><limit lower=\"-1.5\" upper=\"1.5\" effort=\"1\" velocity=\"1\"/></joint>"
        )
    };
    let urdf = format!(
        "<robot name=\"three\"><link name=\"base\"/><link name=\"a\"/><link name=\"b\"/><link name=\"tip\"/>{}{}{}</robot>",
        joint("pan", "base", "a", "0 0 0.3", "0 0 1"),
        joint("lift", "a", "b", "0.05 0 0.1", "0 1 0"),
        joint("elbow", "b", "tip", "0.4 0 0", "0 1 0"),
    );
    json!({
        "robot": { "urdf": urdf },
        "target": [{ "name": "marker", "at_m": [0.3, 0.0, 0.05], "known": { "to_m": 0.1 } }],
        "base": { "at_m": [0, 0, 0], "rpy_deg": [0, 0, 0] },
        "prior": { "direction_rad": 0.05, "point_m": 0.01 },
        "smoother": { "hypotheses": 2, "spawned": 1 },
        "selection": { "evaluations": 60, "ahead": 4 },
        "settled": { "expected_prediction_m": 0.002 },
    })
}

/// Puts axes off by up to 1 degree and 5 mm, except those of exact joints, and places of targets and cameras by up to 3 degrees and 1 cm.
pub fn put_off(truth: &mut State, is_exact: impl Fn(usize) -> bool, rng: &mut ChaCha8Rng) {
    let mut draw = |size: f64| Vector3::from_fn(|_, _| size * rng.random_range(-1.0..=1.0));
    let mut off = |by_m: f64, by_deg: f64| {
        Isometry3::from_parts(draw(by_m).into(), Rotation3::new(draw(by_deg.to_radians())).into())
    };
    for (index, joint) in truth.joints.iter_mut().enumerate() {
        let wrong = off(0.005, 1.0);
        if is_exact(index) {
            continue;
        }
        match joint {
            Joint::Revolute(line) => {
                line.direction = UnitVector3::new_normalize(wrong.rotation * line.direction.into_inner());
                line.point += wrong.translation.vector;
            }
            Joint::Prismatic(direction) => {
                *direction = UnitVector3::new_normalize(wrong.rotation * direction.into_inner());
            }
        }
    }
    for target in &mut truth.targets {
        target.place = Place::Pose(target.place.frame() * off(0.01, 3.0));
    }
    for device in &mut truth.devices {
        device.pose *= off(0.005, 3.0);
    }
}

/// The true robot.
pub struct Robot {
    pub truth: State,
    pub names: Vec<String>,
    pub limits: JointBox,
    noise: std::cell::RefCell<ChaCha8Rng>,
}

impl Robot {
    /// Axes off by up to 3° and 1 cm, the marker by up to 5 cm from where the description has its link.
    pub fn of(session: &Session, seed: u64) -> Self {
        let robot = &session.setup().calibration["robot"];
        let urdf = Urdf::parse(session.setup().urdf()).expect("a URDF");
        let link = |key: &str, usual: &str| robot[key].as_str().unwrap_or(usual).to_owned();
        let chain = urdf.chain(&link("base", "base"), &link("tip", "tip")).expect("a chain");
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut draw = |size: f64| Vector3::from_fn(|_, _| size * rng.random_range(-1.0..=1.0));
        let mut truth = chain.state();
        for joint in &mut truth.joints {
            let angles = draw(3_f64.to_radians());
            let turn = Rotation3::from_euler_angles(angles.x, angles.y, angles.z);
            if let Joint::Revolute(line) = joint {
                line.direction = UnitVector3::new_normalize(turn * line.direction.into_inner());
                line.point += draw(0.01);
            }
        }
        let frame = chain.tip_at(&vec![0.0; chain.names().len()]);
        let truth = truth.with_marker(frame * Point3::from(draw(0.05) + Vector3::new(0.3, 0.0, 0.05)));
        let limits = chain.limits().expect("limits");
        Self { truth, names: chain.names(), limits, noise: rng.into() }
    }

    /// Bends its first link.
    pub fn bend(&mut self, angle: f64) {
        if let Joint::Revolute(line) = &mut self.truth.joints[1] {
            let turn = Rotation3::from_euler_angles(angle, 0.0, -angle);
            line.direction = UnitVector3::new_normalize(turn * line.direction.into_inner());
        }
    }

    /// Carries out a suggestion; the reading is `off` by so many metres beside noise of half a millimetre.
    pub fn sees(&self, suggestion: &Suggestion, off: f64) -> Observation {
        self.observation(Some(suggestion.id), suggestion.configuration.clone(), off)
    }

    pub fn observation(&self, id: Option<u64>, configuration: BTreeMap<String, f64>, off: f64) -> Observation {
        let mut noise = self.noise.borrow_mut();
        let theta: Vec<f64> = self.names.iter().map(|name| configuration[name]).collect();
        let noise = Vector3::from_fn(|_, _| 5e-4 * noise.sample::<f64, _>(StandardNormal));
        let at = self.truth.marker_at(&theta) + noise + Vector3::x() * off;
        let measurements = BTreeMap::from([("marker".to_owned(), json!([at.x, at.y, at.z]))]);
        Observation { suggestion_id: id, configuration, measurements }
    }

    /// The mean distance of the predicted from the true marker at postures that nobody has seen, millimetres.
    pub fn mean_error_mm(&self, session: &Session) -> f64 {
        let believed = &session.belief().expect("an agent").state;
        let mut rng = ChaCha8Rng::seed_from_u64(77);
        let error = |theta: Vec<f64>| (believed.marker_at(&theta) - self.truth.marker_at(&theta)).norm();
        (0..200).map(|_| error(self.limits.draw(&mut rng))).sum::<f64>() / 200.0 * 1e3
    }
}
