//! A robot elsewhere: one thread that owns its session, and does one thing at a time.
//!
//! Every change of the session is prepared, written to the store, and only then made: no answer reports a change that a
//! crash could undo, and a change that could not be written has not happened.

use std::{
    collections::BTreeMap,
    panic::{AssertUnwindSafe, catch_unwind},
    sync::{Arc, atomic::Ordering, mpsc},
    time::{Duration, Instant},
};

use tokio::sync::{OwnedSemaphorePermit, oneshot};
use tokio_util::sync::CancellationToken;
use uuid::Uuid;

use super::{
    Kept, Shared, Snapshot, Taken,
    checkpoints::{self, ComeBy, GoesOn, Replayed, Since},
    engine::{COMPLETE_AFTER, panicked, recording_failed},
    known::Summary,
    shared::Replaying,
};
use crate::server::{
    clock::now_s,
    problem::{Kind, Problem},
    store::{Shown, Store, StoreError, Stored, build},
};
use body_schema_ask_tell as ask_tell;
use body_schema_ask_tell::{
    Answer, Ask, ChannelShape, Happened, Most, Observation, Outcome, Prepared, ReplayError, Setup, Status, Suggestion,
    Suggestions, Told,
};
use body_schema_backend::draw_next;
use body_schema_experiment::Experiment;
use body_schema_recording::{Appearance, Recorder, RecordingError, Target};
use body_schema_wire::Description;

/// The least and the greatest interval, seconds, between checks whether the time of a suggestion has run out.
const LOOK_AGAIN_S: [f64; 2] = [0.5, 3600.0];

/// The most steps that are recorded before requests are looked at again.
const AT_ONCE: usize = 64;

/// The time after which callers are told that a replay is running.
const TOLD_AFTER: Duration = Duration::from_millis(200);

/// The bytes that a session takes for each byte of its setup: the text as sent and as read, with names and places.
const SETUP_TAKES: usize = 4;

/// A job for the engine. It returns a function that answers the caller.
pub(super) type Job = Box<dyn FnOnce(&mut ExternalRobot) -> Reply + Send>;
type Reply = Box<dyn FnOnce() + Send>;

/// The origin of a session.
pub(super) enum Origin {
    /// A new session, with the events that it begins with.
    New(Setup, Shown, Vec<ask_tell::Event>),
    Store(Stored),
}

/// The parts of which an engine is made.
pub(super) struct Beginning {
    pub(super) id: Uuid,
    pub(super) origin: Origin,
    /// When the session was made, seconds since 1970.
    pub(super) made_s: f64,
    pub(super) store: Arc<Store>,
    /// The limits of a new session.
    pub(super) most: Most,
    pub(super) shared: Arc<Shared>,
    /// A permit held until the thread ends, so that ending sessions still count.
    pub(super) permit: OwnedSemaphorePermit,
}

/// The body of the thread. `opened` receives the description once the session exists, and is in the store.
pub(super) fn run(
    beginning: Beginning,
    jobs: &mpsc::Receiver<Job>,
    opened: oneshot::Sender<Result<Description, Problem>>,
) {
    let Beginning { id, origin, made_s, store, most, shared, permit } = beginning;
    let open = || ExternalRobot::open((id, made_s), origin, &most, store, shared.clone());
    match catch_unwind(AssertUnwindSafe(open)).unwrap_or_else(|panic| Err(panicked(&*panic))) {
        Ok(mut robot) => {
            if opened.send(Ok(robot.description.clone())).is_ok() {
                let served = catch_unwind(AssertUnwindSafe(|| robot.serve(jobs)));
                if let Err(panic) = served {
                    shared.fail(panicked(&*panic).into_detail());
                }
            }
        }
        Err(problem) => drop(opened.send(Err(problem))),
    }
    shared.live.close();
    // Before anybody hears of the end: whoever waits for a place may take it at once.
    drop(permit);
    shared.ended.cancel();
}

/// The engine of a robot elsewhere.
pub(in crate::server) struct ExternalRobot {
    id: Uuid,
    session: ask_tell::Session,
    /// Its description, which is the same at every step.
    description: Description,
    channels: Arc<[ChannelShape]>,
    /// The number of each observation by its `Idempotency-Key`.
    keys: BTreeMap<String, u64>,
    recorder: Recorder,
    /// The number of steps that are recorded. Those of a session that has come back are recorded while nothing else is
    /// asked for.
    recorded: usize,
    /// The steps since the latest checkpoint.
    since: Since,
    store: Arc<Store>,
    shared: Arc<Shared>,
    /// Whether the history must be made anew, because other observations count than before.
    is_rewritten: bool,
    /// Cancelled when the caller of the present job no longer waits.
    given_up: CancellationToken,
    /// The memory of the setup.
    _setup: Taken,
    /// How far the clock is behind the time at which the session was last used, seconds.
    ahead_s: f64,
}

impl ExternalRobot {
    fn open(
        (id, made_s): (Uuid, f64),
        origin: Origin,
        most: &Most,
        store: Arc<Store>,
        shared: Arc<Shared>,
    ) -> Result<Self, Problem> {
        let (is_new, (setup, shown), events, keys) = match origin {
            Origin::New(setup, shown, events) => (true, (setup, shown), events, BTreeMap::new()),
            Origin::Store(Stored { setup, shown, events, keys }) => (false, (setup, shown), events, keys),
        };
        let goes_on = if is_new { None } else { GoesOn::of(&store, id, &events) };
        let gone_on = goes_on.and_then(|from| Replayed::of(setup.clone(), events.clone(), Some(from), &shared).ok());
        let replayed = match gone_on {
            Some(replayed) => Ok(replayed),
            // One that cannot be gone on from is no reason not to replay it.
            None => Replayed::of(setup, events, None, &shared),
        };
        let Replayed { session, reports, since, saved } =
            replayed.map_err(|error| if is_new { unusable(error) } else { error.into() })?;
        if is_new {
            session.check_within(most)?;
            session.check_results()?;
        }
        // Each life of a session in memory records anew: viewers must not take two recordings for one.
        let target = Target::live(shared.live.clone()).with_recording_id(Uuid::new_v4().to_string());
        let description = session.description();
        let target = target.with_ellipsoids(shown.ellipsoids).with_appearance(Appearance::of(session.scenario()));
        let begun = Recorder::new(&description, target);
        let recorder = begun.map_err(recording_failed)?;
        if is_new {
            store.insert(id, made_s, session.setup(), shown, session.events())?;
            // A list finds it out otherwise.
            drop(store.note(id, &Summary::of(&session).text(), session.events()));
        }
        checkpoints::keep_all((&store, id), &saved);
        let rewrites =
            |event: &&ask_tell::Event| matches!(event.happened, Happened::Excluded { .. } | Happened::Included { .. });
        shared.rewritings.store(session.events().iter().filter(rewrites).count() as u64, Ordering::Relaxed);
        // What has happened was before now, whatever the clock says.
        let last = session.events().iter().filter_map(|event| event.at_s).max_by(f64::total_cmp);
        let ahead_s = last.map_or(0.0, |last| (last - now_s()).max(0.0));
        let setup = Taken::of(&shared.budget, SETUP_TAKES * session.setup().calibration.to_string().len());
        let channels = session.channels().into();
        let mut robot = Self {
            id,
            session,
            description,
            channels,
            keys,
            recorder,
            recorded: 0,
            since,
            store,
            shared,
            is_rewritten: false,
            given_up: CancellationToken::new(),
            _setup: setup,
            ahead_s,
        };
        robot.publish(reports);
        robot.catch_up(AT_ONCE).map_err(recording_failed)?;
        Ok(robot)
    }

    /// Records up to `most` steps from before the session came back to memory.
    fn catch_up(&mut self, most: usize) -> Result<(), RecordingError> {
        for kept in self.shared.reports_from(self.recorded, most) {
            // Read once more instead of being held in memory until now.
            let report = kept.report().ok_or_else(|| RecordingError::Encode("a step cannot be read again".into()))?;
            self.recorder.log(&report)?;
            self.recorded += 1;
        }
        if !self.is_behind() {
            self.recorder.flush()?;
            self.show()?;
        }
        self.shared.publish(Vec::new(), None);
        Ok(())
    }

    /// Whether there are steps that are not recorded yet.
    fn is_behind(&self) -> bool {
        self.recorded < self.shared.steps()
    }

    /// The next job. Until it comes, the remaining steps are recorded.
    fn next(&mut self, jobs: &mpsc::Receiver<Job>) -> Result<Job, mpsc::RecvError> {
        while self.is_behind() && !self.shared.stop.is_cancelled() {
            if let Ok(job) = jobs.try_recv() {
                return Ok(job);
            }
            if let Err(error) = self.catch_up(AT_ONCE) {
                self.shared.note_recording(Some(error.to_string()));
                // What cannot be recorded keeps nobody from anything else.
                self.recorded = self.shared.steps();
            }
        }
        jobs.recv_timeout(COMPLETE_AFTER).or_else(|_| {
            drop(self.complete());
            self.idle(jobs)
        })
    }

    fn serve(&mut self, jobs: &mpsc::Receiver<Job>) {
        loop {
            let Ok(job) = self.next(jobs) else { return };
            if self.shared.stop.is_cancelled() {
                return;
            }
            let reply = job(self);
            if self.is_rewritten {
                // Whoever hears of it and asks again is to meet the new history.
                self.shared.rewritten.store(true, Ordering::Relaxed);
                self.shared.live.close();
                self.shared.ended.cancel();
                return reply();
            }
            reply();
        }
    }

    /// This engine at a job whose caller waits until `given_up`.
    pub(super) fn for_whoever_waits(&mut self, given_up: CancellationToken) -> &mut Self {
        self.given_up = given_up;
        self
    }

    /// Waits for the next job, and expires suggestions whose time runs out meanwhile.
    fn idle(&mut self, jobs: &mpsc::Receiver<Job>) -> Result<Job, mpsc::RecvError> {
        loop {
            let due = self.session.pending().filter_map(|suggestion| suggestion.expires_at_s).min_by(f64::total_cmp);
            let Some(due) = due else { return jobs.recv() };
            match jobs
                .recv_timeout(Duration::from_secs_f64((due - self.now_s()).clamp(LOOK_AGAIN_S[0], LOOK_AGAIN_S[1])))
            {
                Ok(job) => return Ok(job),
                Err(mpsc::RecvTimeoutError::Disconnected) => return Err(mpsc::RecvError),
                // What cannot be written is tried again.
                Err(mpsc::RecvTimeoutError::Timeout) => {
                    if let Err(problem) = self.expire() {
                        tracing::error!(session = %self.id, why = &*problem.detail, "a suggestion cannot be ended");
                    }
                }
            }
        }
    }

    /// The client's pending suggestions, topped up to as many as it asks for.
    pub(in crate::server) fn suggest(&mut self, ask: &Ask) -> Result<Suggestions, Problem> {
        self.shared.budget.check()?;
        let (stop, given_up) = (&self.shared.stop, &self.given_up);
        let is_wanted = || !stop.is_cancelled() && !given_up.is_cancelled();
        let prepared = self.session.prepare_suggest_while(ask, Some(self.now_s()), &is_wanted)?;
        self.commit(prepared, None)
    }

    /// Marks a suggestion as not going to be carried out.
    pub(in crate::server) fn outcome(
        &mut self,
        id: u64,
        state: Outcome,
        reason: Option<&str>,
    ) -> Result<Suggestion, Problem> {
        // One whose time has run out is told to be, and not pending any more for anybody.
        self.expire()?;
        let prepared = self.session.prepare_outcome(id, state, reason, Some(self.now_s()))?;
        self.commit(prepared, None)
    }

    /// Absorbs an observation, or repeats the answer to the one that came with this key, and returns which of the two
    /// it was.
    pub(in crate::server) fn observe(
        &mut self,
        told: &Observation,
        key: Option<&str>,
    ) -> Result<(Answer, bool), Problem> {
        if let Some(key) = key
            && let Some(known) = self.keys.get(key).and_then(|number| self.told(*number))
        {
            if known.observation.tells_the_same(told) {
                return Ok((known.answer.clone(), true));
            }
            let detail = format!(
                "`{key}` came with observation {}, whose body was another; nothing has happened. Send a key of its own with \
                 each observation",
                known.answer.observation
            );
            return Err(Problem::new(Kind::KeyTaken, detail).field("Idempotency-Key"));
        }
        self.shared.budget.check()?;
        let prepared = self.session.prepare_observe(told.clone(), Some(self.now_s())).map_err(|refusal| {
            let problem = Problem::from(refusal);
            // It is not the address that is wrong.
            match problem.is(Kind::UnknownSuggestion) {
                true => Problem::new(Kind::SuggestionOfBody, problem.into_detail()).field("suggestion_id"),
                false => problem,
            }
        })?;
        let answer = self.commit(prepared, key)?;
        self.shared.metrics.observations.inc();
        self.keys.extend(key.map(|key| (key.to_owned(), answer.observation)));
        Ok((answer, false))
    }

    /// Excludes an observation, or includes it again, and returns the new status.
    pub(in crate::server) fn mark(&mut self, number: u64, excluded: bool) -> Result<Status, Problem> {
        let now = Some(self.now_s());
        let (store, shared, id) = (&self.store, &self.shared, self.id);
        let mut come_by = ComeBy::default();
        let begun = Instant::now();
        let prepared = self.session.prepare_mark(
            (number, excluded),
            now,
            &mut |events| checkpoints::before(store, id, number, events),
            &mut |step| {
                if begun.elapsed() > TOLD_AFTER {
                    shared.replaying.send_replace(Some(Replaying { done: step.events, of: step.of() }));
                }
                come_by.hear(&step, &shared.metrics).is_some() && !shared.stop.is_cancelled()
            },
        );
        let marked = prepared.map_err(Problem::from).and_then(|prepared| {
            self.is_rewritten = !prepared.events().is_empty();
            let saved = come_by.saved;
            self.commit_by(prepared, |store, id, revision, events| {
                store.rewrite(id, revision, events, number, (build().unwrap_or_default(), &saved))
            })
            .inspect_err(|_| self.is_rewritten = false)
        });
        self.shared.replaying.send_replace(None);
        marked?;
        Ok(self.session.status())
    }

    /// Expires the pending suggestions whose time has run out.
    pub(in crate::server) fn expire(&mut self) -> Result<(), Problem> {
        let prepared = self.session.prepare_expire(self.now_s())?;
        self.commit(prepared, None)
    }

    /// The number of events.
    pub(in crate::server) fn revision(&self) -> usize {
        self.session.events().len()
    }

    /// A copy of the session as it is now, for work elsewhere.
    pub(in crate::server) fn copy(&self) -> ask_tell::Session {
        self.session.clone()
    }

    /// Seconds since 1970, never before the latest event.
    fn now_s(&self) -> f64 {
        now_s() + self.ahead_s
    }

    pub(super) fn experiment(&self) -> &Experiment {
        self.session.experiment()
    }

    /// Completes the recording so far.
    pub(super) fn complete(&mut self) -> Result<(), Problem> {
        while self.is_behind() && !self.shared.stop.is_cancelled() {
            self.catch_up(AT_ONCE).map_err(recording_failed)?;
        }
        let flushed = self.recorder.flush().map_err(recording_failed);
        self.shared.publish(Vec::new(), None);
        flushed
    }

    fn told(&self, number: u64) -> Option<&Told> {
        let index = usize::try_from(number.checked_sub(1)?).ok()?;
        self.session.observations().get(index).map(AsRef::as_ref)
    }

    /// Writes a prepared change, commits it, and shows it.
    fn commit<A>(&mut self, prepared: Prepared<A>, key: Option<&str>) -> Result<A, Problem> {
        self.commit_by(prepared, |store, id, revision, events| store.append(id, revision, events, key))
    }

    /// Writes a prepared change by `write`, commits it, and shows it.
    fn commit_by<A>(
        &mut self,
        prepared: Prepared<A>,
        write: impl FnOnce(&Store, Uuid, usize, &[ask_tell::Event]) -> Result<(), StoreError>,
    ) -> Result<A, Problem> {
        if prepared.events().is_empty() {
            return Ok(self.session.commit(prepared)?);
        }
        write(&self.store, self.id, prepared.revision(), prepared.events()).map_err(|error| {
            match error.is_for_want_of_a_session() {
                true => Problem::unknown_session(self.id),
                false => error.into(),
            }
        })?;
        let answer = self.session.commit(prepared)?;
        // It has happened, and is answered so, whatever becomes of the picture of it.
        let shown = self.record().map_err(|error| error.to_string());
        match shown {
            Ok(reports) => {
                let told = self.session.observations().len() as u64;
                for kept in &reports {
                    self.since.keep((&self.store, self.id), kept, told, || self.session.checkpoint());
                }
                self.publish(reports);
            }
            Err(error) => self.shared.note_recording(Some(error)),
        }
        Ok(answer)
    }

    /// Records new steps, and returns them.
    fn record(&mut self) -> Result<Vec<Kept>, RecordingError> {
        let mut reports = Vec::new();
        if self.is_rewritten {
            return Ok(reports);
        }
        let step = self.session.latest().step as usize;
        if step >= self.shared.steps() {
            let report = self.session.report();
            let kept = Kept::of(&report, &self.description);
            reports.push(kept.map_err(|problem| RecordingError::Encode(problem.detail.to_string()))?);
            if self.recorded == step {
                self.recorded += 1;
                self.recorder.log(&report)?;
            }
        }
        if !self.is_behind() {
            self.show()?;
        }
        Ok(reports)
    }

    /// Draws the next suggested posture, as a ghost of the arm.
    fn show(&mut self) -> Result<(), RecordingError> {
        draw_next(&self.session, self.recorded.saturating_sub(1) as u64, &mut self.recorder)
    }

    fn publish(&self, reports: Vec<Kept>) {
        let observations = self.session.observations().to_vec();
        let standing = Snapshot {
            status: self.session.status(),
            pending: self.session.pending().cloned().collect(),
            last: observations.last().map(|told| told.answer.clone()),
            suggestions: self.session.suggestions().to_vec(),
            observations,
            recording: self.recorder.recording_id().to_owned(),
            channels: self.channels.clone(),
        };
        self.shared.standing.send_replace(Some(Arc::new(standing)));
        self.shared.publish(reports, None);
    }
}

/// The problem of a new session that cannot be opened, attributed to the request.
fn unusable(error: ReplayError) -> Problem {
    match error {
        ReplayError::Setup(error) => error.into(),
        ReplayError::Event { index, .. } => {
            Problem::new(Kind::InvalidValue, error.to_string()).field(format!("events[{}]", index - 1))
        }
        ReplayError::NotASession(_) | ReplayError::Version { .. } => {
            Problem::new(Kind::InvalidValue, error.to_string()).field("events")
        }
    }
}
