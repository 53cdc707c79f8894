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

/// A session with a robot elsewhere; see the [module](super). A clone is independent of the original.
#[derive(Clone)]
pub struct Session {
    setup: Setup,
    ledger: Ledger,
    events: Vec<Event>,
}

impl Session {
    /// A new session, without events.
    ///
    /// # Errors
    ///
    /// [`SetupError::Invalid`] names the keys that are wrong, [`SetupError::Agent`] says why no agent can be made.
    pub fn open(setup: Setup) -> Result<Self, SetupError> {
        let session = Self::begun(setup)?;
        session.check_results()?;
        Ok(session)
    }

    /// A new session of a setup that was opened before, without checking again that it will have results.
    fn begun(setup: Setup) -> Result<Self, SetupError> {
        let scenario = Arc::new(setup.scenario()?);
        let ledger = Ledger::new(&setup, scenario)?;
        Ok(Self { setup, ledger, events: Vec::new() })
    }

    /// A session from stored events. Nothing is chosen again, and whether there will be [results](Self::check_results) is not
    /// checked.
    ///
    /// # Errors
    ///
    /// [`ReplayError::Event`] names the first event that cannot have happened, [`ReplayError::Setup`] says why the setup does
    /// not fit this version.
    pub fn replay(setup: Setup, events: Vec<Event>) -> Result<Self, ReplayError> {
        Self::replay_from(setup, events, None, &mut |_| true)
    }

    /// Replays stored events from a checkpoint on, if there is one. `hear` receives the [history](Self::history) from there on, and
    /// says whether to go on.
    ///
    /// # Errors
    ///
    /// [`ReplayError::Setup`] if the setup does not fit this version; [`ReplayError::Event`] with the first event that cannot have
    /// happened, or before which `hear` ended the replay, or with the last before a checkpoint that does not
    /// [serve](Checkpoint::serves).
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

    /// A checkpoint of what was learned so far, for [`replay_from`](Self::replay_from); `None` for a learner that cannot go on
    /// from one.
    pub fn checkpoint(&self) -> Option<Checkpoint> {
        Checkpoint::of(&self.ledger.experiment, self.events.len(), self.events.len())
    }

    /// Reads a session that [`to_json`](Self::to_json) wrote.
    ///
    /// # Errors
    ///
    /// [`ReplayError::NotASession`] if the text is no session, [`ReplayError::Version`] if a later version wrote it;
    /// otherwise the errors of [`replay`](Self::replay).
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

    /// Checks that the session is within limits.
    ///
    /// # Errors
    ///
    /// [`SetupError::Invalid`] names the key of the calibration that exceeds them.
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

    /// Commits a prepared change, whose events must have been written.
    ///
    /// # Errors
    ///
    /// [`Refusal::Stale`] if another change was committed since: this one is not made, and its events must be removed
    /// from the store.
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

    /// Prepares suggestions and commits them; see [`prepare_suggest`](Self::prepare_suggest).
    ///
    /// # Errors
    ///
    /// [`Refusal`] of the preparation; nothing has changed then.
    pub fn suggest(&mut self, ask: &Ask, now_s: Option<f64>) -> Result<Suggestions, Refusal> {
        let prepared = self.prepare_suggest(ask, now_s)?;
        self.commit(prepared)
    }

    /// Prepares an outcome and commits it; see [`prepare_outcome`](Self::prepare_outcome).
    ///
    /// # Errors
    ///
    /// [`Refusal`] of the preparation; nothing has changed then.
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

    /// Prepares an observation and commits it; see [`prepare_observe`](Self::prepare_observe).
    ///
    /// # Errors
    ///
    /// [`Refusal`] of the preparation; nothing has changed then.
    pub fn observe(&mut self, told: Observation, now_s: Option<f64>) -> Result<Answer, Refusal> {
        let prepared = self.prepare_observe(told, now_s)?;
        self.commit(prepared)
    }

    /// Prepares an exclusion and commits it; see [`prepare_exclude`](Self::prepare_exclude).
    ///
    /// # Errors
    ///
    /// [`Refusal`] of the preparation; nothing has changed then.
    pub fn exclude(&mut self, number: u64, now_s: Option<f64>) -> Result<(), Refusal> {
        let prepared = self.prepare_exclude(number, now_s)?;
        self.commit(prepared)
    }

    /// Prepares an inclusion and commits it; see [`prepare_include`](Self::prepare_include).
    ///
    /// # Errors
    ///
    /// [`Refusal`] of the preparation; nothing has changed then.
    pub fn include(&mut self, number: u64, now_s: Option<f64>) -> Result<(), Refusal> {
        let prepared = self.prepare_include(number, now_s)?;
        self.commit(prepared)
    }

    /// The setup.
    pub fn setup(&self) -> &Setup {
        &self.setup
    }

    /// The events, in order.
    pub fn events(&self) -> &[Event] {
        &self.events
    }

    /// The pending suggestions of all clients, in the order in which they were chosen.
    pub fn pending(&self) -> impl Iterator<Item = &Arc<Suggestion>> {
        self.ledger.pending()
    }

    /// The bones of the robot, as it is believed to be, in the posture that is suggested next: axis points in order, then the target,
    /// metres in the frame of the measurements, a line for each branch, that of the target first. `None` where nothing is pending.
    pub fn next_bones_m(&self) -> Option<Vec<Vec<[f64; 3]>>> {
        let next = self.pending().next()?;
        let posture = self.ledger.movement(next).ok()?.configuration;
        let bones = self.belief()?.state.measured().bones(&posture);
        Some(bones.iter().map(|bone| bone.iter().map(|point| [point.x, point.y, point.z]).collect()).collect())
    }

    /// All suggestions ever made, by id.
    pub fn suggestions(&self) -> &[Arc<Suggestion>] {
        &self.ledger.suggestions
    }

    /// All observations ever received, by number.
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

    /// The present belief.
    pub fn belief(&self) -> Option<&Belief> {
        self.ledger.experiment.belief()
    }

    /// One report per observation that counts, from step 0 on, all consistent with the present belief: what a recording
    /// shows of a stored session.
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

    /// The scenario made of the setup.
    pub fn scenario(&self) -> &Arc<Scenario> {
        &self.ledger.scenario
    }

    pub(super) fn ledger(&self) -> &Ledger {
        &self.ledger
    }
}
