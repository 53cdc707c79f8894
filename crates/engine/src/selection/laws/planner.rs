//! What the planner promises.

use nalgebra::DVector;

use super::{Case, JOINTS, PARAMETERS, apart, needs_a_covariance, search, takes_the_best_of_a_pool, watch};
use crate::selection::{
    CriterionUnits, Planned, Planner, Planning, Policy, Selection, Situation, Weights, plan::condition,
};

fn planner(case: &Case, planning: Planning) -> Planner {
    let short = Planning { sweeps: 1, ..planning };
    Planner::new(case.weights.clone(), search(60), short, Vec::new().into())
}

fn greedy(case: &Case) -> Planner {
    planner(case, Planning { ahead: 1, ..Planning::default() })
}

fn planned(selection: &Selection) -> &Planned {
    selection.plan.as_ref().expect("a planner plans")
}

/// One equation for each direction whose deviation is above the threshold, three a movement, and one to spare.
#[test]
fn plans_as_many_movements_as_are_still_needed() {
    let planned = |unknown: usize, planning: Planning| {
        let case = Case::of(DVector::from_fn(PARAMETERS, |k, _| if k < unknown { 0.2 } else { 0.01 }));
        let planned = planned(&case.select(&planner(&case, planning)).expect("a selection")).clone();
        // The one that is made at once is no longer in the plan.
        (1 + planned.poses.len(), planned.committed)
    };
    let default = Planning::default();
    for (unknown, movements) in [(1, 2), (3, 2), (4, 3), (12, 5), (24, 9)] {
        assert_eq!(planned(unknown, default), (movements, 0), "{unknown} unknown directions");
    }
    assert_eq!(planned(24, Planning { unknown: 0.3, ..default }).1, 7, "nothing is unknown above 0.3");
    assert_eq!(planned(12, Planning { spare: 3, ..default }), (7, 0));
    assert_eq!(planned(24, Planning { ahead: 4, ..default }), (4, 0), "no more than are asked for");
    assert_eq!(planned(24, Planning { ahead: 1, ..default }), (1, 0), "greedily");
    assert_eq!(planned(1, Planning { batch: 3, ..default }), (3, 2), "as many as are carried out in one go");
    // One equation per parameter, all of it committed.
    assert_eq!(planned(0, default), (8, 7));
    assert_eq!(planned(0, Planning { ahead: 1, ..default }), (1, 0));
}

/// In the units of the criterion: where a radian counts as 10 cm, 2 cm are as much as a fifth of one.
#[test]
fn what_is_unknown_is_told_by_the_weights_of_the_criterion() {
    let mut case = Case::new(0.02);
    assert_eq!(planned(&case.select(&planner(&case, Planning::default())).expect("a selection")).committed, 7);
    let deviations = DVector::from_element(PARAMETERS, 0.02);
    case.weights = Weights::new(CriterionUnits::CharacteristicLength(0.1), &case.belief.layout, &deviations);
    let selection = case.select(&planner(&case, Planning::default())).expect("a selection");
    // The two coordinates of each point.
    assert_eq!((planned(&selection).poses.len(), planned(&selection).committed), (4, 0));
}

/// Takes a step of a plan that is carried on, and checks that it is one of its movements and the rest stays.
fn carry_on(case: &mut Case, policy: &Planner, last: &Selection) -> Selection {
    case.moved(last, true);
    let (before, next) = (planned(last), case.select(policy).expect("a selection"));
    let mut poses = planned(&next).poses.clone();
    assert_eq!((next.evaluations, &next.search), (0, &None), "nothing is searched");
    assert!(!poses.contains(&next.movement.configuration), "it is made once");
    poses.push(next.movement.configuration.clone());
    assert!(poses.len() == before.poses.len() && before.poses.iter().all(|pose| poses.contains(pose)));
    assert_eq!(planned(&next).committed + 1, before.committed);
    case.check_values(policy, &next);
    next
}

#[test]
fn once_nothing_is_unknown_a_plan_is_carried_out_before_the_next_is_made() {
    let mut case = Case::new(0.05);
    let policy = planner(&case, Planning::default());
    let mut selection = case.select(&policy).expect("a selection");
    assert!(selection.evaluations > 0 && selection.search.is_some());
    for _ in 0..7 {
        selection = carry_on(&mut case, &policy, &selection);
    }
    assert_eq!(planned(&selection), &Planned::default());
    case.moved(&selection, true);
    let anew = case.select(&policy).expect("a selection");
    assert!(anew.evaluations > 0 && planned(&anew).committed == 7, "{:?}", planned(&anew));
}

#[test]
fn while_something_is_unknown_a_plan_is_made_anew_after_every_batch() {
    for batch in [1, 3] {
        let mut case = Case::new(0.3);
        let policy = planner(&case, Planning { batch, ..Planning::default() });
        let mut selection = case.select(&policy).expect("a selection");
        for _ in 1..batch {
            selection = carry_on(&mut case, &policy, &selection);
        }
        assert_eq!(planned(&selection).committed, 0);
        case.moved(&selection, true);
        let anew = case.select(&policy).expect("a selection");
        assert!(anew.evaluations > 0 && planned(&anew).poses.len() == 8, "{}", planned(&anew).poses.len());
    }
}

/// The body may have changed.
#[test]
fn a_plan_made_when_all_was_known_is_dropped_once_something_is_not() {
    for batch in [1, 3] {
        let mut case = Case::new(0.05);
        let policy = planner(&case, Planning { batch, ..Planning::default() });
        let selection = case.select(&policy).expect("a selection");
        assert_eq!(planned(&selection).committed, 7);
        case.moved(&selection, true);
        case.belief = Case::new(0.3).belief;
        let anew = case.select(&policy).expect("a selection");
        assert!(anew.evaluations > 0, "in batches of {batch}");
        assert_eq!(planned(&anew).committed, batch - 1);
    }
}

/// By the criterion of one movement, which `appraise` tells, with a rival and without.
#[test]
fn the_first_of_a_plan_is_what_teaches_most_at_once() {
    for case in [Case::new(0.3), Case::new(0.3).with_rival()] {
        let policy = planner(&case, Planning::default());
        let selection = case.select(&policy).expect("a selection");
        let chosen = selection.criterion.expect("chosen by it");
        assert!(planned(&selection).poses.iter().all(|pose| case.value(&policy, pose) >= chosen));
        case.check_values(&policy, &selection);
        assert!(case.limits().contains(&selection.movement.configuration));
    }
}

#[test]
fn the_partition_tells_which_rectangle_holds_the_movement() {
    let case = Case::new(0.3);
    let selection = case.select(&planner(&case, Planning::default())).expect("a selection");
    let partition = selection.search.expect("searched").partition();
    let leaf = &partition.leaves[partition.chosen];
    let point = case.limits().to_unit(&selection.movement.configuration);
    for ((x, centre), level) in point.iter().zip(&leaf.centre).zip(&leaf.levels) {
        assert!((x - centre).abs() <= 0.5 * 3_f64.powi(-i32::from(*level)) + 1e-9, "{x} {leaf:?}");
    }
}

/// What is explained is the criterion of the next movement: that of the appraisal at every rectangle's centre. What is
/// polished from there is at least as good.
#[test]
fn explanations_agree_with_appraisals() {
    let case = Case::new(0.3).with_rival();
    let policy = greedy(&case);
    let search = policy.explain(&case.situation(), &case.limits()).expect("a search").expect("a planner explains");
    let partition = search.partition();
    let leaves = &partition.leaves;
    for leaf in leaves {
        let (found, value) = (case.value(&policy, &case.limits().from_unit(&leaf.centre)), leaf.value.expect("finite"));
        assert!((found - value).abs() < 1e-9 * found, "{found} {value}");
    }
    let least = leaves.iter().filter_map(|leaf| leaf.value).fold(f64::INFINITY, f64::min);
    assert_eq!(leaves[partition.chosen].value, Some(least));
    let selection = case.select(&policy).expect("a selection");
    assert!(selection.criterion.expect("chosen by it") < least, "polished");
}

#[test]
fn the_same_situation_gives_the_same_selection() {
    let mut case = Case::new(0.3).with_rival();
    let policy = planner(&case, Planning::default());
    let first = case.select(&policy).expect("a selection");
    assert_eq!(case.select(&policy.clone()), Ok(first.clone()));
    case.moved(&first, true);
    let second = case.select(&policy).expect("a selection");
    assert_eq!(case.select(&policy), Ok(second));
}

#[test]
fn eight_movements_planned_together_teach_more_than_eight_greedy_ones() {
    let trace = |case: &Case| case.weights.trace(case.belief.covariance.as_ref().expect("kept"));
    let mut together = Case::new(0.5);
    let policy = planner(&together, Planning { spare: 0, ..Planning::default() });
    let selection = together.select(&policy).expect("a selection");
    let poses = std::iter::once(&selection.movement.configuration).chain(&planned(&selection).poses);
    let poses: Vec<Vec<f64>> = poses.cloned().collect();
    assert_eq!(poses.len(), 8);
    poses.iter().for_each(|pose| assert!(condition(&mut together.belief, pose, |_| 1.0)));
    let mut one_by_one = Case::new(0.5);
    for _ in 0..8 {
        let selection = one_by_one.select(&greedy(&one_by_one)).expect("a selection");
        condition(&mut one_by_one.belief, &selection.movement.configuration, |_| 1.0);
    }
    let (together, one_by_one) = (trace(&together), trace(&one_by_one));
    assert!(together < 0.8 * one_by_one, "{together} {one_by_one}");
}

#[test]
fn rivals_count_in_a_pool_too() {
    let case = Case::new(0.02).with_rival();
    let policy = greedy(&case);
    takes_the_best_of_a_pool(&policy, case);
    let case = Case::new(0.3);
    needs_a_covariance(&planner(&case, Planning::default()));
}

/// Also where what is believed to be in view is not: misses are remembered.
#[test]
fn where_a_head_watches_it_begins_where_it_is_seen_and_avoids_what_was_missed() {
    for planning in [Planning::default(), Planning { ahead: 1, ..Planning::default() }] {
        let mut case = Case::new(0.2);
        let policy = planner(&case, planning).watched(watch(1.0));
        let first = case.select(&policy).expect("a selection");
        assert_eq!((&first.movement.configuration, first.criterion), (&vec![0.0; JOINTS], None));
        case.moved(&first, true);
        let mut missed: Vec<Vec<f64>> = Vec::new();
        for _ in 0..4 {
            let selection = case.select(&policy).expect("a selection");
            case.check_values(&policy, &selection);
            let pose = selection.movement.configuration.clone();
            for before in &missed {
                // Where the chance is discounted to a hundredth nothing is worth looking for.
                let apart = apart(&case.limits(), before, &pose);
                assert!(apart > 0.02, "{apart} from a miss");
            }
            case.moved(&selection, false);
            missed.push(pose);
            let Situation { history, .. } = case.situation();
            assert_eq!(history.misses().len(), missed.len());
        }
    }
}

#[test]
fn where_nothing_is_in_view_it_goes_back_to_where_it_is_seen() {
    let mut case = Case::new(0.001);
    let policy = planner(&case, Planning { ahead: 2, ..Planning::default() }).watched(watch(-1.0));
    let first = case.select(&policy).expect("a selection");
    case.moved(&first, true);
    let selection = case.select(&policy).expect("a selection");
    assert_eq!((&selection.movement.configuration, selection.criterion), (&vec![0.0; JOINTS], None));
    assert_eq!(planned(&selection).committed, 0);
}
