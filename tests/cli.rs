//! The command line as a user meets it.

mod bounds;
mod closed;
mod discover;
pub(crate) mod heard;
mod inputs;
mod interrupted;
mod merge;
pub(crate) mod watch;
mod whole;

use std::process::{Command, Output};

use serde_json::Value;

fn body_schema(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_body-schema")).args(arguments).output().expect("the program starts")
}

fn json(arguments: &[&str]) -> Value {
    let output = body_schema(arguments);
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("standard output holds JSON only")
}

/// Exit code and standard error.
fn failure(arguments: &[&str]) -> (i32, String) {
    let output = body_schema(arguments);
    (output.status.code().expect("an exit code"), String::from_utf8_lossy(&output.stderr).into_owned())
}

#[test]
fn compare_writes_the_documented_json() {
    let value = json(&["compare", "arm-6dof", "--seeds", "2", "--steps", "30", "--json", "-"]);
    assert_eq!((value["scenario"].as_str(), value["steps"].as_u64()), (Some("arm-6dof"), Some(30)));
    let learners = value["learners"].as_array().expect("learners");
    let names: Vec<_> = learners.iter().map(|learner| learner["name"].as_str().expect("a name")).collect();
    assert_eq!(names, ["active", "random", "gradient"]);
    for learner in learners {
        let runs = learner["runs"].as_array().expect("runs");
        assert_eq!(runs.iter().map(|run| run["seed"].as_u64()).collect::<Vec<_>>(), [Some(1), Some(2)]);
        for run in runs {
            assert!(run["converged_at"].is_null() || run["converged_at"].is_u64());
            assert_eq!((run["movements"].as_u64(), run["misses"].as_u64()), (Some(30), Some(0)));
            for error in ["orientation_deg", "axis_deg", "location_m", "prediction_m", "prediction_mean_m"] {
                assert!(run["final"][error].is_f64(), "{error}");
            }
        }
        for key in ["runs", "converged", "median_converged_at", "p90_converged_at", "max_converged_at"] {
            assert!(learner["summary"].get(key).is_some(), "{key}");
        }
        let curve = learner["curve"].as_array().expect("a curve");
        assert_eq!(curve.len(), 31);
        for (movements, point) in curve.iter().enumerate() {
            assert_eq!(point["movements"].as_u64(), Some(movements as u64));
            for quantile in ["mean", "median", "q25", "q75"] {
                assert!(point["orientation_deg"][quantile].is_f64() && point["prediction_mean_m"][quantile].is_f64());
            }
        }
        assert!(learner["selection_ms"]["median"].is_f64() && learner["selection_ms"]["p95"].is_f64());
    }
}

#[test]
fn the_same_command_gives_the_same_outcome_with_one_and_with_two_threads() {
    let outcome = |threads: &str| {
        let command = ["compare", "arm-6dof", "--seeds", "5..8", "--steps", "60", "--threads", threads, "--json", "-"];
        let mut value = json(&command);
        for learner in value["learners"].as_array_mut().expect("learners") {
            learner.as_object_mut().expect("an object").remove("selection_ms");
        }
        value
    };
    let one = outcome("1");
    assert_eq!(one, outcome("2"));
    assert_eq!(one, outcome("2"));
}

#[test]
fn a_recording_that_is_asked_for_is_written_although_reruns_switch_is_off() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("a.rrd");
    let output = Command::new(env!("CARGO_BIN_EXE_body-schema"))
        .args(["run", "arm-6dof", "--steps", "2", "--rrd"])
        .arg(&file)
        .env("RERUN", "off")
        .output()
        .expect("the program starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let bytes = std::fs::read(&file).expect("a recording");
    let messages = re_log_encoding::DecoderApp::decode_eager(std::io::Cursor::new(bytes)).expect("a stream");
    let messages: Vec<_> = messages.collect::<Result<_, _>>().expect("a whole recording");
    assert!(messages.iter().any(|message| message.store_id().is_recording()), "data");
    assert!(messages.iter().any(|message| message.store_id().is_blueprint()), "an arrangement of views");
}

#[test]
fn run_writes_all_that_it_is_asked_for() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name).to_str().expect("a plain path").to_owned();
    let (rrd, csv) = (path("a.rrd"), path("a.csv"));
    let result = json(&[
        "run",
        "tiago-mocap",
        "--learner",
        "active",
        "--learner",
        "random",
        "--seed",
        "4",
        "--steps",
        "9",
        "--rrd",
        &rrd,
        "--csv",
        &csv,
        "--json",
        "-",
    ]);
    assert_eq!((result["scenario"].as_str(), result["seed"].as_u64()), (Some("tiago-mocap"), Some(4)));
    let learners = result["learners"].as_array().expect("learners");
    assert_eq!(learners.len(), 2);
    for learner in learners {
        assert_eq!((learner["estimator"].as_str(), learner["metrics"]["movements"].as_u64()), (Some("rls"), Some(9)));
        assert!(learner["converged_at"].is_null() && learner["metrics"]["orientation_deg"].is_null());
        let covariance = learner["model"]["covariance"].as_array().expect("a covariance");
        assert_eq!(covariance.len(), 39);
        let coordinates = |part: &Value| part["coordinates"].as_array().expect("indices").len();
        let joints = learner["model"]["joints"].as_array().expect("joints");
        assert_eq!(joints.iter().map(coordinates).sum::<usize>() + coordinates(&learner["model"]["marker"]), 33);
        let others = learner["model"]["others"].as_array().expect("parts");
        assert_eq!((others.len(), others[0]["what"].as_str(), coordinates(&others[0])), (1, Some("Base"), 6));
    }
    let rows = std::fs::read_to_string(&csv).expect("a table").lines().count();
    assert_eq!(rows, 1 + 2 * 10, "a header, and steps 0 to 9 of two learners");
    assert!(std::fs::metadata(&rrd).expect("a recording").len() > 10_000);
}

#[test]
fn a_run_ends_as_soon_as_every_learner_is_settled_and_says_why() {
    let command = ["run", "arm-6dof", "--learner", "global", "--seed", "3", "--until", "settled"];
    let result = json(&[&command[..], &["--json", "-"]].concat());
    let (steps, settled) = (result["steps"].as_u64().expect("steps"), result["learners"][0]["settled_at"].as_u64());
    assert!(settled == Some(steps) && steps < 40, "{steps} {settled:?}");
    let said = |arguments: &[&str]| String::from_utf8_lossy(&body_schema(arguments).stdout).into_owned();
    let text = said(&command);
    assert!(text.contains(&format!("stopped after {steps} movements")) && text.contains("25 mm"), "{text}");
    let text = said(&[&command[..], &["--steps", "3"]].concat());
    assert!(text.contains("made all 3 movements") && text.contains("not settled"), "{text}");
}

#[test]
fn the_limits_stand_beside_the_learners() {
    let command =
        ["compare", "arm-6dof", "--learner", "active", "--learner", "random", "--seeds", "2", "--steps", "12"];
    let plain = json(&[&command[..], &["--json", "-"]].concat());
    assert_eq!(plain["movements_by_counting"], 8);
    assert!(
        plain["best_designs"].as_array().is_some_and(Vec::is_empty) && plain["learners"][0]["efficiency"].is_null()
    );
    let value = json(&[&command[..], &["--limits", "--json", "-"]].concat());
    let designs = value["best_designs"].as_array().expect("designs");
    assert_eq!(designs.iter().map(|design| design["movements"].as_u64()).collect::<Vec<_>>(), [5, 10, 12].map(Some));
    let best = designs[2]["best_design_trace"].as_f64().expect("a trace");
    assert!(designs.iter().all(|design| design["gap"].as_f64().is_some_and(|gap| (0.0..=0.01).contains(&gap))));
    for learner in value["learners"].as_array().expect("learners") {
        let bound = learner["curve"][12]["bound_trace"]["median"].as_f64().expect("a bound");
        let efficiency = learner["efficiency"].as_f64().expect("an efficiency");
        assert!((efficiency - best / bound).abs() < 1e-9 && (0.0..1.0).contains(&efficiency), "{efficiency}");
        assert!(learner["runs"][0]["final"]["bound_trace"].is_f64());
    }
    let text = String::from_utf8_lossy(&body_schema(&[&command[..], &["--limits"]].concat()).stdout).into_owned();
    for part in ["equations as unknowns: 8", "best possible design of 12 movements", "random "] {
        assert!(text.contains(part), "{text}");
    }
    let run = json(&["run", "tiago-mocap", "--learner", "random", "--steps", "3", "--json", "-"]);
    assert!(run["best_designs"].as_array().is_some_and(Vec::is_empty), "nobody asked for them");
    assert_eq!(run["movements_by_counting"], 11);
}

#[test]
fn limits_are_refused_where_there_are_none() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("exact.toml");
    let text = include_str!("../scenarios/arm-6dof.toml").replace("sigma_m = 0.01", "sigma_m = 0.0");
    std::fs::write(&file, text).expect("written");
    for command in ["run", "compare"] {
        for (scenario, why) in [("tiago-mocap", "recorded data"), (file.to_str().expect("a path"), "without noise")] {
            let (code, message) = failure(&[command, scenario, "--steps", "3", "--limits"]);
            assert_eq!(code, 2, "{message}");
            assert!(message.contains("--limits") && message.contains(why), "{message}");
        }
    }
}

#[test]
fn learners_that_cannot_settle_are_not_waited_for() {
    let command = |learners: &[&'static str]| {
        let named = learners.iter().flat_map(|name| ["--learner", *name]);
        ["run", "arm-6dof", "--seed", "3", "--until", "settled"].into_iter().chain(named).collect::<Vec<_>>()
    };
    let output = body_schema(&command(&["global", "gradient"]));
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(text.contains("stopped after") && text.contains("`gradient` not waited for"), "{text}");
    let (code, message) = failure(&command(&["gradient", "rls-six-numbers:random"]));
    assert_eq!(code, 2, "{message}");
    assert!(message.contains("`gradient`, `rls-six-numbers:random` can never settle"), "{message}");
}

#[test]
fn two_outputs_cannot_be_one_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name).to_str().expect("a plain path").to_owned();
    std::fs::create_dir(path("sub")).expect("a folder");
    let (same, other_way, different) = (path("a"), path("sub/../a"), path("b"));
    for (arguments, options) in [
        (["run", "--rrd", &same, "--csv", &other_way], ["--rrd", "--csv"]),
        (["run", "--csv", &same, "--json", &same], ["--csv", "--json"]),
        (["compare", "--json", &other_way, "--csv", &same], ["--json", "--csv"]),
    ] {
        let (code, message) = failure(&[&arguments[..], &["arm-6dof", "--steps", "1"]].concat());
        assert_eq!(code, 2, "{message}");
        assert!(options.iter().all(|option| message.contains(option)), "{message}");
        assert!(!folder.path().join("a").exists(), "refused before anything runs");
    }
    let output = body_schema(&["run", "arm-6dof", "--steps", "1", "--csv", &same, "--json", &different]);
    assert!(output.status.success());
}

#[test]
fn global_runs_wherever_its_name_is_offered_and_on_recorded_data() {
    let result = json(&["run", "tiago-mocap", "--learner", "global", "--json", "-"]);
    let learner = &result["learners"][0];
    assert_eq!((learner["name"].as_str(), learner["estimator"].as_str()), (Some("global"), Some("smoother")));
    assert!(learner["failure"].is_null() && learner["metrics"]["movements"] == 37, "{learner}");
    assert!(learner["metrics"]["prediction_mean_m"].as_f64().is_some_and(|error| error < 0.005), "{learner}");
}

#[test]
fn bad_input_exits_with_two_and_says_what_to_do() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("bad.toml");
    let text = include_str!("../scenarios/arm-6dof.toml").replace("sigma_m = 0.01", "sigma = 0.01");
    std::fs::write(&file, text).expect("written");
    let file = file.to_str().expect("a plain path");
    let binary = folder.path().join("tiago-mocap.csv");
    std::fs::write(&binary, b"x1,y1\n\xff\xfe\0").expect("written");
    let measured = folder.path().join("measured.toml");
    std::fs::write(&measured, include_str!("../scenarios/tiago-mocap.toml")).expect("written");
    let (binary, measured) = (binary.to_str().expect("a plain path"), measured.to_str().expect("a plain path"));
    let cases: [(&[&str], &[&str]); 19] = [
        (&["check", file], &["bad.toml:", "`sensor.sigma`", "`sigma_m`"]),
        (&["run", "arm-6dofx"], &["did you mean `arm-6dof`"]),
        (&["run", "no/such.toml"], &["no/such.toml"]),
        (&["run", "arm-6dof", "--learner", "clever"], &["`clever`", "active, random, gradient"]),
        (&["run", "arm-6dof", "--learner", "actve"], &["did you mean `active`"]),
        (&["run", "tiago-mocap", "--learner", "rls:active-direct"], &["every row is tried", "write `rls:active`"]),
        (&["check", measured], &["measurements.file", "tiago-mocap.csv is not text", "UTF-8"]),
        (&["check", binary], &["tiago-mocap.csv is not text"]),
        (&["run", "arm-6dof", "--learner", "active", "--learner", "active"], &["named twice"]),
        (&["run", "tiago-mocap", "--steps", "38"], &["37 movements", "--steps 37"]),
        (&["compare", "arm-6dof", "--seeds", "9..3"], &["3..9"]),
        (&["compare", "arm-6dof", "--seeds", "0"], &["at least one seed"]),
        (&["compare", "arm-6dof", "--threads", "100000"], &["--threads", "512"]),
        (
            &["sweep", "arm-6dof", "--learner", "active", "--set", "filter.x=1", "--threads", "0"],
            &["--threads", "1..=512"],
        ),
        (&["sweep", "arm-6dof", "--set", "filter.x=1"], &["--learner"]),
        (&["serve", "--frame-ancestors", "example.org"], &["`example.org`", "https://example.org"]),
        (&["serve", "--allow-host", "http://lab"], &["`http://lab` is no host name", "lab.example.org"]),
        (&["serve", "--ephemeral", "--data-dir", "x"], &["--ephemeral", "cannot be used with", "--data-dir"]),
        (&["fly"], &["fly"]),
    ];
    for (arguments, expected) in cases {
        let (code, message) = failure(arguments);
        assert_eq!(code, 2, "{arguments:?}: {message}");
        for part in expected {
            assert!(message.contains(part), "{arguments:?}: {message}");
        }
        assert!(!message.contains("panicked"), "{message}");
    }
}

#[test]
fn the_version_names_the_commit_and_rerun() {
    let said = body_schema(&["--version"]);
    let said = String::from_utf8(said.stdout).expect("text");
    assert!(said.starts_with(concat!("body-schema ", env!("CARGO_PKG_VERSION"), " (")), "{said}");
    assert!(said.contains("Rerun 0."), "{said}");
}

#[test]
fn what_cannot_be_written_exits_with_one_and_names_the_file() {
    for option in ["--rrd", "--csv", "--json"] {
        let (code, message) = failure(&["run", "arm-6dof", "--steps", "1", option, "/no/such/folder/x"]);
        assert_eq!(code, 1, "{option}: {message}");
        assert!(message.contains("/no/such/folder/x"), "{option}: {message}");
        assert_eq!(message.matches("os error").count(), 1, "the cause is told once: {message}");
    }
}

#[test]
fn a_scenario_can_be_a_path_with_data_beside_it() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/scenarios/tiago-mocap.toml");
    let output = body_schema(&["check", path]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(String::from_utf8_lossy(&output.stdout).contains("39 parameters"));
    let list = body_schema(&["scenarios"]);
    let text = String::from_utf8_lossy(&list.stdout).into_owned();
    assert!(["arm-6dof", "arm-12dof", "tiago-mocap"].iter().all(|name| text.contains(name)), "{text}");
}

#[test]
fn doubts_about_data_are_warnings_unless_strict() {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).expect("written");
    let table = include_str!("../scenarios/positioner.csv");
    let row = table.lines().nth(1).expect("a row");
    write("my.toml", include_str!("../scenarios/positioner.toml"));
    write("positioner.urdf", include_str!("../scenarios/positioner.urdf"));
    write("positioner.csv", &format!("{table}{row}\n"));
    let path = folder.path().join("my.toml");
    let path = path.to_str().expect("a plain path");
    let output = body_schema(&["check", path]);
    let said = String::from_utf8_lossy(&output.stderr);
    let line = table.lines().count() + 1;
    assert!(
        output.status.success() && said.contains(&format!("warning: line {line}: a copy of an earlier row")),
        "{said}"
    );
    let (code, message) = failure(&["check", path, "--strict"]);
    assert!(code == 2 && message.contains("1 doubt about the data"), "{message}");
    assert!(body_schema(&["check", "positioner", "--strict"]).status.success());
}

#[cfg(target_os = "linux")]
#[test]
fn what_never_ends_is_refused_at_once() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("my.toml");
    let toml = include_str!("../scenarios/tiago-mocap.toml").replace("tiago-mocap.csv\"", "/dev/zero\"");
    std::fs::write(&path, toml).expect("written");
    for path in ["/dev/zero", path.to_str().expect("a plain path")] {
        let (code, message) = failure(&["check", path]);
        assert!(code == 2 && message.contains("is not text: its byte 1 is 0"), "{message}");
    }
}

#[test]
fn several_learners_are_named_with_commas_or_one_by_one() {
    let compared = |learners: &[&str]| {
        let output = body_schema(&[&["compare", "arm-6dof", "--seeds", "1", "--steps", "1"], learners].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let rows = String::from_utf8(output.stdout).expect("text");
        ["random", "gradient", "active"].map(|learner| rows.contains(&format!("| {learner} ")))
    };
    assert_eq!(compared(&["--learner", "random,gradient"]), [true, true, false]);
    assert_eq!(compared(&["--learner", "random", "--learner", "gradient"]), [true, true, false]);
}

#[test]
fn a_run_repeats_what_was_turned_on_the_page() {
    let run = |set: &[&str]| {
        let set: Vec<&str> = set.iter().flat_map(|replacement| ["--set", replacement]).collect();
        json(&[&["run", "arm-6dof", "--learner", "random", "--steps", "4", "--json", "-"], &set[..]].concat())
    };
    let (plain, turned) = (run(&[]), run(&["sensor.sigma_m=0.05", "robot.joint.elbow.limits_deg=[-60.0, 0.0]"]));
    assert_eq!(turned["set"], serde_json::json!(["sensor.sigma_m=0.05", "robot.joint.elbow.limits_deg=[-60.0, 0.0]"]));
    assert!(plain.get("set").is_none() && plain["learners"][0]["metrics"] != turned["learners"][0]["metrics"]);
    let compared = json(&["compare", "arm-6dof", "--set", "steps=5", "--seeds", "2", "--json", "-"]);
    assert_eq!((&compared["steps"], &compared["set"]), (&serde_json::json!(5), &serde_json::json!(["steps=5"])));
    for (set, words) in [
        ("sensor.sigma_m", "KEY=VALUE"),
        ("sensor.sigma_m=much", "no value in TOML"),
        ("sensor.sigma_m=-1", "sensor.sigma_m"),
        ("sensors.sigma_m=1", "there is no table `sensors`"),
    ] {
        let (status, told) = failure(&["run", "arm-6dof", "--set", set]);
        assert!(status == 2 && told.contains(words), "{set}: {status} {told}");
    }
}

#[test]
fn a_sweep_ranks_by_the_learners_own_median() {
    let trials = json(&[
        "sweep",
        "arm-6dof",
        "--learner",
        "random",
        "--set",
        "filter.measurement_variance_m2=0.003,0.00001",
        "--set",
        "filter.stabilising_noise.variance=0.003",
        "--seeds",
        "1001..1004",
        "--steps",
        "500",
        "--json",
        "-",
    ]);
    let trials = trials.as_array().expect("trials");
    assert_eq!(trials.len(), 2);
    let late = |trial: &Value| trial["summary"]["median_converged_at"].as_f64().unwrap_or(f64::INFINITY);
    assert!(late(&trials[0]) <= late(&trials[1]), "{trials:?}");
    assert_eq!(trials[0]["values"][0][1], "0.003");
}

#[test]
fn a_person_cannot_choose_on_the_command_line() {
    for command in
        [&["run"][..], &["compare", "--seeds", "2"], &["sweep", "--set=filter.measurement_variance_m2=0.001"]]
    {
        let arguments = [command, &["arm-6dof", "--learner", "smoother:human"]].concat();
        let (code, error) = failure(&arguments);
        assert_eq!(code, 2, "{error}");
        assert!(error.contains("a person chooses") && error.contains("body-schema serve"), "{error}");
    }
}
