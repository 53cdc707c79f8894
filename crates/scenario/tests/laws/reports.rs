//! Reports are made of outcomes, and nothing comes of making them.

use std::sync::Arc;

use body_schema_experiment::{Experiment, Proposal, StepOutcome};
use body_schema_scenario::{Scenario, builtin};
use body_schema_wire::{Comparison, Description, Metrics, RunResult, StepReport, Trace};

/// Sensors, heads, sockets and outliers, and a body that changes under way.
fn scenarios() -> Vec<(Scenario, usize)> {
    let plain =
        [("arm-6dof", 6), ("head-fov", 6), ("arm-6dof-camera", 3), ("arm-6dof-outliers", 4), ("panda-sockets", 4)];
    let plain = plain.map(|(name, steps)| (builtin(name).expect("built in"), steps));
    let text = builtin("body-change").expect("built in").source.replace("\nstep = 300\n", "\nstep = 3\n");
    let changing = Scenario::parse("changing.toml", &text, &|_| Err("has no data".to_owned())).expect("valid");
    plain.into_iter().chain([(changing, 6)]).collect()
}

/// What came of the latest step, but for how long the choices took.
fn timeless(experiment: &Experiment) -> StepOutcome {
    let mut outcome = experiment.latest().clone();
    for movement in outcome.learners.iter_mut().filter_map(|learner| learner.movement.as_mut()) {
        let untimed = |proposal: &Arc<Proposal>| Arc::new(Proposal { selection_ms: 0.0, ..(**proposal).clone() });
        movement.proposal = movement.proposal.as_ref().map(untimed);
    }
    outcome
}

/// The judge concludes the same whether or not anybody has a step told, and as often as it is told it is the same report.
#[test]
fn nothing_is_concluded_from_reports() {
    for (scenario, steps) in scenarios() {
        let open = || scenario.experiment(3, None).expect("starts");
        let (mut told, mut silent) = (open(), open());
        for step in 0..=steps {
            if step > 0 {
                told.step().expect("a step");
                silent.step().expect("a step");
            }
            let report = StepReport::of(&told);
            assert_eq!(report, StepReport::of(&told), "{} step {step}", scenario.name);
            assert_eq!(timeless(&told), timeless(&silent), "{} step {step}", scenario.name);
        }
        assert_eq!(RunResult::of(&told), RunResult::of(&silent), "{}", scenario.name);
        assert_eq!(Description::of(&told), Description::of(&open()), "{}: it stays the same", scenario.name);
    }
}

/// In units of the prior every parameter counts 1 before anything is measured: those that a learner has, not those of others.
#[test]
fn every_parameter_counts_one_at_the_start() {
    let learners = ["active", "nominal"].map(str::to_owned);
    let experiment = builtin("tiago-mocap").expect("built in").experiment(1, Some(&learners[..])).expect("starts");
    for learner in &RunResult::of(&experiment).learners {
        let (trace, parameters) = (learner.metrics.trace.expect("a covariance"), learner.parameters as f64);
        assert!((trace - parameters).abs() < 1e-6, "{}: {trace} of {parameters}", learner.name);
    }
}

/// A report tells of an outcome no more and no less than there is of it.
#[test]
fn a_report_tells_its_outcome() {
    for (scenario, steps) in scenarios() {
        let mut experiment = scenario.experiment(3, None).expect("starts");
        for step in 1..=steps {
            experiment.step().expect("a step");
            let (outcome, report) = (experiment.latest(), StepReport::of(&experiment));
            assert_eq!((report.step, report.learners.len()), (step as u64, outcome.learners.len()));
            assert_eq!(report.truth.is_some(), scenario.name == "body-change" && step == 4, "{}", scenario.name);
            for (told, learner) in report.learners.iter().zip(&outcome.learners) {
                assert_eq!(told.metrics, Metrics::from(&learner.metrics));
                let (told, movement) =
                    (told.movement.as_ref().expect("told"), learner.movement.as_ref().expect("made"));
                assert_eq!((told.seen, told.partition.is_some()), (movement.seen(), movement.partition().is_some()));
                assert_eq!(told.readings.len(), movement.observation.readings.len());
                assert_eq!(told.gaze.is_some(), experiment.world().head().is_some());
                let misses = movement.observation.readings.iter().map(Option::is_none);
                assert!(told.readings.iter().map(|reading| reading.residual_sigmas.is_none()).eq(misses));
            }
        }
    }
}

/// A comparison makes no reports, and keeps of every step what they tell.
#[test]
fn a_comparison_keeps_what_reports_tell() {
    for (scenario, steps) in scenarios() {
        let mut experiment = scenario.experiment(3, None).expect("starts");
        let trace = Trace::run(experiment.clone(), steps as u64, || ()).expect("runs");
        let comparison = Comparison::of(&scenario.name, steps as u64, &[trace]);
        for step in 0..=steps {
            if step > 0 {
                experiment.step().expect("a step");
            }
            for (told, kept) in StepReport::of(&experiment).learners.iter().zip(&comparison.learners) {
                assert_eq!(told.name, kept.name);
                let kept = &kept.curve[step];
                assert_eq!(kept.prediction_m.map(|it| it.median), told.metrics.prediction_m, "{}", scenario.name);
                assert_eq!(kept.bound_trace.map(|it| it.median), told.metrics.bound_trace, "{}", scenario.name);
                let joints = kept.joints.iter().zip(&told.metrics.joints);
                assert!(joints.into_iter().all(|(kept, told)| kept.axis_deg == told.axis_deg));
            }
        }
    }
}
