//! The program itself as a server: what only a process of its own can show.

use std::{
    io::{BufRead, BufReader, Read},
    path::Path,
    process::{Child, ChildStdout, Command, Stdio},
};

use serde_json::json;

use crate::http::support::{Api, steps};

/// Names the level of the program's log.
pub const LOG: &str = "BODY_SCHEMA_LOG";

/// The program, serving on a port of its own; it is killed when this goes.
pub struct Program {
    process: Child,
    pub api: Api,
    /// What it said when it started.
    pub said: String,
    output: BufReader<ChildStdout>,
}

impl Program {
    pub fn serve(environment: &[(&str, &str)], arguments: &[&str]) -> Self {
        let mut command = Command::new(env!("CARGO_BIN_EXE_body-schema"));
        command.args(["serve", "--bind", "127.0.0.1:0", "--ephemeral"]).args(arguments);
        Self::start(command.envs(environment.iter().copied()))
    }

    /// That keeps nothing.
    pub fn ephemeral() -> Self {
        Self::with(&[])
    }

    /// The same with further arguments.
    pub fn with(arguments: &[&str]) -> Self {
        Self::serve(&[], arguments)
    }

    /// That keeps its sessions in a folder.
    pub fn keeping(folder: &Path) -> Self {
        let mut command = Command::new(env!("CARGO_BIN_EXE_body-schema"));
        Self::start(command.args(["serve", "--bind", "127.0.0.1:0", "--data-dir"]).arg(folder))
    }

    /// Waits until it says where it is, and all that it says beside. It keeps no log, unless it is told to.
    pub fn start(command: &mut Command) -> Self {
        if !command.get_envs().any(|(name, _)| name == LOG) {
            command.env(LOG, "off");
        }
        let mut process = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("the program starts");
        let mut output = BufReader::new(process.stdout.take().expect("its output"));
        let mut said = String::new();
        while !said.contains("kept") {
            assert!(output.read_line(&mut said).expect("a line") > 0, "it ended: {said}");
        }
        let address = said.split_once("http://").and_then(|(_, rest)| rest.split_once('/')).expect("an address").0;
        let api = Api::at(address.parse().expect("an address"));
        Self { process, api, said, output }
    }

    /// The next line that it says.
    pub fn line(&mut self) -> String {
        let mut line = String::new();
        self.output.read_line(&mut line).expect("a line");
        line
    }

    pub fn id(&self) -> u32 {
        self.process.id()
    }

    /// Ends it at once, whatever it is doing.
    pub fn kill(mut self) {
        self.process.kill().expect("killed");
        self.process.wait().expect("it ends");
    }

    /// Asks it to end. Tells its exit code, and what it said on the way.
    #[cfg(unix)]
    pub fn terminate(self) -> (Option<i32>, String) {
        self.signal("TERM");
        self.end()
    }

    #[cfg(unix)]
    pub fn signal(&self, name: &str) {
        let id = self.id().to_string();
        assert!(Command::new("kill").args([&format!("-{name}"), &id]).status().expect("kill").success());
    }

    /// Waits for its end.
    pub fn end(mut self) -> (Option<i32>, String) {
        let mut said = String::new();
        self.output.read_to_string(&mut said).expect("text");
        self.process.stderr.take().expect("its errors").read_to_string(&mut said).expect("text");
        (self.process.wait().expect("it ends").code(), said)
    }

    #[cfg(target_os = "linux")]
    pub fn threads(&self) -> usize {
        self.status("Threads:")
    }

    /// Bytes of memory that it holds, without the program's own text: of that, parts come and go as they are run.
    #[cfg(target_os = "linux")]
    pub fn memory(&self) -> u64 {
        (self.status("RssAnon:") as u64) << 10
    }

    #[cfg(target_os = "linux")]
    pub fn descriptors(&self) -> usize {
        std::fs::read_dir(format!("/proc/{}/fd", self.id())).expect("its descriptors").count()
    }

    #[cfg(target_os = "linux")]
    fn status(&self, name: &str) -> usize {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.id())).expect("its status");
        let line = status.lines().find_map(|line| line.strip_prefix(name)).expect("such a line");
        line.trim().trim_end_matches("kB").trim().parse().expect("a number")
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        // One that has ended by itself is as good.
        drop(self.process.kill());
        drop(self.process.wait());
    }
}

/// A thousand sessions, opened and deleted: as many threads and descriptors as after the tenth, and no more memory for each
/// than what an allocator holds back.
#[cfg(target_os = "linux")]
#[tokio::test]
async fn sessions_leave_nothing_behind() {
    const SESSIONS: u64 = 1000;
    /// Workers and connections come and go; one left behind by each session would be a thousand.
    const MARGIN: usize = 8;
    /// A session of one learner holds ten times as much.
    const KEPT_BYTES: u64 = 8 << 10;
    let program = Program::ephemeral();
    let open_and_delete = async |number: u64| {
        let session = program.api.open(json!({ "scenario": "arm-6dof", "learners": ["random"], "seed": number })).await;
        program.api.step(&session, 1).await;
        program.api.delete(&session).await;
    };
    for number in 0..10 {
        open_and_delete(number).await;
    }
    let before = (program.threads(), program.descriptors(), program.memory());
    for number in 10..SESSIONS {
        open_and_delete(number).await;
    }
    let after = (program.threads(), program.descriptors(), program.memory());
    assert!(after.0 <= before.0 + MARGIN, "threads: {before:?}, then {after:?}");
    assert!(after.1 <= before.1 + MARGIN, "descriptors: {before:?}, then {after:?}");
    assert!(after.2 <= before.2 + SESSIONS * KEPT_BYTES, "memory: {before:?}, then {after:?}");
}

/// Rerun's own switch is for programs that log on the side; a session is asked for.
#[tokio::test]
async fn sessions_are_recorded_although_reruns_switch_is_off() {
    let program = Program::serve(&[("RERUN", "off")], &[]);
    let session = program.api.open_quick(1).await;
    assert_eq!(steps(&program.api.step(&session, 2).await["reports"]), [1, 2]);
    let recording = program.api.get(&format!("{session}/recording.rrd")).await.bytes().await.expect("a recording");
    assert_eq!(crate::http::streams::steps_of_recording(&recording), (0..=2).collect());
}

/// Files that it is started with are scenarios as the built-in ones are, the first in the menu, and run as those that they copy.
#[tokio::test]
async fn files_are_scenarios_of_its_own() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    for name in ["positioner.urdf", "positioner.csv", "positioner.toml"] {
        std::fs::copy(Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios").join(name), at(name)).expect("copied");
    }
    let source = std::fs::read_to_string(at("positioner.toml")).expect("a scenario");
    std::fs::write(at("mine.toml"), source.replacen("name = \"positioner\"", "name = \"mine\"", 1)).expect("written");
    let server = Program::with(&[at("mine.toml").to_str().expect("a plain path")]);
    assert!(server.said.contains("/?scenario=mine"), "{}", server.said);
    let listed = server.api.get_json("/v1/scenarios").await;
    assert_eq!(listed["scenarios"][0]["name"], "mine");
    assert_eq!(listed["scenarios"][1]["name"], "arm-6dof");
    assert!(
        server.api.get_json("/v1/scenarios/mine").await["source"].as_str().expect("text").contains("name = \"mine\"")
    );
    let mut tables = Vec::new();
    for name in ["mine", "positioner"] {
        let session = server.api.open(json!({ "scenario": name, "seed": 3, "learners": ["random"] })).await;
        let made = server.api.step(&session, 5).await;
        tables.push(made["reports"][4]["learners"][0]["metrics"].clone());
    }
    assert!(tables[0].is_object() && tables[0] == tables[1], "{tables:?}");

    // What is wrong with one is said before anything is served.
    std::fs::remove_file(at("positioner.csv")).expect("removed");
    let mut command = Command::new(env!("CARGO_BIN_EXE_body-schema"));
    let output = command.args(["serve", "--bind", "127.0.0.1:0"]).arg(at("mine.toml")).output().expect("it ends");
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("positioner.csv"));
}
