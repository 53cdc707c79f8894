//! Convergence over fixed seeds. Every bar comes from a scenario file or from the design; none is tuned to the seeds.

use body_schema::{
    experiment::{Comparison, LearnerComparison, SeedRun, Trace},
    scenario::{BUILTIN, Scenario, builtin},
};

/// Runs one learner over seeds on two threads; the outcome does not depend on that.
fn compare(scenario: &Scenario, learner: &str, seeds: &[u64], steps: u64) -> LearnerComparison {
    let run = |seed: &u64| {
        let experiment = scenario.experiment(*seed, Some(&[learner.to_owned()])).expect("starts");
        Trace::run(experiment, steps, || {}).expect("runs to its end")
    };
    let (left, right) = seeds.split_at(seeds.len() / 2);
    let traces: Vec<Trace> = std::thread::scope(|scope| {
        let left = scope.spawn(move || left.iter().map(run).collect::<Vec<_>>());
        let right: Vec<_> = right.iter().map(run).collect();
        left.join().expect("no panic").into_iter().chain(right).collect()
    });
    Comparison::of(&scenario.name, steps, &traces).learners.remove(0)
}

/// Every scenario that promises is held to it. Steps beyond the promise confirm that a run stays converged.
#[test]
fn learners_keep_the_promises_of_their_scenarios() {
    let seeds = [201, 202, 203, 204, 205, 206];
    let mut promises = 0;
    for found in BUILTIN {
        let scenario = builtin(found.name).expect("built in");
        for (learner, &promise) in &scenario.promises {
            promises += 1;
            let outcome = compare(&scenario, learner, &seeds, promise + 60);
            let late: Vec<_> =
                outcome.runs.iter().filter(|run| run.converged_at.is_none_or(|at| at > promise)).collect();
            // A promise is 1.3 times the 90th percentile: one run in six may be the tenth that is later.
            assert!(late.len() <= 1, "{} {learner} promised {promise}: {late:?}", found.name);
        }
    }
    assert!(promises >= 4, "the scenarios promise something");
}

#[test]
fn active_beats_random_and_the_gradient_does_not_converge() {
    let scenario = builtin("arm-6dof").expect("built in");
    let seeds: Vec<u64> = (301..=312).collect();
    let median = |learner: &str, steps| {
        let outcome = compare(&scenario, learner, &seeds, steps);
        (outcome.summary.converged, outcome.summary.median_converged_at)
    };
    let (active, random) = (median("active", 500), median("random", 700));
    let ratio = active.1.expect("converges") / random.1.expect("converges");
    assert!(ratio <= 0.8, "active {active:?}, random {random:?}");
    let (converged, _) = median("gradient", 1000);
    assert!(converged <= 2, "gradient converged in {converged} of 12");
}

/// The field of view: the issue asks for a quarter of random's movements and fewer than 10 % misses over 20 seeds; the
/// ratio here leaves room for the spread of 12.
#[test]
fn within_a_field_of_view_active_beats_random_and_seldom_misses() {
    let scenario = builtin("head-fov").expect("built in");
    let seeds: Vec<u64> = (301..=312).collect();
    let (active, random) = (compare(&scenario, "active", &seeds, 500), compare(&scenario, "random", &seeds, 2000));
    let median = |outcome: &LearnerComparison| outcome.summary.median_converged_at.expect("converges");
    let ratio = median(&active) / median(&random);
    assert!(ratio <= 1.0 / 3.0, "active {:?}, random {:?}", active.summary, random.summary);
    let share = |outcome: &LearnerComparison| {
        let sum = |count: fn(&SeedRun) -> u64| outcome.runs.iter().map(count).sum::<u64>() as f64;
        sum(|run| run.misses) / sum(|run| run.movements)
    };
    assert!(share(&active) < 0.1 && share(&random) > 0.6, "{} and {}", share(&active), share(&random));
}

#[test]
fn a_real_robot_is_predicted_better_after_learning_and_sooner_when_chosen_actively() {
    let scenario = builtin("tiago-mocap").expect("built in");
    let seeds: Vec<u64> = (1..=20).collect();
    let mean = |learner: &str| {
        let outcome = compare(&scenario, learner, &seeds, 27);
        [0, 12, 27].map(|movements: usize| {
            outcome.curve[movements].prediction_mean_m.expect("held-out measurements").mean * 1e3
        })
    };
    let ([start, active_12, active_end], [_, random_12, random_end]) = (mean("active"), mean("random"));
    assert!((3.4..4.6).contains(&start), "{start} mm before learning");
    assert!(active_end <= 3.3 && random_end <= 3.3, "{active_end} and {random_end} mm with all rows");
    assert!(active_12 <= 0.92 * random_12, "{active_12} and {random_12} mm at 12 rows");
}

#[test]
fn the_same_seed_gives_the_same_numbers() {
    for name in ["arm-12dof", "tiago-mocap"] {
        let scenario = builtin(name).expect("built in");
        let run = || {
            let mut experiment = scenario.experiment(5, None).expect("starts");
            (0..25).map(|_| experiment.step().map(|_| ())).collect::<Result<Vec<_>, _>>().expect("25 steps");
            let mut report = experiment.latest().clone();
            for movement in report.learners.iter_mut().filter_map(|learner| learner.movement.as_mut()) {
                movement.selection_ms = 0.0;
            }
            report
        };
        assert_eq!(run(), run(), "{name}");
    }
}

#[test]
fn all_learners_of_a_seed_start_alike_and_see_the_same_noise() {
    let scenario = builtin("arm-6dof").expect("built in");
    let mut experiment = scenario.experiment(8, None).expect("starts");
    let start = experiment.latest().clone();
    assert_eq!(start.learners[0].estimate.marker_m, start.learners[1].estimate.marker_m);
    let axes = |learner: usize| start.learners[learner].estimate.joints.iter().map(|j| j.axis).collect::<Vec<_>>();
    assert!(axes(0) == axes(1) && axes(1) == axes(2));
    let report = experiment.step().expect("a step");
    let noise = |learner: usize| {
        let movement = report.learners[learner].movement.as_ref().expect("moved");
        let truth = movement.true_skeleton_m.as_ref().and_then(|points| points.last()).expect("a marker");
        let measured = movement.measured_marker_m.expect("seen");
        std::array::from_fn::<f64, 3, _>(|k| measured[k] - truth[k])
    };
    for (a, b) in noise(0).into_iter().zip(noise(1)) {
        assert!((a - b).abs() < 1e-12, "{a} {b}");
    }
}
