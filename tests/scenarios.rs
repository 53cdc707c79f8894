//! Scenario files as users write them: what is wrong is said with file, line, key and mend.

mod bounds;

use body_schema::{
    experiment::StepReport,
    scenario::{BUILTIN, Problem, Scenario, ScenarioError, builtin},
};

const ARM: &str = include_str!("../scenarios/arm-6dof.toml");
const TIAGO: &str = include_str!("../scenarios/tiago-mocap.toml");
const TIAGO_CSV: &str = include_str!("../scenarios/tiago-mocap.csv");

fn problems(text: &str, data: Result<&str, &str>) -> Vec<Problem> {
    let open = |_: &str| data.map(str::to_owned).map_err(str::to_owned);
    match Scenario::parse("my.toml", text, &open) {
        Err(error @ ScenarioError::Invalid { .. }) => {
            let message = error.to_string();
            let ScenarioError::Invalid { file, problems } = error else { unreachable!("matched above") };
            assert_eq!(file, "my.toml");
            for problem in &problems {
                assert!(message.contains(&format!("my.toml:{}", problem.line)), "{message}");
                assert!(message.contains(&problem.key) && message.contains(&problem.hint), "{message}");
                assert!(!problem.hint.is_empty() && !problem.what.is_empty(), "{message}");
            }
            problems
        }
        other => panic!("must be refused: {other:?}"),
    }
}

/// Replaces `from` in the arm's file and returns the one problem, with the line on which the replacement stands.
fn one(text: &str, from: &str, to: &str) -> (Problem, usize) {
    assert!(text.contains(from), "the test's own premise: {from}");
    let line = text[..text.find(from).expect("contained")].matches('\n').count() + 1;
    let mut found = problems(&text.replacen(from, to, 1), Ok(TIAGO_CSV));
    assert_eq!(found.len(), 1, "{found:?}");
    (found.remove(0), line)
}

#[test]
fn builtin_scenarios_are_valid_and_start() {
    for found in BUILTIN {
        let scenario = builtin(found.name).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(scenario.name, found.name);
        let mut experiment = scenario.experiment(1, None).expect("starts");
        experiment.step().expect("steps");
        // A page reads what the server writes: a number that is none would be null.
        let written = serde_json::to_string(&StepReport::of(&experiment)).expect("JSON");
        let read = serde_json::from_str::<StepReport>(&written);
        assert!(read.is_ok(), "{}: {read:?}", found.name);
    }
}

#[test]
fn an_unknown_key_is_named_with_a_suggestion() {
    let (problem, line) = one(ARM, "learn_marker = false", "learn_marker = false\ncolour = 3");
    assert_eq!((problem.key.as_str(), problem.line), ("robot.colour", line + 1));
    let (problem, line) = one(ARM, "evaluations = 300", "evaluation = 300");
    assert_eq!((problem.key.as_str(), problem.line), ("selection.evaluation", line));
    assert!(problem.hint.contains("`evaluations`"), "{problem}");
}

#[test]
fn a_missing_unit_is_recognised() {
    let (problem, line) = one(ARM, "sigma_m = 0.01", "sigma = 0.01");
    assert_eq!((problem.key.as_str(), problem.line), ("sensor.sigma", line));
    assert!(problem.hint.contains("`sigma_m`") && problem.hint.contains("unit"), "{problem}");
    let (problem, line) = one(ARM, "limits_deg = [-90.0, 60.0]", "limits = [-90.0, 60.0]");
    assert_eq!(problem.line, line);
    assert!(problem.key.contains("limits") && problem.hint.contains("limits_deg"), "{problem}");
}

#[test]
fn a_missing_key_is_named() {
    let (problem, _) = one(ARM, "sigma_m = 0.01", "");
    assert_eq!(problem.key, "sensor.sigma_m");
    let (problem, _) = one(ARM, "limits_deg = [-90.0, 60.0]", "");
    assert_eq!(problem.key, "robot.joint[1].limits_deg");
}

#[test]
fn reversed_limits_are_refused_and_turned_round() {
    let (problem, line) = one(ARM, "limits_deg = [-90.0, 60.0]", "limits_deg = [60.0, -90.0]");
    assert_eq!((problem.key.as_str(), problem.line), ("robot.joint[1].limits_deg", line));
    assert!(problem.hint.contains("[-90.0, 60.0]"), "{problem}");
}

#[test]
fn an_axis_that_is_no_unit_vector_is_refused_and_normalised() {
    let (problem, line) = one(ARM, "axis = [0.0, 1.0, 0.0]", "axis = [0.0, 3.0, 4.0]");
    assert_eq!((problem.key.as_str(), problem.line), ("robot.joint[1].axis", line));
    assert!(problem.hint.contains("[0.000000, 0.600000, 0.800000]"), "{problem}");
    assert_eq!(one(ARM, "axis = [0.0, 1.0, 0.0]", "axis = [0.0, 0.0, 0.0]").0.key, "robot.joint[1].axis");
}

#[test]
fn numbers_that_are_no_numbers_or_out_of_range_are_refused() {
    for (from, to, key) in [
        ("sigma_m = 0.01", "sigma_m = nan", "sensor.sigma_m"),
        ("sigma_m = 0.01", "sigma_m = -0.01", "sensor.sigma_m"),
        ("sigma_m = 0.01", "sigma_m = inf", "sensor.sigma_m"),
        ("point_m = [0.291, 0.0, 0.0]", "point_m = [0.291, nan, 0.0]", "robot.joint[3].point_m"),
        ("axis = [0.0, 1.0, 0.0]", "axis = [0.0, nan, 0.0]", "robot.joint[1].axis"),
        ("limits_deg = [-90.0, 60.0]", "limits_deg = [-90.0, nan]", "robot.joint[1].limits_deg"),
        ("marker_m = [0.66, 0.02, 0.05]", "marker_m = [0.66, inf, 0.05]", "robot.marker_m"),
        ("evaluations = 300", "evaluations = 0", "selection.evaluations"),
        ("every = 1 ", "every = 0 ", "filter.stabilising_noise.every"),
        (
            "measurement_variance_m2 = 0.003",
            "underweighting = -0.1\nmeasurement_variance_m2 = 0.003",
            "filter.underweighting",
        ),
        ("steps = 1000", "steps = 0", "steps"),
        ("direction_rad = 0.6", "direction_rad = 0.0", "prior.direction_rad"),
        // What overflows or vanishes where it is squared.
        ("direction_rad = 0.6", "direction_rad = 1e-160", "prior.direction_rad"),
        ("sigma_m = 0.01", "sigma_m = 1e-160", "sensor.sigma_m"),
        ("sigma_m = 0.01", "sigma_m = 1e160", "sensor.sigma_m"),
        ("limits_deg = [-90.0, 60.0]", "limits_deg = [-1e308, 1e308]", "robot.joint[1].limits_deg"),
        ("point_m = [0.291, 0.0, 0.0]", "point_m = [0.291, 1e308, 0.0]", "robot.joint[3].point_m"),
    ] {
        let (problem, line) = one(ARM, from, to);
        assert_eq!((problem.key.as_str(), problem.line), (key, line), "{problem}");
    }
}

#[test]
fn underweighting_is_of_the_linearised_filter_alone() {
    let (problem, line) = one(ARM, "[unscented]", "[unscented]\nunderweighting = 1.0");
    assert_eq!((problem.key.as_str(), problem.line), ("unscented.underweighting", line + 1));
    let selectors = include_str!("../scenarios/arm-6dof-selectors.toml");
    let (problem, line) = one(selectors, "[filter]", "[filter]\nunderweighting = 1.0");
    assert_eq!((problem.key.as_str(), problem.line), ("filter.underweighting", line + 1));
    assert!(problem.what.contains("random-six-numbers"), "{problem}");
}

#[test]
fn a_body_does_not_change_beyond_all_measure() {
    for (from, to, key) in [
        ("by_m = [0.0, 0.0, 0.05]", "by_m = [0.0, 0.0, 1e308]", "change.shift.by_m"),
        ("angle_deg = 10.0", "angle_deg = 1e308", "change.tilt.angle_deg"),
    ] {
        assert_eq!(one(include_str!("../scenarios/body-change.toml"), from, to).0.key, key);
    }
}

#[test]
fn wrong_types_and_broken_toml_are_located() {
    let (problem, line) = one(ARM, "sigma_m = 0.01", "sigma_m = \"small\"");
    assert_eq!((problem.key.as_str(), problem.line), ("sensor.sigma_m", line));
    let (problem, line) = one(ARM, "sigma_m = 0.01", "sigma_m = 0.01 0.02");
    assert_eq!(problem.line, line, "{problem}");
    let (problem, line) = one(ARM, "axis = [0.0, 1.0, 0.0]", "axis = [0.0, 1.0]");
    assert_eq!((problem.key.as_str(), problem.line), ("robot.joint[1].axis", line));
    let (problem, line) = one(ARM, "sigma_m = 0.01", "sigma_m = .03");
    assert_eq!(problem.line, line, "{problem}");
    assert!(problem.what.contains("`.03`") && problem.hint.contains("write 0.03"), "{problem}");
    let (problem, _) = one(ARM, "variant = \"direct-l\"", "variant = \"simplex\"");
    assert!(problem.hint.contains("direct-l"), "{problem}");
}

#[test]
fn a_list_of_another_length_is_refused_and_nothing_is_dropped() {
    for (text, from, to, key, what, hint) in [
        (
            ARM,
            "marker_m = [0.66, 0.02, 0.05]",
            "marker_m = [0.66, 0.02, 0.05, 1.0]",
            "robot.marker_m",
            "has 4 numbers",
            "write three, x, y, z in metres",
        ),
        (
            ARM,
            "limits_deg = [-90.0, 60.0]",
            "limits_deg = [-90.0, 60.0, 90.0]",
            "robot.joint[1].limits_deg",
            "has 3 numbers",
            "write two, the lower and the upper in degrees",
        ),
        (
            ARM,
            "axis = [0.0, 1.0, 0.0]",
            "axis = [0.0, 1.0, 0.0, 0.0]",
            "robot.joint[1].axis",
            "has 4 numbers",
            "write three, x, y, z",
        ),
        (ARM, "axis = [0.0, 1.0, 0.0]", "axis = 1.0", "robot.joint[1].axis", "floating point", "write three, x, y, z"),
        (
            TIAGO,
            "[\"x1\", \"y1\", \"z1\"]",
            "[\"x1\", \"y1\", \"z1\", \"x2\"]",
            "measurements.marker_columns_m",
            "has 4 names",
            "write three, x, y, z",
        ),
    ] {
        let (problem, line) = one(text, from, to);
        assert_eq!((problem.key.as_str(), problem.line), (key, line), "{problem}");
        assert!(problem.what.contains(what) && problem.hint.contains(hint), "{problem}");
    }
}

#[test]
fn several_problems_are_told_at_once() {
    let text = ARM.replace("sigma_m = 0.01", "sigma_m = -1.0").replace("evaluations = 300", "evaluations = 0");
    assert_eq!(problems(&text, Err("none")).len(), 2);
}

#[test]
fn contradictions_are_refused() {
    let (problem, _) =
        one(ARM, "estimator = \"gradient\"\npolicy = \"random\"", "estimator = \"gradient\"\npolicy = \"active\"");
    assert_eq!(problem.key, "learner[2].policy");
    let (problem, _) = one(ARM, "name = \"gradient\"", "name = \"world\"");
    assert_eq!(problem.key, "learner[2].name");
    let found = problems(&ARM.replace("learn_marker = false", "learn_marker = true"), Err("none"));
    let mut keys: Vec<&str> = found.iter().map(|problem| problem.key.as_str()).collect();
    keys.sort_unstable();
    assert_eq!(keys, ["initial_error.marker_m", "prior.marker_m"]);
    let both =
        format!("{ARM}\n[measurements]\nfile = \"a.csv\"\nmarker_columns_m = [\"x\", \"y\", \"z\"]\nheld_out = 3\n");
    assert_eq!(problems(&both, Ok("")).len(), 1);
}

#[test]
fn searches_that_differ_only_over_a_box_are_refused_over_recorded_rows() {
    for search in ["direct", "random-search", "bayesian", "monte-carlo", "naive"] {
        let policy = format!("policy = \"active-{search}\"");
        let (problem, _) = one(TIAGO, "policy = \"active\"", &policy);
        assert_eq!(problem.key, "learner[0].policy");
        assert!(problem.what.contains("every row is tried") && problem.hint.contains("\"active\""), "{problem}");
    }
}

#[test]
fn measured_data_are_checked() {
    let (problem, line) = one(TIAGO, "file = \"tiago-mocap-1504.csv\"", "count = 34");
    assert_eq!((problem.key.as_str(), problem.line), ("held_out.count", line));
    let (problem, _) = one(TIAGO, "[\"x1\", ", "[\"x9\", ");
    assert!(problem.what.contains("no column `x9`"), "{problem}");
    let (problem, _) = one(TIAGO, "column = \"arm_3_joint\"\n", "");
    assert_eq!(problem.key, "robot.joint[3].column");
    for (csv, what, hint) in [
        (TIAGO_CSV.replace(',', ";"), "separated by semicolons", "write commas"),
        (format!("{TIAGO_CSV}\0"), "is not text", "CSV"),
    ] {
        let problem = problems(TIAGO, Ok(&csv)).remove(0);
        assert!(problem.what.contains("tiago-mocap.csv") && problem.what.contains(what), "{problem}");
        assert!(problem.hint.contains(hint), "{problem}");
    }
    let found = problems(TIAGO, Err("no such file"));
    assert!(found[0].what.contains("no such file"), "{found:?}");
}

#[test]
fn sections_without_a_use_can_be_left_out() {
    let without = |text: &str, section: &str, end: &str| {
        let start = text.find(section).expect("the section");
        let length = text[start..].find(end).expect("what follows it");
        format!("{}{}", &text[..start], &text[start + length..])
    };
    // Measured data are judged by no thresholds.
    let tiago = TIAGO.replace("[selection]", "[thresholds]\norientation_deg = 4.0\nlocation_m = 0.03\n\n[selection]");
    let thresholds =
        |text: &str| Scenario::parse("my.toml", text, &|_| Ok(TIAGO_CSV.to_owned())).expect("valid").thresholds;
    assert_eq!((thresholds(&tiago).orientation_deg, thresholds(&tiago).location_m), (4.0, 0.03));
    assert_eq!((thresholds(TIAGO).orientation_deg, thresholds(TIAGO).location_m), (5.0, 0.02));
    // A simulated world is.
    let found = problems(&without(ARM, "[thresholds]", "[settled]"), Err("none"));
    assert_eq!((found.len(), found[0].key.as_str()), (1, "thresholds"), "{found:?}");
    // A learner by the gradient says its rate; where there is none, a composed one has the default.
    let arm = without(ARM, "[gradient]", "[selection]");
    let found = problems(&arm, Err("none"));
    assert_eq!((found.len(), found[0].key.as_str()), (1, "gradient.rate"), "{found:?}");
    let arm = without(&arm, "[[learner]]\nname = \"gradient\"", "[[learner]]\nname = \"unscented\"");
    let scenario =
        Scenario::parse("my.toml", &arm, &|_| Err("none".to_owned())).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(scenario.gradient_rate, 0.1);
    scenario.experiment(1, Some(&["gradient:random".to_owned()])).expect("starts").step().expect("steps");
}

#[test]
fn a_misspelt_builtin_name_gets_a_suggestion() {
    let message = builtin("arm-6dofs").expect_err("unknown").to_string();
    assert!(message.contains("did you mean `arm-6dof`") && message.contains("tiago-mocap"), "{message}");
}

/// The real robot, with seven of its rows held out, drawn by seed.
fn drawn() -> String {
    TIAGO.replace("file = \"tiago-mocap-1504.csv\"", "count = 7")
}

#[test]
fn held_out_rows_differ_by_seed_and_are_never_chosen() {
    let scenario = Scenario::parse("tiago", &drawn(), &|_| Ok(TIAGO_CSV.to_owned())).expect("valid");
    let mut sets = Vec::new();
    for seed in 1..=5 {
        let mut experiment = scenario.experiment(seed, None).expect("starts");
        assert_eq!(experiment.remaining(), Some(30));
        let mut rows: Vec<Vec<usize>> = vec![Vec::new(); 3];
        for _ in 0..30 {
            let report = experiment.step().expect("30 rows");
            for (rows, learner) in rows.iter_mut().zip(&report.learners) {
                rows.push(learner.movement.as_ref().and_then(|movement| movement.row).expect("a row"));
                assert_eq!(learner.metrics.orientation_deg, None);
                assert_eq!(learner.metrics.nees, None);
                assert!(learner.metrics.prediction_mean_m.is_some());
            }
        }
        assert!(experiment.step().is_err(), "the data end");
        rows.iter_mut().for_each(|rows| rows.sort_unstable());
        rows[0].dedup();
        assert_eq!(rows[0].len(), 30, "each row once");
        assert!(rows.iter().all(|learner| *learner == rows[0]), "all learners end with the same rows");
        sets.push(rows.remove(0));
    }
    sets.dedup();
    assert!(sets.len() > 1, "the split depends on the seed");
}

#[test]
fn what_is_held_out_touches_nothing_but_the_prediction_error() {
    let movements = |csv: &str| {
        let open = |_: &str| Ok(csv.to_owned());
        let scenario = Scenario::parse("tiago", &drawn(), &open).expect("valid");
        let mut experiment = scenario.experiment(3, None).expect("starts");
        (0..30)
            .map(|_| {
                experiment.step().expect("30 rows");
                let report = StepReport::of(&experiment);
                let prediction = report.learners[0].metrics.prediction_mean_m;
                let models: Vec<_> = report.learners.iter().map(|learner| learner.estimate.clone()).collect();
                let rows: Vec<_> =
                    report.learners.iter().map(|learner| learner.movement.as_ref().and_then(|m| m.row)).collect();
                (rows, models, prediction)
            })
            .collect::<Vec<_>>()
    };
    let honest = movements(TIAGO_CSV);
    let used: Vec<usize> = honest.iter().filter_map(|(rows, ..)| rows[0]).collect();
    let tampered: Vec<String> = TIAGO_CSV
        .lines()
        .enumerate()
        .map(|(line, text)| match line.checked_sub(1) {
            Some(row) if !used.contains(&row) => format!("9.0{}", &text[text.find(',').expect("a row")..]),
            _ => text.to_owned(),
        })
        .collect();
    let other = movements(&tampered.join("\n"));
    for ((rows, models, prediction), (other_rows, other_models, other_prediction)) in honest.iter().zip(&other) {
        assert_eq!((rows, models), (other_rows, other_models));
        assert_ne!(prediction, other_prediction);
    }
}

/// A robot whose marker no tracker sees: four cables measure how far it is from their anchors.
#[test]
fn distances_alone_are_a_sensor_too() {
    let anchors = ["[1.0, 0.0, 0.8]", "[-0.6, 0.9, 0.5]", "[0.0, -1.0, -0.4]", "[0.3, 0.2, -1.1]"];
    let cable = |to: &str| format!("[[sensor]]\nchannel = \"distance\"\nto_m = {to}\nsigma_m = 0.002\n");
    let cables = anchors.map(cable).join("");
    let text = ARM.replace("[sensor]\n", "# [sensor]\n").replace("sigma_m = 0.01", &cables);
    let read = |text: &str| Scenario::parse("cables.toml", text, &|_| Err("none".to_owned()));
    let scenario = read(&text).expect("a scenario");
    assert_eq!((scenario.measurement_model.sensors().len(), scenario.measurement_model.equations()), (4, 4));
    let mut experiment = scenario.experiment(1001, Some(&["global".to_owned(), "active".to_owned()])).expect("starts");
    // Four distances hold no more than the three coordinates of a position.
    assert_eq!(experiment.setting().movements_by_counting, 8);
    (0..30).for_each(|_| assert!(experiment.step().is_ok()));
    let [global, active] = [0, 1].map(|index| experiment.latest().learners[index].metrics.clone());
    assert_eq!((global.nis_dof, active.nis_dof), (Some(4), Some(4)));
    assert!(global.location_m.is_some_and(|error| error < 0.02), "{global:?}");
    assert!(global.orientation_deg.is_some_and(|error| error < 5.0), "{global:?}");
    for (from, to, key) in [
        ("to_m = [1.0, 0.0, 0.8]", "to_m = [1.0, 0.0]", "sensor[0].to_m"),
        ("to_m = [1.0, 0.0, 0.8]\n", "", "sensor[0].to_m"),
        ("sigma_m = 0.002", "sigma_m = 0.0", "sensor[0].sigma_m"),
        ("channel = \"distance\"", "channel = \"sonar\"", "sensor[0].channel"),
        ("channel = \"distance\"", "channel = \"position\"", "sensor[0].to_m"),
    ] {
        let Err(ScenarioError::Invalid { problems, .. }) = read(&text.replacen(from, to, 1)) else {
            panic!("{to} is refused")
        };
        assert_eq!(problems[0].key, key, "{problems:?}");
    }
}
