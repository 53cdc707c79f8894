//! All sessions of a server.

use std::{
    path::PathBuf,
    sync::{Arc, Mutex, atomic::Ordering, mpsc},
    thread,
    time::{Duration, Instant},
};

use serde::{Deserialize, Serialize};
use tokio::{
    sync::{OwnedSemaphorePermit, Semaphore, oneshot},
    time::timeout,
};
use tokio_util::sync::CancellationToken;
use utoipa::ToSchema;
use uuid::Uuid;

use super::{Budget, Session, Shared, engine, lock};
use crate::{
    recording::EllipsoidSize,
    server::{
        IDLE_AFTER, MAX_SESSIONS,
        problem::{Kind, Problem},
    },
};

/// How long a session may take to end after it was told to.
const END_WITHIN: Duration = Duration::from_secs(10);

/// What a session is made from.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct NewSession {
    /// Name of a built-in scenario.
    #[schema(example = "arm-6dof")]
    pub scenario: String,
    /// Seed of all random streams.
    #[serde(default = "first_seed")]
    #[schema(default = 1)]
    pub seed: u64,
    /// The learners to compare, by their names in the scenario; all of the scenario's if absent or null.
    #[serde(default)]
    #[schema(example = json!(["active", "random"]))]
    pub learners: Option<Vec<String>>,
    /// How large the ellipsoids of its recording are.
    #[serde(default)]
    pub ellipsoids: EllipsoidSize,
}

fn first_seed() -> u64 {
    1
}

/// All sessions of a server.
pub(in crate::server) struct Sessions {
    /// In the order of their making; few enough to search one by one.
    all: Mutex<Vec<Arc<Session>>>,
    /// One for each session, also while it ends.
    permits: Arc<Semaphore>,
    budget: Arc<Budget>,
    data_dir: Option<PathBuf>,
    shutdown: CancellationToken,
}

impl Sessions {
    pub(in crate::server) fn new(budget: Budget, data_dir: Option<PathBuf>, shutdown: CancellationToken) -> Self {
        Self {
            all: Mutex::default(),
            permits: Arc::new(Semaphore::new(MAX_SESSIONS)),
            budget: Arc::new(budget),
            data_dir,
            shutdown,
        }
    }

    /// Opens a session: a thread, an experiment, its recording.
    pub(in crate::server) async fn open(&self, new: NewSession) -> Result<Arc<Session>, Problem> {
        let permit = self.permit().await?;
        let id = Uuid::new_v4();
        let shared = Arc::new(Shared::new(self.shutdown.child_token(), self.budget.clone()));
        // An unknown scenario's name becomes part of no path: the engine refuses it before it opens the file.
        let file = self.data_dir.as_ref().map(|_| format!("{}-seed{}-{id}.rrd", new.scenario, new.seed));
        let setup = engine::Setup {
            id,
            scenario: new.scenario,
            seed: new.seed,
            learners: new.learners,
            ellipsoids: new.ellipsoids,
            file: self.data_dir.as_ref().zip(file.as_ref()).map(|(directory, file)| directory.join(file)),
            shared: shared.clone(),
            permit,
        };
        let (commands, receiver) = mpsc::channel();
        let (opened, opening) = oneshot::channel();
        thread::Builder::new()
            .name("session".to_owned())
            .spawn(move || engine::run(setup, receiver, opened))
            .map_err(|error| Problem::new(Kind::Internal, format!("no thread for the session: {error}")))?;
        let description =
            opening.await.map_err(|_| Problem::new(Kind::EngineFailed, "the engine ended while it was set up"))??;
        let session = Arc::new(Session {
            id,
            description,
            file,
            commands,
            shared,
            used: Mutex::new(Instant::now()),
            watchers: 0.into(),
        });
        lock(&self.all).push(session.clone());
        // A shutdown that began meanwhile has not seen this session.
        if self.shutdown.is_cancelled() {
            session.stop();
        }
        Ok(session)
    }

    /// A place for one more session, if need be that of the one that has been idle longest.
    async fn permit(&self) -> Result<OwnedSemaphorePermit, Problem> {
        if self.shutdown.is_cancelled() {
            return Err(Problem::new(Kind::ShuttingDown, "no session can be opened any more"));
        }
        if let Ok(permit) = self.permits.clone().try_acquire_owned() {
            return Ok(permit);
        }
        let idle = {
            let all = lock(&self.all);
            let used = |session: &Arc<Session>| *lock(&session.used);
            let unwatched = all.iter().filter(|session| session.watchers.load(Ordering::Relaxed) == 0);
            unwatched
                .min_by_key(|session| used(session))
                .filter(|session| used(session).elapsed() > IDLE_AFTER)
                .cloned()
        };
        if let Some(session) = idle {
            self.close(session.id).await?;
        }
        self.permits.clone().try_acquire_owned().map_err(|_| {
            Problem::new(Kind::ServerFull, format!("there are {MAX_SESSIONS} sessions already; delete one first"))
        })
    }

    pub(in crate::server) fn is_shutting_down(&self) -> bool {
        self.shutdown.is_cancelled()
    }

    /// All sessions, oldest first.
    pub(in crate::server) fn all(&self) -> Vec<Arc<Session>> {
        lock(&self.all).clone()
    }

    /// The session of that id.
    pub(in crate::server) fn get(&self, id: &str) -> Result<Arc<Session>, Problem> {
        let found = Uuid::parse_str(id).ok().and_then(|id| lock(&self.all).iter().find(|s| s.id == id).cloned());
        let session = found.ok_or_else(|| Problem::unknown_session(id))?;
        session.touch();
        Ok(session)
    }

    /// Ends a session and forgets it; its recording's file is complete afterwards.
    pub(in crate::server) async fn close(&self, id: Uuid) -> Result<(), Problem> {
        let session = {
            let mut all = lock(&self.all);
            let index = all.iter().position(|session| session.id == id);
            all.remove(index.ok_or_else(|| Problem::unknown_session(id))?)
        };
        session.stop();
        // An engine in the middle of a step ends a little later; whoever deletes need not wait for ever.
        drop(timeout(END_WITHIN, session.ended().cancelled()).await);
        Ok(())
    }

    /// Ends all sessions and waits, within bounds, until their recordings are complete.
    pub(in crate::server) async fn close_all(&self) {
        let all = self.all();
        for session in &all {
            session.stop();
        }
        let ended = async {
            for session in &all {
                session.ended().cancelled().await;
            }
        };
        drop(timeout(END_WITHIN, ended).await);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_panic_of_the_engine_is_a_problem_for_its_requests_and_hangs_none() {
        let sessions = Sessions::new(Budget::new(usize::MAX), None, CancellationToken::new());
        let new = |scenario: &str| NewSession {
            scenario: scenario.to_owned(),
            seed: 1,
            learners: None,
            ellipsoids: EllipsoidSize::default(),
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
        assert_eq!(sessions.get(&session.id.to_string()).err().map(|problem| problem.status), Some(404));
    }

    #[tokio::test]
    async fn a_report_is_written_once_for_all_its_readers() {
        let sessions = Sessions::new(Budget::new(usize::MAX), None, CancellationToken::new());
        let new = NewSession {
            scenario: "arm-6dof".to_owned(),
            seed: 1,
            learners: Some(vec!["random".to_owned()]),
            ellipsoids: EllipsoidSize::default(),
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
        let sessions = Sessions::new(Budget::new(300_000), None, CancellationToken::new());
        let new = NewSession {
            scenario: "arm-6dof".to_owned(),
            seed: 1,
            learners: Some(vec!["random".to_owned()]),
            ellipsoids: EllipsoidSize::default(),
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
