//! An experiment with its recording.

use body_schema_experiment::Experiment;
use body_schema_recording::{Appearance, ENLARGED, Recorder, Target};
use body_schema_scenario::{self as scenarios, Replacement, Scenario, ScenarioError, WorldKind};
use body_schema_wire::{AppraisalReport, Choice, Description, RunResult, StepReport};

use crate::{EvaluationRequest, Kept, Kind, NewSession, Problem};

/// An experiment, what stays the same of it, and its recording.
pub struct Steps {
    experiment: Experiment,
    description: Description,
    recorder: Recorder,
    most_steps: u64,
}

impl Steps {
    /// Sets an experiment of a scenario up and records its start. It makes at most so many steps.
    ///
    /// # Errors
    ///
    /// [`Kind::InvalidValue`] of the scenario or the learners, [`Kind::Internal`] where the recording cannot be begun.
    pub fn open(
        scenario: &Scenario,
        new: &NewSession,
        target: Target,
        most_steps: u64,
    ) -> Result<(Self, Kept), Problem> {
        if !ENLARGED.contains(&new.enlarge) {
            let what =
                format!("`enlarge` is {}; give a number from {} to {}", new.enlarge, ENLARGED.start(), ENLARGED.end());
            return Err(Problem::new(Kind::InvalidValue, what).field("enlarge"));
        }
        let scenario = replaced(scenario.clone(), &new.set)?;
        let experiment = scenario.experiment(new.seed, new.learners.as_deref())?;
        let unbegun = |error| Problem::new(Kind::Internal, format!("the recording cannot be begun: {error}"));
        let (description, report) = (Description::of(&experiment), StepReport::of(&experiment));
        let target = target.with_ellipsoids(new.ellipsoids).with_appearance(Appearance::of(&scenario));
        let target = target.with_enlarged(new.enlarge);
        let mut recorder = Recorder::new(&description, target).map_err(unbegun)?;
        let recorded = recorder.log(&report).and_then(|()| recorder.flush()).map_err(unbegun);
        match recorded.and_then(|()| Kept::of(&report, &description)) {
            Ok(start) => Ok((Self { experiment, description, recorder, most_steps }, start)),
            Err(problem) => {
                recorder.discard();
                Err(problem)
            }
        }
    }

    /// The experiment.
    pub fn experiment(&self) -> &Experiment {
        &self.experiment
    }

    /// What stays the same from step to step.
    pub fn description(&self) -> &Description {
        &self.description
    }

    /// The latest step.
    pub fn step(&self) -> u64 {
        self.experiment.latest().step
    }

    /// How many steps the recorded data have left; `None` without an end.
    pub fn remaining(&self) -> Option<usize> {
        self.experiment.remaining()
    }

    /// The recording.
    pub fn recorder(&mut self) -> &mut Recorder {
        &mut self.recorder
    }

    /// Gives the recording, to end it.
    pub fn into_recorder(self) -> Recorder {
        self.recorder
    }

    /// Whether so many steps can be made of a session that is expected to be at a step: all of them, or none is.
    ///
    /// # Errors
    ///
    /// [`Kind::StepMismatch`], [`Kind::TooFewStepsLeft`], [`Kind::NoConfiguration`] where a person is to choose first, and
    /// [`Kind::InvalidValue`] of more than one step then.
    pub fn may_make(&self, count: u64, expected: Option<u64>) -> Result<(), Problem> {
        let step = self.step();
        if let Some(expected) = expected.filter(|expected| *expected != step) {
            let detail = format!("the session is at step {step}, not {expected}; nothing was stepped");
            return Err(Problem::new(Kind::StepMismatch, detail).field("expected_step").step(step));
        }
        match self.too_many(count, step).or_else(|| self.waits_for_a_person(count)) {
            Some(problem) => Err(problem.step(step)),
            None => Ok(()),
        }
    }

    fn too_many(&self, count: u64, step: u64) -> Option<Problem> {
        let few =
            |left: u64, detail: String| Problem::new(Kind::TooFewStepsLeft, detail).field("count").remaining(left);
        if let Some(left) = self.remaining().map(|left| left as u64).filter(|left| count > *left) {
            return Some(few(left, format!("the recorded data have {left} steps left, {count} were asked for")));
        }
        let left = self.most_steps.saturating_sub(step);
        let detail = || format!("a session makes at most {} steps: {left} are left, not {count}", self.most_steps);
        (count > left).then(|| few(left, detail()))
    }

    /// What a learner lacks for which a person chooses.
    fn waits_for_a_person(&self, count: u64) -> Option<Problem> {
        let mut chosen_for = self.experiment.chosen_for();
        if count > 1 {
            let (_, name) = chosen_for.next()?;
            let detail = format!("a person chooses each movement of `{name}`: make one step at a time, not {count}");
            return Some(Problem::new(Kind::InvalidValue, detail).field("count"));
        }
        let unset = |name: &&str| matches!(self.experiment.configuration(name), Ok(None));
        let name = chosen_for.map(|(_, name)| name).find(unset)?;
        let detail = format!(
            "`{name}` waits for a person to choose its movement; post {{\"configuration\": […]}}, one position per joint \
             in rad or m, to /v1/sessions/{{id}}/learners/{name}/configuration, then step"
        );
        Some(Problem::new(Kind::NoConfiguration, detail))
    }

    /// Makes a step, with so many postures on the way to it for those who follow the recording. Beside it, whether it could be
    /// recorded: the step stands even if not.
    ///
    /// # Errors
    ///
    /// [`Kind::EngineFailed`]; the experiment is as it was.
    pub fn make(&mut self, frames: u64) -> Result<(Kept, Result<(), Problem>), Problem> {
        self.experiment.step().map_err(|error| Problem::new(Kind::EngineFailed, error.to_string()))?;
        let report = StepReport::of(&self.experiment);
        let kept = Kept::of(&report, &self.description)?;
        Ok((kept, self.recorder.log_moving(&report, frames).map_err(recording_failed)))
    }

    /// The outcome so far.
    pub fn result(&self) -> RunResult {
        RunResult::of(&self.experiment)
    }

    /// How a learner's last movement was chosen.
    ///
    /// # Errors
    ///
    /// [`Kind::UnknownLearner`], [`Kind::NothingToShow`].
    pub fn choice(&self, learner: &str) -> Result<Choice, Problem> {
        Ok(Choice::of(&self.experiment, learner)?)
    }

    /// What another movement would have taught a learner.
    ///
    /// # Errors
    ///
    /// [`Kind::UnknownLearner`], [`Kind::InvalidValue`] of the configuration, [`Kind::NothingToShow`].
    pub fn appraise(&mut self, learner: &str, asked: &EvaluationRequest) -> Result<AppraisalReport, Problem> {
        let appraisal = AppraisalReport::from(&self.experiment.appraise(learner, &asked.configuration)?);
        if asked.show {
            self.show(learner, &appraisal)?;
        }
        Ok(appraisal)
    }

    /// The movement that is set for the next step of a learner for which a person chooses, rad or m per joint.
    ///
    /// # Errors
    ///
    /// [`Kind::UnknownLearner`], [`Kind::ChoosesItself`].
    pub fn configuration(&self, learner: &str) -> Result<Option<Vec<f64>>, Problem> {
        Ok(self.experiment.configuration(learner)?.map(<[f64]>::to_vec))
    }

    /// Sets that movement, shows the posture to those who follow the recording, and tells what it is expected to teach.
    ///
    /// # Errors
    ///
    /// As those of [`appraise`](Self::appraise), and [`Kind::ChoosesItself`].
    pub fn set_configuration(&mut self, learner: &str, configuration: &[f64]) -> Result<AppraisalReport, Problem> {
        let appraisal = AppraisalReport::from(&self.experiment.set_configuration(learner, configuration)?);
        self.show(learner, &appraisal)?;
        Ok(appraisal)
    }

    /// Shows a posture that is tried out beside the learner's arm.
    fn show(&mut self, learner: &str, appraisal: &AppraisalReport) -> Result<(), Problem> {
        let learners = &self.description.learners;
        let Some(index) = learners.iter().position(|described| described.name == learner) else { return Ok(()) };
        let ghost = self.recorder.log_ghost(self.experiment.latest().step, index, Some(&appraisal.bones_m()));
        ghost.map_err(recording_failed)
    }
}

/// A scenario with other values of some keys.
fn replaced(scenario: Scenario, set: &[String]) -> Result<Scenario, Problem> {
    if set.is_empty() {
        return Ok(scenario);
    }
    let refused = |detail: String| Problem::new(Kind::InvalidValue, detail).field("set");
    let replacements = set.iter().map(|text| text.parse::<Replacement>()).collect::<Result<Vec<_>, _>>();
    scenario.with(&replacements.map_err(refused)?).map_err(|error| match error {
        ScenarioError::Invalid { problems, .. } => {
            let told =
                problems.iter().map(|scenarios::Problem { key, what, hint, .. }| format!("`{key}`: {what}; {hint}"));
            refused(told.collect::<Vec<_>>().join("; "))
        }
        error => refused(error.to_string()),
    })
}

/// The kind of world in which the movements of an experiment of ours are made.
pub fn world(description: &Description) -> WorldKind {
    match description.movements_available {
        Some(_) => WorldKind::Measured,
        None => WorldKind::Simulated,
    }
}

/// The problem of a recording that cannot be written.
pub fn recording_failed(error: impl std::fmt::Display) -> Problem {
    Problem::new(Kind::Internal, format!("the recording cannot be written: {error}"))
}
