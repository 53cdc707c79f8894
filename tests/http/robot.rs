//! A robot elsewhere: three joints whose axes are not quite where its description has them.

use std::collections::BTreeMap;

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use serde_json::{Value, json};

/// Its joints, base first.
pub const JOINTS: [&str; 3] = ["pan", "lift", "elbow"];

/// How it is described.
pub fn urdf() -> String {
    let joint = |name: &str, parent: &str, child: &str, xyz: &str, axis: &str| {
        format!(
            "<joint name=\"{name}\" type=\"revolute\"><origin xyz=\"{xyz}\"/><parent link=\"{parent}\"/><child link=\"{child}\"/>\
             <axis xyz=\"{axis}\"/><limit lower=\"-1.5\" upper=\"1.5\" effort=\"1\" velocity=\"1\"/></joint>"
        )
    };
    format!(
        "<robot name=\"three\"><link name=\"base\"/><link name=\"a\"/><link name=\"b\"/><link name=\"tip\"/>{}{}{}</robot>",
        joint("pan", "base", "a", "0 0 0.3", "0 0 1"),
        joint("lift", "a", "b", "0.05 0 0.1", "0 1 0"),
        joint("elbow", "b", "tip", "0.4 0 0", "0 1 0"),
    )
}

/// What is told of it: a marker of which a camera sees where it is, to a millimetre.
pub fn calibration() -> Value {
    json!({
        "name": "three",
        "robot": { "urdf": urdf() },
        "target": [{ "name": "marker", "at_m": [0.3, 0.0, 0.05], "known": { "to_m": 0.02 } }],
        "base": { "at_m": [0, 0, 0], "rpy_deg": [0, 0, 0] },
        "sensor": { "channel": "position", "target": "marker", "sigma_m": 0.001 },
        "prior": { "direction_rad": 0.05, "point_m": 0.01 },
        "smoother": { "hypotheses": 2, "spawned": 1 },
        "selection": { "evaluations": 30, "ahead": 2 },
        "settled": { "expected_prediction_m": 0.002 },
    })
}

/// What a session with it is opened by.
pub fn opening() -> Value {
    json!({ "world": "outside", "calibration": calibration() })
}

/// Where its marker truly is, metres.
pub fn marker(posture: &BTreeMap<String, f64>) -> [f64; 3] {
    let [pan, lift, elbow] = JOINTS.map(|joint| posture[joint]);
    let turn = |at: [f64; 3], axis: [f64; 3], angle: f64| {
        let about = UnitQuaternion::from_scaled_axis(Vector3::from(axis).normalize() * angle);
        Isometry3::from_parts(Translation3::from(Vector3::from(at)), about)
    };
    let tip = turn([0.003, -0.002, 0.3], [0.01, 0.0, 1.0], pan)
        * turn([0.052, 0.001, 0.104], [0.0, 1.0, 0.01], lift)
        * turn([0.396, 0.0, 0.002], [0.01, 1.0, 0.0], elbow);
    let marker = tip * Point3::new(0.306, 0.004, 0.045);
    [marker.x, marker.y, marker.z]
}

/// A posture that nobody has suggested, another for each number.
pub fn posture(number: usize) -> BTreeMap<String, f64> {
    let angle = |joint: usize| 1.4 * ((number * (7 + 4 * joint) + 3 * joint) as f64 * 0.37).sin();
    JOINTS.iter().enumerate().map(|(index, joint)| ((*joint).to_owned(), angle(index))).collect()
}

/// What is told after a movement to a posture.
pub fn told(posture: &BTreeMap<String, f64>) -> Value {
    json!({ "configuration": posture, "measurements": { "marker": marker(posture) } })
}

/// What is told after a suggestion was carried out, to a hundredth of a radian.
pub fn carried_out(suggestion: &Value) -> Value {
    let wanted: BTreeMap<String, f64> =
        serde_json::from_value(suggestion["configuration"].clone()).expect("a configuration");
    let reached = wanted.into_iter().map(|(joint, angle)| (joint, (angle * 100.0).round() / 100.0)).collect();
    let mut told = told(&reached);
    told["suggestion_id"] = suggestion["id"].clone();
    told
}
