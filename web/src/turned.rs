//! A scenario with other values than its file's: what was turned, and a joint that breaks.

use body_schema_scenario::Knob;

use crate::{panel::Panel, wire::joint_turns};

/// How far the axis of a joint that breaks tilts, and the direction towards which: a unit vector along no axis of any
/// scenario's.
const TILT: &str = "angle_deg = 20.0, towards = [0.6, 0.48, 0.64]";

/// The key of a replacement.
fn key(replacement: &str) -> &str {
    replacement.split('=').next().unwrap_or_default()
}

/// The value of a knob: what was set, or the scenario's own.
pub fn value(set: &[String], knob: &Knob) -> f64 {
    let Some(first) = knob.keys.first() else { return knob.least };
    let replaced = set.iter().find(|replacement| key(replacement) == first.key);
    let value = replaced.and_then(|replacement| replacement.split_once('=')?.1.parse().ok());
    value.unwrap_or(first.value)
}

/// A number with three digits, as TOML has it.
fn written(value: f64, whole: bool) -> String {
    let rounded: f64 = format!("{value:.2e}").parse().unwrap_or(value);
    if whole { format!("{value:.0}") } else { format!("{rounded:?}") }
}

impl Panel {
    /// Sets a knob, and runs the scenario anew up to the step that is shown.
    pub fn turn(&mut self, knob: &Knob, value: f64) {
        let Some(first) = knob.keys.first() else { return };
        self.settings.set.retain(|replacement| knob.keys.iter().all(|one| one.key != key(replacement)));
        let share = value / first.value;
        if (share - 1.0).abs() > 1e-3 {
            let turned = knob.keys.iter().map(|one| format!("{}={}", one.key, written(one.value * share, knob.whole)));
            self.settings.set.extend(turned);
        }
        self.run_anew();
    }

    /// Takes all values from the scenario's file again.
    pub fn turn_back(&mut self) {
        self.settings.set.clear();
        self.run_anew();
    }

    /// The joints that can break: those that turn and are learned, of a simulated body that does not change anyway.
    pub fn breakable(&self) -> Vec<String> {
        let Some(description) = self.description().filter(|description| description.truth.is_some()) else {
            return Vec::new();
        };
        let own = self.scenario().is_some_and(|scenario| {
            scenario.knobs.iter().flat_map(|knob| &knob.keys).any(|one| one.key == "change.step")
        });
        if own || self.human().is_some() {
            return Vec::new();
        }
        let joints = description.joints.iter().filter(|joint| joint.learned && joint_turns(joint));
        joints.map(|joint| joint.name.clone()).collect()
    }

    /// Tilts the axis of a joint after the latest movement, and lets the run go on from there.
    pub fn break_joint(&mut self, joint: &str) {
        let step = self.history.latest().max(1);
        self.settings.set.retain(|replacement| key(replacement) != "change");
        let tilt = format!("{{ joint = \"{joint}\", {TILT} }}");
        self.settings.set.push(format!("change={{ step = {step}, tilt = {tilt} }}"));
        self.open(step);
        self.plays_on = true;
    }

    /// Opens the session of the settings, and shows the step that is shown now.
    pub(crate) fn run_anew(&mut self) {
        self.open(self.cursor.max(1));
    }
}

#[cfg(test)]
mod tests {
    use body_schema_scenario::builtin;

    use super::*;

    #[test]
    fn numbers_are_written_short_and_as_the_scenario_reads_them() {
        assert_eq!(written(0.012_345, false), "0.0123");
        assert_eq!(written(90.0, false), "90.0");
        assert_eq!(written(120.4, true), "120");
        let knobs = builtin("arm-6dof").expect("built in").knobs();
        assert_eq!(value(&[], &knobs[0]), 0.01);
        assert_eq!(value(&["steps=3".to_owned(), "sensor.sigma_m=0.002".to_owned()], &knobs[0]), 0.002);
    }
}
