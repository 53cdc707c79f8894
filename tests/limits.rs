//! The best designs beside a run: what they are computed for, and that nobody beats them.

use body_schema::{
    design::{BestDesign, best_designs},
    scenario::{Scenario, builtin},
};

fn designs(name: &str, steps: u64) -> Vec<BestDesign> {
    best_designs(&builtin(name).expect("built in").design_stretches(steps))
}

#[test]
fn lengths_double_up_to_the_whole_run() {
    let movements = |steps| designs("head-fov", steps).iter().map(|design| design.movements).collect::<Vec<_>>();
    assert_eq!(movements(0), [0; 0]);
    assert_eq!(movements(3), [3]);
    assert_eq!(movements(5), [5]);
    assert_eq!(movements(23), [5, 10, 20, 23]);
}

#[test]
fn more_movements_allow_less_error_and_a_design_starts_well_from_a_shorter_one() {
    let problem = builtin("arm-6dof").expect("built in").design_problem().expect("simulated");
    let found = designs("arm-6dof", 40);
    assert!(found.windows(2).all(|pair| pair[1].best_design_trace < pair[0].best_design_trace), "{found:?}");
    assert!(found.iter().all(|design| (0.0..=0.01).contains(&design.gap)), "{found:?}");
    // Nothing that a longer search from elsewhere finds is below what the certificate says.
    let last = found.last().expect("designs");
    let alone = problem.best_design(40, 1e-4).expect("noise");
    let least = last.best_design_trace * (1.0 - last.gap);
    assert!((least..=least * 1.01).contains(&alone.trace), "{last:?} and {} to within {}", alone.trace, alone.gap);
}

#[test]
fn a_head_limits_what_can_be_learned() {
    let scenario = builtin("head-fov").expect("built in");
    let watched = scenario.design_problem().expect("simulated");
    let mut unwatched = watched.clone();
    let head = unwatched.head.take().expect("a head");
    let [seen, all] = [watched, unwatched].map(|problem| problem.best_design(20, 0.01).expect("noise"));
    assert!(seen.trace > all.trace, "{} and {}", seen.trace, all.trace);
    assert!(seen.poses.iter().all(|pose| head.sees(&scenario.robot.state.marker_at(pose))));
}

#[test]
fn a_changed_body_is_learned_anew() {
    let steps: Vec<_> = designs("body-change", 310).iter().map(|design| (design.step, design.movements)).collect();
    assert_eq!(steps[..2], [(5, 5), (10, 10)]);
    assert_eq!(steps[steps.len() - 3..], [(300, 300), (305, 5), (310, 10)]);
}

#[test]
fn where_no_truth_or_no_noise_is_known_there_are_none() {
    assert!(designs("tiago-mocap", 10).is_empty());
    let text = builtin("arm-6dof").expect("built in").source.replace("sigma_m = 0.01", "sigma_m = 0.0");
    let exact = Scenario::parse("exact", &text, &|_| Err("none".into())).expect("a scenario");
    assert!(best_designs(&exact.design_stretches(10)).is_empty());
}
