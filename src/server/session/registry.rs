//! All sessions of a server.

use std::{
    path::{Path, PathBuf},
    sync::{Arc, Mutex, MutexGuard, atomic::Ordering, mpsc},
    thread,
    time::{Duration, Instant},
};

use tokio::{
    sync::{OwnedSemaphorePermit, Semaphore, oneshot},
    time::timeout,
};
use tokio_util::sync::CancellationToken;
use uuid::Uuid;

use super::{Budget, Engine, NewSession, Session, Shared, engine, known::Known, lock};
use crate::server::{
    Limits,
    blocking::run_blocking,
    clock::now_s,
    metrics::{Metrics, Present},
    problem::{Kind, Problem},
    requests,
    store::{Store, StoreError},
};
use body_schema_backend::Scenarios;
use body_schema_scenario::WorldKind;

/// The time that a session may take to end after it was told to …
pub(super) const END_WITHIN: Duration = Duration::from_secs(10);
/// … and when the server ends.
const SHUT_DOWN_WITHIN: Duration = Duration::from_secs(4);

/// What is kept of sessions, and where.
pub(in crate::server) struct Keeping {
    /// The sessions with robots elsewhere.
    pub(in crate::server) store: Store,
    /// The folder of the recordings of all others, if they are kept as files.
    pub(in crate::server) recordings: Option<PathBuf>,
    /// The folder for files without a name.
    pub(in crate::server) scratch: Option<PathBuf>,
    /// The limits.
    pub(in crate::server) limits: Limits,
    /// The scenarios that can be opened.
    pub(in crate::server) scenarios: Arc<Scenarios>,
}

/// All sessions of a server.
///
/// No caller waits for one of its locks while holding another, nor for any without end.
pub(in crate::server) struct Sessions {
    /// The sessions in memory, in the order in which they came there; few enough for a linear search.
    all: Mutex<Vec<Arc<Session>>>,
    /// The sessions in the store, oldest first.
    pub(super) known: Mutex<Vec<Arc<Known>>>,
    /// A permit for each session that makes steps, also while it ends.
    permits: Arc<Semaphore>,
    /// A permit for each session with a robot elsewhere that is in memory.
    pub(super) places: Arc<Semaphore>,
    pub(super) budget: Arc<Budget>,
    pub(super) metrics: Arc<Metrics>,
    pub(super) store: Arc<Store>,
    recordings: Option<PathBuf>,
    scratch: Option<PathBuf>,
    pub(super) limits: Limits,
    scenarios: Arc<Scenarios>,
    pub(super) shutdown: CancellationToken,
}

impl Sessions {
    pub(in crate::server) fn new(
        budget: Budget,
        keeping: Keeping,
        metrics: Arc<Metrics>,
        shutdown: CancellationToken,
    ) -> Result<Arc<Self>, StoreError> {
        let Keeping { store, recordings, scratch, limits, scenarios } = keeping;
        let known = store.all()?.into_iter().map(|(id, made_s)| Arc::new(Known::new(id, made_s))).collect();
        Ok(Arc::new(Self {
            all: Mutex::default(),
            known: Mutex::new(known),
            permits: Arc::new(Semaphore::new(limits.sessions.min(Semaphore::MAX_PERMITS))),
            places: Arc::new(Semaphore::new(limits.sessions.min(Semaphore::MAX_PERMITS))),
            budget: Arc::new(budget),
            metrics,
            store: Arc::new(store),
            recordings,
            scratch,
            limits,
            scenarios,
            shutdown,
        }))
    }

    /// The scenarios that can be opened.
    pub(in crate::server) fn scenarios(&self) -> &Arc<Scenarios> {
        &self.scenarios
    }

    /// Opens a session, with its thread, its experiment and its recording.
    pub(in crate::server) async fn open(&self, new: NewSession) -> Result<Arc<Session>, Problem> {
        self.has_room_for_recordings().await?;
        let permit = self.permit().await?;
        let id = Uuid::new_v4();
        let shared = Arc::new(self.shared(id));
        // An unknown scenario's name becomes part of no path: the engine refuses it before it opens the file.
        let file = self.recordings.as_ref().map(|_| format!("{}-seed{}-{id}.rrd", new.scenario, new.seed));
        let setup = engine::Setup {
            id,
            new: new.clone(),
            scenarios: self.scenarios.clone(),
            file: self.recordings.as_ref().zip(file.as_ref()).map(|(directory, file)| directory.join(file)),
            most_steps: self.limits.steps_per_session,
            shared: shared.clone(),
            permit,
        };
        let (commands, receiver) = mpsc::channel();
        let (opened, opening) = oneshot::channel();
        spawn(move || engine::run(setup, receiver, opened))?;
        let description = opening.await.map_err(|_| no_engine())??;
        let session = Session {
            id,
            description,
            file,
            made_s: now_s(),
            engine: Engine::Steps(commands),
            shared,
            used: Mutex::new(Instant::now()),
            watchers: 0.into(),
            streams: 0.into(),
            together: Default::default(),
            completed: Default::default(),
            report: Default::default(),
        };
        let NewSession { scenario, seed, .. } = new;
        tracing::info!(request = requests::id(), session = %id, scenario, seed, "a session was opened");
        Ok(self.enter(session))
    }

    /// The shared state of a new session.
    pub(super) fn shared(&self, id: Uuid) -> Shared {
        let counters = (self.budget.clone(), self.metrics.clone());
        Shared::new(id, self.shutdown.child_token(), counters, self.scratch.clone())
    }

    /// Checks that one more recording may be kept as a file.
    async fn has_room_for_recordings(&self) -> Result<(), Problem> {
        let Some(directory) = self.recordings.clone() else { return Ok(()) };
        let (most, used) =
            (self.limits.recordings_bytes, run_blocking(move || Ok::<_, Problem>(recordings_bytes(&directory))).await?);
        match used < most {
            true => Ok(()),
            false => Err(Problem::new(
                Kind::ServerFull,
                format!("the recordings in the server's data directory take {used} bytes of {most}; move some away"),
            )),
        }
    }

    /// Adds a session to those in memory.
    pub(super) fn enter(&self, session: Session) -> Arc<Session> {
        let session = Arc::new(session);
        self.all().push(session.clone());
        // A shutdown that began meanwhile has not seen this session.
        if self.shutdown.is_cancelled() {
            session.stop();
        }
        session
    }

    /// The sessions in memory. A robot elsewhere whose engine has ended is not among them: it comes back from the store.
    pub(super) fn all(&self) -> MutexGuard<'_, Vec<Arc<Session>>> {
        let mut all = lock(&self.all);
        all.retain(|session| !(session.is_external() && session.ended().is_cancelled()));
        all
    }

    /// A permit for one more session, if necessary that of the one that has been idle longest.
    async fn permit(&self) -> Result<OwnedSemaphorePermit, Problem> {
        self.check_open()?;
        if let Ok(permit) = self.permits.clone().try_acquire_owned() {
            return Ok(permit);
        }
        let idle = self.idle(|session| !session.is_external(), self.limits.idle_after);
        if let Some(session) = idle.into_iter().next() {
            tracing::info!(request = requests::id(), session = %session.id, "an idle session makes room for another");
            self.close(session.id).await?;
        }
        self.permits.clone().try_acquire_owned().map_err(|_| {
            let most = self.limits.sessions;
            Problem::new(Kind::ServerFull, format!("there are {most} sessions already; delete one first"))
        })
    }

    pub(super) fn check_open(&self) -> Result<(), Problem> {
        match self.shutdown.is_cancelled() {
            true => Err(Problem::new(Kind::ShuttingDown, "no session can be opened any more")),
            false => Ok(()),
        }
    }

    /// The sessions in memory that have been idle for this long and that nobody watches; first the one that was not asked
    /// for longest.
    pub(super) fn idle(&self, wanted: impl Fn(&Session) -> bool, idle: Duration) -> Vec<Arc<Session>> {
        let is_idle = |session: &&Arc<Session>| wanted(session) && session.is_idle() && session.used().elapsed() > idle;
        let mut found: Vec<Arc<Session>> = self.all().iter().filter(is_idle).cloned().collect();
        found.sort_by_key(|session| session.used());
        found
    }

    pub(in crate::server) fn is_shutting_down(&self) -> bool {
        self.shutdown.is_cancelled()
    }

    /// The session with this id, from the store if it is not in memory.
    pub(in crate::server) async fn get(self: &Arc<Self>, id: &str) -> Result<Arc<Session>, Problem> {
        let known = Uuid::parse_str(id).map_err(|_| Problem::unknown_session(id))?;
        let session = match self.in_memory(known) {
            Some(session) => session,
            None => self.wake(known).await?,
        };
        session.touch();
        Ok(session)
    }

    /// The session with this id, if it is in memory.
    pub(super) fn in_memory(&self, id: Uuid) -> Option<Arc<Session>> {
        self.all().iter().find(|session| session.id == id).cloned()
    }

    /// Whether a stream follows a session.
    pub(in crate::server) fn is_followed(&self, id: Uuid) -> bool {
        self.in_memory(id).is_some_and(|session| session.streams.load(Ordering::Relaxed) > 0)
    }

    /// Ends a session and removes it. Its recording's file is then complete, or its events are no longer in the store.
    pub(in crate::server) async fn close(&self, id: Uuid) -> Result<(), Problem> {
        if let Some(known) = self.known(id) {
            return self.forget(&known).await;
        }
        self.end(id).await?;
        tracing::info!(request = requests::id(), session = %id, "a session was deleted");
        Ok(())
    }

    async fn end(&self, id: Uuid) -> Result<(), Problem> {
        let session = self.in_memory(id).ok_or_else(|| Problem::unknown_session(id))?;
        match timeout(END_WITHIN, session.end()).await {
            Ok(ended) => ended?,
            Err(_) => {
                session.stop();
                self.leave(id);
                let detail = "the session is choosing a movement, and ends after it; it is deleted already";
                return Err(Problem::new(Kind::Ending, detail));
            }
        }
        self.leave(id).map(drop).ok_or_else(|| Problem::unknown_session(id))
    }

    /// Removes a session from memory.
    pub(super) fn leave(&self, id: Uuid) -> Option<Arc<Session>> {
        let mut all = self.all();
        let index = all.iter().position(|session| session.id == id)?;
        Some(all.remove(index))
    }

    /// The server's state at the moment, with this many open connections.
    pub(in crate::server) fn present(&self, connections: usize) -> Present {
        let stored_sessions = lock(&self.known).len();
        let all = self.all();
        let of = |world| (world, all.iter().filter(|session| session.world() == world).count());
        Present {
            sessions: [WorldKind::Simulated, WorldKind::Measured, WorldKind::External].map(of),
            stored_sessions,
            streams: all.iter().map(|session| session.streams.load(Ordering::Relaxed)).sum(),
            connections,
            memory_bytes: self.budget.used(),
        }
    }

    /// Ends all sessions and waits, within limits, until their recordings are complete. Returns those that are not, and
    /// why.
    pub(in crate::server) async fn close_all(&self) -> Vec<String> {
        let all = self.all().clone();
        for session in &all {
            session.stop();
        }
        let ended = async {
            for session in &all {
                session.ended().cancelled().await;
            }
        };
        drop(timeout(SHUT_DOWN_WITHIN, ended).await);
        all.iter().filter_map(|session| session.unfinished()).collect()
    }
}

/// The size of the recordings in a directory, bytes. What cannot be examined counts as zero: writing the recording itself
/// will report the error.
fn recordings_bytes(directory: &Path) -> u64 {
    let files = std::fs::read_dir(directory).into_iter().flatten().flatten();
    let recordings = files.filter(|file| file.path().extension().is_some_and(|extension| extension == "rrd"));
    recordings.filter_map(|file| Some(file.metadata().ok()?.len())).sum()
}

/// Starts the thread of a session.
pub(super) fn spawn(body: impl FnOnce() + Send + 'static) -> Result<(), Problem> {
    let spawned = thread::Builder::new().name("session".to_owned()).spawn(body);
    spawned.map(drop).map_err(|error| Problem::new(Kind::Internal, format!("no thread for the session: {error}")))
}

pub(super) fn no_engine() -> Problem {
    Problem::new(Kind::EngineFailed, "the engine ended while it was set up")
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::server::metrics::Most;

    fn sessions(memory: usize) -> Arc<Sessions> {
        let store = Store::in_memory().expect("a store");
        let keeping =
            Keeping { store, recordings: None, scratch: None, limits: Limits::default(), scenarios: Arc::default() };
        let metrics = Arc::new(Metrics::new(&Most { connections: 1, memory_bytes: memory }));
        Sessions::new(Budget::new(memory), keeping, metrics, CancellationToken::new()).expect("sessions")
    }

    #[tokio::test]
    async fn a_panic_of_the_engine_is_a_problem_for_its_requests_and_hangs_none() {
        let sessions = sessions(usize::MAX);
        let new = |scenario: &str| NewSession {
            scenario: scenario.to_owned(),
            seed: 1,
            learners: None,
            ellipsoids: Default::default(),
            set: Vec::new(),
            enlarge: 1.0,
        };
        let session = sessions.open(new("arm-6dof")).await.expect("a session");
        session.make_steps(2, None, 0).await.expect("steps");
        session.panic();
        for _ in 0..2 {
            let problem = session.make_steps(1, None, 0).await.expect_err("a failed engine");
            assert_eq!((problem.status, problem.step), (500, Some(2)));
            assert!(problem.detail.contains("as the test asked"), "{}", problem.detail);
        }
        assert_eq!(session.result().await.expect_err("a failed engine").status, 500);
        assert_eq!(session.reports(0, usize::MAX).len(), 3, "what was made can still be read");
        assert!(session.resource().failure.is_some());
        sessions.close(session.id).await.expect("it can be deleted");
        assert_eq!(sessions.get(&session.id.to_string()).await.err().map(|problem| problem.status), Some(404));
    }

    #[tokio::test]
    async fn a_robot_elsewhere_whose_engine_panics_comes_back_as_it_was_kept() {
        let urdf = r#"<robot name="pendulum"><link name="wall"/><link name="rod"/>
            <joint name="swing" type="revolute"><parent link="wall"/><child link="rod"/>
            <axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"#;
        let new = json!({ "world": "outside", "calibration": { "robot": { "urdf": urdf } } });
        let sessions = sessions(usize::MAX);
        let session = sessions.open_external(serde_json::from_value(new).expect("a request")).await.expect("a session");
        let id = session.id.to_string();
        let told = json!({ "configuration": { "swing": 0.4 }, "measurements": { "marker": [0.1, 0.02, -0.3] } });
        let told = serde_json::from_value(told).expect("an observation");
        sessions.tell(&id, move |robot| robot.observe(&told, None)).await.expect("an answer");
        session.panic();
        let problem = session.result().await.expect_err("a failed engine");
        assert_eq!(problem.status, 500, "{}", problem.detail);
        assert_eq!(sessions.standing(&id).await.expect("it is back").status.observations, 1);
        sessions.tell(&id, |robot| robot.suggest(&Default::default())).await.expect("suggestions");
    }

    #[tokio::test]
    async fn a_report_is_written_once_for_all_its_readers() {
        let sessions = sessions(usize::MAX);
        let new = NewSession {
            scenario: "arm-6dof".to_owned(),
            seed: 1,
            learners: Some(vec!["random".to_owned()]),
            ellipsoids: Default::default(),
            set: Vec::new(),
            enlarge: 1.0,
        };
        let session = sessions.open(new).await.expect("a session");
        let made = session.make_steps(2, None, 0).await.expect("steps");
        for _ in 0..2 {
            for (made, read) in made.iter().zip(session.reports(1, 2)) {
                assert!(Arc::ptr_eq(&made.json, &read.json) && Arc::ptr_eq(&made.rows, &read.rows));
            }
        }
    }

    #[tokio::test]
    async fn full_memory_refuses_steps_until_a_session_goes() {
        let sessions = sessions(300_000);
        let new = NewSession {
            scenario: "arm-6dof".to_owned(),
            seed: 1,
            learners: Some(vec!["random".to_owned()]),
            ellipsoids: Default::default(),
            set: Vec::new(),
            enlarge: 1.0,
        };
        let (first, second) = (sessions.open(new.clone()).await.expect("one"), sessions.open(new).await.expect("two"));
        first.make_steps(300, None, 0).await.expect("the last command may overshoot");
        assert_eq!(second.make_steps(1, None, 0).await.expect_err("full").status, 503);
        sessions.close(first.id).await.expect("deleted");
        drop(first);
        // The engine's thread lets go of the session a moment after its end.
        let room = async {
            while second.make_steps(1, None, 0).await.is_err() {
                tokio::time::sleep(Duration::from_millis(10)).await;
            }
        };
        timeout(END_WITHIN, room).await.expect("room again");
    }
}
