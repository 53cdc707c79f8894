//! What an experiment with a robot elsewhere has come to, to go on from without learning it again.

use serde::{Deserialize, Serialize};

use super::{Executed, Experiment, agent::Learned, judge::Concluded, learner::Record};

/// What the first learner of an experiment has learned, by the same build.
///
/// It is no whole experiment: what the list of events tells by itself (proposals, vetoes, where the robot stands) is told again.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Checkpoint {
    step: u64,
    learned: (Learned, Record),
    concluded: Concluded,
}

impl Checkpoint {
    /// The step after which it was made.
    pub fn step(&self) -> u64 {
        self.step
    }
}

impl Experiment {
    /// What the first learner has learned so far; `None` for a learner that keeps nothing to go on from, and for one that has ended.
    pub fn checkpoint(&self) -> Option<Checkpoint> {
        let learned = self.learners.first()?.learned()?;
        Some(Checkpoint { step: self.latest.step, learned, concluded: self.judge.concluded()? })
    }

    /// The first learner makes a movement, and learns nothing from it until it [takes up](Self::take_up) what it has learned. No step
    /// is judged.
    pub fn carry_out(&mut self, executed: &Executed) {
        self.agent_mut().into_iter().for_each(|agent| agent.carry_out(executed));
        self.latest.step += 1;
    }

    /// The first learner knows from now on what was learned from the movements that it has [made](Self::carry_out): so many, and no
    /// others. False where a checkpoint is of another experiment or of other movements; nothing can be made of the experiment then.
    ///
    /// The latest outcome tells its number alone until the next step.
    pub fn take_up(&mut self, checkpoint: Checkpoint) -> bool {
        let Checkpoint { step, learned, concluded } = checkpoint;
        self.judge.take_up(&concluded, step);
        let learner = self.learners.first_mut();
        step == self.latest.step && learner.is_some_and(|learner| learner.take_up(learned))
    }
}
