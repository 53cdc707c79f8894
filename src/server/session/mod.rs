//! Sessions: experiments that clients step and watch.
//!
//! [`engine`] is the thread that computes, [`Shared`] is what it leaves for everyone to read, each report as [`Kept`],
//! [`Session`] is the way to both, and [`registry`] keeps them all.

mod engine;
mod kept;
mod memory;
mod registry;

use std::{
    sync::{
        Arc, Mutex, MutexGuard, PoisonError, RwLock,
        atomic::{AtomicU64, AtomicUsize, Ordering},
        mpsc,
    },
    time::Instant,
};

use serde::Serialize;
use tokio::sync::{oneshot, watch};
use tokio_util::sync::CancellationToken;
use utoipa::ToSchema;
use uuid::Uuid;

use engine::Command;
pub(super) use kept::Kept;
pub(super) use memory::Budget;
pub use registry::NewSession;
pub(super) use registry::Sessions;

use super::problem::{Kind, Problem};
use crate::{
    experiment::{AppraisalReport, Choice, Description, RunResult},
    recording::LiveLog,
};

/// A session as its resource shows it.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct SessionResource {
    /// Its id.
    #[schema(format = "uuid")]
    pub id: String,
    /// What stays the same from step to step.
    pub description: Description,
    /// The latest step; 0 is the start, before any movement.
    pub step: u64,
    /// How many steps the recorded data set has left; null in a simulated world, which has no end.
    pub remaining: Option<u64>,
    /// Name of the recording's file in the server's data directory; null if it keeps none.
    pub file: Option<String>,
    /// Why the session can make no more steps, if its engine has failed; null otherwise.
    pub failure: Option<String>,
}

/// What an engine leaves for everyone to read.
struct Shared {
    /// One report per step, from step 0.
    history: RwLock<Vec<Kept>>,
    /// The length of `history`, to wait on.
    reports: watch::Sender<usize>,
    /// The recording, as encoded bytes.
    live: LiveLog,
    /// `u64::MAX` stands for no end.
    remaining: AtomicU64,
    failure: Mutex<Option<String>>,
    /// Asks the engine to end.
    stop: CancellationToken,
    /// The engine has ended: nothing more is coming and the recording's file is complete.
    ended: CancellationToken,
    budget: Arc<Budget>,
    /// What this session has taken of the budget …
    taken: AtomicUsize,
    /// … and how much of it for reports.
    reported: AtomicUsize,
}

impl Shared {
    fn new(stop: CancellationToken, budget: Arc<Budget>) -> Self {
        Self {
            history: RwLock::default(),
            reports: watch::Sender::new(0),
            live: LiveLog::new(),
            remaining: AtomicU64::new(u64::MAX),
            failure: Mutex::default(),
            stop,
            ended: CancellationToken::new(),
            budget,
            taken: AtomicUsize::new(0),
            reported: AtomicUsize::new(0),
        }
    }

    fn publish(&self, reports: Vec<Kept>, remaining: Option<usize>) {
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

    fn fail(&self, why: String) {
        *lock(&self.failure) = Some(why);
    }
}

impl Drop for Shared {
    fn drop(&mut self) {
        self.budget.give_back(self.taken.load(Ordering::Relaxed));
    }
}

/// A session: its engine's command line, and all that it has left to read.
pub(super) struct Session {
    id: Uuid,
    description: Description,
    file: Option<String>,
    commands: mpsc::Sender<Command>,
    shared: Arc<Shared>,
    /// When it was last asked for anything.
    used: Mutex<Instant>,
    /// How many watch it.
    watchers: AtomicUsize,
}

impl Session {
    pub(super) fn id(&self) -> Uuid {
        self.id
    }

    pub(super) fn description(&self) -> &Description {
        &self.description
    }

    pub(super) fn resource(&self) -> SessionResource {
        SessionResource {
            id: self.id.to_string(),
            description: self.description.clone(),
            step: self.step(),
            remaining: Some(self.shared.remaining.load(Ordering::Relaxed)).filter(|left| *left != u64::MAX),
            file: self.file.clone(),
            failure: self.failure(),
        }
    }

    /// Why the engine has failed, if it has.
    pub(super) fn failure(&self) -> Option<String> {
        lock(&self.shared.failure).clone()
    }

    /// The latest published step.
    pub(super) fn step(&self) -> u64 {
        (*self.shared.reports.borrow() as u64).saturating_sub(1)
    }

    /// The reports from step `first` on, at most `count`.
    pub(super) fn reports(&self, first: usize, count: usize) -> Vec<Kept> {
        let history = self.shared.history.read().unwrap_or_else(PoisonError::into_inner);
        history.iter().skip(first).take(count).cloned().collect()
    }

    /// Wakes whenever there are more reports.
    pub(super) fn new_reports(&self) -> watch::Receiver<usize> {
        self.shared.reports.subscribe()
    }

    /// The recording so far.
    pub(super) fn live(&self) -> &LiveLog {
        &self.shared.live
    }

    /// Resolves when nothing more is coming.
    pub(super) fn ended(&self) -> &CancellationToken {
        &self.shared.ended
    }

    /// Makes `count` steps, after whatever the session is busy with, and draws so many postures on the way to each.
    pub(super) async fn make_steps(
        &self,
        count: u64,
        expected: Option<u64>,
        frames: u64,
    ) -> Result<Vec<Kept>, Problem> {
        self.ask(|reply| Command::Step { count, expected, frames, reply }).await
    }

    /// The outcome so far, after whatever the session is busy with.
    pub(super) async fn result(&self) -> Result<RunResult, Problem> {
        self.ask(|reply| Command::Result { reply }).await
    }

    /// How a learner's last movement was chosen, after whatever the session is busy with.
    pub(super) async fn choice(&self, learner: String) -> Result<Choice, Problem> {
        self.ask(|reply| Command::Choice { learner, reply }).await
    }

    /// What another movement would have taught a learner, after whatever the session is busy with.
    pub(super) async fn appraise(&self, learner: String, configuration: Vec<f64>) -> Result<AppraisalReport, Problem> {
        self.ask(|reply| Command::Appraise { learner, configuration, reply }).await
    }

    /// Sets the next movement of a learner for which a person chooses, after whatever the session is busy with.
    pub(super) async fn set_configuration(
        &self,
        learner: String,
        configuration: Vec<f64>,
    ) -> Result<AppraisalReport, Problem> {
        self.ask(|reply| Command::SetConfiguration { learner, configuration, reply }).await
    }

    /// The movement that was set for the next step, after whatever the session is busy with.
    pub(super) async fn configuration(&self, learner: String) -> Result<Option<Vec<f64>>, Problem> {
        self.ask(|reply| Command::Configuration { learner, reply }).await
    }

    /// Completes the recording so far, after whatever the session is busy with. That of a failed engine is complete.
    pub(super) async fn flush(&self) -> Result<(), Problem> {
        let flushed = self.ask(|reply| Command::Flush { reply }).await;
        if self.failure().is_some() { Ok(()) } else { flushed }
    }

    async fn ask<T>(&self, command: impl FnOnce(engine::Reply<T>) -> Command) -> Result<T, Problem> {
        let (reply, answer) = oneshot::channel();
        // Both an engine that takes no commands and one that dropped this one have ended. A command that was not sent
        // must go at once: it holds the other end of `answer`.
        if self.commands.send(command(reply)).is_ok()
            && let Ok(outcome) = answer.await
        {
            return outcome;
        }
        Err(self.why_ended().await)
    }

    async fn why_ended(&self) -> Problem {
        // The reason may come an instant after the dropped reply.
        self.shared.ended.cancelled().await;
        match self.failure() {
            Some(failure) => Problem::new(Kind::EngineFailed, failure).step(self.step()),
            None => Problem::unknown_session(self.id),
        }
    }

    /// Asks the engine to end after the step it is making.
    pub(super) fn stop(&self) {
        self.shared.stop.cancel();
        // An engine that waits for commands must wake; one that has ended needs nothing.
        drop(self.commands.send(Command::Wake));
    }

    /// Counts the caller among those who watch, as long as it keeps the answer.
    pub(super) fn watch(self: &Arc<Self>) -> Watching {
        self.watchers.fetch_add(1, Ordering::Relaxed);
        Watching(self.clone())
    }

    fn touch(&self) {
        *lock(&self.used) = Instant::now();
    }

    #[cfg(test)]
    fn panic(&self) {
        drop(self.commands.send(Command::Panic));
    }
}

/// One who watches a session.
pub(super) struct Watching(Arc<Session>);

impl std::ops::Deref for Watching {
    type Target = Session;

    fn deref(&self) -> &Session {
        &self.0
    }
}

impl Drop for Watching {
    fn drop(&mut self) {
        self.0.touch();
        self.0.watchers.fetch_sub(1, Ordering::Relaxed);
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
