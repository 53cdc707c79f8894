//! Scenarios whose robot is a URDF and whose measurements are a table, of any channel; and the data sets that ship.

use std::{collections::BTreeMap, fmt::Write as _};

use body_schema::{
    experiment::{Metrics, RunResult},
    model::Block,
    robot::Urdf,
    scenario::{HeldOutRule, Measurements, Problem, Scenario, ScenarioError, WorldSpec, builtin},
    sensing::MeasurementModel,
};

const UR10: &str = include_str!("urdf/robots/ur10.urdf");
const LEAST: &str = r#"
name = "my-robot"
[robot]
urdf = "my-robot.urdf"
base = "base_link"
tip = "tool0"
[measurements]
file = "my-robot.csv"
"#;
const JOINTS: [&str; 6] =
    ["shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint", "wrist_2_joint", "wrist_3_joint"];

/// Postures that no two joints share a number in.
fn postures(count: usize) -> Vec<Vec<f64>> {
    (0..count).map(|row| (0..6).map(|joint| ((row * 7 + 3 * joint) as f64 * 0.61).sin() * 1.5).collect()).collect()
}

/// A table of joint positions, with further columns.
fn table(titles: &str, postures: &[Vec<f64>], more: impl Fn(usize, &[f64]) -> String) -> String {
    let mut text = format!("{}{titles}\n", JOINTS.join(","));
    for (row, posture) in postures.iter().enumerate() {
        let cells: Vec<String> = posture.iter().map(f64::to_string).collect();
        let _ = writeln!(text, "{}{}", cells.join(","), more(row, posture));
    }
    text
}

fn parsed(toml: &str, csv: &str) -> Result<Scenario, ScenarioError> {
    Scenario::parse("my-robot.toml", toml, &|file| match file {
        "my-robot.urdf" => Ok(UR10.to_owned()),
        "my-robot.csv" => Ok(csv.to_owned()),
        "more.csv" => Ok(csv.lines().take(4).collect::<Vec<_>>().join("\n")),
        _ => Err("cannot be read: no such file".to_owned()),
    })
}

fn valid(toml: &str, csv: &str) -> Scenario {
    parsed(toml, csv).unwrap_or_else(|error| panic!("{error}"))
}

/// The only problem of a file.
fn problem(toml: &str, csv: &str) -> Problem {
    match parsed(toml, csv) {
        Err(ScenarioError::Invalid { mut problems, .. }) if problems.len() == 1 => problems.remove(0),
        other => panic!("one problem expected: {:?}", other.map(|scenario| scenario.name)),
    }
}

fn positions(postures: &[Vec<f64>]) -> String {
    table(",x,y,z", postures, |_, posture| {
        let chain = Urdf::parse(UR10).expect("valid").chain("base_link", "tool0").expect("a chain");
        let at = chain.tip_at(posture).translation.vector;
        format!(",{},{},{}", at.x, at.y, at.z)
    })
}

fn measurements(scenario: &Scenario) -> &Measurements {
    let WorldSpec::Measured { measurements, .. } = &scenario.world else { panic!("measured") };
    measurements
}

/// What a learner ends with.
fn ended(scenario: &Scenario, seed: u64, learner: &str) -> Metrics {
    let mut experiment = scenario.experiment(seed, Some(&[learner.to_owned()])).expect("starts");
    for _ in 0..scenario.steps {
        experiment.step().expect("a row");
    }
    experiment.latest().learners[0].metrics.clone()
}

#[test]
fn the_least_file_learns_where_the_robot_stands() {
    let scenario = valid(LEAST, &positions(&postures(20)));
    assert_eq!((scenario.robot.names.as_slice(), scenario.steps), (&JOINTS.map(String::from)[..], 16));
    let blocks: Vec<Block> = scenario.robot.layout.blocks().map(|(block, _)| block).collect();
    let axes = (0..6).map(Block::Axis);
    assert_eq!(blocks, [Block::Base].into_iter().chain(axes).chain([Block::Target(0)]).collect::<Vec<_>>());
    let names: Vec<&str> = scenario.learners.iter().map(|learner| learner.name.as_str()).collect();
    assert_eq!(names, ["global", "random", "nominal"]);
    // It says no more than what the robot truly is.
    for learner in names {
        let metrics = ended(&scenario, 2, learner);
        assert!(metrics.prediction_mean_m.expect("held out") < 1e-4, "{learner}: {metrics:?}");
    }
}

#[test]
fn what_a_file_says_of_its_robot_is_checked() {
    let csv = positions(&postures(8));
    let with = |from: &str, to: &str| {
        assert!(LEAST.contains(from), "the test's own premise: {from}");
        problem(&LEAST.replace(from, to), &csv)
    };
    let joint = "[[robot.joint]]\nname = \"a\"\nkind = \"revolute\"\naxis = [0.0, 0.0, 1.0]\n[measurements]";
    for (from, to, key, what, hint) in [
        ("[measurements]", joint, "robot.joint", "those of the URDF", "remove"),
        ("tip = \"tool0\"\n", "", "robot.tip", "missing", "two ends of the chain"),
        ("tool0", "tool", "robot.urdf", "my-robot.urdf, line", "did you mean `tool0`"),
        ("my-robot.urdf", "other.urdf", "robot.urdf", "other.urdf cannot be read", "beside the scenario"),
        ("my-robot.csv", "other.csv", "measurements.file", "other.csv cannot be read", "beside the scenario"),
        ("tip", "hold = [\"elbow_joit\"]\ntip", "robot.hold", "no joint `elbow_joit`", "did you mean `elbow_joint`"),
        ("urdf = \"my-robot.urdf\"\n", "", "robot", "joint", "add"),
    ] {
        let found = with(from, to);
        assert!(found.key.starts_with(key), "{found}");
        assert!(found.to_string().contains(what) && found.hint.contains(hint), "{found}");
    }
}

#[test]
fn joints_are_held_and_columns_have_units() {
    let csv = positions(&postures(9));
    let held = valid(&LEAST.replace("tip", "hold = [\"elbow_joint\", \"wrist_3_joint\"]\ntip"), &csv);
    assert_eq!((0..6).filter(|joint| !held.robot.layout.is_learned(*joint)).collect::<Vec<_>>(), [2, 5]);
    // Of an axis its direction or its place alone.
    let partly = valid(&LEAST.replace("tip", "hold = [\"elbow_joint.direction\", \"wrist_1_joint.point\"]\ntip"), &csv);
    let deviations = partly.prior.standard_deviations(&partly.robot.layout);
    let of = |joint: usize| partly.robot.layout.block(Block::Axis(joint)).expect("learned").map(|k| deviations[k]);
    assert_eq!(of(1).collect::<Vec<_>>(), [0.005, 0.005, 0.01, 0.01]);
    assert_eq!(of(2).collect::<Vec<_>>(), [0.005, 0.005, 1e-6, 1e-6]);
    assert_eq!(of(3).collect::<Vec<_>>(), [1e-6, 1e-6, 0.01, 0.01]);
    let both = valid(&LEAST.replace("tip", "hold = [\"elbow_joint.direction\", \"elbow_joint.point\"]\ntip"), &csv);
    assert!(!both.robot.layout.is_learned(2), "a held direction and a held point are a held axis");
    let mut experiment = partly.experiment(1, Some(&["global".to_owned()])).expect("starts");
    (0..6).for_each(|_| assert!(experiment.step().is_ok()));
    // The first joint in degrees.
    let in_degrees: Vec<String> = csv
        .lines()
        .map(|line| match line.split_once(',') {
            Some((cell, rest)) => match cell.parse::<f64>() {
                Ok(radians) => format!("{},{rest}", radians.to_degrees()),
                Err(_) => format!("{cell}_deg,{rest}"),
            },
            None => line.to_owned(),
        })
        .collect();
    let scenario = valid(LEAST, &in_degrees.join("\n"));
    for (found, wanted) in measurements(&scenario).configurations.iter().zip(postures(9)) {
        assert!(found.iter().zip(wanted).all(|(found, wanted)| (found - wanted).abs() < 1e-12));
    }
}

#[test]
fn a_target_may_be_on_any_link_of_the_description() {
    let on = |link: &str| {
        let target = format!("{LEAST}[[target]]\nname = \"marker\"\nlink = \"{link}\"\nat_m = [0.1, 0.2, 0.3]\n");
        valid(&target, &positions(&postures(8)))
    };
    let chain = Urdf::parse(UR10).expect("valid").chain("base_link", "tool0").expect("a chain");
    let posture = &postures(3)[2];
    let links = chain.links(posture);
    for (link, index) in [("forearm_link", 3), ("base_link", 0), ("tool0", links.len() - 1)] {
        let wanted = links[index] * nalgebra::Point3::new(0.1, 0.2, 0.3);
        let found = on(link).robot.state.target_at(0, posture);
        assert!((found - wanted).norm() < 1e-12, "{link}: {found} {wanted}");
    }
    // Beside the chain, fixed to one of its links.
    assert_eq!(on("ee_link").robot.state.targets[0].link, 6);
}

/// What a measurement model would observe of the nominal robot comes back from a table, whatever measures it.
#[test]
fn every_channel_is_read_from_a_table() {
    let camera = "[[camera]]\nname = \"cam\"\nat_m = [3.0, 0.0, 0.5]\nlooks_at_m = [0.0, 0.0, 0.5]\nsize_px = [640.0, 480.0]\n\
                  focal_px = [200.0, 200.0]\n";
    let sensor = |keys: &str| format!("[[sensor]]\ntarget = \"hand\"\n{keys}\n");
    let target = "[[target]]\nname = \"hand\"\nat_m = [0.0, 0.0, 0.1]\nrpy_deg = [10.0, 0.0, 0.0]\n";
    for (sensors, titles) in [
        (sensor("channel = \"position\""), ",hand_x,hand_y,hand_z"),
        (sensor("channel = \"pose\""), ",hand_x,hand_y,hand_z,hand_rx,hand_ry,hand_rz"),
        (sensor("channel = \"pixels\""), ",cam_hand_u,cam_hand_v"),
        (sensor("channel = \"distance\"\nto_m = [1.0, 0.0, 0.0]"), ",hand_distance"),
        (
            sensor("channel = \"distance\"\nto_m = [1.0, 0.0, 0.0]\ncolumns = [\"a\"]")
                + &sensor("channel = \"distance\"\nto_m = [0.0, 1.0, 0.0]\ncolumns = [\"b\"]"),
            ",a,b",
        ),
    ] {
        let toml = format!("{LEAST}{camera}{target}{sensors}");
        let postures = postures(7);
        let columns = titles.matches(',').count();
        let zeros = table(titles, &postures, |_, _| ",0".repeat(columns));
        let (robot, measurement_model) = (valid(&toml, &zeros).robot, valid(&toml, &zeros).measurement_model);
        let observe = |measurement_model: &MeasurementModel, posture: &[f64]| {
            measurement_model.observe(&robot.state, posture, &vec![0.0; measurement_model.equations()])
        };
        let csv = table(titles, &postures, |row, posture| {
            if row == 5 && columns == 1 {
                return ",1".to_owned();
            }
            let read = observe(&measurement_model, posture);
            let cells = measurement_model.sensors().iter().zip(&read.readings).flat_map(|(sensor, reading)| {
                let missing = || vec![f64::NAN; sensor.equations()];
                reading.clone().unwrap_or_else(missing)
            });
            cells.map(|x| if x.is_nan() { ",".to_owned() } else { format!(",{x}") }).collect()
        });
        let Ok(scenario) = parsed(&toml, &csv) else { continue };
        for (row, posture) in postures.iter().enumerate().filter(|(row, _)| *row != 5) {
            assert_eq!(measurements(&scenario).observations[row], observe(&measurement_model, posture), "{sensors}");
        }
        scenario.experiment(1, None).expect("starts").step().expect("steps");
    }
}

#[test]
fn an_empty_cell_is_an_absent_reading() {
    let two = "[[sensor]]\ntarget = \"a\"\n[[sensor]]\ntarget = \"b\"\n";
    let csv = table(",a_x,a_y,a_z,b_x,b_y,b_z", &postures(8), |row, _| match row {
        3 => ",,,,1,2,3".to_owned(),
        _ => ",1,2,3,4,5,6".to_owned(),
    });
    let scenario = valid(&format!("{LEAST}{two}"), &csv);
    let readings = &measurements(&scenario).observations[3].readings;
    assert_eq!(readings, &[None, Some(vec![1.0, 2.0, 3.0])]);
    assert_eq!(scenario.robot.equipment.targets.len(), 2, "as the sensors name them");
    // A row of which nothing is left counts for nothing.
    let scenario = valid(&format!("{LEAST}{two}"), &csv.replace(",,,,1,2,3", ",,,,,,"));
    assert_eq!(measurements(&scenario).lines, [2, 3, 4, 6, 7, 8, 9]);
}

#[test]
fn what_is_held_out_is_told_in_one_way() {
    let csv =
        table(",x,y,z,day", &postures(10), |row, _| format!(",1,2,{row},{}", if row < 6 { "one" } else { "two" }));
    let rule = |held_out: &str| {
        let scenario = valid(&format!("{LEAST}[held_out]\n{held_out}\n"), &csv);
        let WorldSpec::Measured { held_out, measurements } = scenario.world else { panic!("measured") };
        assert_eq!(held_out.rows, measurements.rows());
        held_out.rule
    };
    assert_eq!(rule("folds = 3"), HeldOutRule::Folds(3));
    assert_eq!(rule("count = 4"), HeldOutRule::Count(4));
    assert_eq!(rule("rows = [7, 2]"), HeldOutRule::Rows(vec![2, 7]));
    assert_eq!(rule("rows = []"), HeldOutRule::Nothing);
    assert_eq!(rule("by = \"day\"\ntrain = [\"one\"]"), HeldOutRule::Rows(vec![6, 7, 8, 9]));
    assert_eq!(rule("file = \"more.csv\""), HeldOutRule::Rows(vec![10, 11, 12]));
    for (held_out, key, said) in [
        ("folds = 1", "held_out.folds", "from 2 to 10"),
        ("count = 9", "held_out.count", "from 1 to 6"),
        ("rows = [10]", "held_out.rows", "some of 0 to 9"),
        ("by = \"day\"", "held_out.train", "missing"),
        ("by = \"day\"\ntrain = [\"tow\"]", "held_out.train", "write some of one, two"),
        ("by = \"dya\"\ntrain = [\"one\"]", "measurements.file", "has no column `dya`"),
        ("file = \"none.csv\"", "held_out.file", "none.csv cannot be read"),
        ("folds = 2\ncount = 3", "held_out", "in two ways"),
        ("", "held_out", "says nothing"),
    ] {
        let found = problem(&format!("{LEAST}[held_out]\n{held_out}\n"), &csv);
        assert!(found.key == key && found.to_string().contains(said), "{held_out}: {found}");
    }
    let twice = LEAST.replace("file =", "held_out = 3\nfile =") + "[held_out]\nfolds = 2\n";
    assert_eq!(problem(&twice, &csv).key, "measurements.held_out");
}

#[test]
fn pairs_of_places_and_sockets_are_sockets() {
    let csv = table(",place,socket", &postures(12), |row, _| format!(",{},{}", ["a", "b", "c"][row / 4], row % 2));
    let held_out = "[held_out]\nby = \"place\"\ntrain = [\"b\", \"c\"]\n";
    let scenario = valid(&format!("{LEAST}[sockets]\ndistance_m = 0.05\n{held_out}"), &csv);
    let labels = |sockets: &[body_schema::scenario::SocketSpec]| -> Vec<String> {
        sockets.iter().map(|socket| format!("{}{}", socket.place.as_deref().unwrap_or(""), socket.name)).collect()
    };
    assert_eq!(labels(&scenario.robot.sockets), ["b0", "b1", "c0", "c1"]);
    assert_eq!(labels(&scenario.robot.held_out_sockets), ["a0", "a1"]);
    let rows = measurements(&scenario);
    assert_eq!(rows.sockets[..5], [Some(4), Some(5), Some(4), Some(5), Some(0)]);
    assert_eq!(rows.observations[5].readings, [None, Some(vec![0.0; 3]), None, None, None, None]);
    let known = rows.beforehand.as_ref().expect("two distances");
    assert_eq!(known.readings[4..], [Some(vec![0.05]), Some(vec![0.05])]);
    assert!(scenario.robot.up_to_motion, "nothing tells where the whole stands");
    // In folds there are rows to learn from everywhere.
    let folds = scenario.in_folds(3).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!((folds.robot.sockets.len(), folds.robot.held_out_sockets.len()), (6, 0));
    assert!(scenario.in_folds(13).is_err(), "of 12 rows");
    // A seed may draw any row, so that every socket may be learned from.
    let drawn = valid(&format!("{LEAST}[held_out]\ncount = 7\n"), &csv);
    assert_eq!((drawn.robot.sockets.len(), drawn.robot.held_out_sockets.len()), (6, 0));
    // A distance is between two.
    let three = csv.replace(",b,1", ",a,1").replace(",c,0", ",a,2");
    let found = problem(&format!("{LEAST}[sockets]\ndistance_m = 0.05\n"), &three);
    assert!(found.key == "sockets.distance_m" && found.what.contains("3 sockets"), "{found}");
}

/// What is held in one socket says nothing of another: what a row is expected to teach is what it teaches.
#[test]
fn a_row_is_chosen_by_what_its_own_socket_tells() {
    let scenario = builtin("panda-sockets").expect("built in");
    let mut experiment = scenario.experiment(1, Some(&["rls:active".to_owned()])).expect("offered");
    for _ in 0..12 {
        let learner = &experiment.step().expect("a row").learners[0];
        let (expected, found) = (learner.movement.as_ref().and_then(|it| it.criterion()), learner.metrics.trace);
        let (expected, found) = (expected.expect("chosen"), found.expect("kept"));
        assert!((found / expected - 1.0).abs() < 0.05, "{expected} {found}");
    }
}

/// The held-out error of the data sets that ship, over all folds, in millimetres: learned, and as described.
fn held_out(name: &str, error: impl Fn(&Metrics) -> Option<f64>) -> [f64; 2] {
    let scenario = builtin(name).expect("built in");
    let WorldSpec::Measured { held_out, .. } = &scenario.world else { panic!("measured") };
    let folds = held_out.folds();
    let rows: usize = folds.iter().map(|(_, held_out)| held_out.len()).sum();
    ["random", "nominal"].map(|learner| {
        let of = |(fold, (_, held_out)): (usize, &(Vec<usize>, Vec<usize>))| {
            1e3 * error(&ended(&scenario, fold as u64, learner)).expect("held out") * held_out.len() as f64
        };
        folds.iter().enumerate().map(of).sum::<f64>() / rows as f64
    })
}

#[test]
fn a_ball_in_two_sockets_calibrates_a_panda_and_a_kinova() {
    let [learned, nominal] = held_out("panda-sockets", |metrics| metrics.scatter_m);
    assert!(learned <= 0.40 && (7.6..8.6).contains(&nominal), "panda: {learned} of {nominal} mm");
    let [learned, nominal] = held_out("kinova-sockets", |metrics| metrics.scatter_m);
    assert!(learned <= 3.2 && nominal > 4.0, "kinova: {learned} of {nominal} mm");
}

#[test]
fn held_out_error_falls_on_every_robot_that_ships() {
    for (name, most) in [
        ("tiago-mocap-3", 2.6),
        ("talos-contact", 1.0),
        ("ur10-camera", 6.0),
        ("fr3-hand-eye", 2.0),
        ("positioner", 1.0),
    ] {
        let [learned, nominal] = held_out(name, |metrics| metrics.prediction_mean_m);
        assert!(learned <= most && learned < nominal, "{name}: {learned} of {nominal} mm");
    }
}

#[test]
fn tables_that_ship_are_doubted_where_they_are_doubtful() {
    let doubted: BTreeMap<&str, &[&str]> = BTreeMap::from([
        ("tiago-mocap", &[] as &[&str]),
        ("tiago-mocap-3", &[]),
        ("talos-contact", &[]),
        ("ur10-camera", &[]),
        // Its limits are those of a Panda.
        ("fr3-hand-eye", &["panda_joint6"]),
        ("positioner", &[]),
        ("panda-sockets", &[]),
        ("kinova-sockets", &["joint_3", "joint_5", "joint_6"]),
    ]);
    for (name, columns) in doubted {
        let found = builtin(name).expect("built in").examine().expect("measured").diagnostics;
        let found: Vec<&str> = found.iter().filter_map(|doubt| doubt.column.as_deref()).collect();
        assert_eq!(found, columns, "{name}");
    }
}

#[test]
fn runs_of_poses_and_sockets_tell_their_errors() {
    for (name, of_poses) in [("ur10-camera", true), ("panda-sockets", false)] {
        let scenario = builtin(name).expect("built in");
        let mut experiment = scenario.experiment(1, Some(&["random".to_owned()])).expect("starts");
        for _ in 0..6 {
            experiment.step().expect("a row");
        }
        let result = RunResult::of(&experiment);
        let metrics = &result.learners[0].metrics;
        assert_eq!((metrics.prediction_mean_deg.is_some(), metrics.scatter_m.is_some()), (of_poses, !of_poses));
        assert_eq!(metrics.prediction_mean_m.is_some(), of_poses, "{name}");
    }
}
