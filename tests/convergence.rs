//! Convergence over fixed seeds. Every bar comes from a scenario file or from the design; none is tuned to the seeds.

mod sensors;

use body_schema::{
    experiment::{Comparison, LearnerComparison, RunResult, SeedRun, StepReport, Trace},
    scenario::{BUILTIN, Scenario, builtin},
    selection::Optimality,
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

/// Robots that look at themselves, of which a run takes half a minute: other tests hold them to fewer movements on a few seeds, and the
/// nightly run to all of this on so many.
const DEAR: [&str; 4] = ["humanoid-eyes", "humanoid-eyes-paper-error", "humanoid-two-arms", "two-arms"];

/// How many seeds of those the nightly run asks for.
fn seeds_of_dear_ones() -> Option<u64> {
    std::env::var("BODY_SCHEMA_SEEDS").ok().map(|seeds| seeds.parse().expect("a number of seeds"))
}

/// Whether more is tried than by day.
pub(crate) fn is_night() -> bool {
    seeds_of_dear_ones().is_some()
}

/// Every scenario that promises is held to it. Steps beyond the promise confirm that a run stays converged.
#[test]
fn learners_keep_the_promises_of_their_scenarios() {
    // By day a quarter of the night's, and not the baseline, which takes the most movements.
    let seeds: Vec<u64> = (201..=if is_night() { 220 } else { 205 }).collect();
    let mut promises = 0;
    for found in BUILTIN.iter().filter(|found| !DEAR.contains(&found.name) || is_night()) {
        let scenario = builtin(found.name).expect("built in");
        for (learner, &promise) in scenario.promises.iter().filter(|(learner, _)| *learner != "random" || is_night()) {
            promises += 1;
            let outcome = compare(&scenario, learner, &seeds, promise + 60);
            let late: Vec<_> =
                outcome.runs.iter().filter(|run| run.converged_at.is_none_or(|at| at > promise)).collect();
            // A promise is 1.3 times the 90th percentile: fewer than one run in ten is later, three of twenty or one of five by bad luck.
            assert!(late.len() <= 1 + seeds.len() / 10, "{} {learner} promised {promise}: {late:?}", found.name);
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

/// What the unscented filter is for: from a guess as good as arm-6dof's it needs fewer movements than the linearised
/// one, 75 beside 90 over the seeds 1 to 20; the ratio here leaves room for the spread of 12.
#[test]
fn the_unscented_filter_needs_fewer_movements_from_a_fair_guess() {
    let scenario = builtin("arm-6dof").expect("built in");
    let seeds: Vec<u64> = (301..=312).collect();
    let median = |learner: &str| compare(&scenario, learner, &seeds, 500).summary.median_converged_at;
    let (unscented, active) = (median("unscented").expect("converges"), median("active").expect("converges"));
    assert!(unscented <= 0.9 * active, "unscented {unscented}, active {active}");
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
fn a_real_robot_is_predicted_better_in_another_session_after_learning() {
    let scenario = builtin("tiago-mocap").expect("built in");
    let seeds: Vec<u64> = (1..=100).collect();
    let mean = |learner: &str| {
        let outcome = compare(&scenario, learner, &seeds, 37);
        [0, 12, 37].map(|movements: usize| {
            outcome.curve[movements].prediction_mean_m.expect("held-out measurements").mean * 1e3
        })
    };
    let ([start, _, active_end], [_, random_12, random_end]) = (mean("active"), mean("random"));
    let [_, nominal_12, nominal_end] = mean("nominal");
    assert!(start > 100.0, "{start} mm before learning: nobody has told where it stands");
    assert!(active_end <= 2.5 && random_end <= 2.5, "{active_end} and {random_end} mm with all rows");
    assert!(
        random_12 <= 0.9 * nominal_12 && random_end <= 0.75 * nominal_end,
        "{random_12} of {nominal_12} mm at 12 rows"
    );
}

#[test]
fn the_same_seed_gives_the_same_numbers() {
    for name in ["arm-12dof", "tiago-mocap"] {
        let scenario = builtin(name).expect("built in");
        let run = || {
            let mut experiment = scenario.experiment(5, None).expect("starts");
            (0..25).map(|_| experiment.step().map(|_| ())).collect::<Result<Vec<_>, _>>().expect("25 steps");
            let mut report = StepReport::of(&experiment);
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
    let start = StepReport::of(&experiment);
    assert_eq!(start.learners[0].estimate.marker_m, start.learners[1].estimate.marker_m);
    let axes = |learner: usize| start.learners[learner].estimate.joints.iter().map(|j| j.axis).collect::<Vec<_>>();
    assert!(axes(0) == axes(1) && axes(1) == axes(2));
    experiment.step().expect("a step");
    let report = StepReport::of(&experiment);
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

/// The learner global, against the bars that it was built for. The seeds are fewer than the bars' twenty, so the medians
/// leave room for the spread of eight; the worst run may not be worse than that of twenty.
#[test]
fn the_global_learner_needs_little_more_than_as_many_movements_as_there_are_equations() {
    let seeds: Vec<u64> = (401..=408).collect();
    for (name, steps, median, worst) in [
        ("arm-6dof", 40, 12.0, 16.0),
        ("arm-6dof-doubled-error", 40, 12.0, 17.0),
        ("arm-6dof-no-prior", 45, 12.0, 20.0),
        ("head-fov", 60, 15.0, 30.0),
    ] {
        let summary = compare(&builtin(name).expect("built in"), "global", &seeds, steps).summary;
        assert!(summary.median_converged_at.is_some_and(|at| at <= median), "{name}: {summary:?}");
        assert!(summary.max_converged_at.is_some_and(|at| at <= worst), "{name}: {summary:?}");
    }
    let seeds = [401, 402, 403];
    for (name, steps, worst) in [("arm-12dof", 50, 25.0), ("arm-12dof-no-prior", 55, 28.0)] {
        let summary = compare(&builtin(name).expect("built in"), "global", &seeds, steps).summary;
        assert!(summary.max_converged_at.is_some_and(|at| at <= worst), "{name}: {summary:?}");
    }
}

/// Honest: the mean of NEES/m over the seeds lies in its 99 % band. Close to the limit: the trace of the smoother is
/// that of the bound at the truth. And it calls itself settled soon after it has converged, and not wrongly.
#[test]
fn the_global_learner_is_honest_and_knows_when_it_is_done() {
    let scenario = builtin("arm-6dof").expect("built in");
    let m = scenario.robot.layout.dimension() as f64;
    let seeds = 421..=440;
    let count = 20.0;
    let (mut sums, mut ratios) = ([0.0; 2], Vec::new());
    for seed in seeds {
        let mut experiment = scenario.experiment(seed, Some(&["global".to_owned()])).expect("starts");
        for step in 1..=40 {
            let metrics = experiment.step().expect("a step").learners[0].metrics.clone();
            if let Some(index) = [20, 40].iter().position(|at| *at == step) {
                sums[index] += metrics.nees.expect("a covariance") / m;
                let ratio = metrics.trace.expect("a covariance") / metrics.bound_trace.expect("a truth");
                assert!((0.6..1.6).contains(&ratio), "seed {seed}, {step} movements: {ratio}");
            }
        }
        let result = RunResult::of(&experiment).learners.remove(0);
        let (converged, settled) = (result.converged_at.expect("converges"), result.settled_at.expect("settles"));
        ratios.push(settled as f64 / converged as f64);
    }
    let band = 2.576 * (2.0 / (count * m)).sqrt();
    for (sum, at) in sums.iter().zip([20, 40]) {
        assert!((sum / count - 1.0).abs() < band, "NEES/m {} at {at} movements", sum / count);
    }
    ratios.sort_by(f64::total_cmp);
    assert!(ratios[ratios.len() / 2] <= 1.6, "{ratios:?}");
}

#[test]
fn the_global_learner_notices_a_changed_body_and_learns_it_anew() {
    let scenario = builtin("body-change").expect("built in");
    for seed in 451..=454 {
        let mut experiment = scenario.experiment(seed, Some(&["global".to_owned()])).expect("starts");
        (0..350).for_each(|_| assert!(experiment.step().is_ok()));
        let result = RunResult::of(&experiment).learners.remove(0);
        assert_eq!(result.false_alarms, 0, "seed {seed}");
        assert!(result.change_detected_at.is_some_and(|at| at <= 10), "seed {seed}: {:?}", result.change_detected_at);
        assert!(result.recovered_at.is_some_and(|at| at <= 25), "seed {seed}: {:?}", result.recovered_at);
    }
}

/// The movements of the smoother against the best design of the same length, certified by the equivalence theorem.
#[test]
fn planned_movements_are_nearly_as_good_as_the_best_design() {
    let scenario = builtin("arm-6dof").expect("built in");
    let problem = scenario.design_problem().expect("simulated");
    let best = problem.best_design(40, 0.01).expect("noise");
    assert!(best.gap <= 0.01, "gap {}", best.gap);
    assert!((best.shares.iter().sum::<f64>() - 1.0).abs() < 1e-9);
    let efficiency = |learner: &str| {
        let mut efficiencies: Vec<f64> = (461..=465)
            .map(|seed| {
                let mut experiment = scenario.experiment(seed, Some(&[learner.to_owned()])).expect("starts");
                (0..40).for_each(|_| assert!(experiment.step().is_ok()));
                best.trace / experiment.latest().learners[0].metrics.bound_trace.expect("a truth")
            })
            .collect();
        efficiencies.sort_by(f64::total_cmp);
        assert!(efficiencies.iter().all(|it| *it <= 1.0 + 1e-9), "{learner} beats the bound: {efficiencies:?}");
        efficiencies[2]
    };
    let (global, random) = (efficiency("global"), efficiency("random"));
    assert!(global >= 0.85 && random < 0.4, "global {global}, random {random}");
}
