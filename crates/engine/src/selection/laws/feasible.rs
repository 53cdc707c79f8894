//! What every policy promises where movements are constrained.

use nalgebra::{DVector, Point3};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{Case, JOINTS, PARAMETERS, arm, search, watch};
use crate::{
    kinematics::JointBox,
    model::Workspace,
    optimize::Settings,
    selection::{
        Actions, Active, Constraints, Human, Minimiser, Movement, Obstacle, Outline, Planner, Planning, Policy, Random,
        SelectionError, Situation, travel,
    },
    sensing::{Equipment, TargetKind},
};

fn unconstrained(limits: &JointBox) -> Constraints {
    let names: Vec<String> = (0..JOINTS).map(|joint| format!("joint-{joint}")).collect();
    let mut equipment = Equipment::default();
    equipment.targets.push(TargetKind {
        name: "marker".to_owned(),
        points: vec![Point3::origin()],
        facing: None,
        partly_seen: None,
    });
    let outline = Outline::new(&arm(), &names, &equipment);
    Constraints::new(names, limits.clone(), outline)
}

fn obstacle(centre: [f64; 3], half: f64) -> Obstacle {
    let centre = Point3::from(centre);
    let half = nalgebra::Vector3::repeat(half);
    Obstacle { name: "box".to_owned(), lower: centre - half, upper: centre + half }
}

/// Constraints of every kind, some of which leave much and some little; the stance at θ = 0.
fn drawn(rng: &mut ChaCha8Rng, limits: &JointBox) -> Constraints {
    let mut constraints = unconstrained(limits);
    if rng.random() {
        let mut tightened = limits.joints().to_vec();
        tightened[rng.random_range(0..JOINTS)] = (-0.4, 0.7);
        constraints.tightened = JointBox::new(tightened).expect("limits");
    }
    for _ in 0..rng.random_range(0..3) {
        let centre = std::array::from_fn(|_| rng.random_range(-0.6..0.6));
        constraints.obstacles.push(obstacle(centre, rng.random_range(0.02..0.2)));
    }
    constraints.minimum_height = rng.random::<bool>().then(|| rng.random_range(-0.5..-0.1));
    constraints.start = Some(vec![0.0; JOINTS]);
    if rng.random() {
        constraints.greatest_travel = vec![rng.random_range(0.05..1.0); JOINTS];
    }
    constraints.price = [0.0, 0.05][rng.random_range(0..2)];
    for _ in 0..rng.random_range(0..4) {
        constraints.veto(&limits.draw(rng));
    }
    if rng.random_range(0..5) == 0 {
        constraints.allowed = Some((0..200).map(|_| limits.draw(rng)).collect());
    }
    if rng.random() {
        constraints.hold_apart(rng.random_range(0.02..0.1), []);
    }
    constraints
}

/// Every policy, with short searches.
fn policies(case: &Case) -> Vec<(&'static str, Box<dyn Policy>)> {
    let active = |minimiser| Active::new(case.weights.clone(), minimiser);
    let planning = Planning { sweeps: 1, ahead: 3, ..Planning::default() };
    let planner = || Planner::new(case.weights.clone(), search(40), planning, Workspace::default());
    let original = Settings { max_evaluations: 60, ..Settings::default() };
    vec![
        ("direct-l", Box::new(active(Minimiser::Direct(search(60))))),
        ("direct", Box::new(active(Minimiser::Direct(original)))),
        ("random search", Box::new(active(Minimiser::Random { evaluations: 30 }))),
        ("bayesian", Box::new(active(Minimiser::Bayesian { evaluations: 20 }))),
        ("monte carlo", Box::new(active(Minimiser::Direct(search(30))).sampled(3))),
        ("watched", Box::new(active(Minimiser::Direct(search(60))).watched(watch(1.0)))),
        ("planner", Box::new(planner())),
        ("watched planner", Box::new(planner().watched(watch(1.0)))),
        ("random", Box::new(Random::new(case.weights.clone(), None))),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// No policy ever chooses what is not feasible, movement by movement; where it finds nothing, it names a constraint.
    #[test]
    fn nothing_infeasible_is_chosen(seed: u64, pooled: bool, learned in prop_oneof![Just(0.4), Just(0.02)]) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let constraints = drawn(&mut rng, &Case::new(learned).limits());
        for (name, policy) in policies(&Case::new(learned)) {
            let mut case = if pooled { Case::new(learned).with_pool(60) } else { Case::new(learned) };
            for step in 0..4 {
                let selected = case.select_within(policy.as_ref(), &constraints);
                let selection = match selected {
                    Ok(selection) => selection,
                    Err(SelectionError::Infeasible(nothing)) => {
                        let said = nothing.to_string();
                        prop_assert!(["limits", "travel", "box", "height", "refused", "list"].iter().any(|it| said.contains(it)));
                        break;
                    }
                    Err(error) => return Err(TestCaseError::fail(format!("{name}: {error}"))),
                };
                let from = case.history.posture().or(constraints.start.as_deref());
                let violation = constraints.violation(from, &selection.movement.configuration);
                prop_assert!(violation.is_none(), "{name}, movement {step}: {violation:?}");
                // What is said of the movement holds without the price of getting there.
                if selection.criterion.is_some() && name != "monte carlo" && !(pooled && name.contains("watched")) {
                    case.check_values(policy.as_ref(), &selection);
                }
                case.moved(&selection, step % 3 != 1);
                case.actions.use_up(&selection.movement);
            }
        }
    }
}

/// What is feasible is a corner of the box, which rounding leaves when it is scaled to the unit cube and back.
#[test]
fn a_corner_is_found() {
    let seed = 1_212_315_602_338_997_873;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut constraints = drawn(&mut rng, &Case::new(0.02).limits());
    constraints.clearance = None;
    for (name, policy) in policies(&Case::new(0.02)) {
        let mut case = Case::new(0.02);
        for movement in 0..4 {
            let selection = match case.select_within(policy.as_ref(), &constraints) {
                Err(SelectionError::Infeasible(_)) => break,
                selected => selected.unwrap_or_else(|error| panic!("{name}, movement {movement}: {error}")),
            };
            case.moved(&selection, movement % 3 != 1);
        }
    }
}

/// DIRECT against brute force: where the best posture of all is forbidden, the best feasible one is found.
#[test]
fn the_best_of_what_is_left_is_found() {
    let case = Case::of(DVector::from_fn(PARAMETERS, |k, _| if k < 8 { 0.2 } else { 0.01 }));
    let limits = case.limits();
    let policy = Active::new(case.weights.clone(), Minimiser::Direct(search(1500)));
    let free = case.select(&policy).expect("a selection");
    let mut constraints = unconstrained(&limits);
    let hand = arm().marker_at(&free.movement.configuration);
    constraints.obstacles.push(obstacle([hand.x, hand.y, hand.z], 0.15));
    constraints.minimum_height = Some(-0.3);
    assert!(constraints.violation(None, &free.movement.configuration).is_some());
    let bound = case.select_within(&policy, &constraints).expect("a selection");
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let draws: Vec<Vec<f64>> = (0..40_000).map(|_| limits.draw(&mut rng)).collect();
    let feasible: Vec<Vec<f64>> = draws.into_iter().filter(|posture| constraints.allow(None, posture)).collect();
    let values =
        crate::selection::Criterion::new(&case.belief, &case.weights).expect("a covariance").evaluate(&feasible);
    let brute = values.into_iter().fold(f64::INFINITY, f64::min);
    let found = bound.criterion.expect("chosen by it");
    let scale = found + bound.gain.expect("a gain") - brute;
    assert!(found <= brute + 0.02 * scale, "{found} beside {brute}");
    // What is not feasible has no value, and is no centre that is chosen.
    let partition = bound.search.expect("searched").partition();
    let (mut without, mut with) = (0, 0);
    for leaf in &partition.leaves {
        let is_feasible = constraints.allow(None, &limits.from_unit(&leaf.centre));
        assert_eq!(leaf.value.is_some(), is_feasible);
        *(if is_feasible { &mut with } else { &mut without }) += 1;
    }
    assert!(with > 100 && without > 20, "{with} and {without}");
}

/// What DIRECT does not come upon is found by draws, and a search within reach of the stance is a search of a small box.
#[test]
fn a_small_feasible_set_is_found() {
    let case = Case::new(0.3);
    let mut constraints = unconstrained(&case.limits());
    // Of six joints, all but a corner of the box: about one posture in a hundred.
    constraints.minimum_height = Some(0.1);
    constraints.obstacles.push(obstacle([0.0, 0.5, 0.3], 0.45));
    for (name, policy) in policies(&case) {
        let selection =
            case.select_within(policy.as_ref(), &constraints).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert!(constraints.allow(None, &selection.movement.configuration), "{name}");
    }
    let mut constraints = unconstrained(&case.limits());
    constraints.start = Some(vec![0.1; JOINTS]);
    constraints.greatest_travel = vec![0.01; JOINTS];
    let policy = Active::new(case.weights.clone(), Minimiser::Direct(search(60)));
    let selection = case.select_within(&policy, &constraints).expect("a selection");
    let partition = selection.search.expect("searched").partition();
    assert!(partition.leaves.iter().all(|leaf| leaf.value.is_some()));
    assert!(partition.limits.iter().all(|[lower, upper]| (lower - 0.09).abs() + (upper - 0.11).abs() < 1e-12));
}

#[test]
fn who_excludes_everything_is_named() {
    let case = Case::new(0.3);
    let excluding = |change: &dyn Fn(&mut Constraints)| {
        let mut constraints = unconstrained(&case.limits());
        change(&mut constraints);
        constraints
    };
    for (named, constraints) in [
        ("the minimum height", excluding(&|constraints| constraints.minimum_height = Some(2.0))),
        ("the box `box`", excluding(&|constraints| constraints.obstacles = vec![obstacle([0.0; 3], 3.0)])),
        (
            "the list of allowed",
            excluding(&|constraints| {
                constraints.allowed = Some(vec![vec![0.2; JOINTS]]);
                constraints.minimum_height = Some(2.0);
            }),
        ),
        (
            "`joint-2` stands at 1.4000",
            excluding(&|constraints| {
                constraints.tightened = JointBox::new(vec![(-1.0, 1.0); JOINTS]).expect("limits");
                constraints.start = Some((0..JOINTS).map(|joint| if joint == 2 { 1.4 } else { 0.0 }).collect());
                constraints.greatest_travel = vec![0.3; JOINTS];
            }),
        ),
    ] {
        for (name, policy) in policies(&case) {
            let found = case.select_within(policy.as_ref(), &constraints);
            let Err(SelectionError::Infeasible(nothing)) = found else { panic!("{name}: {found:?}") };
            let said = nothing.to_string();
            let expected = if named.contains("list") { "the minimum height" } else { named };
            assert!(said.contains(expected), "{name}: {said}");
        }
    }
    // In a pool, too, where rows are left that cannot be reached.
    let mut case = Case::new(0.3);
    case.actions = Actions::Pool(vec![Movement { configuration: vec![1.0; JOINTS], row: Some(0), socket: None }]);
    let constraints = excluding(&|constraints| {
        constraints.start = Some(vec![0.0; JOINTS]);
        constraints.greatest_travel = vec![0.5; JOINTS];
    });
    let found = case.select_within(&Random::new(case.weights.clone(), None), &constraints);
    assert!(found.expect_err("out of reach").to_string().contains("is excluded by the greatest travel"));
}

/// The dearer travel is, the shorter the way to the movement; what it would teach is told without its price.
#[test]
fn a_price_keeps_the_robot_near() {
    let case = Case::new(0.3);
    let mut ways = Vec::new();
    for price in [0.0, 0.3, 3.0] {
        let mut constraints = unconstrained(&case.limits());
        constraints.start = Some(vec![0.0; JOINTS]);
        constraints.price = price;
        for (name, policy) in policies(&case).into_iter().filter(|(name, _)| *name == "direct-l" || *name == "planner")
        {
            let selection = case.select_within(policy.as_ref(), &constraints).expect("a selection");
            case.check_values(policy.as_ref(), &selection);
            ways.push((name, travel(&[0.0; JOINTS], &selection.movement.configuration)));
        }
    }
    for (index, (name, way)) in ways.iter().enumerate().skip(2) {
        assert!(*way < 0.8 * ways[index - 2].1, "{name}: {ways:?}");
    }
}

/// A person is measured by what is feasible.
#[test]
fn what_a_person_might_have_done_is_feasible() {
    let case = Case::new(0.3);
    let mut constraints = unconstrained(&case.limits());
    constraints.minimum_height = Some(0.0);
    let human = Human::new(Active::new(case.weights.clone(), Minimiser::Direct(search(100))));
    let mut situation = case.situation();
    situation.constraints = Some(&constraints);
    let partition = human.explain(&situation, &case.limits()).expect("searched").expect("by DIRECT").partition();
    let limits = partition.searched(&case.limits());
    for leaf in &partition.leaves {
        assert_eq!(leaf.value.is_some(), constraints.allow(None, &limits.from_unit(&leaf.centre)));
    }
}

/// How the criterion looks over the box is told also where recorded movements are chosen from, and none is left of them.
#[test]
fn a_choice_from_a_list_is_explained_over_the_box() {
    let planner =
        |case: &Case| Planner::new(case.weights.clone(), search(40), Planning::default(), Workspace::default());
    for count in [20, 0] {
        let case = Case::new(0.3).with_pool(count);
        let limits = case.limits();
        let explained = planner(&case).explain(&case.situation(), &limits).expect("searched").expect("by DIRECT");
        assert!(explained.partition().limits.is_empty() && explained.partition().leaves.len() > 20);
        let mut constraints = unconstrained(&limits);
        constraints.minimum_height = Some(-0.1);
        let within = |constraints: &Constraints| {
            let situation = Situation { constraints: Some(constraints), ..case.situation() };
            planner(&case).explain(&situation, &limits).expect("explained")
        };
        let leaves = within(&constraints).expect("by DIRECT").partition().leaves;
        assert!(leaves.iter().any(|leaf| leaf.value.is_none()) && leaves.iter().any(|leaf| leaf.value.is_some()));
        constraints.allowed = Some(vec![vec![0.0; JOINTS]]);
        assert_eq!(within(&constraints), None);
    }
}
