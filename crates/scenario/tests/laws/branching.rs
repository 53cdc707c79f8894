//! Robots that branch: what one part sees of another, and eyes that follow a hand.

use body_schema_engine::model::Frame;
use body_schema_scenario::{Scenario, builtin};
use body_schema_wire::RunResult;

/// Two arms of three joints on one base, each with a body at its end, and an eye on the left one; `sensors` and `more` are added.
fn two_arms(sensors: &str, more: &str) -> Result<Scenario, String> {
    let arm = |side: &str, across: f64| {
        let joint = |name: &str, parent: &str, axis: [f64; 3], point: [f64; 3]| {
            format!(
                "[[robot.joint]]\nname = \"{side}_{name}\"\nparent = \"{parent}\"\nkind = \"revolute\"\naxis = {axis:?}\npoint_m = {point:?}\n\
                 limits_deg = [-100.0, 100.0]\n"
            )
        };
        joint("1", "base", [0.0, 0.0, 1.0], [0.0, across, 0.0])
            + &joint("2", &format!("{side}_1"), [0.0, 1.0, 0.0], [0.0, across, 0.1])
            + &joint("3", &format!("{side}_2"), [1.0, 0.0, 0.0], [0.2, across, 0.15])
    };
    let body = |side: &str, across: f64| {
        format!(
            "[[target]]\nname = \"{side}\"\nlink = \"{side}_3\"\nat_m = [0.4, {across:?}, 0.05]\nrpy_deg = [10.0, 20.0, 30.0]\n"
        )
    };
    let text = format!(
        "name = \"two\"\ntitle = \"two arms\"\nsteps = 60\n[robot]\n{}{}{}{}[[camera]]\nname = \"eye\"\nlink = \"left_3\"\n\
         at_m = [0.3, 0.2, 0.1]\nlooks_at_m = [0.6, -0.2, 0.0]\nsize_px = [640.0, 480.0]\nfocal_px = [500.0, 500.0]\n\
         [prediction]\nof = \"right\"\nin = \"left\"\n{sensors}{more}\
         [initial_error]\ndraw = \"up_to\"\nangle_deg = 5.0\npoint_m = 0.03\n[prior]\ndirection_rad = 0.1\npoint_m = 0.03\n\
         [filter]\nmeasurement_variance_m2 = 1e-6\n[selection]\nvariant = \"direct-l\"\nepsilon = 1e-4\nevaluations = 100\nunits = \"prior\"\n\
         [thresholds]\norientation_deg = 1.0\nlocation_m = 0.01\n[settled]\nexpected_prediction_m = 0.002\n[[learner]]\nname = \"global\"\nestimator = \"smoother\"\npolicy = \"random\"\n",
        arm("left", 0.3),
        arm("right", -0.3),
        body("left", 0.3),
        body("right", -0.3),
    );
    Scenario::parse("two.toml", &text, &|_| Err("no data".to_owned())).map_err(|error| error.to_string())
}

/// Whatever the one arm measures of the other teaches where its hand is in the frame of the other's, and the learner is as sure as it
/// may be.
#[test]
fn arms_are_learned_from_what_one_measures_of_the_other() {
    let at_a_camera = "[sensor]\nchannel = \"position\"\ntarget = \"right\"\nin = \"eye\"\nsigma_m = 0.001\n";
    let between_hands =
        "[sensor]\nchannel = \"pose\"\ntarget = \"right\"\nin = \"left\"\nsigma_m = 0.001\nsigma_deg = 0.2\n";
    let with_depth = "[[sensor]]\nchannel = \"depth\"\ntarget = \"right\"\nsigma_m = 0.001\n\
                      [[sensor]]\nchannel = \"position\"\ntarget = \"right\"\nin = \"left\"\nsigma_m = 0.002\n";
    let with_bar = "[[sensor]]\nchannel = \"distance\"\ntarget = \"right\"\nto = \"left\"\nsigma_m = 0.0005\n\
                    [[sensor]]\nchannel = \"position\"\ntarget = \"left\"\nin = \"right\"\nsigma_m = 0.002\n";
    for sensors in [at_a_camera, between_hands, with_depth, with_bar] {
        let scenario = two_arms(sensors, "").unwrap_or_else(|error| panic!("{sensors}: {error}"));
        let mut experiment = scenario.experiment(1001, None).expect("an experiment");
        for _ in 0..39 {
            experiment.step().expect("a step");
        }
        let metrics = &experiment.step().expect("a step").learners[0].metrics;
        let error = metrics.prediction_mean_m.expect("a truth");
        assert!(error < 4e-3, "{sensors}: {error} m");
        let nees = metrics.nees.expect("a covariance") / metrics.nees_dof.expect("a covariance") as f64;
        assert!(nees < 2.0, "{sensors}: {nees}");
    }
}

/// What is wrong is told with its key and what to write.
#[test]
fn what_does_not_fit_a_branching_robot_is_told() {
    let position =
        |rest: &str| format!("[sensor]\nchannel = \"position\"\ntarget = \"right\"\nsigma_m = 0.001\n{rest}\n");
    let distance =
        |rest: &str| format!("[sensor]\nchannel = \"distance\"\ntarget = \"right\"\nsigma_m = 0.001\n{rest}\n");
    let view = |rest: &str| format!("[view]\nvisible_pose_deg = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0]\n{rest}\n");
    for (sensor, more, told) in [
        (position("in = \"eyes\""), String::new(), "write one of eye, left, right"),
        (position("in = \"right\""), String::new(), "always at the same place in its own frame"),
        (position("to = \"left\""), String::new(), "this channel has no use for it"),
        (distance("to = \"middle\""), String::new(), "there is no to `middle`"),
        (distance("to = \"right\""), String::new(), "no distance from itself"),
        (distance("to = \"left\"\nto_m = [0.0, 0.0, 0.0]"), String::new(), "a fixed point is given as well"),
        (position("in = \"eye\""), view("servo = [\"left_4\"]"), "did you mean `left_"),
        (position("in = \"eye\""), view("servo = [\"right_1\"]"), "`right_1` does not move the camera"),
        (
            position("in = \"eye\""),
            view("servo = [\"left_1\"]\ntarget = \"left\""),
            "moves what it is to aim at as well",
        ),
        (position("in = \"eye\""), view("servo = [\"left_1\"]\ntarget = [\"right\", \"left\"]"), "`left_1` moves what"),
        (
            position("in = \"eye\""),
            view("servo = [\"left_1\"]\ntarget = [\"right\", \"right\"]"),
            "`right` is named twice",
        ),
        (position("in = \"eye\""), view("servo = [\"left_1\"]\ntarget = [\"right\", \"foot\"]"), "there is no `foot`"),
        (position("in = \"eye\""), view("servo = [\"left_1\"]\ntarget = []"), "they aim at nothing"),
        (position("in = \"eye\""), view("servo = [\"left_1\"]\ntarget = 3"), "`view.target`: is no name"),
        (position("in = \"eye\""), view("servo = []"), "no joint is named"),
        (position("in = \"eye\""), view("camera = \"eye\""), "no joint aims it"),
    ] {
        let error = two_arms(&sensor, &more).expect_err(&sensor);
        assert!(error.contains(told), "{sensor}{more}: {error}");
    }
    let eyes = builtin("humanoid-eyes").expect("built in");
    for (from, to, told) in [
        ("parent = \"base\"\n", "parent = \"elbow\"\n", "does not stand before this one"),
        ("parent = \"base\"\n", "parent = \"nowhere\"\n", "there is no joint `nowhere`"),
        ("link = \"wrist_pitch\"\n", "", "the robot branches, and has no last link"),
        ("in = \"eye\"\n", "in = \"cube\"\n", "always at the same place in its own frame"),
        ("in = \"eye\"\n", "in = \"ear\"\n", "there is no target or camera `ear`"),
    ] {
        assert!(eyes.source.contains(from), "{from}");
        let text = eyes.source.replacen(from, to, 1);
        let error = Scenario::parse("eyes.toml", &text, &|_| Err("no data".to_owned())).expect_err(to).to_string();
        assert!(error.contains(told), "{to}: {error}");
    }
}

/// Of a robot that nobody sees from outside a run says in a sentence that the whole of it may be elsewhere, and names nothing.
#[test]
fn what_nobody_sees_from_outside_is_known_up_to_a_motion() {
    let eyes = builtin("humanoid-eyes").expect("built in");
    let mut experiment = eyes.experiment(1001, Some(&["smoother-random".to_owned()])).expect("an experiment");
    experiment.step().expect("a step");
    let remarks = RunResult::of(&experiment).learners.remove(0).remarks;
    let said = "nothing is measured from outside, so that all is known up to one rigid motion: 6 directions in which";
    assert!(remarks.len() == 1 && remarks[0].starts_with(said), "{remarks:?}");
}

/// The true neck turns to the true hand, whatever is believed; of what is proposed the neck follows from the arm as believed.
#[test]
fn a_neck_follows_the_hand() {
    let scenario = builtin("humanoid-eyes").expect("built in");
    for learner in ["global", "smoother-random", "active"] {
        let mut experiment = scenario.experiment(1001, Some(&[learner.to_owned()])).expect("an experiment");
        for step in 0..3 {
            let outcome = experiment.step().expect("a step");
            let movement = outcome.learners[0].movement.as_ref().expect("a movement");
            let proposed = &movement.proposal.as_ref().expect("proposed").selection.movement.configuration;
            let made = &movement.configuration;
            assert_eq!(proposed[2..], made[2..], "{learner} {step}: the arm goes where it is asked to");
            let truth = &scenario.robot.state;
            assert_eq!(scenario.measurement_model.aimed(truth, proposed).as_ref(), made, "{learner} {step}");
            let limits = scenario.robot.limits.joints();
            let is_free = (0..2).all(|joint| limits[joint].0 < made[joint] && made[joint] < limits[joint].1);
            let at = truth.relative(Frame::Target(0), Frame::Device(0), made).translation.vector;
            assert!(!is_free || (at.x.hypot(at.y) < 1e-6 && at.z > 0.0), "{learner} {step}: {at}");
            // DIRECT divides the joints of the arm alone.
            for leaf in movement.partition().iter().flat_map(|partition| &partition.leaves) {
                assert!(leaf.levels[..2] == [0, 0] && leaf.levels.len() == 8);
            }
        }
    }
}

/// The tag on the chest is left out unless it is asked for; with it the eye sees both, and the hand is learned as well.
#[test]
fn an_optional_target_is_left_out_or_seen() {
    let scenario = builtin("humanoid-eyes").expect("built in");
    let counts =
        |scenario: &Scenario| (scenario.robot.equipment.targets.len(), scenario.measurement_model.sensors().len());
    assert_eq!(counts(&scenario), (1, 1));
    let both = scenario.with(&["robot.first_targets=2".parse().expect("a replacement")]).expect("valid");
    assert_eq!(counts(&both), (2, 2));
    for count in ["0", "3"] {
        let refused = scenario.with(&[format!("robot.first_targets={count}").parse().expect("a replacement")]);
        assert!(refused.expect_err("out of range").to_string().contains("from 1 to 2"));
    }
    let mut experiment = both.experiment(1001, Some(&["global".to_owned()])).expect("an experiment");
    let (mut seen, mut last) = ([0, 0], f64::INFINITY);
    for _ in 0..20 {
        let outcome = experiment.step().expect("a step");
        let learner = &outcome.learners[0];
        let readings = &learner.movement.as_ref().expect("a movement").observation.readings;
        seen.iter_mut().zip(readings).for_each(|(seen, reading)| *seen += usize::from(reading.is_some()));
        last = learner.metrics.prediction_mean_m.expect("a truth");
    }
    assert!(seen[0] >= 8 && seen[1] >= 1 && last < 0.005, "{seen:?} {last}");
}
