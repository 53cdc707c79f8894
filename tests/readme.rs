//! The README's table of movements, and those of docs/learners.md: every figure in them is measured, and is the same on every machine.

use std::process::Command;

use serde_json::Value;

use crate::convergence::is_night;

/// The cells of the table under this head, where an empty first cell repeats the one above it.
fn cells(text: &str, head: &str) -> Vec<Vec<String>> {
    let lines = text.lines().skip_while(|line| !line.starts_with(head)).skip(2);
    let mut first = String::new();
    let mut rows = Vec::new();
    for line in lines.take_while(|line| line.starts_with('|')) {
        let mut cells: Vec<String> =
            line.trim_matches('|').split('|').map(|cell| cell.replace(['*', '`'], "").trim().to_owned()).collect();
        match cells[0].is_empty() {
            true => cells[0].clone_from(&first),
            false => first.clone_from(&cells[0]),
        }
        rows.push(cells);
    }
    assert!(!rows.is_empty(), "no table under {head}");
    rows
}

/// Rows of the table of movements: scenario, learner, and the cells converged, median, 90 %, worst.
fn movements(text: &str) -> Vec<(String, String, [String; 4])> {
    let rows = cells(text, "| scenario | learner | converged |").into_iter();
    let rows: Vec<_> = rows
        .map(|row| {
            let figures = <[String; 4]>::try_from(row[2..6].to_vec()).unwrap_or_else(|_| panic!("{row:?}"));
            (row[0].clone(), row[1].clone(), figures)
        })
        .collect();
    assert_eq!(rows.len() % 2, 0, "two chains, the same learners");
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

/// As many movements as rows are measured with. By day a row whose runs all converge is measured a sixth beyond the last of them that does:
/// all its figures are there by then. Where some do not converge all movements are made.
fn steps(scenario: &str, learner: &str, [_, _, _, worst]: &[String; 4]) -> u64 {
    match (learner, scenario, worst.parse::<u64>()) {
        ("global", "arm-6dof", _) => 40,
        ("global", ..) => 50,
        (_, _, Ok(worst)) if !is_night() => worst + worst.div_ceil(6),
        _ => 1000,
    }
}

fn all_are_measured(rows: Vec<(String, String, [String; 4])>) {
    for (scenario, learner, figures) in rows {
        let steps = steps(&scenario, &learner, &figures).to_string();
        assert_eq!(measured(&scenario, &learner, &steps), figures, "{scenario}, {learner}");
    }
}

#[test]
fn the_table_of_movements_is_measured() {
    let rows = movements(include_str!("../README.md"));
    assert_eq!(rows.len(), 8);
    all_are_measured(rows);
}

const LEARNERS: &str = include_str!("../docs/learners.md");

/// The first word of a cell: the scenario's name before what is said of it.
fn name(cell: &str) -> &str {
    cell.split([',', ' ']).next().expect("a word")
}

#[test]
#[ignore = "half an hour: .ci/nightly tables"]
fn the_tables_of_learners_are_measured() {
    all_are_measured(movements(LEARNERS));
    for row in cells(LEARNERS, "| scenario | movements made") {
        assert_eq!(measured(name(&row[0]), "global", &row[1])[..], row[2..6], "{row:?}");
    }
    // Converged, and where half of the runs have: the median and the 90th percentile.
    let brief = |[converged, median, ninety, _]: [String; 4]| match median.as_str() {
        "–" => converged,
        _ => format!("{converged}: {median}, {ninety}"),
    };
    for row in cells(LEARNERS, "| learner | what it is |") {
        let learner = &row[0];
        let scenarios =
            [("arm-6dof", "1000", "40"), ("arm-6dof-doubled-error", "2000", "40"), ("arm-6dof-no-prior", "2000", "45")];
        for ((scenario, steps, global), cell) in scenarios.into_iter().zip(&row[2..5]) {
            if cell != "not offered" {
                let steps = if learner == "global" { global } else { steps };
                assert_eq!(brief(measured(scenario, learner, steps)), *cell, "{scenario}, {learner}");
            }
        }
    }
}
