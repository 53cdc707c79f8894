//! The README's table of movements: every figure in it is measured, and is the same on every machine.

use std::process::Command;

use serde_json::Value;

/// Rows of the table: scenario, learner, and the cells converged, median, 90 %, worst.
fn rows(text: &str) -> Vec<(String, String, [String; 4])> {
    let lines = text.lines().skip_while(|line| !line.starts_with("| scenario | learner | converged |")).skip(2);
    let mut scenario = String::new();
    let mut rows = Vec::new();
    for line in lines.take_while(|line| line.starts_with('|')) {
        let cells: Vec<String> =
            line.trim_matches('|').split('|').map(|cell| cell.replace(['*', '`'], "").trim().to_owned()).collect();
        let [named, learner, figures @ ..] = &cells[..] else { panic!("{line}") };
        if !named.is_empty() {
            scenario.clone_from(named);
        }
        let figures = <[String; 4]>::try_from(figures.to_vec()).unwrap_or_else(|_| panic!("{line}"));
        rows.push((scenario.clone(), learner.clone(), figures));
    }
    rows
}

/// What a comparison says, as the table writes it.
fn measured(scenario: &str, learner: &str, steps: &str) -> [String; 4] {
    let output = Command::new(env!("CARGO_BIN_EXE_body-schema"))
        .args(["compare", scenario, "--learner", learner, "--seeds", "1..20", "--steps", steps, "--json", "-"])
        .output()
        .expect("it starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let found: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let summary = &found["learners"][0]["summary"];
    let figure = |name: &str| summary[name].as_f64().map_or("–".to_owned(), |movements| movements.to_string());
    [
        format!("{}/{}", summary["converged"], summary["runs"]),
        figure("median_converged_at"),
        figure("p90_converged_at"),
        figure("max_converged_at"),
    ]
}

#[test]
fn the_table_of_movements_is_measured() {
    let rows = rows(include_str!("../README.md"));
    assert_eq!(rows.len(), 8);
    for (scenario, learner, figures) in rows {
        let steps = match (learner.as_str(), scenario.as_str()) {
            ("global", "arm-6dof") => "40",
            ("global", _) => "50",
            _ => "1000",
        };
        assert_eq!(measured(&scenario, &learner, steps), figures, "{scenario}, {learner}");
    }
}
