//! The origins of a chain as `kinematics.yaml`.

use std::fmt::Write;

use super::{Chain, rotation::rpy, write::number};

impl Chain {
    /// The origins of the joints that move as YAML, in the layout in which the descriptions of Universal Robots and others
    /// that are made by xacro take a robot's own calibration: by joint, metres and radians.
    ///
    /// ```yaml
    /// kinematics:
    ///   shoulder_pan_joint:
    ///     x: 0
    ///     y: 0
    ///     z: 0.1273
    ///     roll: 0
    ///     pitch: 0
    ///     yaw: 0
    /// ```
    pub fn kinematics_yaml(&self) -> String {
        let mut text = "kinematics:\n".to_owned();
        for segment in self.moving() {
            let at = segment.origin.translation.vector;
            let [roll, pitch, yaw] = rpy(&segment.origin.rotation, [0.0; 3]);
            // Writing to a string does not fail.
            let _ = writeln!(text, "  {}:", key(&segment.name));
            let values = [("x", at.x), ("y", at.y), ("z", at.z), ("roll", roll), ("pitch", pitch), ("yaw", yaw)];
            for (name, value) in values {
                let _ = writeln!(text, "    {name}: {}", decimal(value));
            }
        }
        text
    }
}

/// A number that every reader of YAML takes for one: some want a point before an exponent.
fn decimal(value: f64) -> String {
    let text = number(value);
    match text.split_once('e') {
        Some((mantissa, exponent)) if !mantissa.contains('.') => format!("{mantissa}.0e{exponent}"),
        _ => text,
    }
}

/// Plain words that some reader of YAML takes for something else than a name.
const TAKEN: [&str; 11] = ["y", "n", "yes", "no", "on", "off", "true", "false", "null", "nan", "inf"];

/// A name as a key: quoted unless it is a plain word.
fn key(name: &str) -> String {
    let is_plain = name.starts_with(|c: char| c.is_ascii_alphabetic())
        && name.chars().all(|c| c.is_ascii_alphanumeric() || "_-./".contains(c));
    let is_plain = is_plain && !TAKEN.contains(&name.to_ascii_lowercase().as_str());
    if is_plain { name.to_owned() } else { serde_json::Value::from(name).to_string() }
}
