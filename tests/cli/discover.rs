//! `discover`: from a table to a robot that the other commands take.

use std::{fmt::Write as _, fs, path::Path};

use body_schema::discover::{
    Reading,
    simulated::{Arm, Measured},
};
use serde_json::Value;

use super::{body_schema, failure, json};

/// A table of a simulated arm of four joints, its columns in degrees and millimetres where they are known.
fn table(path: &Path, rows: usize) {
    let mut arm = Arm::random(2041, 4, true, Measured::Pose(0.005), 2e-3);
    let mut titles: Vec<String> = arm.blank.columns.iter().map(|column| column.title.clone()).collect();
    titles.extend(["x", "y", "z", "rx", "ry", "rz"].map(str::to_owned));
    let mut text = titles.join(",") + "\n";
    for _ in 0..rows {
        let positions = arm.draw();
        let row = arm.measure(&positions);
        let Some(Reading::Pose(pose)) = row.readings[0] else { panic!("a pose") };
        let numbers = row.positions.iter().chain(pose.translation.vector.iter()).copied().collect::<Vec<f64>>();
        let turn = pose.rotation.scaled_axis();
        let cells: Vec<String> = numbers.iter().chain(turn.iter()).map(|number| format!("{number:.9}")).collect();
        let _ = writeln!(text, "{}", cells.join(","));
    }
    fs::write(path, text).expect("written");
}

#[test]
fn what_is_discovered_can_be_checked_and_calibrated() {
    let folder = tempfile::tempdir().expect("a folder");
    let place = |name: &str| folder.path().join(name).to_str().expect("text").to_owned();
    table(Path::new(&place("rows.csv")), 50);
    let told = json(&["discover", &place("rows.csv"), "--out", &place("found"), "--json", "-"]);
    assert_eq!((told["explains"].as_bool(), told["sure"].as_bool()), (Some(true), Some(true)), "{told}");
    assert_eq!(told["joints"].as_array().map(Vec::len), Some(4));
    let role = |title: &str| {
        let columns = told["columns"].as_array().expect("columns");
        let column = columns.iter().find(|column| column["title"] == title).expect("a column");
        column["role"].as_str().expect("a role").to_owned()
    };
    assert_eq!((role("encoder_copy").as_str(), role("temperature").as_str()), ("copy", "nothing"));
    let file = place("found/discovered.toml");
    assert!(body_schema(&["check", &file]).status.success());
    let calibrated: Value = json(&["calibrate", &file, "--json", "-"]);
    assert!(calibrated["joints"].as_array().is_some_and(|joints| joints.len() == 4), "{}", calibrated["joints"]);
    // A folder with anything else in it stays as it is.
    fs::write(place("found/notes"), "mine").expect("written");
    let (code, error) = failure(&["discover", &place("rows.csv"), "--out", &place("found")]);
    assert!(code == 2 && error.contains("notes"), "{error}");
}

#[test]
fn a_table_of_titles_asks_for_a_first_movement() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("rows.csv");
    let file = path.to_str().expect("text").to_owned();
    fs::write(&path, "a_deg,b_mm,time,x,y,z,rx,ry,rz\n").expect("written");
    let ask = || json(&["discover", &file, "--limits", "a_deg=-90..90,b_mm=0..300", "--next", "--json", "-"]);
    let first = ask();
    assert_eq!((first["positions"]["a_deg"].as_f64(), first["positions"]["b_mm"].as_f64()), (Some(0.0), Some(150.0)));
    fs::write(&path, "a_deg,b_mm,time,x,y,z,rx,ry,rz\n0,150,1,0,0,0,0,0,0\n").expect("written");
    let second = ask();
    assert_eq!(
        (second["positions"]["a_deg"].as_f64(), second["positions"]["b_mm"].as_f64()),
        (Some(63.0), Some(150.0))
    );
    let (code, error) = failure(&["discover", &file, "--limits", "c=0..1", "--next"]);
    assert!(code == 2 && error.contains("`c`"), "{error}");
    let (code, error) = failure(&["discover", &file]);
    assert!(code == 2 && error.contains("1 rows"), "{error}");
    fs::write(&path, "a,b\n1,2\n").expect("written");
    let (code, error) = failure(&["discover", &file]);
    assert!(code == 2 && error.contains("x, y and z"), "{error}");
}
