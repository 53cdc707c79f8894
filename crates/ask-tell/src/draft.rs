//! A draft: a copy of a session, on which a change is tried.

use std::{collections::BTreeSet, sync::Arc};

use super::{
    Ask, Choice, Event, Fault, Happened, Plan, Prepared, Refusal, Session, Suggestion, SuggestionState, Why,
    ledger::Ledger,
};
use body_schema_experiment::{Agent, Foreseen, Proposal};

/// A copy of a session at work.
pub(super) struct Draft {
    pub ledger: Ledger,
    pub events: Vec<Event>,
    revision: usize,
    at_s: Option<f64>,
}

impl Draft {
    pub fn of(session: &Session, at_s: Option<f64>) -> Result<Self, Refusal> {
        if let Some(at_s) = at_s.filter(|at_s| !at_s.is_finite()) {
            return Err(Fault::new("now_s", format!("{at_s} is no time"), "write seconds since 1970").into());
        }
        let revision = session.events().len();
        let mut draft = Self { ledger: session.ledger().clone(), events: Vec::new(), revision, at_s };
        draft.expire();
        Ok(draft)
    }

    /// Appends an event that can happen.
    pub fn append(&mut self, happened: Happened) -> Result<(), Refusal> {
        let event = Event { at_s: self.at_s, happened };
        self.ledger.apply(&event, &BTreeSet::new()).map_err(Refusal::Ended)?;
        self.events.push(event);
        Ok(())
    }

    /// Expires suggestions whose time has run out.
    fn expire(&mut self) {
        let Some(now) = self.at_s else { return };
        let has_ended = |suggestion: &&Arc<Suggestion>| suggestion.expires_at_s.is_some_and(|at| at <= now);
        let suggestions: Vec<u64> = self.ledger.pending().filter(has_ended).map(|it| it.id).collect();
        if !suggestions.is_empty() {
            // They are pending, so that they can expire.
            let _ = self.append(Happened::Expired { suggestions });
        }
    }

    pub fn supersede(&mut self, suggestions: Vec<u64>, why: Why) -> Result<(), Refusal> {
        if !suggestions.is_empty() {
            self.append(Happened::Superseded { suggestions, why })?;
        }
        Ok(())
    }

    /// Ends suggestions that can no longer be carried out, without replacing them.
    pub fn drop_infeasible(&mut self) -> Result<(), Refusal> {
        let refused = self.ledger.experiment.agent().map_or_else(Vec::new, Agent::infeasible);
        self.supersede(refused.into_iter().map(|id| id + 1).collect(), Why::Constraints)
    }

    pub fn done<A>(self, answer: A) -> Prepared<A> {
        let Self { ledger, events, revision, .. } = self;
        let ledger = (!events.is_empty()).then_some(ledger);
        Prepared { revision, events, answer, ledger }
    }

    /// Adds one suggestion, chosen given all that are pending.
    pub fn suggest(&mut self, ask: &Ask) -> Result<(), Refusal> {
        let proposed = self.ledger.experiment.next_proposal().map_err(Refusal::Selection)?;
        self.add(ask, proposed)
    }

    /// Adds one suggestion of a posture that somebody wants, after all that are pending.
    pub fn want(&mut self, ask: &Ask, configuration: &[f64]) -> Result<(), Refusal> {
        let proposed = self.ledger.experiment.wanted_proposal(configuration).map_err(Refusal::Selection)?;
        self.add(ask, proposed)
    }

    fn add(&mut self, ask: &Ask, (proposal, prospect): (Proposal, Foreseen)) -> Result<(), Refusal> {
        let selection = proposal.selection;
        let finite = |number: Option<f64>| number.filter(|number| number.is_finite());
        let robot = &self.ledger.scenario.robot;
        let socket = selection.movement.socket.and_then(|socket| robot.sockets.get(socket));
        let suggestion = Suggestion {
            id: proposal.id + 1,
            revision: (self.revision + self.events.len()) as u64,
            client: ask.client.clone(),
            joints: robot.names.clone(),
            configuration: self.ledger.named(&selection.movement.configuration),
            socket: socket.map(|socket| socket.label()),
            expected_gain: finite(selection.gain),
            expected_error_mm_after: finite(prospect.expected_error_m.map(|metres| metres * 1e3)),
            chance_seen: finite(Some(prospect.chance_seen)).unwrap_or(0.0),
            travel_rad: finite(prospect.travel),
            state: SuggestionState::Pending,
            expires_at_s: self.at_s.zip(ask.expires_s).map(|(now, seconds)| now + seconds),
        };
        let plan = selection.plan.map(|plan| Plan { postures: plan.poses, committed: plan.committed });
        let choice = Choice {
            criterion: finite(selection.criterion),
            evaluations: selection.evaluations,
            selection_ms: proposal.selection_ms,
            plan,
        };
        self.append(Happened::Suggested { suggestion, choice })?;
        Ok(())
    }
}
