//! Several learners in one world, step by step.
//!
//! At every step each [`Agent`] proposes a movement, the world carries it out and shows what is seen there, and the agent
//! absorbs it. All start from the same estimate and see the same noise. The [`Judge`], who alone knows the truth, turns what
//! they believe into metrics. What came of a step is its [`StepOutcome`]; whoever shows or stores one makes a report of it,
//! and nothing here knows how that is written.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod agent;
mod checkpoint;
mod chosen;
mod convergence;
#[cfg(test)]
mod failures;
mod gauge;
mod judge;
mod learner;
mod metrics;
mod outcome;
mod remarks;
mod setting;
mod sight;
mod streams;
mod told;
mod world;

pub use agent::{AbsorbError, Agent, Event, Executed, Proposal};
pub use checkpoint::Checkpoint;
pub use chosen::{Appraised, ChoiceError, Chosen};
pub use convergence::{CONFIRMATION, Convergence, Thresholds};
pub use gauge::Gauge;
pub use judge::{Evidence, Judge, Judgement, Verdict};
pub use learner::{Learner, SETTLING_STEPS};
pub use metrics::{
    Evaluation, HeldInSocket, HeldOutError, JointMetrics, Metrics, axis_deg, location_m, orientation_deg,
};
pub use outcome::{LearnerOutcome, MovementOutcome, Standing, StepOutcome};
pub use setting::{Body, ChannelSetting, JointSetting, LearnerSetting, Setting, SocketSetting, channels, socket_label};
pub use sight::{Picture, Reading};
pub use streams::Stream;
pub use told::Foreseen;
pub use world::{Change, Draw, NoiseSequence, Outliers, World, WorldError};

use body_schema_engine::{design::Problem, estimation::Update, selection::SelectionError};

/// A running comparison of learners. A copy of it goes its own way.
#[derive(Clone)]
pub struct Experiment {
    setting: Setting,
    world: World,
    noise: NoiseSequence,
    outliers: Vec<Outlier>,
    learners: Vec<Learner>,
    judge: Judge,
    latest: StepOutcome,
}

/// A reading that had nothing to do with the robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Outlier {
    /// The movement, counted from 1.
    pub movement: u64,
    /// The channel, counted from 0.
    pub channel: usize,
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
    /// A comparison of `learners` in `world`, judged over `evaluation`; step 0 is judged at once. With
    /// `problems`, one for each learner, outcomes tell also what the data of every learner allow (see [`design`](body_schema_engine::design)).
    pub fn new(
        setting: Setting,
        world: World,
        learners: Vec<Learner>,
        evaluation: Evaluation,
        problems: Vec<Problem>,
    ) -> Self {
        let mut judge = Judge::new(evaluation, learners.len(), setting.thresholds, setting.change_at);
        for (truth, learner) in world.truth().into_iter().flat_map(|truth| learners.iter().map(move |it| (truth, it))) {
            judge.study(learner.belief(), truth, world.head(), learner.limits());
        }
        judge.bound(problems);
        let noise = NoiseSequence::new(setting.seed);
        let latest = StepOutcome { step: 0, learners: Vec::new(), truth: None };
        let mut experiment = Self { setting, world, noise, outliers: Vec::new(), learners, judge, latest };
        let standings =
            experiment.learners.iter_mut().map(|learner| (None, learner.stand(Update::default()))).collect();
        experiment.conclude(0, standings, false);
        experiment
    }

    /// What stays the same from step to step.
    pub fn setting(&self) -> &Setting {
        &self.setting
    }

    /// What came of the latest step.
    pub fn latest(&self) -> &StepOutcome {
        &self.latest
    }

    /// The learners, in the order of every outcome.
    pub fn learners(&self) -> &[Learner] {
        &self.learners
    }

    /// What came of the learners' runs so far, in the same order.
    pub fn verdicts(&self) -> &[Verdict] {
        self.judge.verdicts()
    }

    /// The readings so far that had nothing to do with the robot.
    pub fn outliers(&self) -> &[Outlier] {
        &self.outliers
    }

    /// How many steps can still be made; `None` without an end.
    pub fn remaining(&self) -> Option<usize> {
        self.learners.iter().filter_map(Learner::remaining).min()
    }

    /// The truth, for those who judge and for those who show it: reports, recordings, bounds.
    pub fn world(&self) -> &World {
        &self.world
    }

    /// One movement of every learner.
    ///
    /// # Errors
    ///
    /// [`ExperimentError::Selection`] if a learner cannot choose and [`ExperimentError::World`] if nothing can be measured after its
    /// movement, both before anything has changed; [`ExperimentError::Absorb`] if a learner refuses its observation.
    pub fn step(&mut self) -> Result<&StepOutcome, ExperimentError> {
        // All propose and the world shows what it has before any learns, so that a failure leaves the experiment as it was:
        // proposals that nobody carried out are there still, and the same, when they are asked for again.
        let mut proposals = Vec::with_capacity(self.learners.len());
        for learner in &mut self.learners {
            let proposed = learner.propose();
            let name = || learner.setting.name.clone();
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
            let name = || learner.setting.name.clone();
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
        self.outliers.extend(spoilt.map(|channel| Outlier { movement, channel }));
        let has_changed = changed.is_some();
        if let Some(world) = changed {
            world.truth().into_iter().for_each(|truth| self.judge.follow(truth));
            self.world = world;
        }
        let mut fared = Vec::with_capacity(self.learners.len());
        for ((learner, proposal), executed) in self.learners.iter_mut().zip(proposals).zip(executed) {
            let (movement, update) = match proposal.zip(executed) {
                Some((proposal, (movement, observation))) => {
                    let learned = learner.learn(Some(proposal), movement, observation);
                    let name = || learner.setting.name.clone();
                    let (movement, update) =
                        learned.map_err(|source| ExperimentError::Absorb { learner: name(), source })?;
                    (Some(movement), update)
                }
                None => (None, Update::default()),
            };
            fared.push((movement, learner.stand(update)));
        }
        Ok(self.conclude(self.latest.step + 1, fared, has_changed))
    }

    /// The end of a step: how the learners fared is judged, and what came of it stands.
    fn conclude(
        &mut self,
        step: u64,
        fared: Vec<(Option<MovementOutcome>, Standing)>,
        has_changed: bool,
    ) -> &StepOutcome {
        let truth = self.world.truth();
        let evidence: Vec<Evidence<'_>> = self
            .learners
            .iter()
            .zip(&fared)
            .map(|(learner, (movement, standing))| Evidence {
                belief: learner.belief(),
                standing,
                movement: movement.as_ref(),
            })
            .collect();
        let judgements = self.judge.conclude(step, truth, &evidence);
        let learners = self
            .learners
            .iter()
            .zip(fared)
            .zip(judgements)
            .map(|((learner, (movement, _)), Judgement { metrics, allowed })| LearnerOutcome {
                name: learner.setting.name.clone(),
                movement,
                metrics,
                allowed,
                failure: learner.end(),
            })
            .collect();
        let truth = truth.filter(|_| has_changed).cloned();
        self.latest = StepOutcome { step, learners, truth };
        &self.latest
    }
}
