//! The state that an engine shares with its readers.

use std::{
    path::PathBuf,
    sync::{
        Arc, Mutex, PoisonError, RwLock,
        atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering},
    },
};

use tokio::sync::watch;
use tokio_util::sync::CancellationToken;
use uuid::Uuid;

use super::{Budget, Kept, Snapshot, lock};
use crate::server::metrics::Metrics;
use body_schema_recording::LiveLog;

/// The state that an engine shares with its readers.
pub(super) struct Shared {
    id: Uuid,
    /// One report per step, from step 0.
    pub(super) history: RwLock<Vec<Kept>>,
    /// The length of `history`, to wait on.
    pub(super) reports: watch::Sender<usize>,
    /// The recording, as encoded bytes.
    pub(super) live: LiveLog,
    /// The number of steps left; `u64::MAX` stands for no end.
    pub(super) remaining: AtomicU64,
    pub(super) failure: Mutex<Option<String>>,
    /// Why the recording's file lacks steps, if it does.
    pub(super) recording_failure: Mutex<Option<String>>,
    /// The snapshot of a session with a robot elsewhere, to wait on; `None` for all others.
    pub(super) standing: watch::Sender<Option<Arc<Snapshot>>>,
    /// Whether the history was rewritten, so that its followers begin anew.
    pub(super) rewritten: AtomicBool,
    /// How often the history has been rewritten.
    pub(super) rewritings: AtomicU64,
    /// The number of jobs of a robot elsewhere, running and waiting.
    pub(super) jobs: AtomicUsize,
    /// The progress of a long replay; nothing else can be asked of the engine meanwhile.
    pub(super) replaying: watch::Sender<Option<Replaying>>,
    /// Asks the engine to stop its present command.
    pub(super) interrupted: AtomicBool,
    /// Asks the engine to end.
    pub(super) stop: CancellationToken,
    /// Cancelled when the engine has ended: nothing more is coming and the recording's file is complete.
    pub(super) ended: CancellationToken,
    pub(super) budget: Arc<Budget>,
    /// The counters of what engines do.
    pub(super) metrics: Arc<Metrics>,
    /// The folder for files without a name; the operating system's if there is none.
    pub(super) scratch: Option<PathBuf>,
    /// The bytes of the budget that this session has taken …
    taken: AtomicUsize,
    /// … and how many of them for reports.
    reported: AtomicUsize,
}

/// The progress of a replay, for everyone to read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Replaying {
    /// The events that are done …
    pub(super) done: usize,
    /// … of this many.
    pub(super) of: usize,
}

impl Replaying {
    /// The progress in words.
    pub(super) fn told(self) -> String {
        let Self { done, of } = self;
        format!(
            "what happened in the session is being replayed without an observation, or with one more: event {done} of {of}; ask again later"
        )
    }
}

impl Shared {
    pub(super) fn new(
        id: Uuid,
        stop: CancellationToken,
        (budget, metrics): (Arc<Budget>, Arc<Metrics>),
        scratch: Option<PathBuf>,
    ) -> Self {
        Self {
            id,
            history: RwLock::default(),
            reports: watch::Sender::new(0),
            live: LiveLog::new(),
            remaining: AtomicU64::new(u64::MAX),
            failure: Mutex::default(),
            recording_failure: Mutex::default(),
            standing: watch::Sender::new(None),
            rewritten: AtomicBool::new(false),
            rewritings: AtomicU64::new(0),
            jobs: AtomicUsize::new(0),
            replaying: watch::Sender::new(None),
            interrupted: AtomicBool::new(false),
            stop,
            ended: CancellationToken::new(),
            budget,
            metrics,
            scratch,
            taken: AtomicUsize::new(0),
            reported: AtomicUsize::new(0),
        }
    }

    /// The number of steps that can be read, step 0 among them.
    pub(super) fn steps(&self) -> usize {
        *self.reports.borrow()
    }

    /// The reports from step `first` on, at most `count`.
    pub(super) fn reports_from(&self, first: usize, count: usize) -> Vec<Kept> {
        let history = self.history.read().unwrap_or_else(PoisonError::into_inner);
        history.iter().skip(first).take(count).cloned().collect()
    }

    pub(super) fn publish(&self, reports: Vec<Kept>, remaining: Option<usize>) {
        // The engine alone publishes, so that nothing comes between these.
        let reported = self.reported.load(Ordering::Relaxed) + reports.iter().map(Kept::bytes).sum::<usize>();
        self.reported.store(reported, Ordering::Relaxed);
        let taken = reported + self.live.bytes();
        self.budget.take(taken - self.taken.swap(taken, Ordering::Relaxed));
        self.remaining.store(remaining.map_or(u64::MAX, |left| left as u64), Ordering::Relaxed);
        let length = {
            let mut history = self.history.write().unwrap_or_else(PoisonError::into_inner);
            history.extend(reports);
            history.len()
        };
        self.reports.send_replace(length);
    }

    pub(super) fn note_recording(&self, failure: Option<String>) {
        let session = tracing::field::display(self.id);
        let mut known = lock(&self.recording_failure);
        match (&*known, &failure) {
            (None, Some(why)) => tracing::error!(session, why, "the recording cannot be written"),
            (Some(_), None) => tracing::info!(session, "the recording is written again"),
            _ => {}
        }
        *known = failure;
    }

    pub(super) fn fail(&self, why: String) {
        tracing::error!(session = %self.id, why, "the session has failed");
        self.metrics.failed_sessions.inc();
        *lock(&self.failure) = Some(why);
    }
}

impl Drop for Shared {
    fn drop(&mut self) {
        self.budget.give_back(self.taken.load(Ordering::Relaxed));
    }
}
