//! A run that is asked to end early, and one that cannot begin.
#![cfg(target_os = "linux")]

use std::{
    path::Path,
    process::{Child, Command, Output, Stdio},
    time::{Duration, Instant},
};

use re_log_encoding::DecoderApp;
use serde_json::Value;

use crate::cli::{failure, heard::is_heard};

/// Whatever takes longer than this hangs.
const SOON: Duration = Duration::from_secs(60);

/// A run of more steps than anyone waits for, which is sent a signal once its files grow.
fn interrupted(folder: &Path, signal: &str, more: &[&str]) -> Output {
    let file = |name: &str| folder.join(name).to_str().expect("text").to_owned();
    let program = Command::new(env!("CARGO_BIN_EXE_body-schema"))
        .args(["run", "arm-6dof", "--learner", "random", "--steps", "1000000", "--rrd", &file("run.rrd")])
        .args(["--csv", &file("run.csv"), "--json", &file("run.json")])
        .args(more)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts");
    // Under names of their own until they are whole.
    let lengths = || std::fs::read_dir(folder).expect("a folder").map(|entry| entry.and_then(|it| it.metadata()));
    wait("steps", || lengths().filter(|file| file.as_ref().is_ok_and(|file| file.len() > 20_000)).count() >= 2);
    send(&program, signal);
    program.wait_with_output().expect("it ends")
}

fn wait(what: &str, mut is_there: impl FnMut() -> bool) {
    let begun = Instant::now();
    while !is_there() {
        assert!(begun.elapsed() < SOON, "there are no {what}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

fn send(program: &Child, signal: &str) {
    let sent = Command::new("kill").args([&format!("-{signal}"), &program.id().to_string()]).status();
    assert!(sent.expect("kill").success());
}

fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).expect("a folder");
    let mut names: Vec<String> =
        entries.map(|entry| entry.expect("an entry").file_name().into_string().expect("text")).collect();
    names.sort();
    names
}

fn is_finished(recording: &[u8]) -> bool {
    recording.windows(4).rev().take(64).any(|tail| tail == b"FOOT")
}

#[test]
fn a_run_that_is_asked_to_end_leaves_complete_files_and_says_where_it_was() {
    let signals = [("INT", 130), ("TERM", 143), ("HUP", 129)];
    for (signal, code) in signals.into_iter().filter(|(signal, _)| is_heard(signal)) {
        let folder = tempfile::tempdir().expect("a folder");
        let output = interrupted(folder.path(), signal, &[]);
        let told = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{told}");
        let result = std::fs::read(folder.path().join("run.json")).expect("the result");
        let result: Value = serde_json::from_slice(&result).expect("JSON");
        let steps = result["steps"].as_u64().expect("steps");
        assert!(told.contains(&format!("at step {steps} of 1000000")), "{told}");
        let recording = std::fs::read(folder.path().join("run.rrd")).expect("the recording");
        assert!(is_finished(&recording), "{signal}: a footer");
        assert!(DecoderApp::decode_eager(std::io::Cursor::new(recording)).expect("a recording").all(|m| m.is_ok()));
        let table = std::fs::read_to_string(folder.path().join("run.csv")).expect("the table");
        assert!(table.lines().last().expect("rows").starts_with(&format!("{steps},")), "{signal}");
        assert_eq!(names(folder.path()), ["run.csv", "run.json", "run.rrd"]);
    }
}

#[test]
fn what_is_asked_to_end_leaves_nothing_that_is_not_whole() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = |name: &str| folder.path().join(name).to_str().expect("text").to_owned();
    let (part, export) = (file("part"), file("export"));
    let compare = ["compare", "arm-6dof", "--seeds", "1000", "--steps", "100000", "--shard", "1/1", "--part", &part];
    // Whose viewer takes its time to be compressed.
    let commands: [&[&str]; 2] = [&compare, &["export", "--out", &export]];
    for (command, (signal, code)) in commands.into_iter().zip([("INT", 130), ("TERM", 143)]) {
        let mut program = Command::new(env!("CARGO_BIN_EXE_body-schema"))
            .args(command)
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .expect("the program starts");
        wait("files", || names(folder.path()).iter().any(|name| name.ends_with(".unfinished")));
        send(&program, signal);
        assert_eq!(program.wait().expect("it ends").code(), Some(code), "{command:?}");
        assert_eq!(names(folder.path()), [""; 0], "{command:?}");
    }
}

/// As `nohup` has it.
#[test]
fn a_terminal_that_goes_ends_nothing_that_was_started_to_stay() {
    let folder = tempfile::tempdir().expect("a folder");
    let part = folder.path().join("part");
    let mut program = Command::new("sh")
        .args(["-c", "trap '' HUP; exec \"$0\" \"$@\"", env!("CARGO_BIN_EXE_body-schema")])
        .args(["compare", "arm-6dof", "--seeds", "1000", "--steps", "100000", "--shard", "1/1", "--part"])
        .arg(&part)
        .stderr(Stdio::null())
        .spawn()
        .expect("the program starts");
    wait("files", || !names(folder.path()).is_empty());
    send(&program, "HUP");
    std::thread::sleep(Duration::from_millis(300));
    assert!(program.try_wait().expect("a program").is_none(), "it has ended");
    send(&program, "INT");
    assert_eq!(program.wait().expect("it ends").code(), Some(130));
}

#[test]
fn what_cannot_begin_leaves_no_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let recording = folder.path().join("run.rrd");
    let path = recording.to_str().expect("text");
    let nowhere = folder.path().join("none/run.csv");
    let run = ["run", "arm-6dof", "--learner", "random", "--steps", "2", "--rrd", path];
    let (code, told) = failure(&[&run[..], &["--csv", nowhere.to_str().expect("text")]].concat());
    assert!(code == 1 && told.contains("run.csv"), "{told}");
    assert!(!recording.exists(), "an empty recording is left");
    // Nor one that there is no room to begin.
    let mut full = Command::new("prlimit");
    full.arg("--fsize=0:0").args(["sh", "-c", "trap '' XFSZ; exec \"$0\" \"$@\""]);
    let output = full.arg(env!("CARGO_BIN_EXE_body-schema")).args(run).output().expect("the program");
    assert_eq!(output.status.code(), Some(1), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(!recording.exists(), "an empty recording is left");
    // A device is nobody's to remove.
    let (code, _) = failure(&["run", "arm-6dof", "--learner", "random", "--steps", "2", "--rrd", "/dev/full"]);
    assert!(code == 1 && Path::new("/dev/full").exists());
}
