//! A run that is asked to end early, and one that cannot begin.
#![cfg(target_os = "linux")]

use std::{
    path::Path,
    process::{Command, Output, Stdio},
    time::{Duration, Instant},
};

use re_log_encoding::DecoderApp;
use serde_json::Value;

use crate::failure;

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
    let begun = Instant::now();
    while std::fs::metadata(file("run.csv")).map_or(0, |csv| csv.len()) < 20_000 {
        assert!(begun.elapsed() < SOON, "it makes no steps");
        std::thread::sleep(Duration::from_millis(10));
    }
    let sent = Command::new("kill").args([&format!("-{signal}"), &program.id().to_string()]).status();
    assert!(sent.expect("kill").success());
    program.wait_with_output().expect("it ends")
}

fn is_finished(recording: &[u8]) -> bool {
    recording.windows(4).rev().take(64).any(|tail| tail == b"FOOT")
}

#[test]
fn a_run_that_is_asked_to_end_leaves_complete_files_and_says_where_it_was() {
    for (signal, code) in [("INT", 130), ("TERM", 143), ("HUP", 129)] {
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
    }
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
