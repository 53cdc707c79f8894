//! How large what is told to a server may be, and what it keeps.

use body_schema::server::{Limits, Options};
use serde_json::json;

use crate::http::{
    robot,
    support::{Server, problem},
};

async fn with(limits: Limits) -> Server {
    Server::with(Options { limits, ..Options::default() }).await
}

#[tokio::test]
async fn a_robot_has_as_many_joints_and_targets_and_evaluations_as_a_server_takes_on() {
    let usual = Limits::default;
    for (limits, field) in [
        (Limits { joints: 2, ..usual() }, "calibration.robot.urdf"),
        (Limits { targets: 0, ..usual() }, "calibration.target"),
        (Limits { evaluations: 29, ..usual() }, "calibration.selection.evaluations"),
    ] {
        let server = with(limits).await;
        let told = problem(server.post("/v1/sessions", robot::opening()).await, 422, Some(field)).await;
        assert!(told["detail"].as_str().expect("text").contains("more than"), "{told}");
        assert_eq!(server.get_json("/v1/sessions").await["sessions"], json!([]));
        server.stop().await;
    }
    let server = with(Limits { joints: 3, targets: 1, evaluations: 30, ..usual() }).await;
    server.open(robot::opening()).await;
    server.stop().await;
}

#[tokio::test]
async fn what_is_kept_has_room_until_it_has_none() {
    let folder = tempfile::tempdir().expect("a folder");
    let limits = Limits { stored_bytes: 40_000, recordings_bytes: 1000, ..Limits::default() };
    let options =
        Options { data_dir: Some(folder.path().to_owned()), keep_recordings: true, limits, ..Options::default() };
    let server = Server::with(options).await;
    let session = server.open(robot::opening()).await;
    let observations = format!("{session}/observations");
    let mut told = 0;
    let refused = loop {
        let answer = server.post(&observations, robot::told(&robot::posture(told))).await;
        if !answer.status().is_success() {
            break answer;
        }
        told += 1;
        assert!(told < 1000, "it is never full");
    };
    assert!(refused.headers().contains_key("retry-after"));
    let refused = problem(refused, 503, None).await;
    assert_eq!(refused["type"], "urn:body-schema:problem:server-full");
    assert_eq!(server.get_json(&session).await["status"]["observations"], told);
    server.delete(&session).await;
    server.open(robot::opening()).await;

    let first = server.open_quick(1).await;
    server.step(&first, 1).await;
    server.delete(&first).await;
    let full = server.post("/v1/sessions", json!({ "scenario": "arm-6dof" })).await;
    assert!(full.headers().contains_key("retry-after"));
    let full = problem(full, 503, None).await;
    assert!(full["detail"].as_str().expect("text").contains("recordings"), "{full}");
    server.stop().await;
}
