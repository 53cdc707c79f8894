//! Joints that give way to gravity: found in a table of measurements, written, and learned step by step.

mod simulated;

use body_schema::{
    calibration::{Calibration, Case, Extra, Figures, Options, Silent, Trial, calibrate},
    experiment::{LearnerReport, ModelReport, StepReport},
    robot::{Chain, Urdf},
    scenario::{Scenario, builtin},
};
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, UnitVector3, Vector3};
use simulated::{ONE_DEGREE, Simulated, UR10};

const SEEDS: [u64; 4] = [301, 302, 303, 304];

fn calibrated(scenario: &Scenario) -> Calibration {
    let case = Case::new(scenario).expect("measured");
    calibrate(&case, &Options::default(), &Silent).expect("calibrated")
}

fn mean(figures: &Figures) -> f64 {
    figures.mean_mm.expect("lengths")
}

fn compliance_alone(found: &Calibration) -> &Trial {
    found.report.extras.iter().find(|trial| trial.extras == [Extra::Compliance]).expect("tried")
}

/// A degree at full load is learned to 10 %, and with it rows that were held out are predicted at least twice as well.
#[test]
fn what_gives_way_is_learned_and_halves_the_held_out_error() {
    for seed in SEEDS {
        let found = calibrated(&Simulated::bent(seed).scenario(""));
        let held_out = found.report.held_out.as_ref().expect("half of the rows");
        let (after, full) = (mean(&held_out.after), mean(&held_out.full_model));
        assert!(full < 0.5 * after, "seed {seed}: {after} to {full} mm");
        assert!(found.extras.contains(&Extra::Compliance));
        let compliance = found.report.compliance.as_ref().expect("kept");
        assert_eq!(compliance.elbow, "elbow_joint");
        for (joint, given) in [("shoulder_lift_joint", 1.0), ("elbow_joint", 2.0)] {
            let term = compliance.terms.iter().find(|term| term.joint == joint && term.load == "target").expect("it");
            let ratio = term.deg_per_nm / (given * ONE_DEGREE.to_degrees());
            assert!((ratio - 1.0).abs() < 0.1, "seed {seed}: {term:?}");
            assert!(term.sd_deg_per_nm > 0.0 && term.greatest_deg > 0.5, "{term:?}");
        }
    }
}

/// A gravity that pulls sideways explains nothing.
#[test]
fn a_sideways_gravity_changes_next_to_nothing() {
    for seed in SEEDS {
        for up in ["up = [1.0, 0.0, 0.0]", "up = [0.0, 1.0, 0.0]"] {
            let found = calibrated(&Simulated::bent(seed).scenario(up));
            let trial = compliance_alone(&found);
            let (with, without) = (mean(trial.held_out.as_ref().expect("judged")), found.report.held_out.as_ref());
            let change = with / mean(&without.expect("judged").after) - 1.0;
            assert!(change.abs() < 0.05 && !trial.kept, "seed {seed}, {up}: {change}");
        }
    }
}

/// A stiff robot is left stiff.
#[test]
fn a_stiff_robot_keeps_no_compliance() {
    for seed in SEEDS {
        let found = calibrated(&Simulated { compliance: [[0.0; 2]; 6], ..Simulated::bent(seed) }.scenario(""));
        assert!(found.extras.is_empty() && found.report.compliance.is_none(), "seed {seed}: {:?}", found.extras);
    }
}

/// About a vertical axis gravity pulls at nothing, and behind one the elbow's pull is a sine of the joint's own reading.
#[test]
fn what_cannot_be_told_apart_is_learned_as_one() {
    let found = calibrated(&Simulated::bent(SEEDS[0]).scenario(""));
    let trial = |extras: &[Extra]| found.report.extras.iter().find(|trial| trial.extras == extras).expect("tried");
    let alone = trial(&[Extra::Compliance]);
    let pulls_not = "gravity does not pull at shoulder_pan_joint: it has no compliance to learn";
    let as_one = "how shoulder_lift_joint gives way to the load at the elbow cannot be told from its eccentricity: learned as one";
    // Five joints bear the target, and one the elbow.
    assert_eq!((alone.parameters, alone.merged.as_slice()), (6, [pulls_not.to_owned()].as_slice()));
    let own = trial(&[Extra::Ratios, Extra::Eccentricity]);
    let all = trial(&[Extra::Ratios, Extra::Eccentricity, Extra::Compliance]);
    assert_eq!((own.parameters, all.parameters), (18, 23));
    assert_eq!(all.merged, [pulls_not, as_one]);
    assert!(own.merged.is_empty());
    // With another elbow two joints bear it; lying on its side the first joint bears as well.
    let parameters = |keys: &str| compliance_alone(&calibrated(&Simulated::bent(SEEDS[0]).scenario(keys))).parameters;
    assert_eq!(parameters("elbow = \"wrist_1_joint\""), 7);
    assert_eq!(parameters("up = [1.0, 0.0, 0.0]"), 8);
}

/// The numbers below a key of two levels, one a line, or in a list.
fn numbers(yaml: &str, path: [&str; 3]) -> Vec<f64> {
    let section = yaml.split(&format!("\n{}:\n", path[0])).nth(1).expect(path[0]);
    let below = |text: &str| text.split('"').collect::<String>();
    let section = below(section);
    let entry = section.split(&format!("  {}:\n", path[1])).nth(1).expect(path[1]);
    let line = entry.lines().find_map(|line| line.trim().strip_prefix(&format!("{}: ", path[2]))).expect(path[2]);
    line.trim_matches(['[', ']']).split(", ").map(|number| number.parse().expect("a number")).collect()
}

/// Whoever follows what readings.yaml says predicts what the extended model does.
#[test]
fn readings_yaml_says_all_that_it_takes() {
    let scenario = Simulated::bent(SEEDS[1]).scenario("");
    let case = Case::new(&scenario).expect("measured");
    let found = calibrate(&case, &Options::default(), &Silent).expect("calibrated");
    let files = found.files(&case).expect("writable");
    let yaml = &files.iter().find(|file| file.path == "readings.yaml").expect("it").text;
    assert!(yaml.contains("+ compliance·τ") && yaml.contains("  gravity: 9.81\n  up: [0.0, 0.0, 1.0]\n"), "{yaml}");

    let described = Urdf::parse(UR10).expect("a URDF").chain("base_link", "tool0").expect("a chain");
    let mut learned: Chain = described.clone();
    for segment in learned.segments.iter_mut().filter(|segment| segment.kind.moves().is_some()) {
        let value = |key| numbers(yaml, ["kinematics", &segment.name, key])[0];
        let rotation = UnitQuaternion::from_euler_angles(value("roll"), value("pitch"), value("yaw"));
        segment.origin = Isometry3::from_parts(Translation3::new(value("x"), value("y"), value("z")), rotation);
    }
    // The height of a load at readings, as the robot is described.
    let height = |load: &str, readings: &[f64]| {
        let at = Point3::from_slice(&numbers(yaml, ["loads", load, "at_m"]));
        let link = if load == "target" { "tool0" } else { "upper_arm_link" };
        assert!(yaml.contains(&format!("  {load}:\n    link: \"{link}\"\n")), "{yaml}");
        let index = described.segments.iter().position(|segment| segment.link == link).expect("a link") + 1;
        (described.links(readings)[index] * described.links(&[0.0; 6])[index].inverse() * at).z
    };
    let state = found.extended.state();
    for row in case.rows.iter().take(10) {
        let q = &row.positions;
        let torque = |load: &str, joint: usize| {
            let moved = |step: f64| {
                let mut moved = q.clone();
                moved[joint] += step;
                height(load, &moved)
            };
            -9.81 * (moved(1e-4) - moved(-1e-4)) / 2e-4
        };
        let theta: Vec<f64> = (described.names().iter().enumerate())
            .map(|(joint, name)| {
                let of = |key| numbers(yaml, ["readings", name, key]);
                let [offset, ratio, sine, cosine] = ["offset", "ratio", "sine", "cosine"].map(|key| of(key)[0]);
                let unloaded = offset + ratio * q[joint] + sine * q[joint].sin() + cosine * q[joint].cos();
                let compliance = of("compliance");
                unloaded + compliance[0] * torque("target", joint) + compliance[1] * torque("elbow", joint)
            })
            .collect();
        let target = learned.tip_at(&[0.0; 6]).inverse() * state.marker();
        let predicted = state.base * learned.tip_at(&theta) * target;
        let apart = (predicted - state.marker_at(q)).norm();
        assert!(apart < 1e-7, "{apart} m");
    }
}

/// A Panda that gives way at two joints, and learners that know of it or do not.
fn giving_way(learned: bool) -> Scenario {
    let source = builtin("arm-7dof-eccentric").expect("built in").source;
    let mut joint = 0;
    let lines = source.lines().map(|line| {
        if !line.starts_with("eccentricity_deg") {
            return line.to_owned();
        }
        joint += 1;
        let given = if matches!(joint, 2 | 4) { "compliance_deg_per_nm = [0.12, 0.06]\n" } else { "" };
        format!("{given}{}", if learned { "learn_compliance = true" } else { "" })
    });
    let text = lines.collect::<Vec<_>>().join("\n").replace("[prior]", "[prior]\ncompliance_rad_per_nm = 0.002");
    Scenario::parse("bent.toml", &text, &|file| Err(format!("{file} is not there")))
        .unwrap_or_else(|error| panic!("{error}"))
}

/// A simulated truth may give way, and a learner learns it who is asked to; the report says what it takes to predict by it.
#[test]
fn learners_that_are_asked_to_learn_what_gives_way() {
    let ends = |learned: bool| {
        let scenario = giving_way(learned);
        let mut experiment = scenario.experiment(301, Some(&["smoother-random".to_owned()])).expect("starts");
        for _ in 0..80 {
            experiment.step().expect("a step");
        }
        let learner = StepReport::of(&experiment).learners.remove(0);
        (scenario, learner)
    };
    let ((scenario, knows), (_, knows_not)) = (ends(true), ends(false));
    let error = |learner: &LearnerReport| learner.metrics.prediction_mean_m.expect("a truth");
    assert!(error(&knows) < 0.35 * error(&knows_not), "{} {}", error(&knows), error(&knows_not));
    let compliance = knows.estimate.joints[1].correction.expect("learned").compliance;
    assert!((compliance[0].to_degrees() / 0.12 - 1.0).abs() < 0.1, "{compliance:?}");
    // What a learner takes its joints to bear is not what they truly do: it is guessed, as the axes are.
    let (guessed, truth) = (knows.estimate.state().expect("finite"), &scenario.robot.state);
    let (guessed, loads) = (guessed.loads.expect("reported"), truth.loads.as_deref().expect("given"));
    assert_ne!(&*guessed, loads);
    assert!(knows_not.estimate.loads.is_none());
    // The report of the truth moves as the truth does.
    let readings = [0.3, -0.4, 0.5, -1.1, 0.2, 0.7, -0.2];
    let shown = ModelReport::of_state(truth).state().expect("finite");
    assert!((shown.marker_at(&readings) - truth.marker_at(&readings)).norm() < 1e-12);
    let stiff = ModelReport { loads: None, ..ModelReport::of_state(truth) };
    assert!((stiff.state().expect("finite").marker_at(&readings) - truth.marker_at(&readings)).norm() > 1e-3);
}

#[test]
fn keys_that_make_no_sense_are_refused_with_a_mend() {
    let refused = |keys: &str| {
        let open = |file: &str| Ok(if file == "ur10.urdf" { UR10.to_owned() } else { Simulated::bent(1).table() });
        Scenario::parse("bent.toml", &Simulated::bent(1).file(keys), &open).expect_err("refused").to_string()
    };
    let up = refused("up = [0.0, 0.0, 2.0]");
    assert!(up.contains("`robot.up`: its length is 2, not 1") && up.contains("[0.000000, 0.000000, 1.000000]"), "{up}");
    let elbow = refused("elbow = \"elbow_jiont\"");
    assert!(
        elbow.contains("there is no joint `elbow_jiont`") && elbow.contains("did you mean `elbow_joint`?"),
        "{elbow}"
    );
    let text =
        "[[robot.joint]]\nname = \"slide\"\nkind = \"prismatic\"\naxis = [0.0, 0.0, 1.0]\nlimits_m = [0.0, 0.3]\n";
    let source = builtin("arm-7dof-eccentric").expect("built in").source;
    let with_slide = |key: &str| {
        let text = source.replace("[sensor]", &format!("{text}{key}\n[sensor]"));
        let error = Scenario::parse("slide.toml", &text, &|_| Err(String::new())).expect_err("refused");
        error.to_string()
    };
    for key in ["compliance_deg_per_nm = [0.1, 0.0]", "learn_compliance = true"] {
        assert!(with_slide(key).contains("a joint that slides bears no torque"), "{}", with_slide(key));
    }
    let sliding_elbow = source.replace("learn_marker = true", "learn_marker = true\nelbow = \"slide\"");
    let text = sliding_elbow.replace("[sensor]", &format!("{text}[sensor]"));
    let error = Scenario::parse("slide.toml", &text, &|_| Err(String::new())).expect_err("refused").to_string();
    assert!(error.contains("`slide` slides") && error.contains("name a joint that turns"), "{error}");
    let not_finite = source.replacen("eccentricity_deg = [0.07, -0.19]", "compliance_deg_per_nm = [nan, 0.0]", 1);
    let error = Scenario::parse("nan.toml", &not_finite, &|_| Err(String::new())).expect_err("refused").to_string();
    assert!(error.contains("`robot.joint[0].compliance_deg_per_nm`: it is out of range"), "{error}");
}

/// Of a real Panda and a real TIAGo gravity explains what one that pulls sideways does not: of the Panda little, and nothing that is kept for
/// places where it was not.
#[test]
fn real_robots_tell_down_from_sideways() {
    let trial = |name: &str, up: UnitVector3<f64>| {
        let mut scenario = builtin(name).expect("built in");
        scenario.robot.gravity.up = up;
        let found = calibrated(&scenario);
        let axes = mean(&found.report.held_out.as_ref().expect("seven places").after);
        let trial = compliance_alone(&found).clone();
        (mean(&trial.held_out.expect("judged")) / axes, trial.kept)
    };
    for (name, most, least) in [("panda-sockets", 1.0, 1.0), ("tiago-mocap-3", 0.85, 0.9)] {
        let (down, is_kept) = trial(name, Vector3::z_axis());
        assert!(down < most && is_kept == (name == "tiago-mocap-3"), "{name}: {down}");
        for up in [Vector3::x_axis(), Vector3::y_axis()] {
            let (sideways, is_kept) = trial(name, up);
            assert!(sideways > least && !is_kept, "{name}: {sideways}");
        }
    }
}

/// As a user meets it: the report says by how much joints give way.
#[test]
fn the_report_says_by_how_much_joints_give_way() {
    let folder = tempfile::tempdir().expect("a folder");
    let place = |name: &str| folder.path().join(name);
    let bent = Simulated::bent(SEEDS[2]);
    for (name, text) in [("ur10.urdf", UR10.to_owned()), ("bent.csv", bent.table()), ("bent.toml", bent.file(""))] {
        std::fs::write(place(name), text).expect("written");
    }
    let done = std::process::Command::new(env!("CARGO_BIN_EXE_body-schema"))
        .args(["calibrate", "bent.toml", "--out", "out"])
        .current_dir(folder.path())
        .output()
        .expect("the program starts");
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let read = |name: &str| std::fs::read_to_string(place("out").join(name)).expect(name);
    let report: serde_json::Value = serde_json::from_str(&read("report.json")).expect("JSON");
    assert_eq!(report["compliance"]["up"], serde_json::json!([0.0, 0.0, 1.0]));
    assert!(report["compliance"]["terms"][0]["deg_per_nm"].is_f64());
    let mean = |which: &str| report["held_out"][which]["mean_mm"].as_f64().expect("a number");
    assert!(mean("full_model") < 0.5 * mean("after"), "{} {}", mean("full_model"), mean("after"));
    let markdown = read("report.md");
    for said in [
        "Joints give way to gravity",
        "How shoulder\\_lift\\_joint gives way to the load at the elbow cannot be told from its eccentricity: learned as one.",
        "at its greatest load (deg)",
    ] {
        assert!(markdown.contains(said), "{said}: {markdown}");
    }
    assert!(read("report.html").contains("Joints give way to gravity"));
}
