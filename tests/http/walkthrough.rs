//! The walk-through of docs/ask-and-tell.md, as it stands there.

use std::process::Command;

use serde_json::Value;

use crate::http::program::Program;

/// The shell's lines of a document, but for those that start the server.
fn shell(document: &str) -> String {
    let blocks = document.split("```sh\n").skip(1).filter_map(|rest| rest.split_once("```")).map(|(block, _)| block);
    blocks.filter(|block| !block.starts_with("body-schema serve")).collect()
}

#[test]
fn the_walk_through_works_as_it_is_written() {
    let has = |program: &str| Command::new(program).arg("--version").output().is_ok();
    if !(has("curl") && has("python3") && has("sh")) {
        eprintln!("skipped: there is no curl, no python3 or no sh");
        return;
    }
    let program = Program::ephemeral();
    let document = include_str!("../../docs/ask-and-tell.md");
    let lines = shell(document).replace("http://127.0.0.1:8080", &format!("http://{}", program.api.address));
    let folder = tempfile::tempdir().expect("a folder");
    let walked = Command::new("sh").args(["-euc", &lines]).current_dir(folder.path()).output().expect("a shell");
    assert!(walked.status.success(), "{}", String::from_utf8_lossy(&walked.stderr));
    let read = |file: &str| std::fs::read_to_string(folder.path().join(file)).expect("a file");
    let json = |file: &str| serde_json::from_str::<Value>(&read(file)).expect("JSON");
    assert_eq!(json("status.json")["status"]["observations"], 8);
    assert_eq!(json("answer.json")["observation"], 8);
    assert!(json("answer.json")["expected_error_mm"].as_f64().expect("a number") < 2.0);
    assert!(read("model.urdf").contains("<joint name=\"elbow\""));
}
