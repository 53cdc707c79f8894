//! The same again: what a seed and what was told determine is the same to the last byte after a restart.

use std::path::Path;

use serde_json::{Value, json};

use crate::http::{
    program::Program,
    robot,
    streams::rows_of_recording,
    support::{Api, timeless},
};

/// A session's reports without times, its table without the column of them, and the rows of its recording.
async fn simulated(api: &Api) -> (Vec<Value>, String, Value, Vec<String>) {
    let session = api.open(json!({ "scenario": "arm-6dof-camera", "seed": 7 })).await;
    let made = api.step(&session, 12).await;
    let reports = made["reports"].as_array().expect("reports").iter().map(timeless).collect();
    let table = api.get(&format!("{session}/steps.csv")).await.text().await.expect("text");
    let column = table.lines().next().expect("titles").split(',').position(|title| title == "selection_ms");
    let timeless = |line: &str| {
        let cells = line.split(',').enumerate().filter(|(at, _)| Some(*at) != column);
        cells.map(|(_, cell)| cell).collect::<Vec<_>>().join(",")
    };
    let table: Vec<String> = table.lines().map(timeless).collect();
    let result = api.get_json(&format!("{session}/result.json")).await;
    let recording = api.get(&format!("{session}/recording.rrd")).await.bytes().await.expect("a recording");
    let rows = rows_of_recording(&recording);
    assert!(rows.len() > 1000, "{} rows", rows.len());
    api.delete(&session).await;
    (reports, table.join("\n"), result, rows)
}

#[tokio::test]
async fn a_seed_gives_the_same_reports_before_and_after_a_restart() {
    let first = Program::ephemeral();
    let before = simulated(&first.api).await;
    assert_eq!(simulated(&first.api).await, before, "twice on one server");
    first.kill();
    assert_eq!(simulated(&Program::ephemeral().api).await, before, "on another one");
}

/// What a robot that asks and tells is answered, and takes away.
async fn told(api: &Api, session: &str, turns: std::ops::Range<usize>) -> Vec<Value> {
    let mut answers = Vec::new();
    for _ in turns {
        let asked = api.post(&format!("{session}/suggestions"), json!({ "count": 2 })).await;
        let asked: Value = asked.json().await.expect("JSON");
        let told = api.post(&format!("{session}/observations"), robot::carried_out(&asked["suggestions"][0])).await;
        answers.extend([asked, told.json().await.expect("JSON")]);
    }
    answers
}

async fn taken_away(api: &Api, session: &str) -> Vec<String> {
    let mut files = Vec::new();
    for file in ["model.urdf", "kinematics.yaml", "observations.csv", "calibration.toml", "report.json"] {
        let answer = api.get(&format!("{session}/{file}")).await;
        assert!(answer.status().is_success(), "{file}: {}", answer.status());
        files.push(answer.text().await.expect("text"));
    }
    let recording = api.get(&format!("{session}/recording.rrd")).await.bytes().await.expect("a recording");
    files.extend(rows_of_recording(&recording));
    files
}

async fn whole(folder: &Path, restarts: bool) -> (Vec<Value>, Vec<String>) {
    let mut program = Program::keeping(folder);
    let session = program.api.open(robot::opening()).await;
    let mut answers = told(&program.api, &session, 0..4).await;
    if restarts {
        program.kill();
        program = Program::keeping(folder);
    }
    answers.extend(told(&program.api, &session, 4..8).await);
    (answers, taken_away(&program.api, &session).await)
}

#[tokio::test]
async fn the_same_events_give_the_same_suggestions_and_files_across_a_restart() {
    let folders = [(); 2].map(|()| tempfile::tempdir().expect("a folder"));
    let (through, restarted) = (whole(folders[0].path(), false).await, whole(folders[1].path(), true).await);
    for (turn, (a, b)) in through.0.iter().zip(&restarted.0).enumerate() {
        assert_eq!(a, b, "answer {turn}");
    }
    for (a, b) in through.1.iter().zip(&restarted.1) {
        assert_eq!(a, b);
    }
    assert_eq!(through.1.len(), restarted.1.len());
}
