//! The usual clearance beside the meshes of robots.
//!
//! ```sh
//! python -m venv pin && pin/bin/pip install pin==4.1.0 example-robot-data==6.0.0
//! BODY_SCHEMA_PINOCCHIO=pin/bin/python cargo test -p body-schema-ask-tell --test collisions -- --nocapture
//! ```

use std::{collections::BTreeMap, path::Path, process::Command};

use body_schema_ask_tell::{Session, Setup};
use body_schema_robot::{Hulls, Urdf};
use serde::Deserialize;

/// A robot, and where it hits itself.
#[derive(Deserialize)]
struct Robot {
    name: String,
    path: String,
    base: String,
    tips: Vec<String>,
    postures: Vec<Posture>,
}

#[derive(Deserialize)]
struct Posture {
    /// Rad or m.
    positions: BTreeMap<String, f64>,
    meets: bool,
}

/// Of the postures in which a robot hits itself how many are not found, and of the others how many are excluded: shares of 1.
fn judged(robot: &Robot, setup: Setup) -> [f64; 2] {
    let session = Session::open(setup).expect("a session");
    let scenario = session.scenario();
    let constraints = scenario.constraints.as_ref().expect("held apart");
    let (mut wrong, mut count) = ([0.0; 2], [0.0; 2]);
    for Posture { positions, meets } in &robot.postures {
        let posture: Vec<f64> = scenario.robot.names.iter().map(|name| positions[name]).collect();
        let kind = usize::from(!meets);
        count[kind] += 1.0;
        wrong[kind] += f64::from(u8::from(constraints.allow(None, &posture) == *meets));
    }
    [wrong[0] / count[0], wrong[1] / count[1]]
}

#[test]
fn meshes_that_meet_are_found() {
    let Ok(python) = std::env::var("BODY_SCHEMA_PINOCCHIO") else { return eprintln!("not compared with pinocchio") };
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/collisions.py");
    let output = Command::new(&python).arg(script).output().expect("it starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    println!("| robot | hits itself | not found: shapes | capsules | excluded of the rest: shapes | capsules |");
    let mut robots = 0;
    for line in String::from_utf8(output.stdout).expect("text").lines() {
        let robot: Robot = serde_json::from_str(line).expect("JSON");
        let text = std::fs::read_to_string(&robot.path).expect("a file");
        let urdf = Urdf::parse(&text).expect("a URDF");
        let (hulls, unread) =
            Hulls::of_meshes(&urdf, |file| body_schema_files::mesh(Path::new(&robot.path), file).ok());
        let setup = |text: &str| {
            Setup::new(serde_json::json!({ "robot": { "urdf": text, "base": robot.base, "tips": robot.tips } }))
        };
        // A description that says nothing of shapes.
        let bare = text.replace("collision>", "inertial>").replace("<collision", "<inertial");
        let capsules = judged(&robot, setup(&bare));
        let with_shapes = setup(&text).with_shapes(&hulls.unwrap_or_default().to_string());
        let shapes = judged(&robot, with_shapes);
        let hits = robot.postures.iter().filter(|posture| posture.meets).count() as f64 / robot.postures.len() as f64;
        let percent = |share: f64| format!("{:.1} %", 100.0 * share);
        let cells = [hits, shapes[0], capsules[0], shapes[1], capsules[1]].map(percent).join(" | ");
        println!("| {} | {cells} |", robot.name);
        if !unread.is_empty() {
            println!("{}: not read: {unread:?}", robot.name);
        }
        assert!(shapes[0] <= 0.01, "{}: {} are not found", robot.name, percent(shapes[0]));
        robots += 1;
    }
    assert!(robots > 5);
}
