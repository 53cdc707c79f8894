//! A disk that is full for a while. No file of the program may grow beyond a limit of the operating system, which is what a
//! process can do to itself without privileges; it fails to write as on a full disk.
#![cfg(target_os = "linux")]

use std::{path::Path, process::Command};

use reqwest::{Method, StatusCode};
use serde_json::json;

use crate::http::{
    program::Program,
    robot,
    streams::steps_of_recording,
    support::{SOON, problem},
};

/// The program, none of whose files may be larger than this.
fn limited(folder: &Path, bytes: u32) -> Program {
    let mut command = Command::new("prlimit");
    // A write beyond the limit is to fail, and not to kill.
    command.arg(format!("--fsize={bytes}:unlimited")).args(["sh", "-c", "trap '' XFSZ; exec \"$0\" \"$@\""]);
    command.arg(env!("CARGO_BIN_EXE_body-schema")).args(["serve", "--bind", "127.0.0.1:0", "--data-dir"]).arg(folder);
    Program::start(&mut command)
}

/// There is room again.
fn lift(program: &Program) {
    limit(program, "unlimited");
}

/// There is room for nothing any more, however small.
fn fill(program: &Program) {
    limit(program, "1");
}

fn limit(program: &Program, bytes: &str) {
    let id = program.id().to_string();
    let limited = Command::new("prlimit").args(["--pid", &id, &format!("--fsize={bytes}:unlimited")]).status();
    assert!(limited.expect("prlimit").success());
}

async fn delete(program: &Program, session: &str) -> reqwest::Response {
    program.api.request(Method::DELETE, session).timeout(SOON).send().await.expect("an answer")
}

#[tokio::test]
async fn what_a_full_disk_refuses_has_not_happened() {
    let folder = tempfile::tempdir().expect("a folder");
    let program = limited(folder.path(), 400_000);
    let session = program.api.open(robot::opening()).await;
    let observations = format!("{session}/observations");
    let mut accepted = 0;
    let refused = loop {
        let answer = program.api.post(&observations, robot::told(&robot::posture(accepted))).await;
        if answer.status() != StatusCode::CREATED {
            break answer;
        }
        accepted += 1;
        assert!(accepted < 1000, "the disk is never full");
    };
    assert!(accepted > 3, "{accepted}");
    let refused = problem(refused, 507, None).await;
    assert!(refused["detail"].as_str().expect("text").contains("has not happened"), "{refused}");
    // What is shorter might still have found room.
    fill(&program);
    problem(program.api.post(&format!("{session}/suggestions"), json!({})).await, 507, None).await;
    problem(program.api.post("/v1/sessions", robot::opening()).await, 507, None).await;
    problem(delete(&program, &session).await, 507, None).await;
    let count = async |program: &Program| program.api.get_json(&session).await["status"]["observations"].clone();
    assert_eq!(count(&program).await, json!(accepted));

    lift(&program);
    let again = program.api.post(&observations, robot::told(&robot::posture(accepted))).await;
    assert_eq!(again.status(), StatusCode::CREATED);
    assert_eq!(count(&program).await, json!(accepted + 1));
    let before = program.api.get_json(&observations).await;
    assert_eq!(program.terminate().0, Some(0));
    let program = Program::keeping(folder.path());
    assert_eq!(program.api.get_json(&observations).await, before);
    assert_eq!(program.api.get_json("/v1/sessions").await["sessions"].as_array().expect("a list").len(), 1);
    assert_eq!(delete(&program, &session).await.status(), StatusCode::NO_CONTENT);
}

#[tokio::test]
async fn steps_go_on_without_their_file_which_is_written_anew_at_the_end() {
    let folder = tempfile::tempdir().expect("a folder");
    let program = limited(folder.path(), 400_000);
    let session = program.api.open_quick(1).await;
    for step in 1..=40 {
        assert_eq!(program.api.step(&session, 5).await["step"], step * 5, "what is answered has happened");
    }
    // Steps that nobody watches are written in large parts, at the latest once nothing is asked for.
    let mut resource = program.api.get_json(&session).await;
    let began = std::time::Instant::now();
    while resource["recording_failure"].is_null() && began.elapsed() < SOON {
        tokio::time::sleep(std::time::Duration::from_millis(50)).await;
        resource = program.api.get_json(&session).await;
    }
    let failure = resource["recording_failure"].as_str().expect("the file is too large").to_owned();
    let file = resource["file"].as_str().expect("a file").to_owned();
    assert!(failure.contains(&file), "{failure}");
    let recording = program.api.get(&format!("{session}/recording.rrd")).await;
    assert_eq!(recording.status(), StatusCode::OK, "memory holds it");
    assert_eq!(steps_of_recording(&recording.bytes().await.expect("a recording")), (0..=200).collect());
    let refused = problem(delete(&program, &session).await, 507, None).await;
    assert!(refused["detail"].as_str().expect("text").contains("still there"), "{refused}");
    assert_eq!(program.api.step(&session, 1).await["step"], 201, "and it is");

    lift(&program);
    assert_eq!(delete(&program, &session).await.status(), StatusCode::NO_CONTENT);
    let recording = std::fs::read(folder.path().join(file)).expect("the file");
    assert_eq!(steps_of_recording(&recording), (0..=201).collect());
    assert_eq!(program.terminate(), (Some(0), "ended; every recording is complete\n".to_owned()));
}

#[tokio::test]
async fn a_server_that_ends_on_a_full_disk_says_which_recordings_lack_their_end() {
    let folder = tempfile::tempdir().expect("a folder");
    let program = limited(folder.path(), 2_000_000);
    let [long, short] = [program.api.open_quick(1).await, program.api.open_quick(2).await];
    program.api.step(&long, 1000).await;
    program.api.step(&short, 1).await;
    let file = async |session: &str| program.api.get_json(session).await["file"].as_str().expect("a file").to_owned();
    let (long, short): (String, String) = (file(&long).await, file(&short).await);
    let (code, said) = program.terminate();
    assert_eq!(code, Some(1));
    assert!(said.contains("are incomplete") && said.contains(&long) && !said.contains(&short), "{said}");
    assert!(!said.contains("every recording is complete"), "{said}");
    let recording = std::fs::read(folder.path().join(short)).expect("the file");
    assert_eq!(steps_of_recording(&recording), (0..=1).collect());
}
