//! A session: its setup and its events.

use std::sync::Arc;

use serde::Deserialize;

use super::{
    Answer, Ask, ChannelShape, Checkpoint, Document, Event, Observation, Outcome, Prepared, Refusal, ReplayError,
    Setup, SetupError, Suggestion, Suggestions, Told, VERSION, checkpoint::Hear, ledger::Ledger, limits::Most,
    setup::check_size,
};
use crate::json::repeated;
use body_schema_engine::estimation::Belief;
use body_schema_experiment::{Experiment, StepOutcome};
use body_schema_scenario::Scenario;
use body_schema_wire::{Description, StepReport};

/// A session with a robot elsewhere; see the [module](super). A copy of it goes its own way.
#[derive(Clone)]
pub struct Session {
    setup: Setup,
    ledger: Ledger,
    events: Vec<Event>,
}

impl Session {
    /// A session in which nothing has happened yet.
    ///
    /// # Errors
    ///
    /// [`SetupError`] names the key that is wrong, and how to mend it.
    pub fn open(setup: Setup) -> Result<Self, SetupError> {
        let session = Self::begun(setup)?;
        session.check_results()?;
        Ok(session)
    }

    /// The same of a setup that was opened before: whether there will be results is not asked again.
    fn begun(setup: Setup) -> Result<Self, SetupError> {
        let scenario = Arc::new(setup.scenario()?);
        let ledger = Ledger::new(&setup, scenario)?;
        Ok(Self { setup, ledger, events: Vec::new() })
    }

    /// A session of stored events. Nothing is chosen again. Whether there will be [results](Self::check_results) is not asked.
    ///
    /// # Errors
    ///
    /// [`ReplayError`] names the first event that cannot have happened.
    pub fn replay(setup: Setup, events: Vec<Event>) -> Result<Self, ReplayError> {
        Self::replay_from(setup, events, None, &mut |_| true)
    }

    /// The same from a checkpoint on, if there is one. `hear` hears of its [history](Self::history) from there on as it goes, and says
    /// whether to go on.
    ///
    /// # Errors
    ///
    /// [`ReplayError`] names the first event that cannot have happened, or before which nobody wanted to go on; and the last before a
    /// checkpoint that does not [serve](Checkpoint::serves).
    pub fn replay_from(
        setup: Setup,
        events: Vec<Event>,
        from: Option<&Checkpoint>,
        hear: &mut Hear<'_>,
    ) -> Result<Self, ReplayError> {
        let Self { setup, ledger, .. } = Self::begun(setup)?;
        let ledger = ledger.replayed(&events, from, hear);
        let ledger = ledger.map_err(|(index, what)| ReplayError::Event { index, what })?;
        Ok(Self { setup, ledger, events })
    }

    /// What was learned so far, for [`replay_from`](Self::replay_from); `None` for a learner that keeps nothing to go on from.
    pub fn checkpoint(&self) -> Option<Checkpoint> {
        Checkpoint::of(&self.ledger, self.events.len(), self.events.len())
    }

    /// A session as [`to_json`](Self::to_json) wrote it.
    ///
    /// # Errors
    ///
    /// [`ReplayError`] where the text is no session, or one of a later version.
    pub fn from_json(text: &str) -> Result<Self, ReplayError> {
        #[derive(Deserialize)]
        struct Version {
            version: u32,
        }
        let not_a_session = |error: serde_json::Error| ReplayError::NotASession(error.to_string());
        if let Some(key) = repeated(text.as_bytes()) {
            return Err(ReplayError::NotASession(format!("`{key}` is there twice")));
        }
        let Version { version: found } = serde_json::from_str(text).map_err(not_a_session)?;
        if found > VERSION {
            return Err(ReplayError::Version { found, known: VERSION });
        }
        let Document { setup, events, .. } = serde_json::from_str(text).map_err(not_a_session)?;
        Self::replay(setup, events)
    }

    /// Whether the session keeps within these bounds.
    ///
    /// # Errors
    ///
    /// [`SetupError::Invalid`] names the key of the calibration that goes beyond.
    pub fn check_within(&self, most: &Most) -> Result<(), SetupError> {
        Ok(check_size(&self.ledger.scenario, most)?)
    }

    /// The whole session: version, setup and events.
    pub fn to_json(&self) -> String {
        let Self { setup, events, .. } = self;
        let document = Document { version: VERSION, setup: setup.clone(), events: events.clone() };
        // It holds numbers, texts and lists alone.
        serde_json::to_string(&document).unwrap_or_default()
    }

    /// Makes a prepared change, whose events were written.
    ///
    /// # Errors
    ///
    /// [`Refusal::Stale`] where another was made since: nothing has happened then, and the events must be unwritten.
    pub fn commit<A>(&mut self, prepared: Prepared<A>) -> Result<A, Refusal> {
        let Prepared { revision, events, answer, ledger } = prepared;
        if revision != self.events.len() {
            return Err(Refusal::Stale);
        }
        if let Some(ledger) = ledger {
            self.ledger = ledger;
        }
        self.events.extend(events);
        Ok(answer)
    }

    /// [Prepares](Self::prepare_suggest) and commits.
    ///
    /// # Errors
    ///
    /// [`Refusal`]: nothing has happened then.
    pub fn suggest(&mut self, ask: &Ask, now_s: Option<f64>) -> Result<Suggestions, Refusal> {
        let prepared = self.prepare_suggest(ask, now_s)?;
        self.commit(prepared)
    }

    /// [Prepares](Self::prepare_outcome) and commits.
    ///
    /// # Errors
    ///
    /// [`Refusal`]: nothing has happened then.
    pub fn outcome(
        &mut self,
        id: u64,
        state: Outcome,
        reason: Option<&str>,
        now_s: Option<f64>,
    ) -> Result<Suggestion, Refusal> {
        let prepared = self.prepare_outcome(id, state, reason, now_s)?;
        self.commit(prepared)
    }

    /// [Prepares](Self::prepare_observe) and commits.
    ///
    /// # Errors
    ///
    /// [`Refusal`]: nothing has happened then.
    pub fn observe(&mut self, told: Observation, now_s: Option<f64>) -> Result<Answer, Refusal> {
        let prepared = self.prepare_observe(told, now_s)?;
        self.commit(prepared)
    }

    /// [Prepares](Self::prepare_exclude) and commits.
    ///
    /// # Errors
    ///
    /// [`Refusal`]: nothing has happened then.
    pub fn exclude(&mut self, number: u64, now_s: Option<f64>) -> Result<(), Refusal> {
        let prepared = self.prepare_exclude(number, now_s)?;
        self.commit(prepared)
    }

    /// [Prepares](Self::prepare_include) and commits.
    ///
    /// # Errors
    ///
    /// [`Refusal`]: nothing has happened then.
    pub fn include(&mut self, number: u64, now_s: Option<f64>) -> Result<(), Refusal> {
        let prepared = self.prepare_include(number, now_s)?;
        self.commit(prepared)
    }

    /// What it is about.
    pub fn setup(&self) -> &Setup {
        &self.setup
    }

    /// What happened, in order.
    pub fn events(&self) -> &[Event] {
        &self.events
    }

    /// The suggestions that wait to be carried out, of all clients, in the order in which they were chosen.
    pub fn pending(&self) -> impl Iterator<Item = &Arc<Suggestion>> {
        self.ledger.pending()
    }

    /// All suggestions that were ever made, by id.
    pub fn suggestions(&self) -> &[Arc<Suggestion>] {
        &self.ledger.suggestions
    }

    /// All observations that were ever told, by number.
    pub fn observations(&self) -> &[Arc<Told>] {
        &self.ledger.told
    }

    /// The channels, by their names among the measurements.
    pub fn channels(&self) -> &[ChannelShape] {
        &self.ledger.shapes
    }

    /// What stays the same from step to step, as of any experiment.
    pub fn description(&self) -> Description {
        Description::of(&self.ledger.experiment)
    }

    /// What came of the latest observation that counts, as of any experiment's step; of step 0, if there is none.
    pub fn latest(&self) -> &StepOutcome {
        self.ledger.experiment.latest()
    }

    /// The report of it.
    pub fn report(&self) -> StepReport {
        StepReport::of(&self.ledger.experiment)
    }

    /// The experiment behind it, with its agent.
    pub fn experiment(&self) -> &Experiment {
        &self.ledger.experiment
    }

    /// What is believed now.
    pub fn belief(&self) -> Option<&Belief> {
        self.ledger.experiment.belief()
    }

    /// One report per observation that counts, from step 0, as belongs to the belief of now: what a recording shows of a
    /// stored session.
    pub fn history(&self) -> Vec<StepReport> {
        let Ok(ledger) = Ledger::new(&self.setup, self.scenario().clone()) else { return Vec::new() };
        let mut reports = Vec::new();
        // Whatever has happened can happen again.
        drop(ledger.replayed(&self.events, None, &mut |step| {
            reports.push(step.report());
            true
        }));
        reports
    }

    /// What the session was set up with, read.
    pub fn scenario(&self) -> &Arc<Scenario> {
        &self.ledger.scenario
    }

    pub(super) fn ledger(&self) -> &Ledger {
        &self.ledger
    }
}
