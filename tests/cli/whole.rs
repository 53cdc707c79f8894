//! What is written is there whole, or not at all.
#![cfg(target_os = "linux")]

use std::{
    fs,
    os::unix::fs::PermissionsExt,
    path::{Path, PathBuf},
    process::{Command, Output, Stdio},
};

use crate::cli::{body_schema, failure, json};

/// Runs the program where no file may grow beyond so many bytes.
fn limited(bytes: u64, arguments: &[&str]) -> Output {
    let mut command = Command::new("prlimit");
    command.arg(format!("--fsize={bytes}:{bytes}")).arg(env!("CARGO_BIN_EXE_body-schema")).args(arguments);
    command.output().expect("prlimit")
}

/// All files below a folder with what is in them.
fn contents(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        match path.is_dir() {
            true => files.extend(contents(&path)),
            false => files.push((path.clone(), fs::read(path).expect("a file"))),
        }
    }
    files.sort();
    files
}

#[test]
fn where_writing_fails_what_was_there_stays_and_the_outcome_is_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let place = |name: &str| folder.path().join(name).to_str().expect("text").to_owned();
    let files = ["a.rrd", "a.csv", "a.json", "part"].map(place);
    files.iter().for_each(|file| fs::write(file, "before").expect("written"));
    let [rrd, csv, json, part] = &files;
    let before = contents(folder.path());
    let compare = ["compare", "arm-6dof", "--learner", "random", "--seeds", "2", "--steps", "30"];
    let set = ["--set", "filter.measurement_variance_m2=0.001,0.002,0.003,0.004,0.005,0.006"];
    let sweep = [&["sweep", "arm-6dof", "--learner", "random", "--seeds", "2", "--steps", "30"], &set[..]].concat();
    let commands: [(Vec<&str>, &[&str], &str); 7] = [
        (vec!["run", "arm-6dof", "--learner", "random", "--steps", "300", "--rrd", rrd], &[rrd], "random"),
        (vec!["run", "arm-6dof", "--learner", "random", "--steps", "300", "--csv", csv], &[csv], "random"),
        (vec!["run", "arm-6dof", "--learner", "random", "--steps", "30", "--json", json], &[json], "random"),
        ([&compare[..], &["--json", json, "--csv", csv]].concat(), &[json, csv], "random"),
        ([&compare[..], &["--shard", "1/1", "--part", part]].concat(), &[part], ""),
        ([&sweep[..], &["--json", json]].concat(), &[json], "best first"),
        (vec!["observability", "positioner", "--postures", "5", "--json", json], &[json], "expected error"),
    ];
    for (command, named, said) in commands {
        let output = limited(1000, &command);
        let [told, out] = [&output.stderr, &output.stdout].map(|text| String::from_utf8_lossy(text));
        assert_eq!(output.status.code(), Some(1), "{command:?}: {told}");
        assert!(named.iter().all(|file| told.contains(file)) && told.contains("os error"), "{command:?}: {told}");
        assert!(out.contains(said), "{command:?} says {out}");
        assert!(contents(folder.path()) == before, "{command:?} has changed a file");
    }
    // What there is room for is written beside what there is none for.
    let output = limited(20_000, &["run", "arm-6dof", "--steps", "300", "--csv", csv, "--json", &place("new.json")]);
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(fs::read(csv).expect("a file"), b"before");
}

#[test]
fn where_a_folder_cannot_be_written_the_earlier_one_stays() {
    let folder = tempfile::tempdir().expect("a folder");
    let place = |name: &str| folder.path().join(name).to_str().expect("text").to_owned();
    let (calibrated, exported) = (place("calibrated"), place("exported"));
    let calibrate = ["calibrate", "positioner", "--out", &calibrated];
    let own = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios/positioner.toml");
    let export = ["export", own.to_str().expect("text"), "--out", &exported];
    for command in [&calibrate[..], &export] {
        let output = body_schema(command);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    }
    fs::write(place("exported/CNAME"), "example.org").expect("written");
    let before = contents(folder.path());
    for (command, out, said) in [(&calibrate[..], &calibrated, "held out, calibrated"), (&export, &exported, "")] {
        let output = limited(2000, command);
        let [told, text] = [&output.stderr, &output.stdout].map(|text| String::from_utf8_lossy(text));
        assert_eq!(output.status.code(), Some(1), "{told}");
        assert!(told.contains(out.as_str()) && text.contains(said), "{told}{text}");
        assert!(contents(folder.path()) == before, "{command:?} has changed a file");
    }
    // A new folder is not begun.
    let new = place("new");
    let output = limited(2000, &["export", "--out", &new]);
    assert!(output.status.code() == Some(1) && !Path::new(&new).exists());
    // Where there is room the new export has the place of the old one, and what was put beside it stays.
    assert!(Path::new(&place("exported/scenarios/positioner")).is_dir());
    assert!(body_schema(&["export", "--out", &exported]).status.success());
    assert!(!Path::new(&place("exported/scenarios")).exists());
    let names: Vec<_> =
        fs::read_dir(&exported).expect("a folder").map(|it| it.expect("an entry").file_name()).collect();
    assert!(names.iter().any(|name| name == "CNAME") && !names.iter().any(|name| name == ".old"), "{names:?}");
    assert!(!names.iter().any(|name| name.to_string_lossy().ends_with(".unfinished")), "{names:?}");
}

/// Each would take hours if it were not noticed first.
#[test]
fn what_cannot_be_written_is_noticed_before_the_work() {
    let folder = tempfile::tempdir().expect("a folder");
    let place = |name: &str| folder.path().join(name).to_str().expect("text").to_owned();
    fs::create_dir(place("folder")).expect("a folder");
    fs::write(place("file"), "mine").expect("written");
    let run = ["run", "arm-6dof", "--steps", "1000000000"];
    let compare = ["compare", "arm-6dof", "--seeds", "1000", "--steps", "1000000"];
    let (nowhere, inside, directory) = (place("none/a"), place("file/a"), place("folder"));
    for place in [&nowhere, &inside, &directory] {
        let commands: [(&[&str], &str); 5] =
            [(&run, "--rrd"), (&run, "--csv"), (&run, "--json"), (&compare, "--json"), (&compare, "--csv")];
        for (command, option) in commands {
            let (code, message) = failure(&[command, &[option, place]].concat());
            assert!(code == 1 && message.contains(place.as_str()), "{command:?} {option} {place}: {message}");
        }
        let (code, message) = failure(&[&compare[..], &["--shard", "1/2", "--part", place]].concat());
        assert!(code == 1 && message.contains(place.as_str()), "{message}");
    }
    let (code, message) = failure(&["calibrate", "tiago-mocap", "--active", "20", "--out", &inside]);
    assert!(code == 1 && message.contains(&inside), "{message}");
    let (code, message) = failure(&["export", "--out", &inside]);
    assert!(code == 1 && message.contains(&inside), "{message}");
    let (code, message) = failure(&["paper", "--out", &inside]);
    assert!(code == 1 && message.contains(&inside), "{message}");
    assert_eq!(contents(folder.path()), [(folder.path().join("file"), b"mine".to_vec())]);
}

#[test]
fn pipes_and_devices_are_written_to_as_they_are() {
    let folder = tempfile::tempdir().expect("a folder");
    let place = |name: &str| folder.path().join(name).to_str().expect("text").to_owned();
    let run = ["run", "arm-6dof", "--learner", "random", "--steps", "2"];
    assert_eq!(json(&[&run[..], &["--json", "/dev/stdout", "--csv", "/dev/null"]].concat())["steps"], 2);
    let output = body_schema(&[&run[..], &["--csv", "/dev/stdout"]].concat());
    assert!(output.status.success() && String::from_utf8_lossy(&output.stdout).contains("step,learner"));
    let fifo = place("fifo");
    assert!(Command::new("mkfifo").arg(&fifo).status().expect("mkfifo").success());
    for option in ["--csv", "--json", "--rrd"] {
        let reader = Command::new("wc").args(["-c", &fifo]).stdout(Stdio::piped()).spawn().expect("wc");
        assert!(body_schema(&[&run[..], &[option, &fifo]].concat()).status.success(), "{option}");
        let counted = String::from_utf8(reader.wait_with_output().expect("it ends").stdout).expect("text");
        let bytes: u64 = counted.split_whitespace().next().and_then(|count| count.parse().ok()).expect("a number");
        assert!(bytes > 100, "{option}: {counted}");
    }
    // Files that are replaced keep their permissions, and new ones have the usual ones.
    let (old, new) = (place("old"), place("new"));
    fs::write(&old, "before").expect("written");
    fs::set_permissions(&old, fs::Permissions::from_mode(0o604)).expect("set");
    assert!(body_schema(&[&run[..], &["--csv", &old, "--json", &new]].concat()).status.success());
    fs::write(place("usual"), "").expect("written");
    let mode = |path: &str| fs::metadata(path).expect("a file").permissions().mode() & 0o777;
    assert_eq!((mode(&old), mode(&new)), (0o604, mode(&place("usual"))));
}
