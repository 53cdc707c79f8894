//! No output is an input, and no two outputs are one.

use std::{
    fs,
    path::{Path, PathBuf},
};

use crate::cli::{body_schema, failure};

/// A folder with a calibration, its files, and an arm.
struct Files(tempfile::TempDir);

impl Files {
    fn new() -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let scenarios = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios");
        for name in ["tiago-mocap.toml", "tiago-mocap.csv", "tiago-mocap-1504.csv", "positioner.toml", "positioner.csv"]
            .into_iter()
            .chain(["positioner.urdf", "arm-6dof.toml"])
        {
            fs::copy(scenarios.join(name), folder.path().join(name)).expect("copied");
        }
        Self(folder)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn text(&self, name: &str) -> String {
        self.path(name).to_str().expect("text").to_owned()
    }

    /// All files with what is in them.
    fn contents(&self) -> Vec<(PathBuf, Vec<u8>)> {
        let entries = fs::read_dir(self.0.path()).expect("a folder").map(|entry| entry.expect("an entry").path());
        let mut files: Vec<_> = entries.filter(|path| path.is_file()).collect();
        files.sort();
        files.into_iter().map(|path| (path.clone(), fs::read(path).expect("a file"))).collect()
    }

    /// That a command is refused because of these, and changes nothing.
    fn refuses(&self, command: &[&str], named: &[&str]) {
        let before = self.contents();
        let (code, message) = failure(command);
        assert_eq!(code, 2, "{command:?}: {message}");
        assert!(named.iter().all(|part| message.contains(part)), "{command:?}: {message}");
        assert!(self.contents() == before, "{command:?} has changed a file");
    }
}

#[test]
fn no_output_is_an_input() {
    let files = Files::new();
    let [mocap, table, later, arm] =
        ["tiago-mocap.toml", "tiago-mocap.csv", "tiago-mocap-1504.csv", "arm-6dof.toml"].map(|name| files.text(name));
    let [positioner, urdf, rows] =
        ["positioner.toml", "positioner.urdf", "positioner.csv"].map(|name| files.text(name));
    for option in ["--rrd", "--csv", "--json"] {
        for input in [&mocap, &table, &later] {
            files.refuses(&["run", &mocap, option, input], &[option, input, "name another file"]);
        }
    }
    for option in ["--csv", "--json"] {
        files.refuses(&["compare", &mocap, option, &later], &[option, &later]);
    }
    files.refuses(&["compare", &arm, "--shard", "1/2", "--part", &arm], &["--part", &arm]);
    let sweep = ["sweep", &arm, "--learner", "active", "--set", "filter.measurement_variance_m2=0.001", "--json", &arm];
    files.refuses(&sweep, &["--json", &arm]);
    files.refuses(&["observability", &positioner, "--json", &urdf], &["--json", &urdf]);
    files.refuses(&["calibrate", &positioner, "--json", &rows], &["--json", &rows]);
    files.refuses(&["init", &urdf, &rows, "--out", &urdf], &["--out", &urdf, "name another file"]);
    files.refuses(&["init", &urdf, &rows, "--out", &rows], &["--out", &rows, "name another file"]);
    // What would be refused is said, and nothing is, where nothing is written.
    let said = body_schema(&["init", &urdf, &rows, "--dry-run"]);
    let text = String::from_utf8_lossy(&said.stdout).into_owned();
    assert!(said.status.success() && text.contains("positioner.toml if it were not there already"), "{text}");
    files.refuses(&["init", &urdf, &rows], &["positioner.toml is there already", "--out"]);
    files.refuses(&["repair", &rows, "--out", &rows], &["--out", &rows]);
    files.refuses(&["merge", &rows, "--json", &rows], &["--json", &rows]);
}

#[test]
fn folders_that_are_replaced_hold_no_input() {
    let files = Files::new();
    let folder = files.path("out");
    fs::create_dir(&folder).expect("a folder");
    // All of them have names that a calibration writes.
    for (name, other) in
        [("positioner.toml", "report.md"), ("positioner.urdf", "calibrated.urdf"), ("positioner.csv", "report.json")]
    {
        let text = fs::read_to_string(files.path(name)).expect("text");
        let text = text.replace("positioner.urdf", "calibrated.urdf").replace("positioner.csv", "report.json");
        fs::write(folder.join(other), text).expect("written");
    }
    let (out, file) = (files.text("out"), files.text("out/report.md"));
    files.refuses(&["calibrate", &file, "--out", &out], &["--out", &out, "name another folder"]);
    files.refuses(&["calibrate", &file, "--out", &files.text("out/../out")], &["--out", "name another folder"]);
    files.refuses(&["export", &file, "--force", "--out", &out], &["--out", "name another folder"]);
    let beside = files.text("positioner.toml");
    files.refuses(&["calibrate", &beside, "--out", &out, "--json", &files.text("out/a")], &["--json", "--out"]);
    files.refuses(&["paper", "--out", &out, "--json", &files.text("out/paper.json")], &["--json", "--out"]);
    assert_eq!(fs::read_dir(&folder).expect("a folder").count(), 3);
}

#[cfg(unix)]
#[test]
fn no_way_that_leads_to_an_input_is_an_output() {
    let files = Files::new();
    let arm = files.text("arm-6dof.toml");
    fs::create_dir(files.path("sub")).expect("a folder");
    std::os::unix::fs::symlink("arm-6dof.toml", files.path("soft")).expect("a link");
    std::os::unix::fs::symlink("../soft", files.path("sub/softer")).expect("a link");
    fs::hard_link(files.path("arm-6dof.toml"), files.path("hard")).expect("a link");
    for way in ["soft", "hard", "sub/softer", "sub/../arm-6dof.toml", "./sub/.././soft"] {
        let way = files.text(way);
        files.refuses(&["run", &arm, "--steps", "1", "--csv", &way], &["--csv", &way, &arm]);
        // And read by that way.
        files.refuses(&["run", &way, "--steps", "1", "--json", &arm], &["--json", &arm]);
    }
    // A link to what is no input is written through.
    std::os::unix::fs::symlink("new.csv", files.path("link")).expect("a link");
    files.refuses(
        &["run", &arm, "--steps", "1", "--csv", &files.text("link"), "--json", &files.text("new.csv")],
        &["--csv", "--json"],
    );
    let output = body_schema(&["run", &arm, "--steps", "1", "--csv", &files.text("link")]);
    assert!(output.status.success() && files.path("link").is_symlink() && files.path("new.csv").is_file());
}
