//! Stored sessions in a folder that any static host serves.

use std::{io::Read, process::Command};

use flate2::read::GzDecoder;
use serde_json::{Value, json};

use crate::http::{outside::tell, program::Program, robot, streams::steps_of_recording};

#[tokio::test]
async fn a_stored_session_is_exported_while_its_server_runs() {
    let folder = tempfile::tempdir().expect("a folder");
    let data = folder.path().join("data");
    let program = Program::keeping(&data);
    let session = program.api.open(robot::opening()).await;
    let id = session.rsplit('/').next().expect("an id");
    let export = |id: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_body-schema"));
        command.args(["export", "--session", id, "--data-dir"]).arg(&data).arg("--out").arg(folder.path().join("out"));
        command.output().expect("the program")
    };
    assert!(!export(id).status.success(), "nothing was told yet");
    tell(&program.api, &session, 0..5).await;
    let excluded = program.api.request(reqwest::Method::DELETE, &format!("{session}/observations/2")).send().await;
    assert!(excluded.expect("an answer").status().is_success());
    let exported = export(id);
    assert!(exported.status.success(), "{}", String::from_utf8_lossy(&exported.stderr));

    let read = |file: &str| std::fs::read(folder.path().join("out").join(file)).expect("a file");
    let manifest: Value = serde_json::from_slice(&read("export.json")).expect("JSON");
    let scenario = &manifest["scenarios"][0];
    assert_eq!((&scenario["name"], &scenario["world"]), (&json!("three"), &json!("outside")));
    assert_eq!((&scenario["runs"][0]["steps"], &scenario["runs"][0]["seed"]), (&json!(4), &json!(0)));
    let run = scenario["runs"][0]["folder"].as_str().expect("a folder");
    assert_eq!(steps_of_recording(&read(&format!("{run}/recording.rrd"))), (0..=4).collect());
    let mut reports = String::new();
    GzDecoder::new(&*read(&format!("{run}/reports.ndjson.gz"))).read_to_string(&mut reports).expect("text");
    assert_eq!(reports.lines().count(), 5);
    let result: Value = serde_json::from_slice(&read(&format!("{run}/result.json"))).expect("JSON");
    assert_eq!(result, program.api.get_json(&format!("{session}/result.json")).await);

    for unknown in ["67e55044-10b1-426f-9247-bb680e5fe0c8", "x"] {
        let refused = export(unknown);
        let told = String::from_utf8_lossy(&refused.stderr);
        assert!(refused.status.code() == Some(2) && told.contains(unknown), "{told}");
    }
}
