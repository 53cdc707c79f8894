//! Prepared changes of a session, which a store writes before they are made.

use std::{collections::BTreeMap, sync::Arc};

use super::{
    Answer, Ask, Event, Fault, Happened, Observation, Outcome, Prepared, Refusal, Session, Suggestion, SuggestionState,
    Suggestions, Why,
    checkpoint::{Find, Hear},
    draft::Draft,
    ledger::Ledger,
    limits::*,
    observation::positions,
};
use body_schema_engine::{estimation::Belief, selection::SelectionError};
use body_schema_experiment::{Agent, MovementOutcome};

impl Session {
    /// The client's pending suggestions, topped up to as many as it asks for. They are chosen one after the other, each given
    /// everybody's pending ones. `now_s` is the time, seconds since 1970: without it nothing expires.
    ///
    /// # Errors
    ///
    /// [`Refusal::Field`] if a field is wrong, [`Refusal::Full`] if no more suggestions fit, [`Refusal::Selection`] or
    /// [`Refusal::Ended`] if no movement can be chosen.
    pub fn prepare_suggest(&self, ask: &Ask, now_s: Option<f64>) -> Result<Prepared<Suggestions>, Refusal> {
        self.prepare_suggest_while(ask, now_s, &|| true)
    }

    /// Prepares suggestions as [`prepare_suggest`](Self::prepare_suggest) does, as long as the caller waits, which is
    /// asked before each suggestion.
    ///
    /// # Errors
    ///
    /// [`Refusal::GivenUp`] if the caller no longer waits; otherwise the errors of
    /// [`prepare_suggest`](Self::prepare_suggest).
    pub fn prepare_suggest_while(
        &self,
        ask: &Ask,
        now_s: Option<f64>,
        is_wanted: &dyn Fn() -> bool,
    ) -> Result<Prepared<Suggestions>, Refusal> {
        let count = ask.check(now_s)?;
        let mut draft = Draft::of(self, now_s)?;
        draft.drop_infeasible()?;
        let of_client = |draft: &Draft| -> Vec<u64> {
            draft.ledger.pending().filter(|it| it.client == ask.client).map(|it| it.id).collect()
        };
        if ask.replan {
            let own = of_client(&draft);
            draft.supersede(own, Why::Replan)?;
        }
        let wanted = ask.wanted.iter().enumerate().map(|(index, posture)| self.wanted(index, posture));
        let wanted = wanted.collect::<Result<Vec<_>, Fault>>()?;
        if of_client(&draft).len() + wanted.len() > MOST_SUGGESTIONS {
            let hint = "carry some out, or abandon them, before more are wanted";
            return Err(Refusal::Full { what: "pending suggestions of one client", most: MOST_SUGGESTIONS, hint });
        }
        for (index, posture) in wanted.iter().enumerate() {
            check_pending(&draft)?;
            self.check_room(draft.events.len() + 1)?;
            draft.want(ask, posture).map_err(|refusal| match refusal {
                Refusal::Selection(error @ SelectionError::Refused(_)) => {
                    Fault::new(format!("wanted[{index}]"), error.to_string(), "leave it out, or want another").into()
                }
                other => other,
            })?;
        }
        while of_client(&draft).len() < count {
            check_pending(&draft)?;
            self.check_room(draft.events.len() + 1)?;
            if !is_wanted() {
                return Err(Refusal::GivenUp);
            }
            draft.suggest(ask)?;
        }
        let own = draft.ledger.pending().filter(|it| it.client == ask.client);
        let suggestions = own.map(|it| (**it).clone()).collect();
        let answer = Suggestions { suggestions, enough: self.enough() };
        Ok(draft.done(answer))
    }

    /// Marks a pending suggestion as not going to be carried out.
    ///
    /// # Errors
    ///
    /// [`Refusal::UnknownSuggestion`] if there is no such suggestion, [`Refusal::NotPending`] if it is not pending;
    /// others if a field is wrong or the session is full.
    pub fn prepare_outcome(
        &self,
        id: u64,
        state: Outcome,
        reason: Option<&str>,
        now_s: Option<f64>,
    ) -> Result<Prepared<Suggestion>, Refusal> {
        if reason.is_some_and(|reason| reason.chars().count() > MOST_REASON_CHARACTERS) {
            let what = format!("it has more than {MOST_REASON_CHARACTERS} characters");
            return Err(Fault::new("reason", what, "say it shorter").into());
        }
        self.check_room(1)?;
        let mut draft = Draft::of(self, now_s)?;
        let found = position(id).and_then(|index| draft.ledger.suggestions.get(index));
        let count = draft.ledger.suggestions.len();
        let found = found.ok_or(Refusal::UnknownSuggestion { id, count })?;
        if found.state != SuggestionState::Pending {
            return Err(Refusal::NotPending { id, state: found.state });
        }
        draft.append(Happened::Outcome { suggestion: id, state, reason: reason.map(str::to_owned) })?;
        draft.drop_infeasible()?;
        let ended = position(id).map(|index| (*draft.ledger.suggestions[index]).clone());
        let answer = ended.ok_or(Refusal::UnknownSuggestion { id, count })?;
        Ok(draft.done(answer))
    }

    /// Absorbs an observation, whether its movement was suggested or not.
    ///
    /// # Errors
    ///
    /// [`Refusal::Field`] if a field is wrong, [`Refusal::UnknownSuggestion`] if it names a suggestion that does not
    /// exist, [`Refusal::Full`] if the session is full, [`Refusal::Ended`] if the estimate has diverged.
    pub fn prepare_observe(&self, told: Observation, now_s: Option<f64>) -> Result<Prepared<Answer>, Refusal> {
        self.check_room(1)?;
        let mut draft = Draft::of(self, now_s)?;
        let count = draft.ledger.suggestions.len();
        if let Some(id) = told.suggestion_id
            && position(id).is_none_or(|index| index >= count)
        {
            return Err(Refusal::UnknownSuggestion { id, count });
        }
        let executed = told.read(&draft.ledger.scenario, &draft.ledger.shapes)?;
        told.check_reach(self.scenario(), self.channels(), &executed)?;
        let experiment = &draft.ledger.experiment;
        if let Some(failure) = experiment.agent().and_then(Agent::failure) {
            return Err(Refusal::Ended(failure.to_owned()));
        }
        let accepts = |belief: &Belief| belief.accepts(&executed.movement.configuration, &executed.observation);
        experiment.belief().map_or(Ok(()), accepts).map_err(|refused| {
            Fault::new("measurements", refused.to_string(), "correct them; lengths are metres, angles radians")
        })?;
        let before = draft.ledger.changes_noticed();
        // The answer is part of the event, and nothing that happens depends on it.
        let answer = Answer::unknown(draft.ledger.told.len() as u64 + 1);
        draft.append(Happened::Observed { told, answer })?;
        let answer = draft.ledger.answer(draft.ledger.changes_noticed() > before);
        draft.ledger.replace_answer(&answer);
        if let Some(Event { happened: Happened::Observed { answer: unanswered, .. }, .. }) = draft.events.last_mut() {
            unanswered.clone_from(&answer);
        }
        if answer.body_seems_changed {
            let pending = draft.ledger.pending().map(|it| it.id).collect();
            draft.supersede(pending, Why::ChangedBody)?;
        }
        draft.drop_infeasible()?;
        Ok(draft.done(answer))
    }

    /// Excludes an observation: the belief becomes what replaying the rest gives.
    ///
    /// # Errors
    ///
    /// [`Refusal::UnknownObservation`] if there is no such observation, [`Refusal::Full`] if the session is full.
    pub fn prepare_exclude(&self, number: u64, now_s: Option<f64>) -> Result<Prepared<()>, Refusal> {
        self.prepare_mark((number, true), now_s, &mut |_| None, &mut |_| true)
    }

    /// Includes an excluded observation again: the belief becomes what it would be had the observation never been
    /// excluded.
    ///
    /// # Errors
    ///
    /// [`Refusal::UnknownObservation`] if there is no such observation, [`Refusal::Full`] if the session is full.
    pub fn prepare_include(&self, number: u64, now_s: Option<f64>) -> Result<Prepared<()>, Refusal> {
        self.prepare_mark((number, false), now_s, &mut |_| None, &mut |_| true)
    }

    /// Excludes an observation or includes it again, replaying from the checkpoint that `find` returns, if it returns one that
    /// [serves](super::Checkpoint::serves). `hear` receives the history from there on as it becomes, and says whether to go on.
    ///
    /// # Errors
    ///
    /// [`Refusal::UnknownObservation`] if there is no such observation, [`Refusal::Full`] if the session is full,
    /// [`Refusal::Ended`] if `hear` ends the replay or the checkpoint does not serve.
    pub fn prepare_mark(
        &self,
        (number, excluded): (u64, bool),
        now_s: Option<f64>,
        find: &mut Find<'_>,
        hear: &mut Hear<'_>,
    ) -> Result<Prepared<()>, Refusal> {
        self.check_room(1)?;
        let count = self.observations().len();
        let told = position(number).and_then(|index| self.observations().get(index));
        let told = told.ok_or(Refusal::UnknownObservation { number, count })?;
        let mut draft = Draft::of(self, now_s)?;
        if told.excluded != excluded {
            let observation = number;
            let happened =
                if excluded { Happened::Excluded { observation } } else { Happened::Included { observation } };
            draft.events.push(Event { at_s: now_s, happened });
            let events: Vec<Event> = self.events().iter().chain(&draft.events).cloned().collect();
            let empty = Ledger::new(self.setup(), self.scenario().clone());
            let empty = empty.map_err(|error| Refusal::Ended(error.to_string()))?;
            let from = find(&events);
            draft.ledger = empty.replayed(&events, from.as_ref(), hear).map_err(|(_, what)| Refusal::Ended(what))?;
            draft.drop_infeasible()?;
        }
        Ok(draft.done(()))
    }

    /// Expires the pending suggestions whose time has run out.
    ///
    /// # Errors
    ///
    /// [`Refusal::Field`] if `now_s` is no valid time.
    pub fn prepare_expire(&self, now_s: f64) -> Result<Prepared<()>, Refusal> {
        Ok(Draft::of(self, Some(now_s))?.done(()))
    }

    /// A posture that somebody wants, in the order of the joints.
    fn wanted(&self, index: usize, posture: &BTreeMap<String, f64>) -> Result<Vec<f64>, Fault> {
        let field = format!("wanted[{index}]");
        let (robot, configuration) =
            (&self.scenario().robot, positions(&field, posture, self.scenario(), "say where every joint is to go")?);
        let mut joints = robot.names.iter().zip(robot.limits.joints()).zip(&configuration);
        match joints.find(|((_, (lower, upper)), position)| !(*lower..=*upper).contains(*position)) {
            None => Ok(configuration),
            Some(((name, (lower, upper)), position)) => Err(Fault::new(
                format!("{field}.{name}"),
                format!("{position} is beyond its limits, {lower} and {upper}"),
                "want what the robot can do, in rad or m",
            )),
        }
    }

    fn check_room(&self, wanted: usize) -> Result<(), Refusal> {
        if self.events().len() + wanted <= MOST_EVENTS {
            return Ok(());
        }
        Err(Refusal::Full { what: "events", most: MOST_EVENTS, hint: "go on in a new one" })
    }
}

fn check_pending(draft: &Draft) -> Result<(), Refusal> {
    if draft.ledger.pending().count() < MOST_PENDING {
        return Ok(());
    }
    Err(Refusal::Full { what: "pending suggestions", most: MOST_PENDING, hint: "carry some out, or abandon them" })
}

impl Ask {
    /// The number of suggestions that are asked for.
    fn check(&self, now_s: Option<f64>) -> Result<usize, Fault> {
        let most = MOST_SUGGESTIONS as u64;
        let count = self.count.unwrap_or(1);
        if !(1..=most).contains(&count) {
            return Err(Fault::new(
                "count",
                format!("{count} is out of range"),
                format!("write a number from 1 to {most}"),
            ));
        }
        let is_name = |client: &String| !client.is_empty() && client.chars().count() <= MOST_CLIENT_CHARACTERS;
        if self.client.as_ref().is_some_and(|client| !is_name(client)) {
            let hint = format!("write a name of 1 to {MOST_CLIENT_CHARACTERS} characters, or leave it out");
            return Err(Fault::new("client", "this is no name", hint));
        }
        match (self.expires_s, now_s) {
            (Some(seconds), _) if !(seconds > 0.0 && seconds.is_finite()) => {
                Err(Fault::new("expires_s", format!("{seconds} is out of range"), "write a number of seconds above 0"))
            }
            (Some(_), None) => {
                Err(Fault::new("expires_s", "nobody says what time it is", "tell it, or leave this out"))
            }
            _ => Ok(count as usize),
        }
    }
}

impl Ledger {
    /// The answer to the latest observation.
    fn answer(&self, body_seems_changed: bool) -> Answer {
        let learner = &self.experiment.latest().learners[0];
        let readings = learner.movement.iter().flat_map(|movement| &movement.weighed);
        let finite = |number: Option<f64>| number.filter(|number| number.is_finite());
        let metrics = &learner.metrics;
        let innovation = metrics.nis.zip(metrics.nis_dof).filter(|(_, degrees)| *degrees > 0);
        Answer {
            observation: self.told.len() as u64,
            seen: learner.movement.as_ref().is_some_and(MovementOutcome::seen),
            innovation_sigmas: finite(innovation.map(|(nis, degrees)| (nis / degrees as f64).sqrt())),
            outlier_probability: finite(readings.filter_map(|it| it.outlier_probability).reduce(f64::max)),
            expected_error_mm: finite(metrics.expected_prediction_m.map(|metres| metres * 1e3)),
            body_seems_changed,
        }
    }

    fn replace_answer(&mut self, answer: &Answer) {
        let latest = self.told.last_mut();
        latest.into_iter().for_each(|told| Arc::make_mut(told).answer = answer.clone());
    }
}

impl Answer {
    fn unknown(observation: u64) -> Self {
        Self {
            observation,
            seen: false,
            innovation_sigmas: None,
            outlier_probability: None,
            expected_error_mm: None,
            body_seems_changed: false,
        }
    }
}

/// The index of something counted from 1.
fn position(number: u64) -> Option<usize> {
    usize::try_from(number.checked_sub(1)?).ok()
}
