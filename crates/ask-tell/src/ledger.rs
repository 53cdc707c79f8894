//! The state of a session after its events.

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::Arc,
};

use super::{
    Answer, ChannelShape, Event, Happened, Observation, Outcome, Plan, Setup, SetupError, Suggestion, SuggestionState,
    Why,
    channel::shapes,
    checkpoint::{Checkpoint, Hear, Replayed, excluded},
};
use body_schema_engine::selection::{Movement, Planned, Selection};
use body_schema_experiment::{Agent, Event as AgentEvent, Experiment, Proposal};
use body_schema_scenario::Scenario;

/// An observation that was received.
#[derive(Clone, Debug, PartialEq)]
pub struct Told {
    /// The observation as it was received.
    pub observation: Observation,
    /// The answer to it.
    pub answer: Answer,
    /// Whether it is excluded.
    pub excluded: bool,
}

/// The state after some events.
#[derive(Clone)]
pub(super) struct Ledger {
    pub scenario: Arc<Scenario>,
    pub shapes: Arc<[ChannelShape]>,
    pub experiment: Experiment,
    /// All suggestions ever made, by id.
    pub suggestions: Vec<Arc<Suggestion>>,
    /// All observations ever received, by number.
    pub told: Vec<Arc<Told>>,
    /// The numbers of the observations that the agent has learned from, in its order; excluded ones are not among them.
    pub counted: Vec<u64>,
}

/// The way to replay an observation that counts.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Replay {
    /// The agent learns from it.
    Learned,
    /// The agent only carries it out; what it taught is restored later.
    CarriedOut,
}

impl Ledger {
    /// How many changes of the body the learner has noticed.
    pub fn changes_noticed(&self) -> u64 {
        self.experiment.latest().learners[0].metrics.changes_noticed
    }

    /// The state before any event.
    pub fn new(setup: &Setup, scenario: Arc<Scenario>) -> Result<Self, SetupError> {
        let agent = match &setup.agent {
            Some(agent) => scenario.chosen(Some(std::slice::from_ref(agent))),
            None => scenario.chosen(None),
        };
        let agent = agent.map_err(SetupError::Agent)?.swap_remove(0).name;
        let experiment = scenario.experiment(setup.seed, Some(&[agent])).map_err(SetupError::Agent)?;
        let shapes = shapes(&scenario.robot, &scenario.measurement_model).into();
        let (suggestions, told, counted) = Default::default();
        Ok(Self { scenario, shapes, experiment, suggestions, told, counted })
    }

    /// The state after all of `events`. Observations that are excluded at the end never count. What was learned up to a checkpoint
    /// is not learned again. `hear` receives every counting observation after that; without a checkpoint also the state before
    /// any.
    pub fn replayed(
        mut self,
        events: &[Event],
        from: Option<&Checkpoint>,
        hear: &mut Hear<'_>,
    ) -> Result<Self, (usize, String)> {
        let excluded = excluded(events);
        let first = from.map_or(0, Checkpoint::events);
        if let Some(checkpoint) = from {
            if !checkpoint.serves(events) {
                return Err((first, "its checkpoint does not serve".to_owned()));
            }
            for (index, event) in events[..first].iter().enumerate() {
                self.apply_as(event, &excluded, Replay::CarriedOut).map_err(|what| (index + 1, what))?;
            }
            if !self.experiment.take_up(checkpoint.experiment().clone()) {
                return Err((first, "its checkpoint is of another session".to_owned()));
            }
        } else {
            hear(self.replayed_to(0, events));
        }
        for (index, event) in events.iter().enumerate().skip(first) {
            let is_step = self.apply(event, &excluded).map_err(|what| (index + 1, what))?;
            if is_step && !hear(self.replayed_to(index + 1, events)) {
                return Err((index + 1, "nobody waits for it any more".to_owned()));
            }
        }
        Ok(self)
    }

    fn replayed_to(&self, done: usize, of: &[Event]) -> Replayed<'_> {
        Replayed { events: done, known: of.len(), told: self.told.len() as u64, experiment: &self.experiment }
    }

    /// After one more event, where the observations of `skipped` do not count. Tells whether it is a step: an
    /// observation that counts.
    pub fn apply(&mut self, event: &Event, skipped: &BTreeSet<u64>) -> Result<bool, String> {
        self.apply_as(event, skipped, Replay::Learned)
    }

    fn apply_as(&mut self, event: &Event, skipped: &BTreeSet<u64>, replay: Replay) -> Result<bool, String> {
        match &event.happened {
            Happened::Suggested { suggestion, choice } => {
                let id = self.suggestions.len() as u64 + 1;
                if suggestion.id != id {
                    return Err(format!("it suggests number {}, and {id} comes next", suggestion.id));
                }
                let movement = self.movement(suggestion)?;
                let joints = movement.configuration.len();
                let is_posture = |one: &Vec<f64>| one.len() == joints && one.iter().all(|q| q.is_finite());
                if choice.plan.as_ref().is_some_and(|plan| !plan.postures.iter().all(is_posture)) {
                    return Err(format!("its plan has a posture that is none of {joints} joints"));
                }
                let plan =
                    choice.plan.clone().map(|Plan { postures, committed }| Planned { poses: postures, committed });
                let proposal = Proposal {
                    id: id - 1,
                    selection: Selection {
                        movement,
                        criterion: choice.criterion,
                        gain: suggestion.expected_gain,
                        evaluations: choice.evaluations,
                        search: None,
                        plan,
                    },
                    selection_ms: choice.selection_ms,
                };
                self.agent(AgentEvent::Proposed(proposal))?;
                // Those of older sessions do not say it.
                let joints = self.scenario.robot.names.clone();
                self.suggestions.push(Arc::new(Suggestion { joints, ..suggestion.clone() }));
            }
            Happened::Outcome { suggestion, state, .. } => {
                self.end(*suggestion, (*state).into())?;
                if *state == Outcome::Infeasible {
                    let refused = self.movement(&self.suggestions[*suggestion as usize - 1])?;
                    let agent = self.experiment.agent_mut();
                    agent.into_iter().for_each(|agent| agent.forbid(&refused.configuration));
                }
            }
            Happened::Superseded { suggestions, why } => {
                suggestions.iter().try_for_each(|id| self.end(*id, SuggestionState::Superseded))?;
                // What is planned goes on where nothing is wrong with it.
                let agent = self.experiment.agent_mut().filter(|_| *why != Why::Constraints);
                agent.into_iter().for_each(Agent::forget_plan);
            }
            Happened::Expired { suggestions } => {
                suggestions.iter().try_for_each(|id| self.end(*id, SuggestionState::Expired))?;
            }
            Happened::Observed { told, answer } => return self.observe(told, answer, skipped, replay),
            Happened::Excluded { observation } => self.mark(*observation, true)?,
            Happened::Included { observation } => self.mark(*observation, false)?,
        }
        Ok(false)
    }

    fn observe(
        &mut self,
        told: &Observation,
        answer: &Answer,
        skipped: &BTreeSet<u64>,
        replay: Replay,
    ) -> Result<bool, String> {
        let number = self.told.len() as u64 + 1;
        let executed = told.read(&self.scenario, &self.shapes).map_err(|fault| fault.to_string())?;
        let (seen, configuration) = (!executed.observation.is_miss(), executed.movement.configuration.clone());
        let mut is_step = false;
        if skipped.contains(&number) {
            let agent = self.experiment.agent_mut();
            if let Some(agent) = agent {
                if let Some(id) = executed.proposal {
                    agent.withdraw(id);
                }
                agent.stand_at(&configuration);
            }
        } else if replay == Replay::CarriedOut {
            self.experiment.carry_out(&executed);
            self.counted.push(number);
        } else {
            self.experiment.tell(executed).map_err(|error| error.to_string())?;
            is_step = true;
            self.counted.push(number);
        }
        if let Some(id) = told.suggestion_id {
            let state = if seen { SuggestionState::Observed } else { SuggestionState::NotSeen };
            self.suggestion_mut(id)?.state = state;
        }
        let excluded = skipped.contains(&number);
        self.told.push(Arc::new(Told { observation: told.clone(), answer: answer.clone(), excluded }));
        Ok(is_step)
    }

    /// The excluded observations.
    pub fn excluded(&self) -> BTreeSet<u64> {
        let numbered = (1..).zip(&self.told);
        numbered.filter(|(_, told)| told.excluded).map(|(number, _)| number).collect()
    }

    fn mark(&mut self, observation: u64, excluded: bool) -> Result<(), String> {
        let index = observation.checked_sub(1).and_then(|index| usize::try_from(index).ok());
        let told = index.and_then(|index| self.told.get_mut(index));
        Arc::make_mut(told.ok_or_else(|| format!("there is no observation {observation}"))?).excluded = excluded;
        Ok(())
    }

    fn end(&mut self, id: u64, state: SuggestionState) -> Result<(), String> {
        let suggestion = self.suggestion_mut(id)?;
        if suggestion.state != SuggestionState::Pending {
            return Err(format!("suggestion {id} is {} and not pending", suggestion.state));
        }
        suggestion.state = state;
        if let Some(agent) = self.experiment.agent_mut() {
            let leaves_no_trace = matches!(state, SuggestionState::Abandoned | SuggestionState::Expired);
            if leaves_no_trace {
                agent.abandon(id - 1)
            } else {
                agent.withdraw(id - 1)
            };
        }
        Ok(())
    }

    fn suggestion_mut(&mut self, id: u64) -> Result<&mut Suggestion, String> {
        let index = id.checked_sub(1).and_then(|index| usize::try_from(index).ok());
        let found = index.and_then(|index| self.suggestions.get_mut(index));
        found.map(Arc::make_mut).ok_or_else(|| format!("there is no suggestion {id}"))
    }

    fn agent(&mut self, event: AgentEvent) -> Result<(), String> {
        let agent = self.experiment.agent_mut();
        agent.map_or(Ok(()), |agent| agent.restore(&event)).map_err(|error| error.to_string())
    }

    /// A suggestion as a movement of this robot.
    pub(super) fn movement(&self, suggestion: &Suggestion) -> Result<Movement, String> {
        let robot = &self.scenario.robot;
        let positions = robot.names.iter().map(|name| suggestion.configuration.get(name).copied());
        let configuration = positions.collect::<Option<Vec<f64>>>().ok_or("it is about another robot")?;
        let known = |wanted: &String| {
            let found = robot.sockets.iter().position(|socket| socket.label() == *wanted);
            found.ok_or_else(|| format!("there is no socket `{wanted}`"))
        };
        Ok(Movement { configuration, row: None, socket: suggestion.socket.as_ref().map(known).transpose()? })
    }

    /// A posture by joint name.
    pub fn named(&self, posture: &[f64]) -> BTreeMap<String, f64> {
        self.scenario.robot.names.iter().cloned().zip(posture.iter().copied()).collect()
    }

    /// The pending suggestions, in the order in which they were chosen.
    pub fn pending(&self) -> impl Iterator<Item = &Arc<Suggestion>> {
        self.suggestions.iter().filter(|suggestion| suggestion.state == SuggestionState::Pending)
    }
}
