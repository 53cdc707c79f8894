//! Nothing leaves the machine: what the program says to the operating system of the network.
#![cfg(target_os = "linux")]

use std::{
    path::Path,
    process::{Command, Stdio},
    time::{Duration, Instant},
};

use serde_json::json;

use crate::http::{
    program::Program,
    robot,
    support::{Api, SOON},
};

/// The program under `strace`, which writes down every call that has to do with the network; `None`, with a word, where it cannot
/// be watched.
fn watched(trace: &Path) -> Option<Command> {
    let strace = |arguments: &[&str]| {
        let mut command = Command::new("strace");
        command.args(["-f", "-q", "-e", "trace=%network", "-o"]).arg(trace).args(arguments);
        command
    };
    if !strace(&["true"]).stderr(Stdio::null()).status().is_ok_and(|status| status.success()) {
        println!("skipped: there is no strace here, or it may not watch");
        return None;
    }
    // It watches from the side, so that the program is our own child.
    Some(strace(&["-D", env!("CARGO_BIN_EXE_body-schema")]))
}

/// What was written down of a process that has ended.
fn calls(trace: &Path, id: u32) -> Vec<String> {
    // Identifiers are padded to a width.
    let is_end = |line: &str| {
        line.split_once(' ')
            .is_some_and(|(of, what)| of == id.to_string() && what.trim_start().starts_with("+++ exited"))
    };
    let begun = Instant::now();
    loop {
        let text = std::fs::read_to_string(trace).expect("a trace");
        if text.lines().any(is_end) {
            return text.lines().map(str::to_owned).collect();
        }
        assert!(begun.elapsed() < SOON, "the trace has no end: {text}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// Calls that name another end, be it to connect to it or to send it something.
fn reached(calls: &[String]) -> Vec<&String> {
    let outward = ["connect(", "sendto(", "sendmsg(", "sendmmsg("];
    let named = |call: &&String| outward.iter().any(|name| call.contains(name)) && call.contains("sa_family=AF_INET");
    calls.iter().filter(named).collect()
}

#[tokio::test]
async fn a_server_speaks_with_its_clients_alone() {
    let folder = tempfile::tempdir().expect("a folder");
    let trace = folder.path().join("trace");
    let Some(mut command) = watched(&trace) else { return };
    command.args(["serve", "--bind", "127.0.0.1:0", "--data-dir"]).arg(folder.path().join("data"));
    let program = Program::start(&mut command);
    let api: &Api = &program.api;
    let session = api.open_quick(1).await;
    api.step(&session, 3).await;
    for path in ["/", "/viewer/re_viewer.js", "/metrics", &format!("{session}/recording.rrd")] {
        api.get(path).await.bytes().await.expect("a body");
    }
    let elsewhere = api.open(robot::opening()).await;
    api.post(&format!("{elsewhere}/observations"), robot::told(&robot::posture(0))).await;
    api.post(&format!("{elsewhere}/suggestions"), json!({})).await;
    api.get(&format!("{elsewhere}/report.html")).await.bytes().await.expect("a body");
    api.delete(&session).await;
    let id = program.id();
    assert_eq!(program.terminate().0, Some(0));
    let calls = calls(&trace, id);
    assert!(calls.iter().any(|call| call.contains("accept4(")), "it was watched: {calls:?}");
    assert_eq!(reached(&calls), Vec::<&String>::new());
}

#[test]
fn a_run_opens_no_socket_to_anywhere() {
    let folder = tempfile::tempdir().expect("a folder");
    let trace = folder.path().join("trace");
    let Some(mut command) = watched(&trace) else { return };
    let recording = folder.path().join("run.rrd");
    command.args(["run", "arm-6dof", "--steps", "3", "--learner", "active", "--rrd"]).arg(&recording);
    let started = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("the program starts");
    let id = started.id();
    let ended = started.wait_with_output().expect("it ends");
    assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
    assert!(recording.exists());
    let calls = calls(&trace, id);
    let sockets: Vec<&String> = calls.iter().filter(|call| call.contains("AF_INET")).collect();
    assert_eq!(sockets, Vec::<&String>::new());
}
