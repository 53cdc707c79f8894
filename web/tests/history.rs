//! What the panel says of a run, held against what the engine says of it.

use body_schema_experiment::{CONFIRMATION, Experiment};
use body_schema_panel::history::{History, Verdict};
use body_schema_scenario::builtin;
use body_schema_wire::{Description, RunResult, StepReport};

fn begin(scenario: &str, learners: &[&str]) -> Experiment {
    let learners: Vec<String> = learners.iter().map(|name| (*name).to_owned()).collect();
    builtin(scenario).and_then(|found| found.experiment(1, Some(&learners))).expect("an experiment")
}

/// Before a change of the body and after it.
#[test]
fn convergence_is_what_the_engine_says() {
    let mut experiment = begin("body-change", &["active", "random", "rigid"]);
    let change = experiment.setting().change_at.expect("the body changes");
    let mut history = History::new(&Description::of(&experiment));
    assert!(history.take(&StepReport::of(&experiment)));
    while experiment.latest().step < 2 * change {
        experiment.step().expect("a step");
        assert!(history.take(&StepReport::of(&experiment)));
    }
    let learners = RunResult::of(&experiment).learners;
    assert!(
        learners.iter().any(|one| one.converged_at.is_some()) && learners.iter().any(|one| one.recovered_at.is_some())
    );
    for (index, learner) in learners.iter().enumerate() {
        assert_eq!(history.converged_at(change, index), learner.converged_at, "{}", learner.name);
        let recovered = learner.recovered_at.map(|movements| change + movements);
        assert_eq!(history.converged_at(2 * change, index), recovered, "{}", learner.name);
    }
}

/// Errors that a change of the body leaves within the thresholds are confirmed 20 movements after it.
#[test]
fn a_change_that_does_no_harm_is_confirmed_after_twenty_movements() {
    let mut experiment = begin("body-change", &["random"]);
    experiment.step().expect("a step");
    let start = StepReport::of(&experiment);
    let change = experiment.setting().change_at.expect("the body changes");
    let mut history = History::new(&Description::of(&experiment));
    for step in 0..=change + CONFIRMATION {
        let mut report = StepReport { step, ..start.clone() };
        let metrics = &mut report.learners[0].metrics;
        (metrics.orientation_deg, metrics.location_m) = (Some(0.1), Some(0.001));
        assert!(history.take(&report));
    }
    assert_eq!(history.verdict(change + CONFIRMATION - 1, 0), Verdict::Within(change, CONFIRMATION - 1));
    assert_eq!(history.verdict(change + CONFIRMATION, 0), Verdict::Converged(change));
    assert_eq!(history.verdict(change, 0), Verdict::Converged(0));
}
