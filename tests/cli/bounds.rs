//! What is beyond all measure is refused.

use std::{
    fs::{self, File},
    io::Write,
    path::Path,
    process::Command,
};

use flate2::{Compression, write::GzEncoder};

use crate::cli::{body_schema, failure};

/// A calibration, and what its table is replaced by.
fn with_table(folder: &Path, table: impl FnOnce(&Path)) -> String {
    let scenarios = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios");
    for name in ["positioner.toml", "positioner.urdf", "positioner.csv"] {
        fs::copy(scenarios.join(name), folder.join(name)).expect("copied");
    }
    table(&folder.join("positioner.csv"));
    folder.join("positioner.toml").to_str().expect("text").to_owned()
}

#[test]
fn what_is_too_long_is_not_read() {
    let folder = tempfile::tempdir().expect("a folder");
    let holed = |path: &Path, mebibytes: u64| {
        File::create(path).and_then(|file| file.set_len((mebibytes << 20) + 1)).expect("a file with a hole");
    };
    let file = with_table(folder.path(), |table| holed(table, 512));
    let (code, told) = failure(&["check", &file]);
    assert!(code == 2 && told.contains("positioner.csv has 513 MiB, and 512 MiB at most are read"), "{told}");
    let file = with_table(folder.path(), |table| {
        let text = fs::read_to_string(table).expect("text");
        let row = text.lines().nth(1).expect("a row").to_owned() + "\n";
        fs::write(table, text + &row.repeat(1_000_000)).expect("written");
    });
    let (code, told) = failure(&["check", &file]);
    assert!(code == 2 && told.contains("positioner.csv has more than 1000000 rows"), "{told}");
    for name in ["a.toml", "a.urdf"] {
        let path = folder.path().join(name);
        holed(&path, 16);
        let path = path.to_str().expect("text");
        let command = if name == "a.toml" { vec!["check", path] } else { vec!["init", path, &file] };
        let (code, told) = failure(&command);
        assert!(code == 2 && told.contains("has 17 MiB, and 16 MiB at most are read"), "{told}");
    }

    let part = folder.path().join("part");
    holed(&part, 256);
    let merge = ["merge", part.to_str().expect("text")];
    let (code, told) = failure(&merge);
    assert!(code == 2 && told.contains("longer than 256 MiB"), "{told}");
    // Little that unpacks to much.
    let mut packed = GzEncoder::new(File::create(&part).expect("a file"), Compression::fast());
    let blanks = vec![b' '; 1 << 20];
    (0..257).for_each(|_| packed.write_all(&blanks).expect("written"));
    packed.finish().expect("written");
    assert!(fs::metadata(&part).expect("a file").len() < 4 << 20);
    let (code, told) = failure(&merge);
    assert!(code == 2 && told.contains("longer than 256 MiB"), "{told}");
}

#[test]
fn no_number_is_without_end() {
    const GREAT: &str = "18446744073709551615";
    for command in [
        &["serve", "--max-sessions", GREAT][..],
        &["serve", "--max-memory", GREAT],
        &["run", "arm-6dof", "--steps", GREAT],
        &["compare", "arm-6dof", "--steps", GREAT],
        &["calibrate", "positioner", "--folds", GREAT],
        &["calibrate", "positioner", "--active", GREAT],
        &["export", "arm-6dof", "--out", "x", "--steps", GREAT],
        &["observability", "positioner", "--accuracy", GREAT],
    ] {
        let (code, told) = failure(command);
        assert!(code == 2 && told.contains(GREAT) && !told.contains("panicked"), "{command:?}: {told}");
    }
    let values = vec!["1"; 101].join(",");
    let [one, two] = ["a", "b"].map(|key| format!("filter.{key}={values}"));
    let (code, told) = failure(&["sweep", "arm-6dof", "--learner", "active", "--set", &one, "--set", &two]);
    assert!(code == 2 && told.contains("more than 10000 points"), "{told}");
}

#[test]
fn names_lead_nowhere() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("my.toml");
    let toml = include_str!("../../scenarios/arm-6dof.toml");
    for name in ["..", ".", "../up", "a/b", "/root", "-x", ".hidden", ""] {
        fs::write(&path, toml.replacen("name = \"arm-6dof\"", &format!("name = \"{name}\""), 1)).expect("written");
        let (code, told) = failure(&["check", path.to_str().expect("text")]);
        assert!(code == 2 && told.contains("cannot be a name"), "{name}: {told}");
    }
}

#[test]
fn tables_hold_no_formulas() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name).to_str().expect("text").to_owned();
    let toml = include_str!("../../scenarios/arm-6dof.toml").replacen("name = \"random\"", "name = \"-a\"", 1);
    fs::write(path("my.toml"), toml.replace("\nrandom = 405", "")).expect("written");
    let (file, csv) = (path("my.toml"), path("a.csv"));
    for command in [&["run", &file][..], &["compare", &file, "--seeds", "1"]] {
        let output = body_schema(&[command, &["--learner=-a", "--steps", "1", "--csv", &csv]].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let table = fs::read_to_string(&csv).expect("a table");
        assert!(table.contains("'-a,") && !table.contains("\n-a"), "{table}");
    }
}

#[test]
fn help_is_whole_and_as_wide_as_the_terminal() {
    let text = |arguments: &[&str]| String::from_utf8(body_schema(arguments).stdout).expect("text");
    let help = text(&["repair", "--help"]);
    assert!(
        ["Exit code 0 if everything is whole", "a copy aside", "--check"].iter().all(|part| help.contains(part)),
        "{help}"
    );
    for command in ["serve", "run", "compare", "calibrate", "repair", "export", "sweep", "init", "paper"] {
        let mut program = Command::new(env!("CARGO_BIN_EXE_body-schema"));
        let help = program.args([command, "--help"]).env("COLUMNS", "72").output().expect("it starts").stdout;
        let help = String::from_utf8(help).expect("text");
        // Usage is a line of its own.
        let long = help.lines().filter(|line| !line.contains("body-schema ")).find(|line| line.chars().count() > 72);
        assert_eq!(long, None, "{command}");
    }
}

#[test]
fn lines_are_told_with_their_files() {
    let output = body_schema(&["check", "tiago-mocap"]);
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    let mut lines = told.lines().filter(|line| line.contains("line"));
    assert!(lines.clone().count() > 0, "{told}");
    assert!(
        lines.all(|line| line.contains("tiago-mocap-1504.csv: line") || line.contains("tiago-mocap.csv: line")),
        "{told}"
    );
}
