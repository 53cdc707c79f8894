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
    let seeds: Vec<u64> = (201..=220).collect();
    let mut promises = 0;
    for found in BUILTIN {
        let scenario = builtin(found.name).expect("built in");
        for (learner, &promise) in &scenario.promises {
            promises += 1;
            let outcome = compare(&scenario, learner, &seeds, promise + 60);
            let late: Vec<_> =
                outcome.runs.iter().filter(|run| run.converged_at.is_none_or(|at| at > promise)).collect();
            // A promise is 1.3 times the 90th percentile: fewer than one run in ten is later, three of twenty by bad luck.
            assert!(late.len() <= 3, "{} {learner} promised {promise}: {late:?}", found.name);
        }
    }
    assert!(promises >= 4, "the scenarios promise something");
}

/// One reading in ten shows something else. The robust loss tells every one that is far off, and hardly ever suspects a good
/// one; least squares believes them all and never gets there.
#[test]
fn outliers_are_told_from_readings_and_least_squares_is_lost_to_them() {
    let scenario = builtin("arm-6dof-outliers").expect("built in");
    let seeds: Vec<u64> = (301..=320).collect();
    let outcome = compare(&scenario, "global", &seeds, 60);
    let median = outcome.summary.median_converged_at;
    assert!(outcome.summary.converged == 20 && median.is_some_and(|median| median <= 14.0), "{:?}", outcome.summary);
    let least_squares = compare(&scenario, "global-least-squares", &seeds[..6], 60);
    assert_eq!(least_squares.summary.converged, 0, "{:?}", least_squares.runs);
    let (mut suspected, mut good, mut told) = (0, 0, 0);
    for seed in seeds {
        let names = ["global".to_owned()];
        let mut experiment = scenario.experiment(seed, Some(&names)).expect("starts");
        for step in 1..=40 {
            experiment.step().expect("a step");
            if step <= 20 {
                continue;
            }
            let result = experiment.result();
            let truth: Vec<_> = result.outliers.iter().map(|it| (it.movement, it.channel)).collect();
            assert_eq!(result.learners[0].readings.len(), step);
            told += truth.len();
            for reading in &result.learners[0].readings {
                let probability = reading.outlier_probability.expect("a mixture");
                if !truth.contains(&(reading.movement, reading.channel)) {
                    good += 1;
                    suspected += usize::from(probability > 0.9);
                } else if reading.residual_sigmas > 5.0 {
                    assert!(probability > 0.9, "seed {seed}, step {step}: {reading:?}");
                }
            }
        }
    }
    assert!(suspected * 100 <= good && told > 100, "{suspected} of {good}, {told}");
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
fn a_real_robot_is_predicted_better_after_learning_and_sooner_when_chosen_actively() {
    let scenario = builtin("tiago-mocap").expect("built in");
    // So many, since 20 splits scatter by as much as the bar leaves: the ratio is 0.89 over the seeds 1001 to 1100.
    let seeds: Vec<u64> = (1..=100).collect();
    let mean = |learner: &str| {
        let outcome = compare(&scenario, learner, &seeds, 27);
        [0, 12, 27].map(|movements: usize| {
            outcome.curve[movements].prediction_mean_m.expect("held-out measurements").mean * 1e3
        })
    };
    let ([start, active_12, active_end], [_, random_12, random_end]) = (mean("active"), mean("random"));
    assert!(start > 100.0, "{start} mm before learning: nobody has told where it stands");
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
        let result = experiment.result().learners.remove(0);
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
        let result = experiment.result().learners.remove(0);
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

/// One camera and a tag whose place on the hand nobody knows: misses count, and still twenty of twenty are there soon.
#[test]
fn one_camera_and_a_tag_calibrate_an_arm() {
    let scenario = builtin("arm-6dof-camera").expect("built in");
    let seeds: Vec<u64> = (301..=320).collect();
    let outcome = compare(&scenario, "global", &seeds, 50);
    let worst = outcome.runs.iter().filter_map(|run| run.converged_at).max();
    let median = outcome.summary.median_converged_at;
    assert!(outcome.summary.converged == 20 && median.is_some_and(|median| median <= 14.0), "{:?}", outcome.summary);
    assert!(worst.is_some_and(|worst| worst <= 25), "{:?}", outcome.runs);
}

/// The camera is on the hand, its place there wrong by up to 5 cm and 10 degrees, and a board stands somewhere: where the camera's
/// centre will be is known to 2 mm after 25 movements, up to a motion of the whole.
#[test]
fn a_camera_on_the_hand_is_calibrated_with_the_arm() {
    let scenario = builtin("hand-eye-6dof").expect("built in");
    for seed in 301..=310 {
        let mut experiment = scenario.experiment(seed, Some(&["global".to_owned()])).expect("starts");
        for _ in 0..25 {
            experiment.step().expect("a step");
        }
        let metrics = &experiment.latest().learners[0].metrics;
        let (found, expected) =
            (metrics.prediction_mean_m.expect("a truth"), metrics.expected_prediction_m.expect("kept"));
        assert!(found < 0.002, "seed {seed}: {found}");
        assert!((0.3..3.0).contains(&(found / expected)), "seed {seed}: {found}, expected {expected}");
    }
}

/// Nothing is read but the joints: after twenty chosen postures that hold a ball in two sockets it is predicted to a millimetre, the
/// size of the robot included, and in sockets elsewhere it meets itself within a quarter of one; sooner than by random postures.
#[test]
fn a_ball_in_two_sockets_calibrates_an_arm() {
    let scenario = builtin("arm-7dof-socket").expect("built in");
    let names = ["global", "random"].map(str::to_owned);
    let mut errors = vec![[Vec::new(), Vec::new()]; 2];
    let (mut early, mut ratio) = (vec![Vec::new(); 2], 0.0);
    for seed in 301..=320 {
        let mut experiment = scenario.experiment(seed, Some(&names)).expect("starts");
        for step in 1..=20 {
            experiment.step().expect("a step");
            for (learner, early) in experiment.latest().learners.iter().zip(&mut early) {
                early.extend((step == 12).then_some(learner.metrics.scatter_m.expect("held out")));
            }
        }
        for (learner, [prediction, scatter]) in experiment.latest().learners.iter().zip(&mut errors) {
            prediction.push(learner.metrics.prediction_mean_m.expect("a truth"));
            scatter.push(learner.metrics.scatter_m.expect("held out"));
        }
        let metrics = &experiment.latest().learners[0].metrics;
        ratio += metrics.prediction_mean_m.expect("a truth") / metrics.expected_prediction_m.expect("kept") / 20.0;
    }
    let median = |errors: &mut Vec<f64>| {
        errors.sort_by(f64::total_cmp);
        0.5 * (errors[9] + errors[10])
    };
    let [[prediction, scatter], [_, by_chance]] = [0, 1].map(|k| errors[k].each_mut().map(median));
    assert!(prediction < 1.3e-3 && scatter < 2.5e-4, "{prediction} m, scatter {scatter} m");
    assert!(scatter < 0.85 * by_chance, "{scatter} m, by chance {by_chance} m");
    let [chosen, by_chance] = [0, 1].map(|k| median(&mut early[k]));
    assert!(chosen < 0.75 * by_chance, "after 12: {chosen} m, by chance {by_chance} m");
    assert!((0.5..1.3).contains(&ratio), "found/expected {ratio}");
}

/// Noise and gears are learned with the axes, and the belief is as sure as it may be.
#[test]
fn gears_and_noise_that_nobody_knows_are_learned() {
    let scenario = builtin("arm-6dof-pose-gears").expect("built in");
    let seeds: Vec<u64> = (301..=320).collect();
    let (mut within, mut scales, mut nees, mut ratio) = (0, [Vec::new(), Vec::new()], 0.0, 0.0);
    for &seed in &seeds {
        let mut experiment = scenario.experiment(seed, Some(&["global".to_owned()])).expect("starts");
        for _ in 0..150 {
            experiment.step().expect("a step");
        }
        let learner = &experiment.result().learners[0];
        let truth = scenario.robot.state.corrections.iter();
        let errors = truth.zip(&learner.model.joints).map(|(truth, joint)| (joint.ratio / truth.ratio - 1.0).abs());
        within += usize::from(errors.fold(0.0, f64::max) < 1e-3);
        scales.iter_mut().zip(&learner.noise).for_each(|(scales, noise)| scales.push(noise.scale));
        let metrics = &learner.metrics;
        nees += metrics.nees.expect("kept") / metrics.nees_dof.expect("kept") as f64 / seeds.len() as f64;
        let expected = metrics.expected_prediction_m.expect("kept");
        ratio += metrics.prediction_mean_m.expect("a truth") / expected / seeds.len() as f64;
    }
    assert!(within >= 18, "all ratios to 0.1 % in {within} of 20");
    for scales in &mut scales {
        scales.sort_by(f64::total_cmp);
        let median = 0.5 * (scales[9] + scales[10]);
        assert!((median - 1.0).abs() < 0.03 && scales[1] > 0.9 && scales[18] < 1.1, "{scales:?}");
    }
    assert!((0.8..1.25).contains(&nees) && (0.7..1.3).contains(&ratio), "NEES {nees}, found/expected {ratio}");
}

/// Nothing is fitted in advance: base and marker are known to a metre and a radian, and found from the rows that are chosen.
#[test]
fn a_real_robot_is_learned_from_the_rows_that_are_chosen() {
    let scenario = builtin("tiago-mocap").expect("built in");
    let names = ["nominal", "random", "active", "global"].map(str::to_owned);
    let mut errors = vec![vec![Vec::new(); 28]; names.len()];
    for seed in 1001..=1040 {
        let mut experiment = scenario.experiment(seed, Some(&names)).expect("starts");
        for row in 1..=27 {
            experiment.step().expect("a step");
            for (learner, errors) in experiment.latest().learners.iter().zip(&mut errors) {
                errors[row].push(learner.metrics.prediction_mean_m.expect("held out"));
            }
        }
    }
    let median = |learner: usize, row: usize| {
        let mut errors = errors[learner][row].clone();
        errors.sort_by(f64::total_cmp);
        0.5 * (errors[19] + errors[20])
    };
    for row in 4..=27 {
        let [nominal, random, active, global] = [0, 1, 2, 3].map(|learner| median(learner, row));
        assert!(random <= 1.05 * nominal, "{row} rows: random {random}, nominal {nominal}");
        assert!(active <= 1.02 * random && global <= 1.02 * random, "{row} rows: {active} {global} {random}");
    }
    assert!(median(2, 12) <= 0.95 * median(1, 12) && median(3, 12) <= 0.95 * median(1, 12));
    assert!((1..4).all(|learner| median(learner, 27) <= 0.88 * median(0, 27)));
}

/// Encoders off their centres, which no learner models: chosen movements do not run to where the model fails, and learners know how
/// far off they are.
#[test]
fn what_no_parameter_explains_is_expected_and_not_chased() {
    let scenario = builtin("arm-7dof-eccentric").expect("built in");
    let names = ["global", "smoother-random"].map(str::to_owned);
    let seeds = 301..=340;
    let mut errors = vec![vec![Vec::new(); 61]; names.len()];
    let mut found_by_expected = errors.clone();
    for seed in seeds.clone() {
        let mut experiment = scenario.experiment(seed, Some(&names)).expect("starts");
        for step in 1..=60 {
            experiment.step().expect("a step");
            for (index, learner) in experiment.latest().learners.iter().enumerate() {
                let found = learner.metrics.prediction_mean_m.expect("a truth");
                errors[index][step].push(found);
                found_by_expected[index][step].push(found / learner.metrics.expected_prediction_m.expect("kept"));
            }
        }
        let result = experiment.result();
        let remark = &result.learners[0].remarks;
        assert!(remark.iter().any(|remark| remark.contains("no parameter explains")), "{remark:?}");
    }
    let median = |values: &[f64]| {
        let mut values = values.to_vec();
        values.sort_by(f64::total_cmp);
        0.5 * (values[19] + values[20])
    };
    for step in 13..=60 {
        let [chosen, random] = [0, 1].map(|learner| median(&errors[learner][step]));
        assert!(chosen <= 1.02 * random, "{step} movements: chosen {chosen}, random {random}");
        for learner in [0, 1] {
            let ratio = median(&found_by_expected[learner][step]);
            assert!(ratio <= 1.3, "{step} movements of {}: found/expected {ratio}", names[learner]);
        }
    }
}
