//! Sessions: experiments that clients step and watch, and robots elsewhere that ask and tell.
//!
//! [`engine`] and [`outside`] are the threads that compute, [`Shared`] is what they leave for everyone to read, each report as
//! [`Kept`], [`Session`] is the way to both, and [`registry`] keeps them all; those with robots elsewhere are also in the
//! store, and [`dormant`] ones there alone.

mod checkpoints;
mod clock;
mod completed;
mod dormant;
mod engine;
mod kept;
mod memory;
mod outside;
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

pub(super) use clock::now_s;
pub(super) use dormant::Listed;
use engine::{Command, recording_failed};
pub(super) use kept::Kept;
pub(super) use memory::{Budget, Taken};
pub(super) use outside::Elsewhere;
pub use registry::NewSession;
pub(super) use registry::{Keeping, Sessions};
pub use resource::{DamagedSession, SessionResource};
use shared::Shared;
pub use standing::NewOutsideSession;
pub(super) use standing::Standing;
pub(super) use together::Together;
pub(super) use watching::{Following, Watching};

use super::problem::{Kind, Problem};
use body_schema_calibration::File;
use body_schema_experiment::{AppraisalReport, Choice, Description, RunResult};
use body_schema_recording::LiveLog;

/// A session: its engine's command line, and all that it has left to read.
pub(super) struct Session {
    id: Uuid,
    description: Description,
    file: Option<String>,
    /// When it was made, seconds since 1970.
    made_s: f64,
    engine: Engine,
    shared: Arc<Shared>,
    /// When it was last asked for anything.
    used: Mutex<Instant>,
    /// How many watch it …
    watchers: AtomicUsize,
    /// … and how many of them by a stream.
    streams: AtomicUsize,
    /// The recording for those who come late.
    together: together::LastTogether,
    /// The recording to take away.
    completed: completed::LastCompleted,
    /// Of a robot elsewhere.
    report: AsyncMutex<Option<ReportFiles>>,
}

/// The files of a report, which take a while to make.
pub(super) struct ReportFiles {
    /// How many events the session had.
    pub(super) revision: usize,
    pub(super) files: Arc<[File]>,
}

/// The way to the thread that computes.
enum Engine {
    /// Learners in a world of ours.
    Steps(mpsc::Sender<Command>),
    /// A robot elsewhere.
    Elsewhere(mpsc::Sender<outside::Job>),
}

impl Session {
    pub(super) fn id(&self) -> Uuid {
        self.id
    }

    pub(super) fn description(&self) -> &Description {
        &self.description
    }

    /// Why the engine has failed, if it has.
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

    /// Brings the recording up to date for one who has begun to follow it: steps that nobody watched may wait.
    pub(super) fn show(&self) {
        // An engine of the other kind leaves nothing waiting, and one that has ended left nothing.
        if let Engine::Steps(commands) = &self.engine
            && self.live().is_behind()
        {
            drop(commands.send(Command::Show));
        }
    }

    /// How many steps are left; `None` without an end.
    pub(super) fn remaining(&self) -> Option<u64> {
        Some(self.shared.remaining.load(Ordering::Relaxed)).filter(|left| *left != u64::MAX)
    }

    /// Resolves when nothing more is coming.
    pub(super) fn ended(&self) -> &CancellationToken {
        &self.shared.ended
    }

    /// How a session with a robot elsewhere stands, and to wait on; `None` for all others.
    pub(super) fn standing(&self) -> watch::Receiver<Option<Arc<Standing>>> {
        self.shared.standing.subscribe()
    }

    /// Whether its history was rewritten, so that whoever follows it has to begin anew.
    pub(super) fn is_rewritten(&self) -> bool {
        self.shared.rewritten.load(Ordering::Relaxed)
    }

    /// How often its history was rewritten before it was as it is.
    pub(super) fn rewritten(&self) -> u64 {
        self.shared.rewritings.load(Ordering::Relaxed)
    }

    /// Of a robot elsewhere: the files of its report, as they were made last.
    pub(super) fn report(&self) -> &AsyncMutex<Option<ReportFiles>> {
        &self.report
    }

    fn is_elsewhere(&self) -> bool {
        matches!(self.engine, Engine::Elsewhere(_))
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
        if self.is_elsewhere() {
            return self.tell(|robot| Ok(robot.experiment().result())).await;
        }
        self.ask(|reply| Command::Result { reply }).await
    }

    /// How a learner's last movement was chosen, after whatever the session is busy with.
    pub(super) async fn choice(&self, learner: String) -> Result<Choice, Problem> {
        if self.is_elsewhere() {
            return self.tell(move |robot| Ok(robot.experiment().choice(&learner)?)).await;
        }
        self.ask(|reply| Command::Choice { learner, reply }).await
    }

    /// What another movement would have taught a learner, after whatever the session is busy with.
    pub(super) async fn appraise(&self, learner: String, configuration: Vec<f64>) -> Result<AppraisalReport, Problem> {
        if self.is_elsewhere() {
            return self.tell(move |robot| Ok(robot.experiment().appraise(&learner, &configuration)?)).await;
        }
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

    /// Completes the recording so far, after the step that is being made, or with a robot elsewhere after whatever the session is
    /// busy with. That of a failed engine is complete.
    pub(super) async fn flush(&self) -> Result<(), Problem> {
        if self.is_elsewhere() {
            return self.tell(|robot| robot.complete()).await;
        }
        let flushed = self.ask(|reply| Command::Flush { reply }).await;
        if self.failure().is_some() { Ok(()) } else { flushed }
    }

    /// Completes the recording's file and ends the engine. On a problem nothing has ended.
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

    /// Asks the engine of a world of ours.
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

    /// Has something done by the engine of a robot elsewhere, after whatever it is busy with.
    pub(super) async fn tell<T: Send + 'static>(
        &self,
        work: impl FnOnce(&mut Elsewhere) -> Result<T, Problem> + Send + 'static,
    ) -> Result<T, Problem> {
        let Engine::Elsewhere(jobs) = &self.engine else { return Err(Problem::not_outside(self.id)) };
        let (reply, mut answer) = oneshot::channel();
        let counted = Job::of(&self.shared);
        let given_up = CancellationToken::new();
        let _waiting = given_up.clone().drop_guard();
        // Whoever is first: the engine that begins it, or who refuses it.
        let is_taken = Arc::new(AtomicBool::new(false));
        let taken = is_taken.clone();
        let job: outside::Job = Box::new(move |robot| {
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
            None if self.is_elsewhere() => {
                Problem::new(Kind::Dormant, "the session has just left memory; ask again and it comes back")
            }
            None => Problem::unknown_session(self.id),
        }
    }

    /// Asks the engine to end after the step it is making.
    pub(super) fn stop(&self) {
        self.shared.stop.cancel();
        // An engine that waits for commands must wake; one that has ended needs nothing.
        match &self.engine {
            Engine::Steps(commands) => drop(commands.send(Command::Wake)),
            Engine::Elsewhere(jobs) => drop(jobs.send(Box::new(|_| Box::new(|| ())))),
        }
    }

    fn touch(&self) {
        *lock(&self.used) = Instant::now();
    }

    fn used(&self) -> Instant {
        *lock(&self.used)
    }

    /// Whether nobody watches it, and its engine is at nothing.
    fn is_idle(&self) -> bool {
        self.watchers.load(Ordering::Relaxed) == 0 && self.shared.jobs.load(Ordering::Relaxed) == 0
    }

    /// The recording's file with what it lacks, if it is not complete.
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
            Engine::Elsewhere(jobs) => drop(jobs.send(Box::new(|_| panic!("as the test asked")))),
        }
    }
}

/// Something that an engine is at, or will be.
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
