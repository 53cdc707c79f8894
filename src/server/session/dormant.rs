//! Sessions with robots elsewhere come and go between memory and the store.
//!
//! All of them are in the store as long as they live. One that nobody has asked for in a while leaves memory, and comes back,
//! by replaying its events, when it is asked for.

use std::{
    collections::BTreeMap,
    sync::{Arc, Mutex, mpsc},
    time::{Duration, Instant},
};

use tokio::{
    sync::{OwnedSemaphorePermit, oneshot},
    task::spawn_blocking,
    time::{sleep, timeout},
};
use uuid::Uuid;

use super::{
    DamagedSession, Engine, ExternalRobot, NewOutsideSession, Session, SessionResource, Sessions, Snapshot,
    external::{self, Beginning, Origin},
    known::{Known, MOVED_WITHIN, Summary},
    lock,
    registry::{END_WITHIN, no_engine, spawn},
};
use crate::server::{
    blocking::run_blocking,
    clock::now_s,
    problem::{Kind, Problem},
    requests,
    store::{Shown, Store, StoreError, Stored},
};
use body_schema_ask_tell as ask_tell;
use body_schema_ask_tell::{MOST_EVENTS, ReplayError, Setup, Status, VERSION};
use body_schema_scenario::WorldKind;

/// The number of retries of a request whose session left memory just before it came.
const ATTEMPTS: usize = 3;
/// The time that a request which needs room waits for another engine to leave.
const LEFT_WITHIN: Duration = Duration::from_secs(2);
/// The number of sessions, and then the time, for which a list checks that they are as they were written.
const LOOKED_AT_FIRST: usize = 8;
const LOOKED_AT_WITHIN: Duration = Duration::from_millis(20);
/// The least interval between searches for idle sessions.
const LOOK_EVERY: Duration = Duration::from_secs(60);

/// A part of the list of all sessions.
#[derive(Default)]
pub(in crate::server) struct Listed {
    pub(in crate::server) sessions: Vec<SessionResource>,
    /// Those that cannot be loaded.
    pub(in crate::server) damaged: Vec<DamagedSession>,
    /// The id after which there are more.
    pub(in crate::server) next: Option<Uuid>,
}

/// A session in memory, or one that is in the store alone.
type InMemory = Result<Arc<Session>, Arc<Known>>;

impl Sessions {
    /// Opens a session with a robot elsewhere. It is in the store before this returns.
    pub(in crate::server) async fn open_external(&self, new: NewOutsideSession) -> Result<Arc<Session>, Problem> {
        self.check_open()?;
        let NewOutsideSession { calibration, agent, seed, ellipsoids, events, version, .. } = new;
        if let Some(found) = version.filter(|version| *version > VERSION) {
            let newer = ReplayError::Version { found, known: VERSION };
            return Err(Problem::new(Kind::InvalidValue, newer.to_string()).field("version"));
        }
        if events.len() > MOST_EVENTS {
            let detail = format!("{} events are more than the {MOST_EVENTS} that a session may have", events.len());
            return Err(Problem::new(Kind::InvalidValue, detail).field("events"));
        }
        let known = Arc::new(Known::new(Uuid::new_v4(), now_s()));
        let origin = Origin::New(Setup { calibration, agent, seed }, Shown { ellipsoids }, events);
        self.budget.check()?;
        let session = self.begin(&known, origin).await?;
        tracing::info!(request = requests::id(), session = %session.id, "a session with a robot elsewhere was opened");
        lock(&self.known).push(known);
        Ok(session)
    }

    pub(super) fn known(&self, id: Uuid) -> Option<Arc<Known>> {
        lock(&self.known).iter().find(|known| known.id == id).cloned()
    }

    /// Loads a session into memory, whether or not the caller still waits.
    pub(super) async fn wake(self: &Arc<Self>, id: Uuid) -> Result<Arc<Session>, Problem> {
        let all = self.clone();
        let waking = async move { all.bring_back(id).await };
        done_anyway(waking, "what happened in the session is still being replayed; ask again later").await
    }

    async fn bring_back(&self, id: Uuid) -> Result<Arc<Session>, Problem> {
        let unknown = || Problem::unknown_session(id);
        let known = self.known(id).ok_or_else(unknown)?;
        let _moving = known.still().await?;
        // Others may have been waiting for the same.
        if let Some(session) = self.in_memory(id) {
            return Ok(session);
        }
        self.check_open()?;
        let stored = self.load(id).await?.ok_or_else(unknown)?;
        let session = self.begin(&known, Origin::Store(stored)).await?;
        tracing::info!(request = requests::id(), session = %id, "a session is back in memory");
        Ok(session)
    }

    async fn begin(&self, known: &Known, origin: Origin) -> Result<Arc<Session>, Problem> {
        let permit = self.place().await?;
        let Known { id, made_s, .. } = *known;
        let shared = Arc::new(self.shared(id));
        let (store, most) = (self.store.clone(), self.limits.most());
        let beginning = Beginning { id, origin, made_s, store, most, shared: shared.clone(), permit };
        let (jobs, receiver) = mpsc::channel();
        let (opened, opening) = oneshot::channel();
        spawn(move || external::run(beginning, &receiver, opened))?;
        let description = opening.await.map_err(|_| no_engine())??;
        let engine = Engine::ExternalRobot(jobs);
        let (used, watchers, streams) = (Mutex::new(Instant::now()), 0.into(), 0.into());
        let (together, completed, report) = Default::default();
        let file = None;
        Ok(self.enter(Session {
            id,
            description,
            file,
            made_s,
            engine,
            shared,
            used,
            watchers,
            streams,
            together,
            completed,
            report,
        }))
    }

    /// A place in memory, if necessary that of the session that was not asked for longest.
    async fn place(&self) -> Result<OwnedSemaphorePermit, Problem> {
        if let Ok(permit) = self.places.clone().try_acquire_owned() {
            return Ok(permit);
        }
        for session in self.idle(Session::is_external, Duration::ZERO) {
            if self.put_to_sleep(&session).await
                && let Ok(permit) = self.places.clone().try_acquire_owned()
            {
                return Ok(permit);
            }
        }
        self.places.clone().try_acquire_owned().map_err(|_| {
            Problem::new(Kind::ServerFull, "as many sessions are watched and busy as there may be; try again later")
        })
    }

    /// Removes a session from memory, unless it is followed, at work, or being moved already. Returns whether it has left.
    async fn put_to_sleep(&self, session: &Arc<Session>) -> bool {
        let Some(known) = self.known(session.id) else { return false };
        let Ok(mut moving) = known.moving.try_lock() else { return false };
        if !session.is_idle() || self.leave(session.id).is_none() {
            return false;
        }
        *lock(&known.resource) = Some(SessionResource { recording: None, ..session.resource() });
        session.stop();
        // Nobody else may write its events meanwhile.
        *moving = Some(session.ended().clone());
        let has_left = timeout(LEFT_WITHIN, session.ended().cancelled()).await.is_ok();
        tracing::info!(session = %session.id, has_left, "a session leaves memory");
        has_left
    }

    /// Removes idle sessions from memory, now and then, for ever.
    pub(in crate::server) async fn watch_over(&self) {
        let known = lock(&self.known).clone();
        for known in known {
            self.look_at(&known).await;
        }
        loop {
            sleep(self.limits.idle_after.min(LOOK_EVERY)).await;
            for session in self.idle(Session::is_external, self.limits.idle_after) {
                self.put_to_sleep(&session).await;
            }
        }
    }

    /// Forgets a session in the store and in memory.
    pub(super) async fn forget(&self, known: &Known) -> Result<(), Problem> {
        let _moving = known.still().await?;
        let (store, id) = (self.store.clone(), known.id);
        self.known(id).ok_or_else(|| Problem::unknown_session(id))?;
        run_blocking(move || store.delete(id)).await?;
        lock(&self.known).retain(|other| other.id != id);
        tracing::info!(request = requests::id(), session = %id, "a session was deleted");
        if let Some(session) = self.leave(id) {
            session.stop();
            // An engine that is choosing ends a little later, and can write nothing any more.
            drop(timeout(END_WITHIN, session.ended().cancelled()).await);
        }
        Ok(())
    }

    /// Runs work on the engine of a robot elsewhere, which is loaded for it if necessary.
    pub(in crate::server) async fn tell<T: Send + 'static>(
        self: &Arc<Self>,
        id: &str,
        work: impl Fn(&mut ExternalRobot) -> Result<T, Problem> + Clone + Send + 'static,
    ) -> Result<T, Problem> {
        let mut attempts = 1..ATTEMPTS;
        loop {
            let session = self.get(id).await?.watch();
            match session.tell(work.clone()).await {
                Err(problem) if problem.is(Kind::Dormant) && attempts.next().is_some() => {}
                outcome => return outcome,
            }
        }
    }

    /// Excludes an observation or includes it again, whether or not the caller still waits, and returns the new status.
    pub(in crate::server) async fn mark(
        self: &Arc<Self>,
        id: &str,
        number: u64,
        excluded: bool,
    ) -> Result<Status, Problem> {
        let (all, id) = (self.clone(), id.to_owned());
        let marking = async move { all.tell(&id, move |robot| robot.mark(number, excluded)).await };
        let later = "what happened in the session is being replayed, and then it is done; ask again later";
        done_anyway(marking, later).await
    }

    /// The status of a session with a robot elsewhere, also while its engine is busy.
    pub(in crate::server) async fn standing(self: &Arc<Self>, id: &str) -> Result<Arc<Snapshot>, Problem> {
        let session = self.get(id).await?;
        let standing = session.standing().borrow().clone();
        standing.ok_or_else(|| Problem::not_outside(id))
    }

    /// The sessions after the given id, oldest first and at most `most`; those among them that cannot be loaded; and the id of the
    /// last, if there are more.
    pub(in crate::server) async fn list(&self, after: Option<Uuid>, most: usize) -> Result<Listed, Problem> {
        let all = self.all().clone();
        let known = lock(&self.known).clone();
        let steps = all.iter().filter(|session| !session.is_external());
        let mut every: Vec<(f64, Uuid, InMemory)> =
            steps.map(|session| (session.made_s, session.id, Ok(session.clone()))).collect();
        every.extend(known.into_iter().map(|known| {
            let awake = all.iter().find(|session| session.id == known.id);
            (known.made_s, known.id, awake.cloned().ok_or(known))
        }));
        every.sort_by(|(a, ..), (b, ..)| a.total_cmp(b));
        let first = match after {
            None => 0,
            Some(after) => {
                let found = every.iter().position(|(_, id, _)| *id == after);
                1 + found.ok_or_else(|| {
                    let detail =
                        format!("there is no session `{after}` after which to go on; begin anew without `after`");
                    Problem::new(Kind::UnknownSession, detail).field("after")
                })?
            }
        };
        let page = every.get(first..).unwrap_or_default();
        let has_more = page.len() > most;
        let page = &page[..most.min(page.len())];
        let asleep: Vec<Arc<Known>> = page.iter().filter_map(|(.., session)| session.as_ref().err().cloned()).collect();
        self.look_at_some(&asleep).await;
        let mut shown = self.described(&asleep).await?;
        let mut listed = Listed { next: page.last().filter(|_| has_more).map(|(_, id, _)| *id), ..Listed::default() };
        for (_, id, session) in page {
            match session {
                Ok(session) => listed.sessions.push(session.resource()),
                // One that cannot be read keeps nobody from the others.
                Err(_) => match shown.remove(id) {
                    Some(Ok(resource)) => listed.sessions.push(resource),
                    Some(Err(why)) => listed.damaged.push(DamagedSession { id: id.to_string(), detail: why }),
                    // It was deleted meanwhile.
                    None => {}
                },
            }
        }
        Ok(listed)
    }

    /// Sessions as they can be shown without replaying them, or the reasons why they cannot be loaded.
    async fn described(
        &self,
        asleep: &[Arc<Known>],
    ) -> Result<BTreeMap<Uuid, Result<SessionResource, String>>, Problem> {
        let (store, asleep) = (self.store.clone(), asleep.to_vec());
        run_blocking(move || {
            let mut shown = BTreeMap::new();
            for known in asleep {
                let remembered = lock(&known.resource).clone();
                let found = match (known.damage.get(), remembered) {
                    (Some(Some(why)), _) => Err(why.clone()),
                    (_, Some(resource)) => Ok(resource),
                    _ => match summed_up(&store, known.id) {
                        Ok(None) => continue,
                        Ok(Some(resource)) => {
                            *lock(&known.resource) = Some(resource.clone());
                            Ok(resource)
                        }
                        Err(why) => Err(why),
                    },
                };
                shown.insert(known.id, found);
            }
            Ok::<_, Problem>(shown)
        })
        .await
    }

    /// Checks sessions that were not checked yet: a few of many; the others are checked in the background.
    async fn look_at_some(&self, asleep: &[Arc<Known>]) {
        let begun = Instant::now();
        let new = asleep.iter().filter(|known| known.damage.get().is_none());
        for (number, known) in new.enumerate() {
            if number >= LOOKED_AT_FIRST && begun.elapsed() > LOOKED_AT_WITHIN {
                break;
            }
            self.look_at(known).await;
        }
    }

    /// Checks whether a session is as it was written.
    async fn look_at(&self, known: &Arc<Known>) {
        if known.damage.get().is_some() {
            return;
        }
        let (store, id) = (self.store.clone(), known.id);
        let looked = spawn_blocking(move || store.load(id).map(drop)).await;
        let damage = match looked {
            Ok(Ok(())) => None,
            Ok(Err(error @ (StoreError::Damaged { .. } | StoreError::Newer { .. }))) => {
                Some(Problem::from(error).into_detail())
            }
            // The disk may be there again later.
            Ok(Err(_)) | Err(_) => return,
        };
        drop(known.damage.set(damage));
    }

    async fn load(&self, id: Uuid) -> Result<Option<Stored>, Problem> {
        let store = self.store.clone();
        run_blocking(move || store.load(id)).await
    }
}

/// Runs work to its end whether or not the caller still waits; a caller that waits too long gets a problem that says
/// `later`.
async fn done_anyway<T: Send + 'static>(
    work: impl Future<Output = Result<T, Problem>> + Send + 'static,
    later: &'static str,
) -> Result<T, Problem> {
    match timeout(MOVED_WITHIN, tokio::spawn(requests::carried(work))).await {
        Ok(done) => done.unwrap_or_else(|_| Err(no_engine())),
        Err(_) => Err(Problem::new(Kind::Busy, later)),
    }
}

/// A session in the store as it can be shown; `None` if it is no longer there.
fn summed_up(store: &Store, id: Uuid) -> Result<Option<SessionResource>, String> {
    let told = |error: StoreError| Problem::from(error).into_detail();
    let noted = store.summary(id).map_err(told)?;
    let noted = noted.and_then(|(text, step)| Some((serde_json::from_str::<Summary>(&text).ok()?, step)));
    let (Summary { description, channels }, step) = match noted {
        Some(noted) => noted,
        None => {
            let Some(stored) = store.load(id).map_err(told)? else { return Ok(None) };
            let step = stored.counted();
            let session = ask_tell::Session::replay(stored.setup, Vec::new()).map_err(|error| error.to_string())?;
            let summary = Summary::of(&session);
            // It is found out again where it cannot be noted.
            drop(store.note(id, &summary.text(), &stored.events));
            (summary, step)
        }
    };
    Ok(Some(SessionResource {
        id: id.to_string(),
        world: WorldKind::External,
        description,
        step,
        remaining: None,
        recording: None,
        file: None,
        recording_failure: None,
        failure: None,
        status: None,
        channels,
    }))
}
