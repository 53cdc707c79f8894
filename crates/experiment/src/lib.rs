//! Several learners in one world, step by step.
//!
//! At every step each [`Agent`] proposes a movement, the world carries it out and shows what is seen there, and the agent
//! absorbs it. All start from the same estimate and see the same noise. The [`Judge`], who alone knows the truth, turns what
//! they believe into metrics. One [`StepReport`] per step is all that the outside reads.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod agent;
mod checkpoint;
mod choice;
mod comparison;
mod convergence;
#[cfg(test)]
mod failures;
mod gauge;
mod head;
mod judge;
mod learner;
mod loads;
mod metrics;
mod remarks;
mod report;
mod result;
mod sight;
mod streams;
mod told;
mod world;

pub use agent::{AbsorbError, Agent, Event, Executed, Proposal};
pub use checkpoint::Checkpoint;
pub use choice::{
    AppraisalReport, BoxReport, Choice, ChoiceError, ChosenReport, IterationReport, SearchedJoint, ShapeReport,
};
pub use comparison::{
    Comparison, Curve, LearnerComparison, Quantiles, RunSummary, SeedRun, SelectionTime, Summary, Trace,
};
pub use convergence::{CONFIRMATION, Convergence, Thresholds};
pub use gauge::Gauge;
pub use head::{GazeReport, HeadDescription};
pub use judge::{Judge, Verdict};
pub use learner::{Learner, SETTLING_STEPS};
pub use loads::{AxisReport, LoadsReport, MassReport};
pub use metrics::{
    Evaluation, HeldInSocket, HeldOutError, JointMetrics, Metrics, axis_deg, location_m, orientation_deg,
};
pub use report::{
    Body, Description, JointDescription, JointReport, LearnerDescription, LearnerReport, ModelReport, MovementReport,
    SocketDescription, StepReport,
};
pub use result::{JointModel, LearnerResult, MarkerModel, Model, OutlierReading, RunResult};
pub use sight::{
    CameraDescription, ChannelDescription, ChannelReading, CorrectionReport, PlaceReport, TargetDescription, channels,
    described,
};
pub use streams::Stream;
pub use told::Foreseen;
pub use world::{Change, Draw, NoiseSequence, Outliers, World, WorldError};

use body_schema_engine::{design::Problem, estimation::Update, selection::SelectionError};

/// A running comparison of learners. A copy of it goes its own way.
#[derive(Clone)]
pub struct Experiment {
    description: Description,
    world: World,
    noise: NoiseSequence,
    /// The readings so far that had nothing to do with the robot.
    outliers: Vec<OutlierReading>,
    learners: Vec<Learner>,
    judge: Judge,
    latest: StepReport,
}

/// Why a step could not be made. The experiment stays as it was: the same step can be asked for again.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ExperimentError {
    /// A learner could not choose.
    #[error("learner `{learner}` cannot choose its next movement: {source}")]
    Selection {
        /// Its name.
        learner: String,
        /// Why.
        source: SelectionError,
    },
    /// The world has nothing to show after a movement.
    #[error("nothing can be measured after the movement of learner `{learner}`: {source}")]
    World {
        /// Its name.
        learner: String,
        /// Why.
        source: WorldError,
    },
    /// A learner refused what it was shown.
    #[error("learner `{learner}`: {source}")]
    Absorb {
        /// Its name.
        learner: String,
        /// Why.
        source: AbsorbError,
    },
}

impl Experiment {
    /// A comparison of `learners` in `world`, judged over `evaluation`; step 0 is reported at once. With
    /// `problems`, one for each learner, reports tell also what the data of every learner allow (see [`design`](body_schema_engine::design)).
    pub fn new(
        description: Description,
        world: World,
        mut learners: Vec<Learner>,
        evaluation: Evaluation,
        problems: Vec<Problem>,
    ) -> Self {
        let mut judge = Judge::new(evaluation, learners.len(), description.thresholds, description.change_at);
        for (truth, learner) in world.truth().into_iter().flat_map(|truth| learners.iter().map(move |it| (truth, it))) {
            judge.study(learner.belief(), truth, world.head(), learner.limits());
        }
        judge.bound(problems);
        let truth = world.truth();
        let reports =
            learners.iter_mut().map(|learner| learner.report(None, Update::default(), &judge, truth)).collect();
        let mut latest = StepReport { step: 0, learners: reports, truth: None };
        judge.conclude(&mut latest);
        let noise = NoiseSequence::new(description.seed);
        Self { description, world, noise, outliers: Vec::new(), learners, judge, latest }
    }

    /// What stays the same from step to step.
    pub fn description(&self) -> &Description {
        &self.description
    }

    /// The report of the latest step.
    pub fn latest(&self) -> &StepReport {
        &self.latest
    }

    /// How many steps can still be made; `None` without an end.
    pub fn remaining(&self) -> Option<usize> {
        self.learners.iter().filter_map(Learner::remaining).min()
    }

    /// The truth, for those who judge: reports, recordings, bounds.
    pub fn world(&self) -> &World {
        &self.world
    }

    /// One movement of every learner.
    pub fn step(&mut self) -> Result<&StepReport, ExperimentError> {
        // All propose and the world shows what it has before any learns, so that a failure leaves the experiment as it was:
        // proposals that nobody carried out are there still, and the same, when they are asked for again.
        let mut proposals = Vec::with_capacity(self.learners.len());
        for learner in &mut self.learners {
            let proposed = learner.propose();
            let name = || learner.description.name.clone();
            proposals.push(proposed.map_err(|source| ExperimentError::Selection { learner: name(), source })?);
        }
        let mut noise = self.noise.clone();
        let draw = noise.draw(&self.world);
        let changed = self.world.changed_after(self.latest.step);
        let world = changed.as_ref().unwrap_or(&self.world);
        let mut executed = Vec::with_capacity(self.learners.len());
        for (learner, proposal) in self.learners.iter().zip(&proposals) {
            let Some(proposal) = proposal else {
                executed.push(None);
                continue;
            };
            let name = || learner.description.name.clone();
            let shown = world.execute(&proposal.selection.movement, &draw).and_then(|movement| {
                let observation = world.observe(&movement, &draw)?;
                Ok((movement, observation))
            });
            let (movement, observation) = shown.map_err(|source| ExperimentError::World { learner: name(), source })?;
            learner.belief().accepts(&movement.configuration, &observation).map_err(|refused| {
                ExperimentError::Absorb { learner: name(), source: AbsorbError::Refused(refused) }
            })?;
            executed.push(Some((movement, observation)));
        }
        self.noise = noise;
        let (movement, channels) = (self.latest.step + 1, 0..draw.outliers.len());
        let spoilt = channels.filter(|channel| world.is_outlier(&draw, *channel));
        self.outliers.extend(spoilt.map(|channel| OutlierReading { movement, channel }));
        let has_changed = changed.is_some();
        if let Some(world) = changed {
            world.truth().into_iter().for_each(|truth| self.judge.follow(truth));
            self.world = world;
        }
        let truth = self.world.truth();
        let mut reports = Vec::with_capacity(self.learners.len());
        for ((learner, proposal), executed) in self.learners.iter_mut().zip(proposals).zip(executed) {
            let (movement, update) = match proposal.zip(executed) {
                Some((proposal, (movement, observation))) => {
                    let name = learner.description.name.clone();
                    let socket = movement.socket.and_then(|socket| self.description.sockets.get(socket));
                    let socket = socket.map(SocketDescription::label);
                    let learned =
                        learner.learn(Some(proposal), movement, observation, &self.world, &self.description.channels);
                    let (report, update) =
                        learned.map_err(|source| ExperimentError::Absorb { learner: name, source })?;
                    (Some(MovementReport { socket, ..report }), update)
                }
                None => (None, Update::default()),
            };
            reports.push(learner.report(movement, update, &self.judge, truth));
        }
        let truth = truth.filter(|_| has_changed).map(ModelReport::of_state);
        let mut report = StepReport { step: self.latest.step + 1, learners: reports, truth };
        self.judge.conclude(&mut report);
        self.latest = report;
        Ok(&self.latest)
    }
}
