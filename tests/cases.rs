//! Files that users have, each an instance of a kind of mistake or circumstance: what comes of them.

use std::path::Path;

use body_schema::{
    calibration::{Calibration, Case, Options, Silent, calibrate},
    scenario::{Problem, Scenario, ScenarioError},
};

/// The text of a file of a case.
fn text(case: &str, file: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/cases").join(case).join(file);
    std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// A case, after `changed` has had its files by name.
fn parsed(case: &str, changed: &dyn Fn(&str, String) -> String) -> Result<Scenario, ScenarioError> {
    let open = |file: &str| Ok(changed(file, text(case, file)));
    Scenario::parse("cal.toml", &changed("cal.toml", text(case, "cal.toml")), &open)
}

fn valid(case: &str, changed: &dyn Fn(&str, String) -> String) -> Scenario {
    parsed(case, changed).unwrap_or_else(|error| panic!("{case}: {error}"))
}

/// The only problem of a case.
fn problem(case: &str, changed: &dyn Fn(&str, String) -> String) -> Problem {
    match parsed(case, changed) {
        Err(ScenarioError::Invalid { mut problems, .. }) if problems.len() == 1 => problems.remove(0),
        other => panic!("one problem expected: {:?}", other.map(|scenario| scenario.name)),
    }
}

fn calibrated(scenario: &Scenario) -> Calibration {
    let case = Case::new(scenario).expect("measured");
    calibrate(&case, &Options::default(), &Silent).unwrap_or_else(|error| panic!("{error}"))
}

fn as_it_is(_: &str, text: String) -> String {
    text
}

/// Quaternions whose scalar stands first, by their titles.
#[test]
fn titles_say_which_number_of_a_quaternion_is_which() {
    let held_out = |scenario: &Scenario| calibrated(scenario).report.held_out.expect("folds").after;
    let mean = held_out(&valid("t11-explicit-wxyz", &as_it_is)).mean_deg.expect("rotations");
    assert!(mean < 0.06, "{mean} degrees");
    // In any order in the list, and in capitals in the file.
    let shuffled = |file: &str, text: String| match file {
        "cal.toml" => {
            text.replace(r#"["x", "y", "z", "qw", "qx", "qy", "qz"]"#, r#"["qz", "y", "qw", "x", "qx", "z", "qy"]"#)
        }
        "data.csv" => text.replace("qw,qx,qy,qz", "Qw,QX,qy,Qz"),
        _ => text,
    };
    assert_eq!(held_out(&valid("t11-explicit-wxyz", &shuffled)).mean_deg, Some(mean));
    let twice = |file: &str, text: String| match file {
        "cal.toml" => text.replace(r#""qw", "qx", "qy", "qz"]"#, r#""qx", "qx", "qy", "qz"]"#),
        _ => text,
    };
    let found = problem("t11-explicit-wxyz", &twice);
    assert!(found.what.contains("`qx` and `qx` are both taken for qx, and none is qw"), "{found}");
    assert!(found.mend.contains("name x, y and z, and qx, qy, qz and qw"), "{found}");
}

#[test]
fn titles_say_units() {
    let scenario = valid("t13-columns-cm", &as_it_is);
    let before = calibrated(&scenario).report.training.before.mean_mm.expect("lengths");
    assert!(before < 50.0, "{before} mm");
    let titled = |unit: &'static str| move |_: &str, text: String| text.replace("_cm", unit);
    for (unit, said) in
        [("_ft", "`ft` is no unit"), (" (furlong)", "`furlong` is no unit"), ("_deg", "`deg` is no unit")]
    {
        let found = problem("t13-columns-cm", &titled(unit));
        assert!(found.what.contains(&format!("column `x{unit}`: {said}")), "{found}");
        assert!(found.mend.contains("_m, _cm, _mm, _um, _in"), "{found}");
    }
}

/// Joints have units too.
#[test]
fn joints_are_read_in_their_units() {
    let in_degrees = |file: &str, text: String| {
        if file != "data.csv" {
            return text;
        }
        let mut lines = text.lines();
        let mut table = lines.next().expect("titles").replacen("pan,", "pan (deg),", 1) + "\n";
        for line in lines {
            let (pan, rest) = line.split_once(',').expect("cells");
            table += &format!("{},{rest}\n", pan.parse::<f64>().expect("a number").to_degrees());
        }
        table
    };
    let case = "t13-columns-cm";
    let means = [valid(case, &as_it_is), valid(case, &in_degrees)]
        .map(|scenario| calibrated(&scenario).report.training.before.mean_mm.expect("lengths"));
    assert!((means[0] - means[1]).abs() < 1e-6, "{means:?}");
    for unit in ["_mm", "_grad", "_in"] {
        let titled = |file: &str, text: String| {
            if file == "data.csv" { text.replacen("pan,", &format!("pan{unit},"), 1) } else { text }
        };
        let found = problem(case, &titled);
        assert!(found.what.contains(&format!("column `pan{unit}`")) && found.mend.contains("_rad, _deg"), "{found}");
    }
    // What is measured is no joint.
    let joint = |file: &str, text: String| {
        if file == "cal.toml" { text.replace("\"x_cm\",", "\"pan\",") } else { text }
    };
    assert!(problem(case, &joint).what.contains("`pan` is the column of a joint"));
}
