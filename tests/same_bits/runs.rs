//! Whole runs, to compare what comes of them.

use body_schema::{
    experiment::{RunResult, StepReport},
    scenario::builtin,
};
use serde_json::Value;

/// Scenarios of every kind of sensor and learner, how many steps are made, and by whom.
pub const RUNS: [(&str, usize, &[&str]); 8] = [
    ("arm-6dof", 25, &["active", "random", "gradient", "global"]),
    ("arm-12dof", 15, &["active", "random", "global"]),
    ("head-fov", 15, &["active", "global"]),
    ("body-change", 60, &["active", "global"]),
    ("arm-6dof-camera", 8, &["global"]),
    ("arm-7dof-socket", 8, &["global"]),
    ("arm-6dof-outliers", 20, &["global"]),
    ("panda-sockets", 8, &["global"]),
];

/// What came of a run, wall times apart.
pub fn result((name, steps, learners): (&str, usize, &[&str])) -> String {
    let names: Vec<String> = learners.iter().map(|name| (*name).to_owned()).collect();
    let scenario = builtin(name).expect("built in");
    let mut experiment = scenario.experiment(7, Some(&names)).expect("its learners");
    let mut all = Vec::new();
    for _ in 0..steps {
        experiment.step().unwrap_or_else(|error| panic!("{name}: {error}"));
        all.push(serde_json::to_value(StepReport::of(&experiment)).expect("JSON"));
    }
    all.push(serde_json::to_value(RunResult::of(&experiment)).expect("JSON"));
    all.iter_mut().for_each(timeless);
    serde_json::to_string(&all).expect("JSON")
}

/// Without the times that choices took.
fn timeless(value: &mut Value) {
    match value {
        Value::Object(members) => {
            members.retain(|name, _| !name.ends_with("_ms"));
            members.values_mut().for_each(timeless);
        }
        Value::Array(items) => items.iter_mut().for_each(timeless),
        _ => {}
    }
}
