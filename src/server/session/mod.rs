//! Sessions: experiments that clients step and watch, and robots elsewhere that ask and tell.
//!
//! [`engine`] and [`outside`] are the threads that compute, [`Shared`] is what they leave for everyone to read, each report as
//! [`Kept`], [`Session`] is the way to both, and [`registry`] keeps them all; those with robots elsewhere are also in the
//! store, and [`dormant`] ones there alone.

mod checkpoints;
mod completed;
mod dormant;
mod engine;
mod external;
mod known;
mod memory;
mod registry;
mod resource;
mod shared;
mod standing;
mod together;
mod watching;

use std::{
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, AtomicUsize, Ordering},
        mpsc,
    },
    time::Instant,
};

use tokio::sync::{Mutex as AsyncMutex, oneshot, watch};
use tokio_util::sync::CancellationToken;
use uuid::Uuid;

use body_schema_backend::EvaluationRequest;
pub(super) use body_schema_backend::Kept;
pub use body_schema_backend::{NewSession, SessionResource};
pub(super) use dormant::Listed;
use engine::{Command, recording_failed};
pub(super) use external::ExternalRobot;
pub(super) use memory::{Budget, Taken};
pub(super) use registry::{Keeping, Sessions};
pub use resource::DamagedSession;
use shared::Shared;
pub use standing::NewOutsideSession;
pub(super) use standing::Snapshot;
pub(super) use together::Together;
pub(super) use watching::{Following, Watching};

use super::problem::{Kind, Problem};
use body_schema_calibration::File;
use body_schema_recording::LiveLog;
use body_schema_wire::{AppraisalReport, Choice, Description, RunResult};

/// A session: the channel to its engine, and everything that it has left to read.
pub(super) struct Session {
    id: Uuid,
    description: Description,
    file: Option<String>,
    /// When the session was made, seconds since 1970.
    made_s: f64,
    engine: Engine,
    shared: Arc<Shared>,
    /// When it was last asked for anything.
    used: Mutex<Instant>,
    /// The number of followers and readers …
    watchers: AtomicUsize,
    /// … and how many of them follow by a stream.
    streams: AtomicUsize,
    /// The recording, put together for late followers.
    together: together::LastTogether,
    /// The recording for downloads.
    completed: completed::LastCompleted,
    /// The report of a robot elsewhere.
    report: AsyncMutex<Option<ReportFiles>>,
}

/// The files of a report, which take a while to make.
pub(super) struct ReportFiles {
    /// The number of events that the session had.
    pub(super) revision: usize,
    /// In how many folds it judges; as the calibration file says, if absent.
    pub(super) folds: Option<usize>,
    pub(super) files: Arc<[File]>,
}

/// The channel to the thread that computes.
enum Engine {
    /// An engine of learners in a simulated or recorded world.
    Steps(mpsc::Sender<Command>),
    /// An engine of a robot elsewhere.
    ExternalRobot(mpsc::Sender<external::Job>),
}

impl Session {
    pub(super) fn id(&self) -> Uuid {
        self.id
    }

    pub(super) fn description(&self) -> &Description {
        &self.description
    }

    /// The failure of the engine, if it has failed.
    pub(super) fn failure(&self) -> Option<String> {
        lock(&self.shared.failure).clone()
    }

    /// The latest published step.
    pub(super) fn step(&self) -> u64 {
        (self.shared.steps() as u64).saturating_sub(1)
    }

    /// The reports from step `first` on, at most `count`.
    pub(super) fn reports(&self, first: usize, count: usize) -> Vec<Kept> {
        self.shared.reports_from(first, count)
    }

    /// Wakes whenever there are more reports.
    pub(super) fn new_reports(&self) -> watch::Receiver<usize> {
        self.shared.reports.subscribe()
    }

    /// The recording so far.
    pub(super) fn live(&self) -> &LiveLog {
        &self.shared.live
    }

    /// Brings the recording up to date for a new follower: steps that nobody watched may wait.
    pub(super) fn show(&self) {
        // An engine of the other kind leaves nothing waiting, and one that has ended left nothing.
        if let Engine::Steps(commands) = &self.engine
            && self.live().is_behind()
        {
            drop(commands.send(Command::Show));
        }
    }

    /// The number of steps that are left; `None` without an end.
    pub(super) fn remaining(&self) -> Option<u64> {
        Some(self.shared.remaining.load(Ordering::Relaxed)).filter(|left| *left != u64::MAX)
    }

    /// A token that is cancelled when nothing more is coming.
    pub(super) fn ended(&self) -> &CancellationToken {
        &self.shared.ended
    }

    /// The snapshot of a session with a robot elsewhere, as a value to wait on; `None` for all others.
    pub(super) fn standing(&self) -> watch::Receiver<Option<Arc<Snapshot>>> {
        self.shared.standing.subscribe()
    }

    /// Whether its history was rewritten, so that its followers must begin anew.
    pub(super) fn is_rewritten(&self) -> bool {
        self.shared.rewritten.load(Ordering::Relaxed)
    }

    /// How often its history has been rewritten.
    pub(super) fn rewritten(&self) -> u64 {
        self.shared.rewritings.load(Ordering::Relaxed)
    }

    /// The files of the latest report of a robot elsewhere.
    pub(super) fn report(&self) -> &AsyncMutex<Option<ReportFiles>> {
        &self.report
    }

    fn is_external(&self) -> bool {
        matches!(self.engine, Engine::ExternalRobot(_))
    }

    /// Makes `count` steps, after the engine's present work, with `frames` postures drawn on the way to each.
    pub(super) async fn make_steps(
        &self,
        count: u64,
        expected: Option<u64>,
        frames: u64,
    ) -> Result<Vec<Kept>, Problem> {
        self.ask(|reply| Command::Step { count, expected, frames, reply }).await
    }

    /// The result so far, after the engine's present work.
    pub(super) async fn result(&self) -> Result<RunResult, Problem> {
        if self.is_external() {
            return self.tell(|robot| Ok(RunResult::of(robot.experiment()))).await;
        }
        self.ask(|reply| Command::Result { reply }).await
    }

    /// How a learner's last movement was chosen, after the engine's present work.
    pub(super) async fn choice(&self, learner: String) -> Result<Choice, Problem> {
        if self.is_external() {
            return self.tell(move |robot| Ok(Choice::of(robot.experiment(), &learner)?)).await;
        }
        self.ask(|reply| Command::Choice { learner, reply }).await
    }

    /// What another movement would have taught a learner, after the engine's present work.
    pub(super) async fn appraise(&self, learner: String, asked: EvaluationRequest) -> Result<AppraisalReport, Problem> {
        if self.is_external() {
            let appraised = move |robot: &mut ExternalRobot| {
                Ok(AppraisalReport::from(&robot.experiment().appraise(&learner, &asked.configuration)?))
            };
            return self.tell(appraised).await;
        }
        self.ask(|reply| Command::Appraise { learner, asked, reply }).await
    }

    /// Sets the next movement of a learner for which a person chooses, after the engine's present work.
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

    /// Completes the recording so far, after the step that is being made, or with a robot elsewhere after the engine's present
    /// work. The recording of a failed engine is complete.
    pub(super) async fn flush(&self) -> Result<(), Problem> {
        if self.is_external() {
            return self.tell(|robot| robot.complete()).await;
        }
        let flushed = self.ask(|reply| Command::Flush { reply }).await;
        if self.failure().is_some() { Ok(()) } else { flushed }
    }

    /// Completes the recording's file and ends the engine. If that fails nothing has ended.
    async fn end(&self) -> Result<(), Problem> {
        self.shared.interrupted.store(true, Ordering::Relaxed);
        let ended = self.ask(|reply| Command::End { reply }).await;
        // An engine that has failed is at its end.
        if ended.is_err() && !self.ended().is_cancelled() {
            return ended;
        }
        self.ended().cancelled().await;
        Ok(())
    }

    /// Sends a command to the engine of learners in a world, and awaits the answer.
    async fn ask<T>(&self, command: impl FnOnce(engine::Reply<T>) -> Command) -> Result<T, Problem> {
        let Engine::Steps(commands) = &self.engine else { return Err(Problem::never_steps(self.id)) };
        let (reply, answer) = oneshot::channel();
        // Both an engine that takes no commands and one that dropped this one have ended. A command that was not sent
        // must go at once: it holds the other end of `answer`.
        if commands.send(command(reply)).is_ok()
            && let Ok(outcome) = answer.await
        {
            return outcome;
        }
        Err(self.why_ended().await)
    }

    /// Runs work on the engine of a robot elsewhere, after its present work.
    pub(super) async fn tell<T: Send + 'static>(
        &self,
        work: impl FnOnce(&mut ExternalRobot) -> Result<T, Problem> + Send + 'static,
    ) -> Result<T, Problem> {
        let Engine::ExternalRobot(jobs) = &self.engine else { return Err(Problem::not_outside(self.id)) };
        let (reply, mut answer) = oneshot::channel();
        let counted = Job::of(&self.shared);
        let given_up = CancellationToken::new();
        let _waiting = given_up.clone().drop_guard();
        // Whoever is first: the engine that begins it, or who refuses it.
        let is_taken = Arc::new(AtomicBool::new(false));
        let taken = is_taken.clone();
        let job: external::Job = Box::new(move |robot| {
            let _counted = counted;
            if taken.swap(true, Ordering::Relaxed) {
                return Box::new(|| ());
            }
            let outcome = work(robot.for_whoever_waits(given_up));
            // Nobody may wait for it any longer; what was done stands all the same.
            Box::new(move || drop(reply.send(outcome)))
        });
        if jobs.send(job).is_err() {
            return Err(self.why_ended().await);
        }
        let mut replaying = self.shared.replaying.subscribe();
        let replaying = async { replaying.wait_for(Option::is_some).await.ok().and_then(|replaying| *replaying) };
        let outcome = tokio::select! {
            outcome = &mut answer => outcome,
            Some(replaying) = replaying => {
                if !is_taken.swap(true, Ordering::Relaxed) {
                    return Err(Problem::new(Kind::Busy, replaying.told()));
                }
                answer.await
            }
        };
        match outcome {
            Ok(outcome) => outcome,
            Err(_) => Err(self.why_ended().await),
        }
    }

    async fn why_ended(&self) -> Problem {
        // The reason may come an instant after the dropped reply.
        self.shared.ended.cancelled().await;
        match self.failure() {
            Some(failure) => Problem::new(Kind::EngineFailed, failure).step(self.step()),
            None if self.is_external() => {
                Problem::new(Kind::Dormant, "the session has just left memory; ask again and it comes back")
            }
            None => Problem::unknown_session(self.id),
        }
    }

    /// Asks the engine to end after the step that it is making.
    pub(super) fn stop(&self) {
        self.shared.stop.cancel();
        // An engine that waits for commands must wake; one that has ended needs nothing.
        match &self.engine {
            Engine::Steps(commands) => drop(commands.send(Command::Wake)),
            Engine::ExternalRobot(jobs) => drop(jobs.send(Box::new(|_| Box::new(|| ())))),
        }
    }

    fn touch(&self) {
        *lock(&self.used) = Instant::now();
    }

    fn used(&self) -> Instant {
        *lock(&self.used)
    }

    /// Whether nobody watches the session, and its engine is idle.
    fn is_idle(&self) -> bool {
        self.watchers.load(Ordering::Relaxed) == 0 && self.shared.jobs.load(Ordering::Relaxed) == 0
    }

    /// The recording's file and what it lacks, if it is incomplete.
    fn unfinished(&self) -> Option<String> {
        let file = self.file.as_deref()?;
        match lock(&self.shared.recording_failure).as_deref() {
            Some(failure) => Some(format!("{file}: {failure}")),
            None if !self.ended().is_cancelled() => Some(format!("{file}: its session had not ended in time")),
            None => None,
        }
    }

    #[cfg(test)]
    fn panic(&self) {
        match &self.engine {
            Engine::Steps(commands) => drop(commands.send(Command::Panic)),
            Engine::ExternalRobot(jobs) => drop(jobs.send(Box::new(|_| panic!("as the test asked")))),
        }
    }
}

/// A job of an engine, running or waiting.
struct Job(Arc<Shared>);

impl Job {
    fn of(shared: &Arc<Shared>) -> Self {
        shared.jobs.fetch_add(1, Ordering::Relaxed);
        Self(shared.clone())
    }
}

impl Drop for Job {
    fn drop(&mut self) {
        self.0.jobs.fetch_sub(1, Ordering::Relaxed);
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
