//! What the cards of the stories say, held against what the engine does.

use body_schema_experiment::{Experiment, StepOutcome};
use body_schema_panel::stories::{STORIES, Story};
use body_schema_scenario::builtin;
use body_schema_wire::{LearnerResult, RunResult};

/// A story's own run.
struct Run {
    story: &'static Story,
    experiment: Experiment,
}

impl Run {
    fn of(scenario: &str) -> Self {
        let story = STORIES.iter().find(|story| story.scenario == scenario).expect("a story");
        let scenario = builtin(scenario).expect("a built-in scenario");
        let mut learners: Vec<String> = story.learners.iter().map(|name| (*name).to_owned()).collect();
        if learners.is_empty() {
            learners = scenario.summary().explorer;
        }
        Self { story, experiment: scenario.experiment(story.seed, Some(&learners)).expect("an experiment") }
    }

    fn place(&self, learner: &str) -> usize {
        let learners = &self.experiment.setting().learners;
        learners.iter().position(|one| one.name == learner).expect("a learner of the story")
    }

    fn to(&mut self, step: u64) -> &StepOutcome {
        while self.experiment.latest().step < step {
            self.experiment.step().expect("a step");
        }
        self.experiment.latest()
    }

    fn result(&self, learner: &str) -> LearnerResult {
        RunResult::of(&self.experiment).learners.swap_remove(self.place(learner))
    }

    fn says(&self, words: &str) -> bool {
        self.story.title.contains(words) || self.story.cards.iter().any(|card| card.text.contains(words))
    }
}

#[test]
fn ten_movements_are_enough_and_ellipsoids_do_as_the_cards_say() {
    let mut run = Run::of("arm-6dof");
    assert!(run.says("Ten movements are enough") && run.says("Those of global shrink") && run.says("stay large"));
    let places = ["active", "random", "global"].map(|name| run.place(name));
    let trace =
        |outcome: &StepOutcome| places.map(|place| outcome.learners[place].metrics.trace.expect("a covariance"));
    let first = trace(run.to(1));
    let tenth = trace(run.to(10));
    assert!(tenth[2] < 0.05 * first[2], "those of global shrink: {first:?} {tenth:?}");
    let later = trace(run.to(60));
    let allowed = places.map(|place| run.experiment.latest().learners[place].metrics.bound_trace.expect("a bound"));
    assert!(later[0] > 10.0 * allowed[0] && later[1] > 10.0 * allowed[1], "{later:?} {allowed:?}");
    for (learner, stabilised) in [("active", true), ("random", true), ("global", false)] {
        assert_eq!(run.experiment.setting().learners[run.place(learner)].stabilised, stabilised, "{learner}");
    }
    run.to(600);
    let needed = ["global", "active", "random"].map(|name| run.result(name).converged_at.expect("it converges"));
    assert!(needed[0] <= 10 && needed[1] < needed[2], "{needed:?}");
}

#[test]
fn all_recover_from_the_broken_elbow_and_who_asks_sooner() {
    let mut run = Run::of("body-change");
    assert!(run.says("After movement 300") && run.says("5 cm"));
    assert_eq!(run.experiment.setting().change_at, Some(300));
    run.to(500);
    let needed = ["active", "random", "global"].map(|name| run.result(name).recovered_at.expect("it recovers"));
    assert!(needed[0] < needed[1], "{needed:?}");
}

#[test]
fn who_forgets_that_it_may_not_see_misses_most() {
    let mut run = Run::of("head-fov");
    let places = ["active", "random", "naive"].map(|name| run.place(name));
    let misses = places.map(|place| run.to(30).learners[place].metrics.misses);
    assert!(misses[0] < misses[1] && misses[1] < misses[2], "{misses:?}");
    run.to(400);
    let needed = ["active", "random"].map(|name| run.result(name).converged_at.expect("it converges"));
    assert!(needed[0] < needed[1] && run.result("naive").converged_at.is_none(), "{needed:?}");
}

#[test]
fn a_real_robot_is_predicted_better_where_its_axes_are_learned() {
    let mut run = Run::of("tiago-mocap");
    assert!(run.says("59 postures") && run.says("misses by a third less"));
    let places = ["active", "nominal"].map(|name| run.place(name));
    let movements = run.experiment.remaining().expect("a table");
    let report = run.to(movements as u64);
    let [learned, described] = places.map(|place| report.learners[place].metrics.prediction_mean_m.expect("held out"));
    assert!((0.6..0.72).contains(&(learned / described)), "{learned} of {described}");
}
