//! Stored sessions in a folder that any static host serves.

use std::process::Command;

use body_schema_backend::{Asked, Local};
use serde_json::{Value, json};

use crate::{
    http::{external::tell, program::Program, robot, streams::steps_of_recording},
    recording::reading::entities_in_order,
};

/// What the visitor's engine answers.
fn asked(local: &mut Local, path: &str) -> Vec<u8> {
    match local.ask("GET", path, b"") {
        Asked::Done(answer) if answer.status == 200 => answer.body,
        Asked::Done(answer) => panic!("{path}: {}", String::from_utf8_lossy(&answer.body)),
        Asked::Begun(_) => panic!("{path} takes its time"),
    }
}

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
    let nothing = export(id);
    assert!(nothing.status.code() == Some(2), "nothing was told yet");
    assert!(String::from_utf8_lossy(&nothing.stderr).contains("no observation yet"));
    tell(&program.api, &session, 0..5).await;
    let excluded = program.api.request(reqwest::Method::DELETE, &format!("{session}/observations/2")).send().await;
    assert!(excluded.expect("an answer").status().is_success());
    let asked_for = program.api.post(&format!("{session}/suggestions"), json!({})).await;
    assert!(asked_for.status().is_success());
    let exported = export(id);
    assert!(exported.status.success(), "{}", String::from_utf8_lossy(&exported.stderr));

    let read = |file: &str| std::fs::read(folder.path().join("out").join(file)).expect("a file");
    let manifest: Value = serde_json::from_slice(&read("export.json")).expect("JSON");
    let events = format!("sessions/{id}.json");
    assert_eq!(manifest["sessions"], json!([{ "id": id, "events": events }]));
    assert_eq!(manifest["opens"], format!("session={id}"));

    // The visitor's engine replays it to what the server has.
    let mut local = Local::new(|| "another".to_owned());
    local.take_up(id, &String::from_utf8(read(&events)).expect("text")).expect("a session");
    for file in ["result.json", "model.urdf", "kinematics.yaml", "observations.csv", "calibration.toml", "session.json"]
    {
        let there = program.api.get(&format!("{session}/{file}")).await.bytes().await.expect("a body");
        let here = asked(&mut local, &format!("{session}/{file}"));
        assert_eq!(String::from_utf8_lossy(&here), String::from_utf8_lossy(&there), "{file}");
    }
    let (here, mut there): (Value, Value) =
        (serde_json::from_slice(&asked(&mut local, &session)).expect("JSON"), program.api.get_json(&session).await);
    // Each life of a session on the server records anew.
    there["recording"] = here["recording"].clone();
    assert_eq!((&here, &here["step"]), (&there, &json!(4)));
    assert_eq!(steps_of_recording(&asked(&mut local, &format!("{session}/recording.rrd"))), (0..=4).collect());
    let (parts, messages) = local.news(id, 0, 0).expect("a session");
    let scene: Vec<u8> = parts.iter().flat_map(|part| part.to_vec()).collect();
    assert!(entities_in_order(&scene).iter().any(|entity| entity.ends_with("/arm/ghost")), "where it is to go next");
    let (standing, reports) = messages.split_last().expect("messages");
    let standing: Value = serde_json::from_str(standing).expect("JSON");
    assert_eq!(
        (reports.len(), &standing["type"], &standing["data"]["status"]["observations"]),
        (5, &json!("status"), &json!(5))
    );
    assert!(local.news(id, 0, messages.len()).is_some_and(|(_, more)| more.is_empty()), "it is told once");
    match local.ask("POST", &format!("{session}/steps"), b"") {
        Asked::Done(answer) => assert_eq!(answer.status, 409),
        Asked::Begun(_) => panic!("a robot's session steps by itself"),
    }

    for unknown in ["67e55044-10b1-426f-9247-bb680e5fe0c8", "x"] {
        let refused = export(unknown);
        let told = String::from_utf8_lossy(&refused.stderr);
        assert!(refused.status.code() == Some(2) && told.contains(unknown), "{told}");
    }
}
