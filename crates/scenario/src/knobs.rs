//! What is instructive to turn in a scenario: a few numbers, each within a range.

use serde::{Deserialize, Serialize};
use toml::{Table, Value};

use crate::{Replacement, Scenario, WorldSpec};

/// A number of a scenario that is instructive to turn, with those that turn along.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Knob {
    /// What it is called.
    pub name: String,
    /// The smallest value of its first key.
    pub least: f64,
    /// The largest value of its first key.
    pub most: f64,
    /// Whether its values are whole numbers.
    pub whole: bool,
    /// Its keys with the scenario's own values. The values of the others change in proportion to the first.
    pub keys: Vec<KnobKey>,
}

/// A key that a knob turns.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct KnobKey {
    /// The dotted path, which names the unit.
    pub key: String,
    /// The scenario's own value.
    pub value: f64,
}

/// All knobs: name, the range of the first key, and the keys.
const KNOBS: [(&str, [f64; 2], &[&str]); 5] = [
    ("Noise of the marker", [0.0005, 0.05], &["sensor.sigma_m"]),
    // A learner is told how wrong its guess may be: the prior turns along.
    (
        "Error of the first guess",
        [5.0, 90.0],
        &["initial_error.angle_deg", "initial_error.point_m", "prior.direction_rad", "prior.point_m"],
    ),
    ("Half the eye's field of view", [15.0, 60.0], &["head.lens_half_angle_deg"]),
    ("How far the head turns", [12.0, 60.0], &["head.pan_limit_deg", "head.tilt_limit_deg"]),
    ("Movement after which the body changes", [10.0, 500.0], &["change.step"]),
];

/// The key that says how many joints move.
const JOINTS: &str = "robot.first_joints";
/// The key that says how many targets there are.
const TARGETS: &str = "robot.first_targets";

impl Scenario {
    /// What is instructive to turn in this scenario.
    pub fn knobs(&self) -> Vec<Knob> {
        let Ok(document) = self.source.parse::<Table>() else { return Vec::new() };
        let knob = |(name, [least, most], keys): &(&str, [f64; 2], &[&str])| {
            let found: Vec<(&str, &Value)> = keys.iter().filter_map(|key| Some((*key, at(&document, key)?))).collect();
            // One that the file does not have has nothing to turn.
            let (first, value) = *found.first().filter(|(key, _)| *key == keys[0])?;
            let (value, whole) = (number(value)?, value.is_integer() && first.ends_with("step"));
            let keys =
                found.iter().filter_map(|(key, value)| Some(KnobKey { key: (*key).to_owned(), value: number(value)? }));
            let (least, most) = (least.min(value), most.max(value));
            Some(Knob { name: (*name).to_owned(), least, most, whole, keys: keys.collect() })
        };
        KNOBS.iter().filter_map(knob).chain(self.joints_knob(&document)).chain(targets_knob(&document)).collect()
    }

    /// How many joints move, from as few as the rest of the file allows. Of fewer than two there is nothing to see.
    fn joints_knob(&self, document: &Table) -> Option<Knob> {
        let all = document.get("robot")?.as_table()?.get("joint")?.as_array()?.len();
        // Of a tree the first joints are one branch and a bit of another.
        if !self.robot.state.tree.is_serial() || matches!(self.world, WorldSpec::Measured { .. }) {
            return None;
        }
        let allowed = |count: &usize| {
            let fewer = Replacement { key: JOINTS.to_owned(), value: Value::Integer(*count as i64) };
            self.with(&[fewer]).is_ok()
        };
        let least = (2..all).find(allowed)?;
        let keys = vec![KnobKey { key: JOINTS.to_owned(), value: self.robot.names.len() as f64 }];
        Some(Knob { name: "Number of joints".to_owned(), least: least as f64, most: all as f64, whole: true, keys })
    }
}

/// How many targets there are, where the file says it: some are optional then.
fn targets_knob(document: &Table) -> Option<Knob> {
    let value = number(at(document, TARGETS)?)?;
    let most = document.get("target")?.as_array()?.len() as f64;
    let keys = vec![KnobKey { key: TARGETS.to_owned(), value }];
    (most > 1.0).then(|| Knob { name: "Number of targets".to_owned(), least: 1.0, most, whole: true, keys })
}

/// The value at a dotted path of tables.
fn at<'a>(document: &'a Table, path: &str) -> Option<&'a Value> {
    let (first, rest) = path.split_once('.').unwrap_or((path, ""));
    let value = document.get(first)?;
    if rest.is_empty() { Some(value) } else { at(value.as_table()?, rest) }
}

fn number(value: &Value) -> Option<f64> {
    value.as_float().or_else(|| value.as_integer().map(|whole| whole as f64))
}

#[cfg(test)]
mod tests {
    use crate::{BUILTIN, Replacement, builtin};

    #[test]
    fn every_knob_of_every_scenario_can_be_turned_to_both_ends() {
        let mut turned = 0;
        for known in BUILTIN {
            let scenario = builtin(known.name).expect("built in");
            for knob in scenario.knobs() {
                for end in [knob.least, knob.most] {
                    let replacements = knob.keys.iter().map(|one| {
                        let value = one.value * end / knob.keys[0].value;
                        let value = if knob.whole { format!("{value:.0}") } else { format!("{value:?}") };
                        format!("{}={value}", one.key).parse::<Replacement>().expect("a replacement")
                    });
                    let replacements: Vec<Replacement> = replacements.collect();
                    let is = format!("{}: {} to {end}", known.name, knob.name);
                    let other = scenario.with(&replacements).unwrap_or_else(|error| panic!("{is}: {error}"));
                    match knob.keys[0].key.as_str() {
                        super::JOINTS => assert_eq!(other.robot.names.len(), end as usize, "{is}"),
                        super::TARGETS => assert_eq!(other.robot.equipment.targets.len(), end as usize, "{is}"),
                        _ => {}
                    }
                    turned += 1;
                }
            }
        }
        assert!(turned >= 40, "{turned}");
        let names = |name: &str| -> Vec<String> {
            builtin(name).expect("built in").knobs().into_iter().map(|knob| knob.name).collect()
        };
        assert_eq!(names("arm-6dof"), ["Noise of the marker", "Error of the first guess", "Number of joints"]);
        assert_eq!(names("head-fov").len(), 4, "its poses have a position per joint");
        assert!(!names("humanoid-eyes").contains(&"Number of joints".to_owned()), "a tree");
        assert!(names("humanoid-eyes").contains(&"Number of targets".to_owned()), "one on its chest");
        let least = |name: &str| {
            let knobs = builtin(name).expect("built in").knobs();
            knobs.iter().find(|knob| knob.keys[0].key == super::JOINTS).map(|knob| (knob.least, knob.most))
        };
        assert_eq!(least("arm-12dof"), Some((2.0, 12.0)));
        assert_eq!(least("body-change"), Some((4.0, 6.0)), "its elbow changes");
        assert!(names("body-change").iter().any(|name| name.contains("changes")));
    }
}
