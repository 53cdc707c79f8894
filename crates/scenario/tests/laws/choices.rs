//! How choices are told, and what other movements would have taught.

use body_schema_engine::{
    estimation::HypothesisSettings,
    selection::{Criterion, Planning},
};
use body_schema_experiment::{ChoiceError, Experiment, MovementOutcome};
use body_schema_scenario::builtin;
use body_schema_wire::{AppraisalReport, Choice, StepReport};

/// A learner that plans, with short searches, and takes directions for unknown above this deviation.
fn planning(name: &str, unknown: f64) -> Experiment {
    let mut scenario = builtin(name).expect("built in");
    scenario.selection.search.max_evaluations = 60;
    scenario.selection.planning = Planning { sweeps: 1, unknown, ..scenario.selection.planning };
    scenario.smoother.hypotheses = HypothesisSettings { kept: 8, spawned: 8 };
    scenario.experiment(4, Some(&["global".to_owned()])).expect("starts")
}

#[test]
fn the_chosen_movement_is_the_best_of_its_search_and_of_its_appraisal() {
    for (name, steps) in [("arm-6dof", 3), ("head-fov", 6)] {
        let mut experiment = builtin(name).and_then(|s| s.experiment(4, None)).expect("starts");
        assert!(matches!(experiment.choice("active"), Err(ChoiceError::NotSearched(_))));
        for _ in 0..steps {
            experiment.step().expect("a step");
        }
        let choice = Choice::of(&experiment, "active").expect("searched by DIRECT");
        let last = choice.iterations.last().expect("iterations");
        assert_eq!((last.best_box, last.best), (Some(choice.chosen.rectangle), choice.chosen.criterion));
        assert_eq!(choice.boxes.len(), choice.evaluations);
        let same = experiment.appraise("active", &choice.chosen.configuration).expect("an appraisal");
        let (found, chosen) = (same.appraisal.criterion, choice.chosen.criterion.expect("a criterion"));
        assert!((found - chosen).abs() < 1e-9 * same.appraisal.before, "{name}: {found} {chosen}");
        let other = experiment.appraise("active", &vec![0.0; choice.joints.len()]).expect("an appraisal");
        assert!(
            other.appraisal.gain <= same.appraisal.gain * (1.0 + 1e-9),
            "{name}: {} {}",
            other.appraisal.gain,
            same.appraisal.gain
        );
        assert!(matches!(experiment.choice("random"), Err(ChoiceError::NotSearched(_))));
        assert!(experiment.appraise("random", &choice.chosen.configuration).is_ok(), "it has a covariance too");
        assert!(matches!(
            experiment.appraise("gradient", &choice.chosen.configuration),
            Err(ChoiceError::Selection(_))
        ));
        for wrong in [vec![0.0], vec![f64::NAN; choice.joints.len()], vec![9.0; choice.joints.len()]] {
            assert!(matches!(experiment.appraise("active", &wrong), Err(ChoiceError::Configuration(_))));
        }
        assert!(matches!(experiment.choice("nobody"), Err(ChoiceError::UnknownLearner { .. })));
    }
}

/// Also of steps at which nothing was searched: where all is taken for known, plans of eight movements are carried on.
#[test]
fn a_planner_answers_at_every_step() {
    for (unknown, carried_on) in [(1e-3, vec![]), (10.0, vec![2, 3, 4, 5, 6, 7, 8, 10])] {
        let mut experiment = planning("arm-6dof", unknown);
        assert!(matches!(experiment.choice("global"), Err(ChoiceError::NotSearched(_))));
        let mut without_search = Vec::new();
        for step in 1..=10 {
            let learner = &experiment.step().expect("a step").learners[0];
            let movement = learner.movement.clone().expect("a movement");
            without_search.extend((movement.evaluations() == 0).then_some(step));
            answers(&experiment, &movement);
        }
        assert_eq!(without_search, carried_on);
    }
}

/// The choice and the appraisal of a planner's last movement.
fn answers(experiment: &Experiment, movement: &MovementOutcome) {
    let choice = Choice::of(experiment, "global").expect("explained");
    assert_eq!(choice.chosen.configuration, movement.configuration);
    let holder = &choice.boxes[choice.chosen.rectangle];
    let levels = &holder.shapes.last().expect("a shape").levels;
    for ((x, centre), level) in choice.chosen.point.iter().zip(&holder.centre).zip(levels) {
        assert!((x - centre).abs() <= 0.5 * 3_f64.powi(-i32::from(*level)) + 1e-9, "step {}", choice.step);
    }
    let appraised = experiment.appraise("global", &movement.configuration).expect("an appraisal");
    let appraisal = AppraisalReport::from(&appraised);
    let tolerance = 1e-9 * appraisal.trace;
    assert!((appraisal.criterion - movement.criterion().expect("chosen by it")).abs() < tolerance);
    assert!((appraisal.gain - movement.gain().expect("chosen by it")).abs() < tolerance);
    assert!((choice.trace.expect("has one") - appraisal.trace).abs() < tolerance);
}

/// Under several hypotheses a movement is worth more than what it teaches under the heaviest.
#[test]
fn a_planner_appraises_by_its_own_criterion() {
    let mut experiment = planning("arm-6dof-no-prior", 0.1);
    let weights = builtin("arm-6dof-no-prior").expect("built in").weights();
    for _ in 0..2 {
        let belief = experiment.belief().expect("a learner").clone();
        assert!(belief.weight() < 0.9, "rivals");
        let learner = &experiment.step().expect("a step").learners[0];
        let movement = learner.movement.clone().expect("a movement");
        let found = experiment.appraise("global", &movement.configuration).expect("an appraisal");
        let found = found.appraisal;
        assert!((found.criterion - movement.criterion().expect("chosen by it")).abs() < 1e-9 * found.before);
        let plain = Criterion::new(&belief, &weights).expect("a covariance");
        let plain = plain.appraise(&movement.configuration).expect("an appraisal");
        assert!((plain.criterion / found.criterion - 1.0).abs() > 0.01, "{} {}", plain.criterion, found.criterion);
        assert!(found.before > plain.before, "what is between hypotheses counts too");
    }
}

/// The person's learner goes first, and the active one has chosen before it is found to be waiting.
#[test]
fn a_person_chooses_and_until_then_no_learner_moves() {
    let names = ["active", "human", "random"].map(str::to_owned);
    let open = || builtin("arm-6dof").and_then(|s| s.experiment(6, Some(&names))).expect("starts");
    let (mut experiment, mut patient) = (open(), open());
    let pose = |step: usize| vec![0.3, -0.2 * step as f64, 0.5, -0.4, 0.1 * step as f64, 0.2];
    for step in 0..4 {
        let before = experiment.latest().clone();
        for _ in 0..2 {
            let refused = experiment.step().expect_err("nobody has chosen").to_string();
            assert!(refused.contains("`human`") && refused.contains("set a configuration"), "{refused}");
        }
        assert_eq!((experiment.latest(), experiment.configuration("human").expect("known")), (&before, None));
        experiment.set_configuration("human", &[0.0; 6]).expect("a first thought");
        let expected = experiment.set_configuration("human", &pose(step)).expect("a second one, which counts");
        assert_eq!(experiment.configuration("human").expect("known"), Some(pose(step).as_slice()));
        let made = experiment.step().expect("a step").learners[1].movement.clone().expect("a movement");
        assert_eq!((made.gain(), made.configuration), (Some(expected.appraisal.gain), pose(step)));
        assert!((made.predicted_marker - expected.appraisal.marker).amax() < 1e-12);
        // What was refused has left no trace in anybody.
        patient.set_configuration("human", &pose(step)).expect("set");
        patient.step().expect("a step");
        let [one, other] = [&experiment, &patient].map(|it| StepReport::of(it).learners);
        for (one, other) in one.iter().zip(&other) {
            assert_eq!(one.estimate, other.estimate);
        }
    }
}

/// The best there is at hand has the whole share, a movement made twice next to none.
#[test]
fn a_posture_is_told_its_share_of_the_best_gain() {
    for name in ["arm-6dof", "head-fov"] {
        let names = ["active", "human"].map(str::to_owned);
        let mut experiment = builtin(name).and_then(|s| s.experiment(2, Some(&names))).expect("starts");
        let joints = experiment.setting().joints.len();
        for _ in 0..3 {
            let told = experiment.set_configuration("human", &vec![0.05; joints]).expect("an appraisal");
            let share = told.appraisal.gain / told.best_gain.expect("searched");
            assert_eq!(told.share(), Some(share.clamp(0.0, 1.0)));
            experiment.step().expect("a step");
            let again = experiment.appraise("human", &vec![0.05; joints]).expect("an appraisal");
            assert_eq!((again.best_gain, again.share()), (told.best_gain, told.share()), "the same, looked back at");
        }
        let choice = Choice::of(&experiment, "human").expect("what DIRECT would have found");
        let best = choice.boxes.iter().filter_map(|found| Some((found.value?, &found.centre)));
        let (_, centre) = best.min_by(|a, b| a.0.total_cmp(&b.0)).expect("boxes");
        let limits = choice.joints.iter().map(|joint| joint.limits);
        let best: Vec<f64> = limits.zip(centre).map(|([lower, upper], x)| lower + x * (upper - lower)).collect();
        let share = experiment.appraise("human", &best).expect("an appraisal").share().expect("searched");
        assert!(share > 1.0 - 1e-9, "{name}: {share}");
        let chosen = experiment.latest().learners[0].movement.clone().expect("a movement");
        let share = experiment.appraise("active", &chosen.configuration).expect("an appraisal").share();
        assert!(share.expect("searched") > 1.0 - 1e-9, "{name}: {share:?}");
    }
}

#[test]
fn only_a_person_is_told_where_to_move_and_only_within_the_limits() {
    let names = ["active", "human"].map(str::to_owned);
    let mut experiment = builtin("arm-6dof").and_then(|s| s.experiment(6, Some(&names))).expect("starts");
    let mut set = |learner: &str, pose: &[f64]| experiment.set_configuration(learner, pose).expect_err("refused");
    assert!(matches!(set("active", &[0.0; 6]), ChoiceError::ChoosesItself(name) if name == "active"));
    assert!(matches!(set("nobody", &[0.0; 6]), ChoiceError::UnknownLearner { .. }));
    for wrong in [&[0.0; 5][..], &[9.0; 6], &[f64::NAN; 6]] {
        assert!(matches!(set("human", wrong), ChoiceError::Configuration(_)), "{wrong:?}");
    }
    assert_eq!(experiment.configuration("human").expect("known"), None);
}
