//! A session: its setup and its events.

use std::{collections::BTreeSet, sync::Arc};

use serde::{Deserialize, Serialize};

use super::{
    Answer, Ask, ChannelShape, Document, Enough, Event, Observation, Outcome, Prepared, Refusal, ReplayError, Setup,
    SetupError, Suggestion, Suggestions, Told, VERSION, ledger::Ledger, limits::MOST_EVENTS,
};
use crate::{
    estimation::Belief,
    experiment::{ChannelReading, Description, Experiment, StepReport},
    scenario::Scenario,
};

/// A session with a robot elsewhere; see the [module](super). A copy of it goes its own way.
#[derive(Clone)]
pub struct Session {
    setup: Setup,
    ledger: Ledger,
    events: Vec<Event>,
}

/// How a session stands.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "app", derive(utoipa::ToSchema))]
pub struct Status {
    /// How many events there are.
    pub revision: u64,
    /// Observations told, the excluded ones among them.
    pub observations: u64,
    /// Those that are excluded, by number.
    pub excluded: Vec<u64>,
    /// Of those that count, how many saw nothing.
    pub not_seen: u64,
    /// Of those that count, which rather are outliers than not, as is believed now, by number.
    pub outliers: Vec<u64>,
    /// Pending suggestions of all clients.
    pub pending: u64,
    /// The mean error of predictions over the workspace that is expected now, millimetres; null without a covariance.
    pub expected_error_mm: Option<f64>,
    /// What of it no parameter explains, millimetres; null where the noise is known.
    pub model_error_mm: Option<f64>,
    /// What is wanted, millimetres.
    pub wanted_mm: f64,
    /// There once no more are needed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub enough: Option<Enough>,
    /// About how many more movements there are until then, if they teach as those so far did: the error that is not the model's
    /// falls with the root of their number. Null before there are half as many again as could determine the robot, and where the model's
    /// own error is more than is wanted, so that no number will do.
    pub movements_left: Option<u64>,
    /// How often the body seemed to have changed.
    pub changes_noticed: u64,
    /// Why nothing is learned any more; null as long as something is.
    pub failure: Option<String>,
}

impl Session {
    /// A session in which nothing has happened yet.
    ///
    /// # Errors
    ///
    /// [`SetupError`] names the key that is wrong, and how to mend it.
    pub fn open(setup: Setup) -> Result<Self, SetupError> {
        let scenario = Arc::new(setup.scenario()?);
        let ledger = Ledger::new(&setup, scenario)?;
        Ok(Self { setup, ledger, events: Vec::new() })
    }

    /// A session of stored events. Nothing is chosen again.
    ///
    /// # Errors
    ///
    /// [`ReplayError`] names the first event that cannot have happened.
    pub fn replay(setup: Setup, events: Vec<Event>) -> Result<Self, ReplayError> {
        Self::replay_telling(setup, events, &mut |_| ())
    }

    /// The same, and its [history](Self::history) as it goes.
    ///
    /// # Errors
    ///
    /// [`ReplayError`] names the first event that cannot have happened.
    pub fn replay_telling(
        setup: Setup,
        events: Vec<Event>,
        tell: &mut dyn FnMut(StepReport),
    ) -> Result<Self, ReplayError> {
        if events.len() > MOST_EVENTS {
            let what = format!("a session has at most {MOST_EVENTS} events");
            return Err(ReplayError::Event { index: MOST_EVENTS + 1, what });
        }
        let Self { setup, ledger, .. } = Self::open(setup)?;
        tell(ledger.experiment.latest().clone());
        let ledger = ledger.replayed(&events, tell).map_err(|(index, what)| ReplayError::Event { index, what })?;
        Ok(Self { setup, ledger, events })
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
        let Version { version: found } = serde_json::from_str(text).map_err(not_a_session)?;
        if found > VERSION {
            return Err(ReplayError::Version { found, known: VERSION });
        }
        let Document { setup, events, .. } = serde_json::from_str(text).map_err(not_a_session)?;
        Self::replay(setup, events)
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
    pub fn description(&self) -> &Description {
        self.ledger.experiment.description()
    }

    /// The report of the latest observation that counts, as of any experiment's step; of step 0, if there is none.
    pub fn latest(&self) -> &StepReport {
        self.ledger.experiment.latest()
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
        let mut reports = vec![ledger.experiment.latest().clone()];
        // Whatever has happened can happen again.
        drop(ledger.replayed(&self.events, &mut |report| reports.push(report)));
        reports
    }

    /// There once no more observations are needed.
    pub fn enough(&self) -> Option<Enough> {
        let metrics = &self.latest().learners[0].metrics;
        let expected = metrics.expected_prediction_m.filter(|_| metrics.settled)?;
        Some(Enough {
            expected_error_mm: expected * 1e3,
            wanted_mm: self.scenario().settled_below_m * 1e3,
            observations: metrics.movements,
        })
    }

    fn movements_left(&self) -> Option<u64> {
        if self.enough().is_some() {
            return Some(0);
        }
        let metrics = &self.latest().learners[0].metrics;
        let seen = metrics.movements - metrics.misses;
        let (wanted, floor) = (self.scenario().settled_below_m, metrics.model_error_m.unwrap_or(0.0));
        let spare = wanted * wanted - floor * floor;
        let is_determined = 2 * seen >= 3 * self.description().movements_by_counting as u64;
        let expected = metrics.expected_prediction_m.filter(|_| is_determined && spare > 0.0)?;
        let needed = seen as f64 * (expected * expected - floor * floor).max(0.0) / spare;
        Some(((needed - seen as f64).ceil() as u64).max(1))
    }

    /// How it stands.
    pub fn status(&self) -> Status {
        let learner = &self.latest().learners[0];
        let metrics = &learner.metrics;
        let readings = self.experiment().agent().map_or_else(Vec::new, |agent| agent.readings());
        let suspected =
            readings.iter().filter(|reading| reading.outlier_probability.is_some_and(|p| p > ChannelReading::OUTLIER));
        let numbers = suspected.filter_map(|reading| {
            let index = usize::try_from(reading.movement.checked_sub(1)?).ok()?;
            self.ledger.counted.get(index).copied()
        });
        Status {
            revision: self.events.len() as u64,
            observations: self.ledger.told.len() as u64,
            excluded: self.ledger.excluded().into_iter().collect(),
            not_seen: metrics.misses,
            outliers: numbers.collect::<BTreeSet<u64>>().into_iter().collect(),
            pending: self.ledger.pending().count() as u64,
            expected_error_mm: metrics.expected_prediction_m.map(|metres| metres * 1e3),
            model_error_mm: metrics.model_error_m.map(|metres| metres * 1e3),
            wanted_mm: self.scenario().settled_below_m * 1e3,
            enough: self.enough(),
            movements_left: self.movements_left(),
            changes_noticed: metrics.changes_noticed,
            failure: learner.failure.clone(),
        }
    }

    pub(crate) fn scenario(&self) -> &Arc<Scenario> {
        &self.ledger.scenario
    }

    pub(super) fn ledger(&self) -> &Ledger {
        &self.ledger
    }
}
