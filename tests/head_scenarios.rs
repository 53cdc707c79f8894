//! Scenarios with a head that watches or a body that changes: what is wrong in a file, and what learners may know.

use body_schema::{
    experiment::{RunResult, StepReport, Summary},
    model::State,
    scenario::{Problem, Scenario, ScenarioError, WorldSpec, builtin},
    sensing::Head,
};

const FOV: &str = include_str!("../scenarios/head-fov.toml");
const CHANGE: &str = include_str!("../scenarios/body-change.toml");

fn parse(text: &str) -> Result<Scenario, ScenarioError> {
    Scenario::parse("my.toml", text, &|_| Err("no data".to_owned()))
}

/// Replaces `from` and returns the one problem, with the line on which the replacement stands.
fn one(text: &str, from: &str, to: &str) -> (Problem, usize) {
    assert!(text.contains(from), "the test's own premise: {from}");
    let line = text[..text.find(from).expect("contained")].matches('\n').count() + 1;
    match parse(&text.replacen(from, to, 1)) {
        Err(ScenarioError::Invalid { mut problems, .. }) if problems.len() == 1 => (problems.remove(0), line),
        other => panic!("one problem: {other:?}"),
    }
}

fn watched(scenario: &Scenario) -> (Head, Vec<f64>, State) {
    match &scenario.world {
        WorldSpec::Simulated { watch: Some(watch), .. } => {
            (watch.head.expect("a head"), watch.visible_pose.clone(), scenario.robot.state.clone())
        }
        other => panic!("a head watches: {other:?}"),
    }
}

#[test]
fn problems_of_a_head_name_line_key_and_mend() {
    let pose = "visible_pose_deg = [0.0, 0.0, 0.0, -60.0]";
    for (from, to, key, hint) in [
        ("pan_limit_deg = 15.0", "pan_limit = 15.0", "head.pan_limit", "pan_limit_deg"),
        ("pan_limit_deg = 15.0", "pan_limit_deg = -1.0", "head.pan_limit_deg", "from 0"),
        ("lens_half_angle_deg = 20.0", "lens_half_angle_deg = nan", "head.lens_half_angle_deg", "from 1"),
        ("lens_half_angle_deg = 20.0", "lens_angle_deg = 20.0", "head.lens_angle_deg", "lens_half_angle_deg"),
        ("look = [0.8, 0.0, -0.6]", "look = [0.8, 0.0, -0.9]", "head.look", "[0.664364, 0.000000, -0.747409]"),
        ("look = [0.8, 0.0, -0.6]", "look = [0.0, 0.0, -1.0]", "head.look", "upright"),
        (pose, "visible_pose_deg = [20.0, 20.0, 0.0]", "head.visible_pose_deg", "one position per joint"),
        (pose, "visible_pose_deg = [20.0, 70.0, 0.0, -60.0]", "head.visible_pose_deg", "from -90.0000 to 60.0000"),
        (pose, "visible_pose_deg = [20.0, nan, 0.0, -60.0]", "head.visible_pose_deg", "for this joint"),
        (pose, "visible_pose_deg = [-90.0, 20.0, 0.0, 0.0]", "head.visible_pose_deg", "look = ["),
        ("position_m = [-0.05, 0.25, 0.45]", "position_m = [-0.05, 0.25, inf]", "head.position_m", "finite"),
    ] {
        let (problem, line) = one(FOV, from, to);
        assert_eq!((problem.key.as_str(), problem.line), (key, line), "{problem}");
        assert!(problem.hint.contains(hint), "{problem}");
    }
    let (problem, _) = one(FOV, pose, "");
    assert_eq!(problem.key, "head.visible_pose_deg");
}

#[test]
fn problems_of_a_change_name_line_key_and_mend() {
    for (from, to, key, hint) in [
        ("\nstep = 300", "\nstep = 0", "change.step", "at least 1"),
        ("angle_deg = 10.0", "angle = 10.0", "change.tilt.angle", "angle_deg"),
        ("angle_deg = 10.0", "angle_deg = 0.0", "change.tilt.angle_deg", "above 0"),
        ("towards = [0.0, 0.0, 1.0]", "towards = [0.0, 0.0, 2.0]", "change.tilt.towards", "unit vector"),
        ("towards = [0.0, 0.0, 1.0]", "towards = [0.0, 1.0, 0.0]", "change.tilt.towards", "differs"),
        ("tilt = { joint = \"elbow\"", "tilt = { joint = \"elbou\"", "change.tilt.joint", "`elbow`"),
        ("by_m = [0.0, 0.0, 0.05]", "by_m = [nan, 0.0, 0.0]", "change.shift.by_m", "finite"),
    ] {
        let (problem, line) = one(CHANGE, from, to);
        assert_eq!(problem.key, key, "{problem}");
        assert_eq!(problem.line, line + from.matches('\n').count(), "{problem}");
        assert!(problem.hint.contains(hint), "{problem}");
    }
    let (problem, _) = one(CHANGE, "learn_marker = true", "learn_marker = false");
    assert_eq!(problem.key, "change.shift.joint");
    let (problem, _) = one(CHANGE, "estimator = \"gradient\"", "estimator = \"gradient\"\nstabilising_noise = true");
    assert_eq!(problem.key, "learner[2].stabilising_noise");
}

#[test]
fn active_starts_at_the_visible_pose_and_all_learners_may_miss() {
    let scenario = builtin("head-fov").expect("built in");
    let (head, pose, truth) = watched(&scenario);
    let mut experiment = scenario.experiment(4, None).expect("starts");
    for step in 0..30 {
        let outcome = experiment.step().expect("a step");
        for learner in &outcome.learners {
            let movement = learner.movement.as_ref().expect("moved");
            if step == 0 && learner.name == "active" {
                assert_eq!(movement.configuration, pose);
            }
            let seen = head.sees(&truth.marker_at(&movement.configuration));
            assert_eq!(movement.measured_marker.is_some(), seen);
        }
    }
    let misses = |index: usize| experiment.latest().learners[index].metrics.misses;
    let (active, random, naive) = (misses(0), misses(1), misses(3));
    assert!(active < random && random < naive, "{active} {random} {naive}");
}

#[test]
fn what_is_known_stays_fixed() {
    let frozen = ["shoulder_yaw", "wrist_pitch"];
    let mut text = include_str!("../scenarios/arm-6dof.toml").to_owned();
    for name in frozen {
        let line = format!("name = \"{name}\"\n");
        text = text.replacen(&line, &format!("{line}learned = false\n"), 1);
    }
    let scenario = parse(&text).expect("four of six");
    assert_eq!(scenario.robot.layout.dimension(), 16);
    let mut experiment = scenario.experiment(2, None).expect("starts");
    for _ in 0..25 {
        experiment.step().expect("a step");
        let report = StepReport::of(&experiment);
        for learner in &report.learners {
            for (index, name) in scenario.robot.names.iter().enumerate() {
                let joint = &learner.estimate.joints[index];
                let truth = &scenario.robot.state.joints[index];
                let is_true = joint.axis == <[f64; 3]>::from(truth.direction().into_inner());
                let known = frozen.contains(&name.as_str());
                assert_eq!(is_true, known, "{name}");
                assert_eq!(learner.metrics.joints[index].axis_deg.is_none(), known, "{name}");
                assert!(!known || joint.point_covariance_m2.is_none());
            }
        }
    }
}

/// Random movements, so that only the noise differs. All runs see the same seeds.
#[test]
fn stabilising_noise_lets_the_filter_recover_from_a_changed_body() {
    let scenario = builtin("body-change").expect("built in");
    let recovered = |learner: &str| {
        let run = |seed: u64| {
            let mut experiment = scenario.experiment(seed, Some(&[learner.to_owned()])).expect("starts");
            (0..600).for_each(|_| assert!(experiment.step().is_ok()));
            let learner = RunResult::of(&experiment).learners.remove(0);
            learner.recovered_at
        };
        Summary::of((1..=8).map(run))
    };
    let (with, without) = (recovered("random"), recovered("rigid"));
    assert!(with.converged == with.runs, "with: {with:?}");
    assert!(without.converged <= 3, "without: {without:?}");
}

#[test]
fn without_a_change_nothing_recovers() {
    let mut experiment = builtin("arm-6dof").expect("built in").experiment(1, None).expect("starts");
    (0..40).for_each(|_| assert!(experiment.step().is_ok_and(|report| report.truth.is_none())));
    assert!(RunResult::of(&experiment).learners.iter().all(|learner| learner.recovered_at.is_none()));
}
