//! Small files of people who calibrate robots, each an instance of a kind: what becomes of them from the first calibration file to
//! the rows that are learned from.

use std::{f64::consts::TAU, fs};

use body_schema::{
    ask_tell::{Ask, Session, Setup},
    calibration::{Sources, begin},
    robot::Urdf,
    scenario::{Scenario, WorldSpec},
};

/// A file of a case.
fn text(case: &str, file: &str) -> String {
    let path = format!("{}/tests/cases/{case}/{file}", env!("CARGO_MANIFEST_DIR"));
    fs::read_to_string(&path).unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// The calibration file that is begun, or what is said.
fn begun(case: &str, base: Option<&str>, tip: Option<&str>) -> Result<String, String> {
    let (urdf, table) = (text(case, "robot.urdf"), text(case, "data.csv"));
    let sources = Sources {
        name: case,
        urdf_file: "robot.urdf",
        urdf: &urdf,
        shapes_file: None,
        table_file: "data.csv",
        table: &table,
        base,
        tip,
        on: &[],
        tag_side_m: None,
        socket_distance_m: None,
    };
    begin(&sources).map(|begun| begun.text).map_err(|error| error.to_string())
}

/// The scenario of it.
fn scenario(case: &str, calibration: &str) -> Scenario {
    let parsed = Scenario::parse("cal.toml", calibration, &|file| Ok(text(case, file)));
    parsed.unwrap_or_else(|error| panic!("{case}: {error}"))
}

/// How many rows are learned from, and where joints are moved.
fn read(case: &str, base: Option<&str>, tip: Option<&str>) -> (usize, Vec<(f64, f64)>) {
    let calibration = begun(case, base, tip).unwrap_or_else(|error| panic!("{case}: {error}"));
    let scenario = scenario(case, &calibration);
    let WorldSpec::Measured { measurements, .. } = &scenario.world else { panic!("{case}: measured") };
    let limits = scenario.robot.limits.joints().to_vec();
    (measurements.rows(), limits)
}

#[test]
fn what_others_read_is_read() {
    for (case, rows) in [
        ("u01-drake-prefix", 12),
        ("u02-blank-before-declaration", 12),
        ("u03-limits-1e16", 12),
        ("u04-leftover-xacro-in-visual", 12),
        ("u08a-revolute-999999", 15),
        ("t14c-gantry-x-and-x_mm", 14),
        ("t10-nan-row", 13),
        ("t10b-na", 13),
        ("t10c-none", 13),
    ] {
        let (found, limits) = read(case, None, None);
        assert_eq!(found, rows, "{case}");
        assert!(limits.iter().all(|(lower, upper)| -TAU <= *lower && *upper <= TAU), "{case}: {limits:?}");
        let urdf = Urdf::parse(&text(case, "robot.urdf")).expect("a URDF");
        let mut chain = urdf.chain("base_link", "tool0").expect("a chain");
        assert_eq!(urdf.written(&chain), text(case, "robot.urdf"), "{case}");
        chain.segments[1].origin.translation.vector.x = 0.125;
        assert_eq!(urdf.written(&chain).matches("0.125").count(), 1, "{case}");
    }
    read("u05-floating-root", Some("base_link"), None);
    read("n03-dual-arm", None, Some("rl6"));
}

/// Joints that are called as coordinates are, in a file without sensors.
#[test]
fn the_columns_of_joints_are_not_measured() {
    let urdf = text("t14c-gantry-x-and-x_mm", "robot.urdf");
    let file = "name = \"gantry\"\n[robot]\nurdf = \"robot.urdf\"\nbase = \"base_link\"\ntip = \"tool0\"\n[measurements]\nfile = \"data.csv\"\n";
    for titles in ["x,y,z,tool_x,tool_y,tool_z", "x_mm,y_mm,z_m,tool_x_mm,tool_y_mm,tool_z_mm"] {
        let rows: String = (0..9).map(|row| format!("0.{row},0.{},-0.2,0.3,0.{row},1\n", 9 - row)).collect();
        let table = format!("{titles}\n{rows}");
        let open = |name: &str| Ok(if name == "robot.urdf" { urdf.clone() } else { table.clone() });
        let scenario = Scenario::parse("gantry.toml", file, &open).unwrap_or_else(|error| panic!("{error}"));
        let targets: Vec<&str> = scenario.robot.equipment.targets.iter().map(|target| target.name.as_str()).collect();
        assert_eq!(targets, ["tool"], "{titles}");
    }
}

#[test]
fn what_is_not_taken_is_named() {
    for (case, said) in [
        ("u05-floating-root", &["joint `free` between `world` and `base_link` is floating", "--base base_link"][..]),
        ("u06-no-limit-first", &["line 6", "joint `a` has no <limit>"]),
        ("u09-limits-zero", &["line 11", "joint `a`: it cannot move, as its limits are both 0"]),
        ("n03-dual-arm", &["to `ll6` by lift, l1", "to `rl6` by lift, r1", "--tip ll6 or --tip rl6"]),
        ("t03-semicolon-decimal-comma", &["data.csv: line 1: the columns are separated by semicolons"]),
    ] {
        let error = begun(case, None, None).expect_err(case);
        said.iter().for_each(|said| assert!(error.contains(said), "{case}: {error}"));
    }
}

#[test]
fn a_session_asks_for_no_more_than_a_turn() {
    let mut session =
        Session::open(Setup::from_urdf(&text("u08a-revolute-999999", "robot.urdf"), None, None)).expect("a session");
    let ask = Ask { count: Some(3), ..Ask::default() };
    for suggestion in session.suggest(&ask, None).expect("suggestions").suggestions {
        assert!(suggestion.configuration.values().all(|q| q.abs() <= TAU), "{suggestion:?}");
    }
    let still = Session::open(Setup::from_urdf(&text("u09-limits-zero", "robot.urdf"), None, None));
    let error = still.map(drop).expect_err("it cannot move").to_string();
    assert!(error.contains("joint `a`: it cannot move, as its limits are both 0"), "{error}");
}

/// A link that no joint names, and a table beside the robot, are no part of it.
#[test]
fn a_session_begins_where_its_tip_hangs() {
    let urdf = text("u01-drake-prefix", "robot.urdf");
    for (beside, tip) in [
        ("<link name=\"orphan\"/>", None),
        (
            "<link name=\"table\"/><link name=\"leg\"/><joint name=\"t\" type=\"fixed\"><parent link=\"table\"/><child link=\"leg\"/></joint>",
            Some("tool0"),
        ),
    ] {
        let with = urdf.replacen("<link name=\"base_link\"/>", &format!("{beside}<link name=\"base_link\"/>"), 1);
        let opened = Session::open(Setup::from_urdf(&with, None, tip)).map(drop);
        opened.unwrap_or_else(|error| panic!("{beside}: {error}"));
    }
}

/// Rows that are held out are those of the file: a line without a reading before them moves none.
#[test]
fn rows_are_held_out_by_their_numbers_in_the_file() {
    let case = "t10-nan-row";
    let calibration = begun(case, None, None).expect("begun").replace("folds = 5", "rows = [4, 5]");
    let scenario = scenario(case, &calibration);
    let WorldSpec::Measured { measurements, held_out, .. } = &scenario.world else { panic!("{case}: measured") };
    let lines: Vec<usize> = held_out.split(1).1.into_iter().map(|row| measurements.lines[row]).collect();
    // Row 4 is line 6, of which nothing was measured.
    assert_eq!(lines, [7]);
}
