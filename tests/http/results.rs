//! What a session with a robot elsewhere comes to, to take away: files, and the session itself.

use std::{collections::BTreeMap, process::Command};

use reqwest::StatusCode;
use serde_json::{Value, json};

use crate::http::{
    external::tell,
    robot,
    support::{Server, problem},
};

#[tokio::test]
async fn results_are_what_calibrate_makes_of_the_files() {
    let server = Server::start().await;
    let session = server.open(robot::opening()).await;
    for nothing in ["model.urdf", "kinematics.yaml", "report.json", "report.html"] {
        problem(server.get(&format!("{session}/{nothing}")).await, 409, None).await;
    }
    tell(&server, &session, 0..24).await;
    let folder = tempfile::tempdir().expect("a folder");
    let types = [
        ("calibration.toml", "application/toml"),
        ("observations.csv", "text/csv; charset=utf-8"),
        ("robot.urdf", "application/xml"),
        ("model.urdf", "application/xml"),
        ("kinematics.yaml", "application/yaml"),
        ("report.json", "application/json"),
        ("report.html", "text/html; charset=utf-8"),
    ];
    let mut files = BTreeMap::new();
    for (name, content_type) in types {
        let response = server.get(&format!("{session}/{name}")).await;
        assert_eq!(response.status(), StatusCode::OK, "{name}");
        assert_eq!(response.headers()["content-type"], content_type, "{name}");
        // The report has its style within.
        let policy = response.headers()["content-security-policy"].to_str().expect("text");
        assert_eq!(policy.contains("style-src 'unsafe-inline'"), name == "report.html", "{name}: {policy}");
        files.insert(name, response.text().await.expect("text"));
    }
    for name in ["calibration.toml", "observations.csv", "robot.urdf"] {
        std::fs::write(folder.path().join(name), &files[name]).expect("written");
    }
    let out = folder.path().join("out");
    let calibrated = Command::new(env!("CARGO_BIN_EXE_body-schema"))
        .arg("calibrate")
        .arg(folder.path().join("calibration.toml"))
        .arg("--out")
        .arg(&out)
        .output()
        .expect("the program");
    assert!(calibrated.status.success(), "{}", String::from_utf8_lossy(&calibrated.stderr));
    let made = |name: &str| std::fs::read_to_string(out.join(name)).expect("a file");
    assert_eq!(files["model.urdf"], made("calibrated.urdf"));
    assert_eq!(files["kinematics.yaml"], made("kinematics.yaml"));
    let report = |text: &str| serde_json::from_str::<Value>(text).expect("JSON");
    assert_eq!(report(&files["report.json"])["parameters"], report(&made("report.json"))["parameters"]);
    assert!(files["report.html"].starts_with("<!doctype html>") || files["report.html"].starts_with("<!DOCTYPE html>"));
    server.stop().await;
}

#[tokio::test]
async fn a_saved_session_goes_on_in_another() {
    let server = Server::start().await;
    let session = server.open(robot::opening()).await;
    tell(&server, &session, 0..5).await;
    let asked: Value = server.post(&format!("{session}/suggestions"), json!({})).await.json().await.expect("JSON");
    let saved: Value = server.get(&format!("{session}/session.json")).await.json().await.expect("JSON");
    let copy = |events: &Value, version: u32| {
        let mut opening = saved["setup"].clone();
        (opening["world"], opening["events"], opening["version"]) = (json!("outside"), events.clone(), json!(version));
        opening
    };
    let other = server.open(copy(&saved["events"], 1)).await;
    assert_ne!(other, session);
    let result = async |session: &str| -> Value {
        server.get(&format!("{session}/result.json")).await.json().await.expect("JSON")
    };
    assert_eq!(result(&other).await["learners"][0]["model"], result(&session).await["learners"][0]["model"]);
    let again: Value = server.post(&format!("{other}/suggestions"), json!({})).await.json().await.expect("JSON");
    assert_eq!(again, asked, "what was pending is");
    let kept: Value = server.get(&format!("{other}/session.json")).await.json().await.expect("JSON");
    assert_eq!(kept, saved);

    // What cannot have happened is named.
    let mut events = saved["events"].clone();
    events[3]["told"]["configuration"] = json!({ "pan": 0.0 });
    let refused = problem(server.post("/v1/sessions", copy(&events, 1)).await, 422, Some("events[3]")).await;
    assert!(refused["detail"].as_str().is_some_and(|detail| detail.contains("event 4")), "{refused}");
    let mut events = saved["events"].clone();
    events[5]["choice"]["plan"] = json!({ "postures": [[0.1]], "committed": 1 });
    problem(server.post("/v1/sessions", copy(&events, 1)).await, 422, Some("events[5]")).await;
    problem(server.post("/v1/sessions", copy(&saved["events"], 99)).await, 422, Some("version")).await;
    server.stop().await;
}
