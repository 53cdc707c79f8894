//! What goes wrong around a server: damaged files, folders that vanish, ports that are taken, and what `repair` makes of it.
#![cfg(target_os = "linux")]

use std::{
    fs,
    path::Path,
    process::{Command, Output},
};

use reqwest::StatusCode;
use serde_json::{Value, json};
use tokio::{io::AsyncWriteExt, net::TcpStream};

use crate::http::{
    program::Program,
    robot,
    streams::steps_of_recording,
    support::{SOON, problem},
};

const STORE: &str = "sessions.sqlite";

fn repair(path: &Path, more: &[&str]) -> (i32, String) {
    let output: Output = Command::new(env!("CARGO_BIN_EXE_body-schema"))
        .arg("repair")
        .arg(path)
        .args(more)
        .output()
        .expect("the program");
    let said = [output.stdout, output.stderr].map(|said| String::from_utf8_lossy(&said).into_owned()).concat();
    (output.status.code().expect("an exit code"), said)
}

/// Sessions with this many observations each, kept in a folder whose server has ended.
async fn kept(folder: &Path, observations: &[usize]) -> Vec<String> {
    let program = Program::keeping(folder);
    let mut sessions = Vec::new();
    for count in observations {
        let session = program.api.open(robot::opening()).await;
        for number in 0..*count {
            let told = program.api.post(&format!("{session}/observations"), robot::told(&robot::posture(number))).await;
            assert_eq!(told.status(), StatusCode::CREATED);
        }
        sessions.push(session);
    }
    assert_eq!(program.terminate().0, Some(0));
    sessions
}

fn change(folder: &Path, sql: &str) {
    let store = rusqlite::Connection::open(folder.join(STORE)).expect("the store");
    assert_eq!(store.execute(sql, []).expect("changed"), 1, "{sql}");
}

fn ids(list: &Value) -> Vec<&str> {
    list.as_array().expect("a list").iter().map(|session| session["id"].as_str().expect("an id")).collect()
}

#[tokio::test]
async fn a_damaged_session_is_named_and_the_others_are_served() {
    let folder = tempfile::tempdir().expect("a folder");
    let sessions = kept(folder.path(), &[6, 3]).await;
    let (damaged, whole) =
        (sessions[0].rsplit('/').next().expect("an id"), sessions[1].rsplit('/').next().expect("an id"));
    let of = format!("session = (SELECT number FROM session WHERE id = '{damaged}')");
    // A digit of a measurement, as a disk may lose it.
    change(folder.path(), &format!("UPDATE event SET event = replace(event, '0.', '1.') WHERE number = 4 AND {of}"));

    let program = Program::keeping(folder.path());
    let list = program.api.get_json("/v1/sessions").await;
    assert_eq!((ids(&list["sessions"]), ids(&list["damaged"])), (vec![whole], vec![damaged]), "{list}");
    let told = problem(program.api.get(&sessions[0]).await, 500, None).await;
    assert_eq!(told["type"], "urn:body-schema:problem:damaged");
    assert!(told["detail"].as_str().expect("text").contains("event 4 is not as it was written"), "{told}");
    let answer = program.api.post(&format!("{}/observations", sessions[0]), robot::told(&robot::posture(9))).await;
    problem(answer, 500, None).await;
    assert_eq!(program.api.get_json(&sessions[1]).await["status"]["observations"], 3);
    let (code, said) = repair(folder.path(), &[]);
    assert!(code == 1 && said.contains("another body-schema server"), "{said}");
    assert_eq!(program.terminate().0, Some(0));

    let before = fs::read(folder.path().join(STORE)).expect("the store");
    let (code, said) = repair(folder.path(), &["--check"]);
    assert!(code == 1 && said.contains("event 4") && said.contains("the 3 events before it can be kept"), "{said}");
    assert_eq!(fs::read(folder.path().join(STORE)).expect("the store"), before, "it only looks");
    let (code, said) = repair(folder.path(), &[]);
    assert!(code == 0 && said.contains("mended") && said.contains("before-repair-1"), "{said}");
    assert!(folder.path().join(format!("{STORE}.before-repair-1")).exists());
    assert_eq!(repair(folder.path(), &["--check"]).0, 0);
    let program = Program::keeping(folder.path());
    let list = program.api.get_json("/v1/sessions").await;
    assert_eq!((list["sessions"].as_array().expect("a list").len(), &list["damaged"]), (2, &json!(null)));
    assert_eq!(program.api.get_json(&sessions[0]).await["status"]["observations"], 3);
    let answer = program.api.post(&format!("{}/observations", sessions[0]), robot::told(&robot::posture(9))).await;
    assert_eq!(answer.status(), StatusCode::CREATED);
}

#[tokio::test]
async fn a_server_starts_on_a_damaged_store_and_says_what_is_damaged() {
    let folder = tempfile::tempdir().expect("a folder");
    let sessions = kept(folder.path(), &[40, 2]).await;
    let file = folder.path().join(STORE);
    let mut bytes = fs::read(&file).expect("the store");
    let last = bytes.len() - 4096;
    bytes[last..].fill(0xA5);
    fs::write(&file, bytes).expect("written");
    let program = Program::keeping(folder.path());
    let list = program.api.get_json("/v1/sessions").await;
    for (session, count) in sessions.iter().zip([40, 2]) {
        let id = session.rsplit('/').next().expect("an id");
        if ids(&list["sessions"]).contains(&id) {
            assert_eq!(program.api.get_json(session).await["status"]["observations"], count, "half a session is none");
        }
    }
    let (code, said) = program.terminate();
    assert_eq!(code, Some(0));
    assert!(said.contains("warning: ") && said.contains("is damaged") && said.contains("damaged-1"), "{said}");
}

#[tokio::test]
async fn a_folder_that_vanishes_takes_no_observation_with_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let data = folder.path().join("data");
    let program = Program::keeping(&data);
    let session = program.api.open(robot::opening()).await;
    let observations = format!("{session}/observations");
    let tell = async |number: usize| program.api.post(&observations, robot::told(&robot::posture(number))).await;
    assert_eq!(tell(0).await.status(), StatusCode::CREATED);
    fs::rename(&data, folder.path().join("elsewhere")).expect("moved");
    let refused = problem(tell(1).await, 507, None).await;
    assert!(refused["detail"].as_str().expect("text").contains("has disappeared"), "{refused}");
    problem(program.api.post("/v1/sessions", robot::opening()).await, 507, None).await;
    // A session whose recording would be kept there cannot begin; what needs no disk goes on.
    problem(program.api.post("/v1/sessions", json!({ "scenario": "arm-6dof" })).await, 500, None).await;
    assert_eq!(program.api.get_json(&session).await["status"]["observations"], 1);
    fs::rename(folder.path().join("elsewhere"), &data).expect("put back");
    assert_eq!(tell(1).await.status(), StatusCode::CREATED);
    program.kill();
    let program = Program::keeping(&data);
    assert_eq!(program.api.get_json(&session).await["status"]["observations"], 2);
}

#[tokio::test]
async fn a_port_that_is_taken_and_a_folder_that_is_none_are_told() {
    let first = Program::ephemeral();
    let serve = |arguments: &[&str]| {
        Command::new(env!("CARGO_BIN_EXE_body-schema")).arg("serve").args(arguments).output().expect("the program")
    };
    let second = serve(&["--bind", &first.api.address.to_string(), "--ephemeral"]);
    let said = String::from_utf8_lossy(&second.stderr);
    assert!(second.status.code() == Some(1) && said.contains("another program may be using it"), "{said}");
    let third = serve(&["--bind", "127.0.0.1:0", "--data-dir", "/proc/nothing"]);
    let said = String::from_utf8_lossy(&third.stderr);
    assert!(third.status.code() == Some(1) && said.contains("/proc/nothing") && said.contains("--data-dir"), "{said}");
}

/// A recording whose server was killed is cut off anywhere; what is whole of it is kept.
#[tokio::test]
async fn the_recordings_of_a_killed_server_are_mended() {
    let folder = tempfile::tempdir().expect("a folder");
    let program = Program::keeping(folder.path());
    let session = program.api.open_quick(1).await;
    program.api.step(&session, 60).await;
    // Whoever asks for the recording has all of it written.
    assert_eq!(program.api.get(&format!("{session}/recording.rrd")).await.status(), StatusCode::OK);
    let name = program.api.get_json(&session).await["file"].as_str().expect("a file").to_owned();
    program.kill();
    let file = folder.path().join(&name);
    let whole = fs::read(&file).expect("the recording");
    let (code, said) = repair(folder.path(), &[]);
    assert!(code == 0 && said.contains(&name) && said.contains("mended"), "{said}");
    assert_eq!(fs::read(folder.path().join(format!("{name}.before-repair-1"))).expect("as it was"), whole);
    let mended = fs::read(&file).expect("the recording");
    assert_eq!(steps_of_recording(&mended), (0..=60).collect());
    assert!(mended.windows(4).rev().take(64).any(|tail| tail == b"FOOT"), "a footer");
    assert_eq!(repair(&file, &[]).0, 0, "it is whole now");

    let cut = folder.path().join("cut.rrd");
    fs::write(&cut, &whole[..whole.len() * 2 / 3]).expect("written");
    let out = folder.path().join("out.rrd");
    let to = out.to_str().expect("text");
    assert_eq!(repair(&cut, &["--check"]).0, 1);
    assert_eq!(repair(&cut, &["--out", to]).0, 0);
    assert_eq!(fs::read(&cut).expect("as it was").len(), whole.len() * 2 / 3);
    assert!(fs::read(&out).expect("mended").windows(4).rev().take(64).any(|tail| tail == b"FOOT"));
    assert_eq!(repair(&cut, &["--out", to]).0, 2, "nothing is overwritten");
    fs::write(&cut, "no recording").expect("written");
    let (code, said) = repair(&cut, &[]);
    assert!(code == 1 && said.contains("lost") && fs::read(&cut).expect("as it was") == b"no recording", "{said}");
    assert_eq!(repair(&folder.path().join("nothing"), &[]).0, 2);
    assert_eq!(repair(tempfile::tempdir().expect("a folder").path(), &[]).0, 2);
}

/// A thousand streams, opened and dropped by who never reads.
#[tokio::test]
async fn a_thousand_streams_leave_nothing_behind() {
    const STREAMS: usize = 1000;
    const MARGIN: usize = 8;
    let program = Program::ephemeral();
    let session = program.api.open_quick(1).await;
    program.api.step(&session, 20).await;
    let before = (program.threads(), program.descriptors());
    for number in 0..STREAMS {
        let what = ["events", "live.rrd", "live"][number % 3];
        let upgrade = "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n\
                       Sec-WebSocket-Key: AQIDBAUGBwgJCgsMDQ4PEA==\r\n";
        let more = if what == "live" { upgrade } else { "" };
        let mut stream = TcpStream::connect(program.api.address).await.expect("a connection");
        let head = format!("GET {session}/{what} HTTP/1.1\r\nHost: {}\r\n{more}\r\n", program.api.address);
        stream.write_all(head.as_bytes()).await.expect("written");
        if number % 2 == 0 {
            // That it is answered shows that it was a stream.
            stream.readable().await.expect("an answer");
        }
    }
    program.api.step(&session, 1).await;
    let begun = std::time::Instant::now();
    while program.threads() > before.0 + MARGIN || program.descriptors() > before.1 + MARGIN {
        assert!(begun.elapsed() < SOON, "{before:?} before, {} and {}", program.threads(), program.descriptors());
        tokio::time::sleep(std::time::Duration::from_millis(50)).await;
        program.api.step(&session, 1).await;
    }
    let events = program.api.get(&format!("{session}/events")).await;
    assert_eq!(events.status(), StatusCode::OK, "there is room for others");
}
