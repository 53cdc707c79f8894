//! Experiments with a robot elsewhere: their only learner is asked for movements, and told what came of them.

use super::{Agent, Executed, Experiment, ExperimentError, Proposal, StepOutcome};
use body_schema_engine::{
    estimation::Belief,
    selection::{SelectionError, travel},
};

/// What is expected of a proposal, once all that was pending before it is carried out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Foreseen {
    /// The error of predictions over the workspace that the learner expects of itself after it, metres; `None` without a
    /// covariance.
    pub expected_error_m: Option<f64>,
    /// The chance that anything is seen.
    pub chance_seen: f64,
    /// By how far the joint that moves farthest moves, rad or m; `None` where nobody knows where the robot stands before.
    pub travel: Option<f64>,
}

impl Experiment {
    /// The agent of the first learner, the only one where the robot is elsewhere. `None` for an experiment of none.
    pub fn agent(&self) -> Option<&Agent> {
        self.learners.first().map(super::Learner::agent)
    }

    /// The same, to be told of anything but observations.
    pub fn agent_mut(&mut self) -> Option<&mut Agent> {
        self.learners.first_mut().map(super::Learner::agent_mut)
    }

    /// What the first learner believes.
    pub fn belief(&self) -> Option<&Belief> {
        self.agent().map(Agent::belief)
    }

    /// One more proposal of the first learner, chosen given the pending ones, and what is expected of it. It is not proposed by
    /// that: whoever has stored it restores it to the [agent](Self::agent_mut).
    ///
    /// # Errors
    ///
    /// [`SelectionError`] where nothing can be chosen.
    pub fn next_proposal(&self) -> Result<(Proposal, Foreseen), SelectionError> {
        self.expected(Agent::next_proposal)
    }

    /// The same of a movement to a posture that somebody wants, rad or m per joint, base first.
    ///
    /// # Errors
    ///
    /// [`SelectionError::NoConfiguration`] if there is not one position for each joint, [`SelectionError::Refused`] if the constraints
    /// exclude the movement; others if the criterion cannot be computed there.
    pub fn wanted_proposal(&self, configuration: &[f64]) -> Result<(Proposal, Foreseen), SelectionError> {
        self.expected(|agent| agent.wanted_proposal(configuration))
    }

    fn expected(
        &self,
        propose: impl FnOnce(&Agent) -> Result<Proposal, SelectionError>,
    ) -> Result<(Proposal, Foreseen), SelectionError> {
        let learner = self.learners.first().ok_or(SelectionError::Exhausted)?;
        let agent = learner.agent();
        let proposal = propose(agent)?;
        let movement = &proposal.selection.movement;
        let before = agent.pending().last().map(|last| last.selection.movement.configuration.as_slice());
        let from = before.or(agent.posture());
        let travel = from.map(|from| travel(from, &movement.configuration));
        let mut foreseen = agent.foreseen();
        let chance_seen = agent.foresee(&mut foreseen, movement);
        let expected_error_m = foreseen.belief.expected_error_m(learner.workspace());
        Ok((proposal, Foreseen { expected_error_m, chance_seen, travel }))
    }

    /// The first learner takes in a movement that a robot elsewhere has made, and what was observed after it. It is
    /// a step as any other.
    ///
    /// # Errors
    ///
    /// [`ExperimentError::Absorb`] where the observation is refused or the learner has ended: nothing has happened then.
    pub fn tell(&mut self, executed: Executed) -> Result<&StepOutcome, ExperimentError> {
        let Executed { proposal, movement, observation } = executed;
        let Some(learner) = self.learners.first_mut() else { return Ok(&self.latest) };
        let refused = |source| ExperimentError::Absorb { learner: self.setting.learners[0].name.clone(), source };
        if let Some(failure) = learner.agent().failure() {
            return Err(refused(super::AbsorbError::Ended(failure.to_owned())));
        }
        let mut pending = learner.agent().pending().iter();
        let proposal = pending.find(|pending| Some(pending.id) == proposal).cloned();
        let (movement, update) = learner.learn(proposal, movement, observation).map_err(refused)?;
        let fared = vec![(Some(movement), learner.stand(update))];
        Ok(self.conclude(self.latest.step + 1, fared, false))
    }
}
