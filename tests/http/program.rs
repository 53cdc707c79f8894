//! The program itself as a server: what only a process of its own can show.

use std::{
    io::{BufRead, BufReader},
    process::{Child, Command, Stdio},
};

use serde_json::json;

use crate::support::{Api, steps};

/// The program, serving on a port of its own; it is killed when this goes.
struct Program {
    process: Child,
    api: Api,
}

impl Program {
    fn serve(environment: &[(&str, &str)]) -> Self {
        let mut process = Command::new(env!("CARGO_BIN_EXE_body-schema"))
            .args(["serve", "--bind", "127.0.0.1:0", "--ephemeral"])
            .envs(environment.iter().copied())
            .stdout(Stdio::piped())
            .spawn()
            .expect("the program starts");
        let mut line = String::new();
        let output = process.stdout.as_mut().expect("its output");
        BufReader::new(output).read_line(&mut line).expect("a line");
        let address = line.split_once("http://").and_then(|(_, rest)| rest.split_once('/')).expect("an address").0;
        let api = Api::at(address.parse().expect("an address"));
        Self { process, api }
    }

    #[cfg(target_os = "linux")]
    fn threads(&self) -> usize {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.process.id())).expect("its status");
        let threads = status.lines().find_map(|line| line.strip_prefix("Threads:")).expect("a line on threads");
        threads.trim().parse().expect("a number")
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        // One that has ended by itself is as good.
        drop(self.process.kill());
        drop(self.process.wait());
    }
}

#[cfg(target_os = "linux")]
#[tokio::test]
async fn sessions_leave_no_threads_behind() {
    /// Workers come and go; one thread left behind by each session would be 150.
    const MARGIN: usize = 8;
    let program = Program::serve(&[]);
    let open_and_delete = async || {
        let session = program.api.open(json!({ "scenario": "arm-6dof", "learners": ["random"] })).await;
        program.api.step(&session, 1).await;
        program.api.delete(&session).await;
    };
    for _ in 0..5 {
        open_and_delete().await;
    }
    let before = program.threads();
    for _ in 0..150 {
        open_and_delete().await;
    }
    let after = program.threads();
    assert!(after <= before + MARGIN, "{before} threads before 150 sessions, {after} after");
}

/// Rerun's own switch is for programs that log on the side; a session is asked for.
#[tokio::test]
async fn sessions_are_recorded_although_reruns_switch_is_off() {
    let program = Program::serve(&[("RERUN", "off")]);
    let session = program.api.open_quick(1).await;
    assert_eq!(steps(&program.api.step(&session, 2).await["reports"]), [1, 2]);
    let recording = program.api.get(&format!("{session}/recording.rrd")).await.bytes().await.expect("a recording");
    assert_eq!(crate::streams::steps_of_recording(&recording), (0..=2).collect());
}
