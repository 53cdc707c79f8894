//! Who learns: an estimator, a policy, and the list of what happened.
//!
//! An agent never meets a world or a truth. It proposes movements and absorbs what was executed, which need not be what it
//! proposed, nor have been proposed at all.
//!
//! *The belief depends on the executed events alone*, in their order: absorbing them again gives it again, to the last bit
//! with the same build. *Proposals depend on the whole list of events.* The random numbers of a proposal are
//! keyed by the seed and by its ordinal; what a policy planned with it stands in its event, and nothing is remembered
//! elsewhere; so a stored list of events is restored without choosing anything again.

use std::{collections::VecDeque, sync::Arc};

use serde::{Deserialize, Serialize};
use web_time::Instant;

use super::streams::Stream;
use body_schema_engine::{
    estimation::{Belief, EstimationError, Estimator, Misfit, NoiseReport, ReadingReport, Update},
    kinematics::JointBox,
    selection::{
        Actions, Appraisal, Constraints, KeptSituation, Movement, Past, Planned, Policy, Search, Selection,
        SelectionError, Situation,
    },
    sensing::{Observation, Refused},
};

/// An estimator and a policy at work. A copy of it lives on by itself.
#[derive(Clone)]
pub struct Agent {
    estimator: Box<dyn Estimator>,
    policy: Arc<dyn Policy>,
    actions: Actions,
    limits: JointBox,
    constraints: Option<Arc<Constraints>>,
    seed: u64,
    /// Proposals made so far.
    proposals: u64,
    pending: Vec<Proposal>,
    /// The plan of the latest proposal that was carried out, with its ordinal.
    carried_out: Option<(u64, Planned)>,
    history: Past,
    failure: Option<String>,
}

/// A movement that an agent asks for.
#[derive(Clone, Debug, PartialEq)]
pub struct Proposal {
    /// Its ordinal among all proposals of the agent, from 0.
    pub id: u64,
    /// The movement, what is expected of it, and what is planned to follow.
    pub selection: Selection,
    /// How long the choice took, milliseconds of wall time.
    pub selection_ms: f64,
}

/// A movement that was made, and what was seen after it.
#[derive(Clone, Debug, PartialEq)]
pub struct Executed {
    /// The proposal that it carried out; `None` for one that nobody proposed.
    pub proposal: Option<u64>,
    /// Where the joints were, as executed.
    pub movement: Movement,
    /// What was seen there.
    pub observation: Observation,
}

/// What an agent has learned from its movements.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Learned {
    estimator: Vec<u8>,
    /// Where nothing was seen, or nothing that counted.
    misses: VecDeque<Vec<f64>>,
}

/// What happened to an agent.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// It proposed a movement.
    Proposed(Proposal),
    /// A movement was made.
    Executed(Executed),
    /// A proposal was taken back.
    Withdrawn(u64),
    /// The robot refused a posture, rad or m per joint.
    Vetoed(Vec<f64>),
}

/// Why an agent has not absorbed what was executed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum AbsorbError {
    /// The measurement does not fit. Nothing was changed.
    #[error("the measurement was refused: {0}")]
    Refused(#[from] Refused),
    /// The estimate has left the range of numbers, at this measurement or before. The agent learns nothing any more.
    #[error("{0}")]
    Ended(String),
}

impl Agent {
    /// An agent that may do `actions`, within `limits` (recorded movements have some too).
    pub fn new(
        estimator: Box<dyn Estimator>,
        policy: Box<dyn Policy>,
        actions: Actions,
        limits: JointBox,
        seed: u64,
    ) -> Self {
        let (pending, history) = (Vec::new(), Past::default());
        let policy = Arc::from(policy);
        let (constraints, carried_out, failure) = (None, None, None);
        Self {
            estimator,
            policy,
            actions,
            limits,
            constraints,
            seed,
            proposals: 0,
            pending,
            carried_out,
            history,
            failure,
        }
    }

    /// The same bound to constraints: it proposes nothing that violates them.
    pub fn bound_to(self, constraints: Constraints) -> Self {
        Self { constraints: Some(Arc::new(constraints)), ..self }
    }

    /// What it believes.
    pub fn belief(&self) -> &Belief {
        self.estimator.belief()
    }

    /// What it makes of every reading so far; empty for an estimator that keeps none.
    pub fn readings(&self) -> Vec<ReadingReport> {
        self.estimator.readings()
    }

    /// What it makes of the readings of the latest movement, the `movement`-th; whatever the number of those before.
    pub fn latest_readings(&self, movement: u64) -> Vec<ReadingReport> {
        self.estimator.latest_readings(movement)
    }

    /// The scales of noise that it learns.
    pub fn noise(&self) -> Vec<NoiseReport> {
        self.estimator.noise()
    }

    /// What the readings say that its model does not allow.
    pub fn misfit(&self) -> Option<Misfit> {
        self.estimator.misfit()
    }

    /// How far joints' readings are off, where it learns that: one standard deviation each, rad or m.
    pub fn reading_sigmas(&self) -> Vec<f64> {
        self.estimator.reading_sigmas()
    }

    /// What it may do.
    pub fn actions(&self) -> &Actions {
        &self.actions
    }

    /// The joint limits.
    pub fn limits(&self) -> &JointBox {
        &self.limits
    }

    /// What its movements are bound to, if to anything.
    pub fn constraints(&self) -> Option<&Constraints> {
        self.constraints.as_deref()
    }

    /// Why it has ended, if it has.
    pub fn failure(&self) -> Option<&str> {
        self.failure.as_deref()
    }

    /// The proposals that nobody has carried out or taken back yet.
    pub fn pending(&self) -> &[Proposal] {
        &self.pending
    }

    /// At least `count` pending proposals: those that there are, and new ones chosen given these. Asking again changes
    /// nothing until one is absorbed or withdrawn. An agent that has ended proposes nothing.
    ///
    /// An error leaves the agent as it was, but for proposals made before it was met: no choice ends an agent.
    ///
    /// # Errors
    ///
    /// [`SelectionError`] if the policy cannot choose: no movement is left, none is feasible, or the criterion is not
    /// finite.
    pub fn propose(&mut self, count: usize) -> Result<&[Proposal], SelectionError> {
        self.drop_infeasible();
        while self.pending.len() < count && self.failure.is_none() {
            let proposal = self.next_proposal()?;
            self.proposed(proposal);
        }
        Ok(&self.pending)
    }

    /// One more proposal, chosen given the pending ones, which is not proposed by that: whoever stores it first
    /// [restores](Self::restore) it then.
    ///
    /// # Errors
    ///
    /// [`SelectionError`] if the policy cannot choose: no movement is left, none is feasible, or the criterion is not
    /// finite.
    pub fn next_proposal(&self) -> Result<Proposal, SelectionError> {
        let start = Instant::now();
        let selection = self.select()?;
        let selection_ms = start.elapsed().as_secs_f64() * 1e3;
        Ok(Proposal { id: self.proposals, selection, selection_ms })
    }

    /// One more proposal, of a movement to a posture that somebody wants, to follow the pending ones; not proposed by that, as
    /// [`next_proposal`](Self::next_proposal).
    ///
    /// # Errors
    ///
    /// [`SelectionError::NoConfiguration`] if there is not one position for each joint, [`SelectionError::Refused`] if the constraints
    /// exclude the movement; others if the criterion cannot be computed there.
    pub fn wanted_proposal(&self, configuration: &[f64]) -> Result<Proposal, SelectionError> {
        let foreseen = self.foreseen();
        let appraisal = match self.appraise(foreseen.borrowed(), configuration) {
            // Of a policy without a criterion nothing is told.
            Err(SelectionError::NoCovariance) => None,
            appraisal => Some(appraisal?),
        };
        self.refuse(&self.pending, configuration)?;
        let selection = Selection {
            criterion: appraisal.as_ref().map(|it| it.criterion),
            gain: appraisal.as_ref().map(|it| it.gain),
            ..Selection::of(self.actions.movement_to(&foreseen.belief, configuration))
        };
        Ok(Proposal { id: self.proposals, selection, selection_ms: 0.0 })
    }

    /// The pending proposals that are not feasible any more, each taken to follow the feasible ones before it.
    pub fn infeasible(&self) -> Vec<u64> {
        let (mut kept, mut refused): (Vec<Proposal>, Vec<u64>) = Default::default();
        for proposal in &self.pending {
            match self.refuse(&kept, &proposal.selection.movement.configuration) {
                Ok(()) => kept.push(proposal.clone()),
                Err(_) => refused.push(proposal.id),
            }
        }
        refused
    }

    /// The constraint that a movement to `configuration` violates if it follows these proposals.
    fn refuse(&self, before: &[Proposal], configuration: &[f64]) -> Result<(), SelectionError> {
        let Some(constraints) = &self.constraints else { return Ok(()) };
        let last = before.last().map(|proposal| proposal.selection.movement.configuration.as_slice());
        let from = last.or(self.posture());
        constraints.violation(from, configuration).map_or(Ok(()), |violation| Err(SelectionError::Refused(violation)))
    }

    /// Takes back the first pending proposal that is no longer feasible, as after a veto or a movement to elsewhere, and those
    /// that were to follow it.
    fn drop_infeasible(&mut self) {
        let is_refused = |index: usize| {
            let Proposal { selection, .. } = &self.pending[index];
            self.refuse(&self.pending[..index], &selection.movement.configuration).is_err()
        };
        let kept = (0..self.pending.len()).find(|index| is_refused(*index)).unwrap_or(self.pending.len());
        self.pending.truncate(kept);
    }

    /// Chooses one more movement, given the pending ones; whatever the policy, a feasible one.
    fn select(&self) -> Result<Selection, SelectionError> {
        let selection = self.choose()?;
        self.refuse(&self.pending, &selection.movement.configuration)?;
        Ok(selection)
    }

    fn choose(&self) -> Result<Selection, SelectionError> {
        let mut rng = Stream::Policy.keyed(self.seed, self.proposals);
        if self.pending.is_empty() {
            return self.policy.select(&self.situation(), &mut rng);
        }
        self.policy.select(&self.foreseen().borrowed(), &mut rng)
    }

    /// The situation that it expects once all that is pending is carried out.
    pub fn foreseen(&self) -> KeptSituation {
        let mut foreseen = self.situation().kept();
        for Proposal { selection, .. } in &self.pending {
            self.foresee(&mut foreseen, &selection.movement);
        }
        foreseen
    }

    /// Goes on to the situation that it expects after a movement. Tells the chance that anything is seen there.
    pub fn foresee(&self, foreseen: &mut KeptSituation, movement: &Movement) -> f64 {
        let Movement { configuration, socket, .. } = movement;
        let belief = foreseen.belief.held_in(*socket);
        let situation = Situation { belief: &belief, ..foreseen.borrowed() };
        // What is not expected to be seen is not expected to teach.
        let appraisal = self.policy.appraise(&situation, &self.limits, configuration);
        let chance = appraisal.map_or(1.0, |appraisal| appraisal.chance);
        drop(belief);
        foreseen.belief.after(movement, |_| chance);
        foreseen.history.expect(configuration);
        foreseen.actions.use_up(movement);
        chance
    }

    fn proposed(&mut self, proposal: Proposal) {
        self.history.proposed(proposal.selection.plan.as_ref());
        self.proposals = proposal.id + 1;
        self.pending.push(proposal);
    }

    /// Whether its movements are chosen outside, by [`set`](Self::set) alone.
    pub fn is_set_from_outside(&self) -> bool {
        self.policy.is_set_from_outside()
    }

    /// Proposes this movement in place of all that are pending, whatever its policy would choose. It is a proposal as any
    /// other: stored with the events, and restored with them. An agent that has ended proposes nothing.
    ///
    /// # Errors
    ///
    /// [`SelectionError::NoConfiguration`] if there is not one position for each joint, [`SelectionError::Refused`] if
    /// the constraints exclude the posture; others if the criterion cannot be computed there.
    pub fn set(&mut self, configuration: &[f64]) -> Result<Appraisal, SelectionError> {
        let appraisal = self.appraise(self.situation(), configuration)?;
        self.refuse(&[], configuration)?;
        let selection = Selection {
            criterion: Some(appraisal.criterion),
            gain: Some(appraisal.gain),
            ..Selection::of(self.actions.movement_to(self.belief(), configuration))
        };
        if self.failure.is_none() {
            self.pending.clear();
            self.proposed(Proposal { id: self.proposals, selection, selection_ms: 0.0 });
        }
        Ok(appraisal)
    }

    /// The robot cannot go to `configuration`: it and its neighbourhood are excluded (see
    /// [`Vetoes`](body_schema_engine::selection::Vetoes)), and pending proposals in there replaced, with those that were to follow them.
    /// An error leaves the veto in force.
    ///
    /// # Errors
    ///
    /// [`SelectionError::NoConfiguration`] if there is not one position for each joint; others if the policy cannot replace what was
    /// pending.
    pub fn veto(&mut self, configuration: &[f64]) -> Result<&[Proposal], SelectionError> {
        if configuration.len() != self.limits.dimension() {
            return Err(SelectionError::NoConfiguration(configuration.len()));
        }
        let count = self.pending.len();
        self.exclude(configuration);
        let count = if self.is_set_from_outside() { 0 } else { count };
        self.propose(count)
    }

    fn exclude(&mut self, configuration: &[f64]) {
        self.forbid(configuration);
        self.drop_infeasible();
    }

    /// As [`veto`](Self::veto), but what is pending stays pending, and nothing is chosen. Not a position for every joint is no
    /// posture to forbid.
    pub fn forbid(&mut self, configuration: &[f64]) {
        if configuration.len() == self.limits.dimension() {
            let unbound = || Arc::new(Constraints::none(self.limits.clone()));
            Arc::make_mut(self.constraints.get_or_insert_with(unbound)).veto(configuration);
        }
    }

    /// The robot stands there now (rad or m per joint), by a movement of which nothing is to be learned.
    pub fn stand_at(&mut self, configuration: &[f64]) {
        self.history.expect(configuration);
    }

    /// Where the robot stands, as far as is known, rad or m per joint: where it moved last, or else where it starts.
    pub fn posture(&self) -> Option<&[f64]> {
        let start = || self.constraints.as_deref()?.start.as_deref();
        self.history.posture().or_else(start)
    }

    /// Takes a proposal back; false if it is not pending.
    pub fn withdraw(&mut self, id: u64) -> bool {
        let before = self.pending.len();
        self.pending.retain(|proposal| proposal.id != id);
        self.pending.len() < before
    }

    /// Takes a proposal back as if it had never been made, the plan that came with it included; false if it is not pending. What
    /// is drawn for the next one is drawn anew.
    pub fn abandon(&mut self, id: u64) -> bool {
        let was_pending = self.withdraw(id);
        if was_pending {
            let planned = self.pending.iter().filter_map(|it| Some((it.id, it.selection.plan.clone()?)));
            let latest = planned.chain(self.carried_out.clone()).max_by_key(|(id, _)| *id);
            self.history.plan_anew(latest.map(|(_, plan)| plan));
        }
        was_pending
    }

    /// Forgets what is planned: the next choice begins with none.
    pub fn forget_plan(&mut self) {
        self.carried_out = None;
        self.history.plan_anew(None);
    }

    /// Takes in movements that were executed, in order. If one does not fit, none is absorbed. Tells what each update
    /// found; an update that ends the agent ends the list, and those before it count.
    ///
    /// # Errors
    ///
    /// [`AbsorbError::Refused`] if an observation does not fit, [`AbsorbError::Ended`] if the agent has ended before,
    /// or ends because its estimate diverges.
    pub fn absorb(&mut self, executed: &[Executed]) -> Result<Vec<Update>, AbsorbError> {
        if let Some(failure) = &self.failure {
            return Err(AbsorbError::Ended(failure.clone()));
        }
        for Executed { movement, observation, .. } in executed {
            self.belief().accepts(&movement.configuration, observation)?;
        }
        executed.iter().map(|executed| self.absorb_one(executed)).collect()
    }

    /// Makes a movement without learning from it: what it has learned it is [told](Self::take_up) later.
    pub(super) fn carry_out(&mut self, executed: &Executed) {
        let Executed { proposal, movement, observation } = executed;
        if let Some(index) = self.pending.iter().position(|pending| Some(pending.id) == *proposal) {
            let Proposal { id, selection, .. } = self.pending.remove(index);
            let is_latest = self.carried_out.as_ref().is_none_or(|(latest, _)| *latest < id);
            if let Some(plan) = selection.plan.filter(|_| is_latest) {
                self.carried_out = Some((id, plan));
            }
        }
        self.history.moved(movement, &self.actions, observation);
        self.actions.use_up(movement);
    }

    /// All that it has learned, beside what the list of events tells; `None` where its estimator keeps nothing to go on from, and
    /// where it has ended.
    pub(super) fn learned(&self) -> Option<Learned> {
        let is_going_on = self.failure.is_none();
        let estimator = is_going_on.then(|| self.estimator.stored()).flatten()?;
        Some(Learned { estimator, misses: self.history.misses().clone() })
    }

    /// Knows from now on what was learned from the movements that it has [made](Self::carry_out) and no others; false where that is
    /// not of an agent like this.
    pub(super) fn take_up(&mut self, learned: Learned) -> bool {
        let Some(estimator) = self.estimator.restored(&learned.estimator) else { return false };
        self.estimator = estimator;
        self.history.missed(learned.misses);
        true
    }

    fn absorb_one(&mut self, executed: &Executed) -> Result<Update, AbsorbError> {
        self.carry_out(executed);
        let Executed { movement, observation, .. } = executed;
        // All of the list were accepted before the first of it was absorbed.
        let update = self.estimator.correct(&movement.configuration, observation).map_err(|error| match error {
            EstimationError::Refused(refused) => refused.into(),
            EstimationError::Diverged(_) => {
                self.failure = Some(error.to_string());
                self.pending.clear();
                AbsorbError::Ended(error.to_string())
            }
        })?;
        let made = self.history.made().len() as u64;
        let readings = self.estimator.latest_readings(made);
        let is_alone = self.belief().alternatives.is_empty();
        if is_alone && !readings.is_empty() && readings.iter().all(|reading| reading.weight < 0.5) {
            // It counted for nothing, as if nothing had been seen.
            self.history.rejected(movement, &self.actions);
        }
        Ok(update)
    }

    /// Restores an event of a stored list, in its turn, without choosing anything again.
    ///
    /// # Errors
    ///
    /// [`AbsorbError::Refused`] if the observation of an executed movement does not fit. That the agent has ended is no
    /// error here.
    pub fn restore(&mut self, event: &Event) -> Result<(), AbsorbError> {
        match event {
            Event::Proposed(proposal) => self.proposed(proposal.clone()),
            Event::Executed(executed) => match self.absorb(std::slice::from_ref(executed)) {
                // The movement at which it ended, or one after that.
                Ok(_) | Err(AbsorbError::Ended(_)) => {}
                Err(refused) => return Err(refused),
            },
            Event::Withdrawn(id) => drop(self.withdraw(*id)),
            Event::Vetoed(configuration) => self.exclude(configuration),
        }
        Ok(())
    }

    /// What it would choose from now.
    pub fn situation(&self) -> Situation<'_> {
        let (actions, history, constraints) = (&self.actions, &self.history, self.constraints.as_deref());
        Situation { belief: self.belief(), actions, history, constraints }
    }

    /// What a movement would teach it in a `situation`, by what it chooses by.
    ///
    /// # Errors
    ///
    /// [`SelectionError::NoConfiguration`] if there is not one position for each joint; others if the criterion cannot
    /// be computed there.
    pub fn appraise(&self, situation: Situation<'_>, configuration: &[f64]) -> Result<Appraisal, SelectionError> {
        if configuration.len() != self.limits.dimension() {
            return Err(SelectionError::NoConfiguration(configuration.len()));
        }
        let socket = situation.actions.movement_to(situation.belief, configuration).socket;
        let belief = situation.belief.held_in(socket);
        let situation = Situation { belief: &belief, ..situation };
        self.policy.appraise(&situation, &self.limits, configuration)
    }

    /// How the criterion of the next movement looked over the joint box in a `situation`, if its policy plans.
    ///
    /// # Errors
    ///
    /// [`SelectionError`] if the policy cannot repeat its search there.
    pub fn explain(&self, situation: Situation<'_>) -> Result<Option<Search>, SelectionError> {
        // Of manifolds there is no partition of the joint box to show, recorded or not.
        if situation.belief.measurement_model.holds(0).is_some() {
            return Ok(None);
        }
        self.policy.explain(&situation, &self.limits)
    }
}
