//! The same bits from every processor: whole runs with plainer and wider instructions, on one thread and on two.

use body_schema::{Instructions, scenario::builtin, use_at_most};
use serde_json::Value;

/// Scenarios of every kind of sensor and learner, how many steps are made, and by whom.
const RUNS: [(&str, usize, &[&str]); 8] = [
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
fn result((name, steps, learners): (&str, usize, &[&str])) -> String {
    let names: Vec<String> = learners.iter().map(|name| (*name).to_owned()).collect();
    let scenario = builtin(name).expect("built in");
    let mut experiment = scenario.experiment(7, Some(&names)).expect("its learners");
    let mut all = Vec::new();
    for _ in 0..steps {
        let report = experiment.step().unwrap_or_else(|error| panic!("{name}: {error}"));
        all.push(serde_json::to_value(report).expect("JSON"));
    }
    all.push(serde_json::to_value(experiment.result()).expect("JSON"));
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

#[test]
fn results_are_the_same_whatever_the_instructions_and_the_threads() {
    let pool = |threads: usize| rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
    let (one, two) = (pool(1), pool(2));
    for run in RUNS {
        use_at_most(Instructions::Baseline);
        let expected = one.install(|| result(run));
        for instructions in [Instructions::Sse4_2, Instructions::Avx2, Instructions::Widest] {
            use_at_most(instructions);
            let found = two.install(|| result(run));
            let first = expected.bytes().zip(found.bytes()).position(|(a, b)| a != b);
            let around =
                |text: &str| first.map(|at| text[at.saturating_sub(200)..(at + 40).min(text.len())].to_owned());
            assert!(expected == found, "{}, {instructions:?}: {:?} {:?}", run.0, around(&expected), around(&found));
        }
    }
}
