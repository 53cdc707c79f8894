//! The server's part, played by the engine itself: what it reports is what visitors get.

use body_schema_experiment::Experiment;
use body_schema_scenario::{Replacement, Scenario, builtin, edited};
use body_schema_wire::{AppraisalReport, Choice, Description, RunResult, StepReport};
use serde_json::{Value, json};

/// How long every choice is said to have taken, ms: the one number that is another in each run.
const SELECTION_MS: f64 = 0.3;

/// A server with one session at most, and its answers as the page passes them on.
#[derive(Default)]
pub struct Server {
    /// What is other than in the scenario's file.
    edits: Vec<(String, toml::Value)>,
    /// What the page asks to be other.
    replaced: Vec<Replacement>,
    experiment: Option<Experiment>,
    reports: Vec<Value>,
    /// How many of the reports the page has passed on.
    told: usize,
}

impl Server {
    /// Sets a number of every scenario opened from now on.
    pub fn edit(&mut self, path: &str, value: f64) {
        self.edits.push((path.to_owned(), value.into()));
    }

    /// Replaces values of every scenario opened from now on, as the page asks for it.
    pub fn replace(&mut self, set: &[String]) {
        self.replaced = set.iter().map(|text| text.parse().expect("a replacement")).collect();
    }

    /// What there is to choose from: as many scenarios as a test needs.
    pub fn scenarios() -> Value {
        let names = [
            "arm-6dof",
            "head-fov",
            "humanoid-eyes",
            "body-change",
            "tiago-mocap",
            "arm-6dof-camera",
            "arm-6dof-outliers",
            "panda-sockets",
            "ur10-camera",
        ];
        let summaries = names.map(|name| builtin(name).expect("a built-in scenario").summary());
        json!({ "is": "scenarios", "scenarios": summaries })
    }

    /// Opens a session, at step 0.
    pub fn open(&mut self, scenario: &str, seed: u64, learners: Option<&[String]>) {
        self.experiment = Some(self.begin(scenario, seed, learners));
        (self.reports, self.told) = (Vec::new(), 0);
        self.keep();
    }

    fn begin(&self, name: &str, seed: u64, learners: Option<&[String]>) -> Experiment {
        if self.edits.is_empty() {
            let scenario = builtin(name).and_then(|found| found.with(&self.replaced)).expect("a scenario");
            return scenario.experiment(seed, learners).expect("an experiment");
        }
        let text = edited(&builtin(name).expect("a built-in scenario").source, &self.edits).expect("paths that exist");
        let scenario = Scenario::parse(name, &text, &|file| Err(format!("{file} is not needed here")));
        scenario.and_then(|scenario| scenario.experiment(seed, learners)).expect("an experiment")
    }

    /// The experiment of the session.
    pub fn experiment(&self) -> &Experiment {
        self.experiment.as_ref().expect("a session")
    }

    /// What has come of it so far.
    pub fn result(&self) -> RunResult {
        RunResult::of(self.experiment())
    }

    /// Makes steps.
    pub fn step(&mut self, count: u64) {
        for _ in 0..count {
            self.experiment.as_mut().expect("a session").step().expect("a step");
            self.keep();
        }
    }

    fn keep(&mut self) {
        self.reports.push(written(StepReport::of(self.experiment())));
    }

    /// The reports that the page has not passed on yet.
    pub fn news(&mut self) -> Vec<Value> {
        let news = self.reports[self.told..].to_vec();
        self.told = self.reports.len();
        news
    }

    /// The session's id.
    pub fn id(&self) -> String {
        let description = self.experiment().setting();
        format!("{}-{}", description.scenario, description.seed)
    }

    /// The session.
    pub fn session(&self) -> Value {
        let experiment = self.experiment();
        json!({ "is": "session", "session": {
            "id": self.id(), "world": "simulated", "step": experiment.latest().step, "remaining": experiment.remaining(),
            "description": Description::of(experiment),
        } })
    }

    /// How a learner's last movement was chosen.
    pub fn choice(&self, learner: &str) -> Choice {
        Choice::of(self.experiment(), learner).expect("a choice by DIRECT")
    }

    /// The same, passed on by the page.
    pub fn selection(&self, learner: &str) -> Value {
        json!({ "is": "selection", "learner": learner, "selection": self.choice(learner) })
    }

    /// What another posture would have taught.
    pub fn evaluation(&self, learner: &str, configuration: &[f64]) -> Value {
        let appraisal = self.experiment().appraise(learner, configuration).expect("an appraisal");
        json!({ "is": "evaluation", "evaluation": AppraisalReport::from(&appraisal) })
    }

    /// Sets the next movement of a learner whose movements the visitor chooses, and says what it would teach.
    pub fn configure(&mut self, learner: &str, configuration: &[f64]) -> Value {
        let experiment = self.experiment.as_mut().expect("a session");
        let appraisal = experiment.set_configuration(learner, configuration).expect("an appraisal");
        json!({ "is": "configured", "learner": learner, "evaluation": AppraisalReport::from(&appraisal) })
    }

    /// The session's comparison with another seed, from step 1 on.
    pub fn other_seed(&self, seed: u64, steps: u64) -> Value {
        let description = self.experiment().setting();
        let learners: Vec<String> = description.learners.iter().map(|learner| learner.name.clone()).collect();
        let mut experiment = self.begin(&description.scenario, seed, Some(&learners));
        let next = |_| {
            experiment.step().expect("a step");
            written(StepReport::of(&experiment))
        };
        let reports: Vec<Value> = (0..steps).map(next).collect();
        json!({ "is": "seeds", "seed": seed, "reports": reports, "done": true })
    }
}

/// A report as JSON.
pub(super) fn written(mut report: StepReport) -> Value {
    for movement in report.learners.iter_mut().filter_map(|learner| learner.movement.as_mut()) {
        movement.selection_ms = SELECTION_MS;
    }
    serde_json::to_value(report).expect("a report can be written")
}
