//! The Python package against this server. Which Python has it `BODY_SCHEMA_PYTHON` says (`pip install ./python`); without that
//! variable `python3` may lack it.

use std::process::Command;

use serde_json::Value;

use crate::http::program::Program;

/// A Python that has the package, if there is one.
fn python() -> Option<String> {
    let asked = std::env::var("BODY_SCHEMA_PYTHON");
    let python = asked.clone().unwrap_or_else(|_| "python3".to_owned());
    let has = Command::new(&python).args(["-c", "import body_schema"]).output();
    if has.is_ok_and(|output| output.status.success()) {
        return Some(python);
    }
    assert!(asked.is_err(), "{python} has no body_schema");
    eprintln!("skipped: {python} has no body_schema");
    None
}

/// What a script prints.
fn run(command: &mut Command) -> String {
    let output = command.output().expect("it starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("text")
}

/// Told the same, step by step or as a list of events, the package and the server believe the same.
#[test]
fn package_and_server_hold_the_same_belief() {
    let Some(python) = python() else { return };
    let program = Program::ephemeral();
    let url = format!("http://{}", program.api.address);
    let printed = run(Command::new(python).args(["tests/http/same_belief.py", &url, "scenarios/panda.urdf"]));
    let found: Value = serde_json::from_str(&printed).expect("JSON");
    // Seven axes, a base and a marker, and the covariance of all that is learned.
    assert!(found["numbers"].as_u64().expect("a number") > 1000, "{found}");
    for what in ["beliefs_apart", "statuses_apart", "suggestions_apart"] {
        assert!(found[what].as_f64().expect("a number") <= 1e-12, "{found}");
    }
    let status = &found["status"];
    assert_eq!((&status["observations"], &status["excluded"]), (&13.into(), &serde_json::json!([4])), "{found}");
}

/// The example that needs nothing but Python and a server.
#[test]
fn the_example_of_a_client_calibrates_its_robot() {
    if Command::new("python3").arg("--version").output().is_err() {
        eprintln!("skipped: there is no python3");
        return;
    }
    let program = Program::ephemeral();
    let url = format!("http://{}", program.api.address);
    let folder = tempfile::tempdir().expect("a folder");
    let urdf = folder.path().join("calibrated.urdf");
    let printed = run(Command::new("python3").args(["examples/http_client.py", "--url", &url, "--out"]).arg(&urdf));
    assert!(printed.contains("enough"), "{printed}");
    assert!(std::fs::read_to_string(urdf).expect("a file").contains("<joint name=\"elbow\""));
}
