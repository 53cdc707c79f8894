//! Laws of agents, over all estimators and policies: propose and absorb are two, and a list of events tells all.

use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use body_schema_engine::{
    estimation::HypothesisSettings, kinematics::JointBox, selection::Movement, sensing::Observation,
};
use body_schema_experiment::{AbsorbError, Agent, Event, Executed};
use body_schema_scenario::{EstimatorKind, PolicyKind, Scenario, builtin};

/// Every estimator with every policy that fits it.
fn pairs(scenario: &Scenario) -> Vec<String> {
    let pairs = EstimatorKind::ALL.into_iter().flat_map(|estimator| PolicyKind::ALL.map(|policy| (estimator, policy)));
    // A person proposes nothing.
    pairs
        .filter(|(_, policy)| *policy != PolicyKind::Human)
        .map(|(estimator, policy)| format!("{}:{}", estimator.name(), policy.name()))
        .filter(|name| scenario.chosen(Some(std::slice::from_ref(name))).is_ok())
        .collect()
}

fn agent(scenario: &Scenario, name: &str, seed: u64) -> Agent {
    let spec = scenario.chosen(Some(&[name.to_owned()])).expect("fits").remove(0);
    scenario.agent(&spec, seed).expect("an agent")
}

/// What an agent believes, bit by bit.
fn belief_bits(agent: &Agent) -> Vec<u64> {
    let belief = agent.belief();
    let mut numbers = Vec::new();
    let mut put = |state: &body_schema_engine::model::State| {
        for joint in &state.joints {
            numbers.extend(joint.direction().iter().copied());
            numbers.extend(
                joint.line().into_iter().flat_map(|line| line.point.coords.iter().copied().collect::<Vec<_>>()),
            );
        }
        numbers.extend(state.marker().coords.iter().copied());
    };
    put(&belief.state);
    belief.alternatives.iter().for_each(|alternative| put(&alternative.state));
    numbers.extend(belief.alternatives.iter().map(|alternative| alternative.weight));
    numbers.extend(belief.covariance.iter().flat_map(|p| p.iter().copied()));
    numbers.into_iter().map(f64::to_bits).collect()
}

/// Lives through a random list of events with a world that is the scenario's robot: proposals asked for once or twice,
/// carried out as proposed or a little differently, out of order, never, or taken back; movements that nobody proposed;
/// measurements that do not fit.
fn live(scenario: &Scenario, agent: &mut Agent, seed: u64) -> Vec<Event> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let limits: &JointBox = &scenario.robot.limits;
    let mut events = Vec::new();
    for _ in 0..7 {
        let known = agent.pending().len();
        let count = rng.random_range(1..=2);
        let first = agent.propose(count).expect("proposals").to_vec();
        let again = agent.propose(count).expect("proposals").to_vec();
        assert_eq!(first, again, "asking twice gives the same proposals");
        events.extend(first[known..].iter().cloned().map(Event::Proposed));
        if rng.random_range(0..6) == 0 {
            let id = first[rng.random_range(0..first.len())].id;
            assert!(agent.withdraw(id) && !agent.withdraw(id));
            events.push(Event::Withdrawn(id));
            continue;
        }
        let chosen = &first[rng.random_range(0..first.len())];
        let (proposal, configuration) = match rng.random_range(0..4) {
            0 => (None, limits.draw(&mut rng)),
            1 => {
                let shaken = chosen.selection.movement.configuration.iter().map(|q| q + rng.random_range(-0.01..0.01));
                (Some(chosen.id), shaken.collect())
            }
            _ => (Some(chosen.id), chosen.selection.movement.configuration.clone()),
        };
        let noise: Vec<f64> =
            (0..scenario.measurement_model.equations()).map(|_| rng.random_range(-1.0..1.0)).collect();
        let observation = match rng.random_range(0..5) {
            0 => Observation::missed(scenario.measurement_model.sensors().len()),
            _ => scenario.measurement_model.observe(&scenario.robot.state, &configuration, &noise),
        };
        let executed = Executed { proposal, movement: Movement::to(configuration), observation };
        refuses_what_does_not_fit(agent, &executed);
        agent.absorb(std::slice::from_ref(&executed)).expect("a measurement");
        events.push(Event::Executed(executed));
    }
    events
}

/// A bad measurement, alone or behind a good one, is refused with a reason, and nothing is changed by it.
fn refuses_what_does_not_fit(agent: &mut Agent, good: &Executed) {
    let before = (belief_bits(agent), agent.pending().to_vec());
    let mut bad = Vec::new();
    for observation in [
        Observation { readings: Vec::new() },
        Observation::of([1.0]),
        Observation::of([f64::NAN, 0.0, 0.0]),
        Observation::of([0.0, f64::INFINITY, 0.0]),
    ] {
        bad.push(Executed { observation, ..good.clone() });
    }
    for configuration in [Vec::new(), vec![f64::NAN; good.movement.configuration.len()]] {
        bad.push(Executed { movement: Movement::to(configuration), ..good.clone() });
    }
    for bad in bad {
        for list in [vec![bad.clone()], vec![good.clone(), bad.clone()]] {
            assert!(matches!(agent.absorb(&list), Err(AbsorbError::Refused(_))), "{bad:?}");
            assert!(agent.failure().is_none());
        }
    }
    assert!(before == (belief_bits(agent), agent.pending().to_vec()), "a refused measurement changed something");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(3))]

    /// Replaying a list of events gives belief, pending proposals and the next proposal to the last bit; the belief depends
    /// on the executed ones alone.
    #[test]
    fn a_list_of_events_tells_all(seed: u64) {
        for name in ["arm-6dof-doubled-error", "head-fov"] {
            let mut scenario = builtin(name).expect("built in");
            // Short searches: what is replayed does not depend on how long they are.
            scenario.selection.search.max_evaluations = 30;
            scenario.smoother.hypotheses = HypothesisSettings { kept: 4, spawned: 3 };
            for pair in pairs(&scenario) {
                let mut lived = agent(&scenario, &pair, seed);
                let events = live(&scenario, &mut lived, seed ^ 5);
                let mut replayed = agent(&scenario, &pair, seed);
                events.iter().for_each(|event| replayed.restore(event).expect("restored"));
                prop_assert!(belief_bits(&lived) == belief_bits(&replayed), "{} {}: belief", name, pair);
                prop_assert!(lived.pending() == replayed.pending(), "{} {}: pending", name, pair);
                let next = |agent: &mut Agent| {
                    let count = agent.pending().len() + 1;
                    agent.propose(count).expect("a proposal").last().map(|proposal| proposal.selection.clone())
                };
                prop_assert!(next(&mut lived) == next(&mut replayed), "{} {}: next proposal", name, pair);
                // Without any proposal the belief is the same.
                let mut told = agent(&scenario, &pair, seed);
                for event in &events {
                    if let Event::Executed(executed) = event {
                        let executed = Executed { proposal: None, ..executed.clone() };
                        told.absorb(&[executed]).expect("a measurement");
                    }
                }
                prop_assert!(belief_bits(&lived) == belief_bits(&told), "{} {}: belief without proposals", name, pair);
            }
        }
    }
}

/// The numbers of a proposal depend on its ordinal alone, not on how many its forerunners used.
#[test]
fn random_numbers_are_keyed_by_the_ordinal() {
    let scenario = builtin("arm-6dof").expect("built in");
    let mut one_by_one = agent(&scenario, "rls:random", 3);
    let all = agent(&scenario, "rls:random", 3).propose(4).expect("proposals").to_vec();
    for (ordinal, expected) in all.iter().enumerate() {
        let found = one_by_one.propose(1).expect("a proposal")[0].clone();
        assert_eq!((found.id, &found.selection), (ordinal as u64, &expected.selection));
        assert!(one_by_one.withdraw(found.id));
    }
}

/// Where a head watches, the first movement goes to the visible pose, and those proposed with it elsewhere.
#[test]
fn only_the_first_of_several_proposals_goes_to_the_visible_pose() {
    let scenario = builtin("head-fov").expect("built in");
    for name in ["rls:active", "smoother:active-planned"] {
        let proposals = agent(&scenario, name, 1001).propose(3).expect("proposals").to_vec();
        let movements: Vec<_> = proposals.iter().map(|proposal| &proposal.selection.movement).collect();
        assert!(movements[0] != movements[1] && movements[1] != movements[2], "{name}: {movements:?}");
    }
}

/// A reading beyond all numbers is refused by every estimator, and the next one is learned from.
#[test]
fn an_absurd_reading_ends_nobody() {
    let scenario = builtin("arm-6dof").expect("built in");
    for pair in pairs(&scenario).iter().filter(|pair| pair.ends_with(":random")) {
        let mut agent = agent(&scenario, pair, 1001);
        let before = belief_bits(&agent);
        let configuration = vec![0.1; 6];
        let good = scenario.measurement_model.observe(&scenario.robot.state, &configuration, &[0.0; 3]);
        let executed = |observation| {
            let movement = Movement::to(configuration.clone());
            [Executed { proposal: None, movement, observation }]
        };
        let refused = agent.absorb(&executed(Observation::of([1e160, 0.0, 0.0])));
        assert!(matches!(refused, Err(AbsorbError::Refused(_))), "{pair}: {refused:?}");
        assert!(before == belief_bits(&agent));
        agent.absorb(&executed(good)).expect("a measurement");
        assert!(before != belief_bits(&agent), "{pair} learned nothing");
    }
}

/// `arm-6dof` with one thing changed.
fn changed_arm(from: &str, to: &str) -> Scenario {
    let text = include_str!("../../../../scenarios/arm-6dof.toml");
    let changed = text.replacen(from, to, 1);
    assert_ne!(changed, text);
    Scenario::parse("arm.toml", &changed, &|_| Err("no data".into())).expect("a scenario")
}

/// At a rate that is far too large the gradient leaves all bounds at once: it says so, and the others learn as without it.
#[test]
fn a_learner_that_diverges_says_so_and_the_others_go_on() {
    let end = |scenario: &Scenario| {
        let learners = ["random", "gradient", "active"].map(str::to_owned);
        let mut experiment = scenario.experiment(1001, Some(&learners)).expect("an experiment");
        for _ in 0..8 {
            experiment.step().expect("a step");
        }
        experiment.latest().learners.clone()
    };
    let (well, badly) = (end(&builtin("arm-6dof").expect("built in")), end(&changed_arm("rate = 0.3", "rate = 1e9")));
    for (well, badly) in well.iter().zip(&badly) {
        assert!(badly.metrics.prediction_mean_m.is_some_and(f64::is_finite), "{badly:?}");
        let diverged = badly.failure.as_deref().filter(|why| why.contains("diverged") && why.contains("rate"));
        assert_eq!(diverged.is_some(), badly.name == "gradient", "{badly:?}");
        if badly.failure.is_none() {
            assert_eq!((badly.metrics.movements, &badly.metrics), (8, &well.metrics));
        }
    }
}

/// Two joints on one line, of which nobody can tell whose angle is whose, and a marker that the last joint does not move.
#[test]
fn degenerate_arms_end_nobody() {
    for (from, to) in [
        ("axis = [0.0, 1.0, 0.0]\npoint_m = [0.0, 0.0, 0.0]", "axis = [0.0, 0.0, 1.0]\npoint_m = [0.0, 0.0, 0.3]"),
        ("marker_m = [0.66, 0.02, 0.05]", "marker_m = [0.56, 0.1, 0.0]"),
    ] {
        let learners = ["active", "unscented", "global"].map(str::to_owned);
        let mut experiment = changed_arm(from, to).experiment(1001, Some(&learners)).expect("an experiment");
        for _ in 0..15 {
            for learner in &experiment.step().expect("a step").learners {
                let (name, metrics) = (&learner.name, &learner.metrics);
                assert!(learner.failure.is_none(), "{name}: {:?}", learner.failure);
                let told = [metrics.prediction_mean_m, metrics.expected_prediction_m, metrics.trace];
                assert!(told.iter().all(|number| number.is_some_and(f64::is_finite)), "{name}: {told:?}");
            }
        }
    }
}

/// Two proposals at once are two movements.
#[test]
fn proposals_are_chosen_given_the_pending_ones() {
    let scenario = builtin("arm-6dof").expect("built in");
    for name in ["rls:active", "smoother:active-planned"] {
        let mut agent = agent(&scenario, name, 3);
        let proposals = agent.propose(3).expect("proposals").to_vec();
        let gains: Vec<f64> = proposals.iter().filter_map(|proposal| proposal.selection.gain).collect();
        assert!(gains.len() == 3 && gains.iter().all(|gain| *gain > 0.0), "{name}: {gains:?}");
        for (index, a) in proposals.iter().enumerate() {
            for b in &proposals[..index] {
                assert_ne!(a.selection.movement, b.selection.movement, "{name}");
            }
        }
    }
}

/// Where a reading was rejected there is little to be learned: nothing near it is asked for in the next movements.
#[test]
fn what_was_rejected_is_not_asked_for_again() {
    let scenario = builtin("arm-6dof-outliers").expect("built in");
    for seed in 1001..1004 {
        let mut agent = agent(&scenario, "global", seed);
        let truth = &scenario.robot.state;
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut rejected: Option<Vec<f64>> = None;
        for index in 0..31 {
            let proposal = agent.propose(1).expect("chosen")[0].clone();
            let theta = &proposal.selection.movement.configuration;
            let unit = agent.limits().to_unit(theta);
            if let Some(rejected) = &rejected {
                let squared: f64 = unit.iter().zip(rejected).map(|(a, b)| (a - b) * (a - b)).sum();
                assert!(squared.sqrt() > 0.05, "seed {seed}: asked again after {index} movements");
            }
            let mut seen = truth.marker_at(theta);
            seen.coords.iter_mut().for_each(|x| *x += 0.01 * rng.sample::<f64, _>(rand_distr::StandardNormal));
            if index == 25 {
                seen.x += 3.0;
                rejected = Some(unit);
            }
            let movement = proposal.selection.movement.clone();
            let observation = Observation::seen(seen);
            let executed = Executed { proposal: Some(proposal.id), movement, observation };
            agent.absorb(&[executed]).expect("absorbed");
        }
        let weights: Vec<f64> = agent.latest_readings(26).iter().map(|reading| reading.weight).collect();
        assert!(weights.first().is_some_and(|weight| *weight < 1e-3), "seed {seed}: {weights:?}");
    }
}
