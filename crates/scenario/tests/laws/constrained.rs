//! What experiments and agents promise where movements are bound.

use body_schema_engine::{
    estimation::HypothesisSettings,
    selection::{Movement, SelectionError, travel},
};
use body_schema_experiment::{Agent, ChoiceError, Event, Executed, Experiment, NoiseSequence};
use body_schema_scenario::{Scenario, builtin};
use body_schema_wire::Choice;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// A built-in scenario with `[constraints]`, and searches short enough for a test.
fn bound(name: &str, constraints: &str) -> Scenario {
    let plain = builtin(name).expect("built in");
    let text = format!("{}\n{constraints}", plain.source);
    let mut scenario = Scenario::parse("bound.toml", &text, &|file| plain.data_file(file)).expect("still valid");
    scenario.selection.search.max_evaluations = 60;
    scenario.smoother.hypotheses = HypothesisSettings { kept: 6, spawned: 6 };
    scenario
}

fn agent(scenario: &Scenario, name: &str) -> Agent {
    let spec = scenario.chosen(Some(&[name.to_owned()])).expect("fits").remove(0);
    scenario.agent(&spec, 1003).expect("an agent")
}

/// Makes so many steps and checks every movement; the travel of each learner.
fn run(scenario: &Scenario, experiment: &mut Experiment, steps: usize) -> Vec<f64> {
    let constraints = scenario.constraints.as_ref().expect("constrained");
    let learners = experiment.latest().learners.len();
    let mut stands = vec![constraints.start.clone(); learners];
    let mut travelled = vec![0.0; learners];
    for step in 0..steps {
        let report = experiment.step().expect("a step");
        for ((learner, stands), travelled) in report.learners.iter().zip(&mut stands).zip(&mut travelled) {
            let Some(movement) = &learner.movement else { continue };
            let violation = constraints.violation(stands.as_deref(), &movement.configuration);
            assert!(violation.is_none(), "step {step}, {}: {violation:?}", learner.name);
            *travelled += stands.as_ref().map_or(0.0, |stands| travel(stands, &movement.configuration));
            *stands = Some(movement.configuration.clone());
        }
    }
    travelled
}

const TIGHT: &str = "
[constraints]
limits_deg = { elbow = [-80.0, -10.0] }
minimum_height_m = -0.35
start_deg = [0.0, 0.0, 0.0, -20.0, 0.0, 0.0]
greatest_travel_deg = 25.0
[[constraints.box]]
name = \"pillar\"
lower_m = [0.3, 0.1, -0.5]
upper_m = [0.4, 0.4, 0.5]
";

/// Over whole runs of every policy: the greatest travel, too.
#[test]
fn every_movement_of_a_run_is_feasible() {
    let scenario = bound("arm-6dof-selectors", TIGHT);
    let mut names: Vec<String> = scenario.learners.iter().map(|spec| spec.name.clone()).collect();
    names.push("smoother:active-planned".to_owned());
    let mut experiment = scenario.experiment(1001, Some(&names)).expect("starts");
    let travelled = run(&scenario, &mut experiment, 30);
    let most = 30.0 * 25_f64.to_radians() + 1e-9;
    assert!(travelled.iter().all(|way| (1.0..=most).contains(way)), "{travelled:?}");
    assert!(experiment.latest().learners.iter().all(|learner| learner.failure.is_none()));
    // DIRECT's box is what can be reached; the choice says so, and holds what was chosen.
    let choice = Choice::of(&experiment, "active").expect("searched by DIRECT");
    for (joint, x) in choice.joints.iter().zip(&choice.chosen.configuration) {
        assert!(joint.limits[1] - joint.limits[0] <= 50_f64.to_radians() + 1e-9 && !joint.name.is_empty());
        assert!((joint.limits[0]..=joint.limits[1]).contains(x));
    }
}

/// Sockets that cannot be reached any more end a learner, and the others go on.
#[test]
fn sockets_out_of_reach_end_one_learner() {
    let limits = "[constraints]\ngreatest_travel_deg = 1e-5\n";
    let scenario = bound("arm-7dof-socket", limits);
    let names = ["global", "random"].map(str::to_owned);
    let mut experiment = scenario.experiment(1003, Some(&names)).expect("starts");
    for _ in 0..6 {
        experiment.step().expect("a step, whoever has ended");
    }
    assert!(experiment.latest().learners.iter().all(|learner| learner.failure.is_some()));
}

/// A head's visible pose may be out of reach at first.
#[test]
fn a_watched_learner_goes_towards_what_is_in_view() {
    let pose = &builtin("head-fov").expect("built in");
    let joints = pose.robot.names.len();
    let scenario =
        bound("head-fov", &format!("[constraints]\nstart_deg = {:?}\ngreatest_travel_deg = 15.0", vec![0.0; joints]));
    let names = ["active", "random", "global"].map(str::to_owned);
    let mut experiment = scenario.experiment(1002, Some(&names)).expect("starts");
    run(&scenario, &mut experiment, 15);
}

/// Recorded rows: those that are not feasible are left out, and one out of reach ends a learner with the constraint's name,
/// while others go on.
#[test]
fn recorded_rows_are_bound_too() {
    let free = builtin("tiago-mocap").expect("built in").experiment(3, None).expect("starts").remaining();
    let scenario = bound("tiago-mocap", "[constraints]\nlimits_deg = { arm_1_joint = [40.0, 157.5] }");
    let mut experiment = scenario.experiment(3, None).expect("starts");
    let left = experiment.remaining().expect("an end");
    assert!(left > 4 && Some(left) < free, "{left} of {free:?}");
    run(&scenario, &mut experiment, left);
    assert_eq!(experiment.remaining(), Some(0));

    let scenario = bound("tiago-mocap", "[constraints]\ngreatest_travel_deg = 20.0");
    let mut experiment = scenario.experiment(3, None).expect("starts");
    run(&scenario, &mut experiment, 27);
    let ended = experiment.latest().learners.iter().filter_map(|learner| learner.failure.as_deref());
    let ended: Vec<&str> = ended.filter(|failure| failure.contains("excluded by the greatest travel")).collect();
    assert!(!ended.is_empty());
}

/// A price of travel shortens the way, and the arm is learned as well: medians, since what one learner comes to hangs on the last
/// bit of a criterion.
#[test]
fn a_price_of_travel_shortens_the_way() {
    for (learner, steps, price) in [("global", 25, 0.003), ("active", 60, 0.03)] {
        let ways = |price: f64| {
            let start = vec![0.0; 6];
            let scenario =
                bound("arm-6dof", &format!("[constraints]\ntravel_price = {price:?}\nstart_deg = {start:?}"));
            let way = |seed: u64| {
                let mut experiment = scenario.experiment(seed, Some(&[learner.to_owned()])).expect("starts");
                let travelled = run(&scenario, &mut experiment, steps)[0];
                (travelled, experiment.latest().learners[0].metrics.location_m.expect("simulated"))
            };
            let (mut travelled, mut errors): (Vec<f64>, Vec<f64>) = (1001..=1007).map(way).unzip();
            travelled.sort_by(f64::total_cmp);
            errors.sort_by(f64::total_cmp);
            (travelled[3], errors[3])
        };
        let ((free, error_of_free), (dear, error_of_dear)) = (ways(0.0), ways(price));
        assert!(dear < 0.7 * free, "{learner}: {dear} beside {free} rad");
        assert!(error_of_dear < error_of_free + 0.02, "{learner}: {error_of_dear} beside {error_of_free} m");
    }
}

#[test]
fn a_person_is_told_why_a_posture_is_refused() {
    let scenario = bound("arm-6dof", TIGHT);
    let mut experiment = scenario.experiment(6, Some(&["human".to_owned()])).expect("starts");
    let mut refused = |pose: [f64; 6]| match experiment.set_configuration("human", &pose) {
        Err(ChoiceError::Configuration(why)) => why,
        other => panic!("{other:?}"),
    };
    assert!(refused([0.0; 6]).contains("joint `elbow` would be at 0.0000, outside its constrained limits"));
    assert!(refused([0.0, 0.0, 0.0, -1.2, 0.0, 0.0]).contains("joint `elbow` would move by 0.85"));
    assert!(refused([0.4, 0.0, 0.0, -0.35, 0.0, 0.0]).contains("the box `pillar`"));
    experiment.set_configuration("human", &[-0.2, 0.0, 0.0, -0.35, 0.0, 0.1]).expect("feasible");
    experiment.step().expect("a step");
    // From where it was executed.
    experiment.set_configuration("human", &[-0.6, 0.0, 0.0, -0.35, 0.0, 0.1]).expect("feasible");
}

/// What a robot refuses is replaced, again and again, and a stored list of events knows it.
#[test]
fn a_veto_replaces_what_is_pending() {
    let scenario = builtin("arm-6dof").expect("built in");
    for name in ["rls:active", "rls:random", "smoother:active-planned"] {
        let mut lived = agent(&scenario, name);
        let first = lived.propose(3).expect("proposals").to_vec();
        let refused = first[1].selection.movement.configuration.clone();
        let after = lived.veto(&refused).expect("replaced").to_vec();
        assert_eq!((&after[0], after.len(), after[1].id), (&first[0], 3, 3), "{name}");
        let constraints = lived.constraints().expect("bound now").clone();
        for proposal in &after {
            assert!(constraints.allow(None, &proposal.selection.movement.configuration), "{name}");
        }
        let mut events: Vec<Event> = first.iter().cloned().map(Event::Proposed).collect();
        events.push(Event::Vetoed(refused));
        events.extend(after[1..].iter().cloned().map(Event::Proposed));
        let mut restored = agent(&scenario, name);
        events.iter().for_each(|event| restored.restore(event).expect("restored"));
        assert_eq!(restored.pending(), lived.pending());
        let next = |agent: &mut Agent| agent.propose(4).expect("proposals")[3].selection.clone();
        assert_eq!(next(&mut restored), next(&mut lived), "{name}");
        // A robot that refuses all around a posture is soon asked to go elsewhere.
        let stubborn = lived.pending()[0].selection.movement.configuration.clone();
        let limits = &scenario.robot.limits;
        let near = |agent: &Agent| {
            let (a, b) = (agent.pending()[0].selection.movement.configuration.clone(), stubborn.clone());
            limits.to_unit(&a).iter().zip(limits.to_unit(&b)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) < 0.2
        };
        let vetoes = (0..40).take_while(|_| {
            let posture = lived.pending()[0].selection.movement.configuration.clone();
            lived.veto(&posture).expect("replaced");
            near(&lived)
        });
        assert!(vetoes.count() < 40, "{name}");
    }
    let wrong = agent(&scenario, "rls:random").veto(&[0.0]).expect_err("no posture");
    assert_eq!(wrong, SelectionError::NoConfiguration(1));
}

/// Proposals at once are each within reach of the one before; a robot that went elsewhere gets new ones.
#[test]
fn several_proposals_follow_one_another() {
    let scenario = bound("arm-6dof", TIGHT);
    let constraints = scenario.constraints.clone().expect("constrained");
    for name in ["rls:active", "smoother:active-planned"] {
        let mut agent = agent(&scenario, name);
        let proposals = agent.propose(4).expect("proposals").to_vec();
        let mut from = constraints.start.clone();
        for proposal in &proposals {
            let posture = &proposal.selection.movement.configuration;
            assert_eq!(constraints.violation(from.as_deref(), posture), None, "{name}");
            from = Some(posture.clone());
        }
        let configuration = vec![-1.2, -0.5, 1.2, -0.9, -1.2, -0.9];
        let observation = scenario.measurement_model.observe(&scenario.robot.state, &configuration, &[0.0; 3]);
        let movement = Movement::to(configuration.clone());
        agent.absorb(&[Executed { proposal: None, movement, observation }]).expect("measured elsewhere");
        let anew = agent.propose(2).expect("proposals").to_vec();
        assert!(anew.iter().all(|proposal| proposal.id > proposals[3].id), "{name}");
        assert_eq!(constraints.violation(Some(&configuration), &anew[0].selection.movement.configuration), None);
    }
}

/// Postures that hold a target in a socket are bound too; what is carried out is the nearest that truly holds it there.
#[test]
fn postures_in_sockets_are_bound_too() {
    let scenario = bound("arm-7dof-socket", "[constraints]\nlimits_deg = { panda_joint3 = [-30.0, 30.0] }\n");
    for name in ["global", "random", "rls:active"] {
        let experiment = scenario.experiment(1003, Some(&[name.to_owned()])).expect("starts");
        let world = experiment.world();
        let (mut agent, mut noise) = (agent(&scenario, name), NoiseSequence::new(1003));
        for step in 0..8 {
            let proposal = agent.propose(1).expect("a movement")[0].clone();
            let angle = proposal.selection.movement.configuration[2].to_degrees();
            assert!(angle.abs() < 30.0 + 1e-9, "step {step}, {name}: {angle} degrees");
            let draw = noise.draw(world);
            // Where it is pushed into the socket, which need not be where it was sent.
            let movement = world.execute(&proposal.selection.movement, &draw).expect("carried out");
            let observation = world.observe(&movement, &draw).expect("measured");
            agent.absorb(&[Executed { proposal: Some(proposal.id), movement, observation }]).expect("absorbed");
        }
    }
    let text = format!("{}\n[constraints]\nminimum_height_m = 0.5\n", scenario.source);
    let text = text.replacen("[constraints]\nlimits_deg = { panda_joint3 = [-30.0, 30.0] }\n", "", 1);
    let error =
        Scenario::parse("low.toml", &text, &|_| Err("no data".to_owned())).expect_err("excludes the beginnings");
    assert!(error.to_string().contains("with which socket 0 begins"), "{error}");
}

/// Links that do not follow one another are held apart, in a file of a simulated robot where it says so, and a start that is folded is
/// told.
#[test]
fn links_are_held_apart_where_a_file_says_so() {
    assert!(
        bound("arm-12dof", "[constraints]\nminimum_height_m = -9.0")
            .constraints
            .expect("constrained")
            .clearance
            .is_none()
    );
    let clearance = |text: &str| bound("arm-12dof", text).constraints.expect("constrained").clearance;
    assert_eq!(clearance("[constraints]\nself_clearance_m = 0.0").expect("said").pairs(), 0);
    let held = clearance("[constraints]\nself_clearance_m = 0.08").expect("held apart");
    assert!(held.least() == 0.08 && held.pairs() > 2, "{held:?}");
    // A posture in which links are too near to one another.
    let plain = builtin("arm-12dof").expect("built in");
    let constraints = bound("arm-12dof", "[constraints]\nself_clearance_m = 0.08").constraints.expect("constrained");
    let mut rng = ChaCha8Rng::seed_from_u64(1003);
    let limits = &plain.robot.limits;
    let folded =
        (0..20_000).map(|_| limits.draw(&mut rng)).find(|posture| !constraints.allow(None, posture)).expect("one");
    let start: Vec<f64> = folded.iter().map(|angle| angle.to_degrees()).collect();
    for (value, told) in [
        (format!("0.08\nstart_deg = {start:?}"), "clearance of 0.080 m between links"),
        ("-0.1".to_owned(), "constraints.self_clearance_m"),
    ] {
        let text = format!("{}\n[constraints]\nself_clearance_m = {value}\n", plain.source);
        let error = Scenario::parse("folded.toml", &text, &|_| Err("no data".to_owned())).expect_err("not possible");
        assert!(error.to_string().contains(told), "{error}");
    }
}
