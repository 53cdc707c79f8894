//! Sessions with robots elsewhere come and go between memory and the store.
//!
//! All of them are in the store as long as they live. One that nobody has asked for in a while leaves memory, and comes back,
//! by replaying its events, when it is asked for.

use std::{
    sync::{Arc, Mutex, mpsc},
    time::{Duration, Instant},
};

use tokio::{
    sync::{Mutex as AsyncMutex, OwnedSemaphorePermit, oneshot},
    task::spawn_blocking,
    time::{sleep, timeout},
};
use uuid::Uuid;

use super::{
    DamagedSession, Elsewhere, Engine, NewOutsideSession, Session, SessionResource, Sessions, Standing, lock,
    outside::{self, Beginning, Origin, now_s},
    registry::{END_WITHIN, no_engine, spawn},
};
use crate::{
    ask_tell::{self, MOST_EVENTS, ReplayError, Setup, VERSION},
    scenario::WorldKind,
    server::{
        aside::aside,
        problem::{Kind, Problem},
        requests,
        store::{Shown, Stored},
    },
};

/// So often a request is tried again whose session left memory just before it came.
const ATTEMPTS: usize = 3;
/// How often it is looked for sessions that nobody asks for, at most.
const LOOK_EVERY: Duration = Duration::from_secs(60);

/// A session that is in the store.
pub(super) struct Known {
    id: Uuid,
    made_s: f64,
    /// Held while it comes or goes, so that it is never in memory twice.
    moving: AsyncMutex<()>,
    /// As it was when it left memory, or without its status as it was described at first.
    resource: Mutex<Option<SessionResource>>,
}

impl Known {
    pub(super) fn new(id: Uuid, made_s: f64) -> Self {
        Self { id, made_s, moving: AsyncMutex::new(()), resource: Mutex::new(None) }
    }
}

impl Sessions {
    /// Opens a session with a robot elsewhere. It is in the store before this returns.
    pub(in crate::server) async fn open_outside(&self, new: NewOutsideSession) -> Result<Arc<Session>, Problem> {
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
        let session = self.begin(&known, origin).await?;
        tracing::info!(request = requests::id(), session = %session.id, "a session with a robot elsewhere was opened");
        lock(&self.known).push(known);
        Ok(session)
    }

    pub(super) fn known(&self, id: Uuid) -> Option<Arc<Known>> {
        lock(&self.known).iter().find(|known| known.id == id).cloned()
    }

    /// Brings a session back to memory.
    pub(super) async fn wake(&self, id: Uuid) -> Result<Arc<Session>, Problem> {
        let unknown = || Problem::unknown_session(id);
        let known = self.known(id).ok_or_else(unknown)?;
        let _moving = known.moving.lock().await;
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
        spawn(move || outside::run(beginning, &receiver, opened))?;
        let description = opening.await.map_err(|_| no_engine())??;
        let engine = Engine::Elsewhere(jobs);
        let (used, watchers, streams) = (Mutex::new(Instant::now()), 0.into(), 0.into());
        let (together, report) = (Default::default(), Default::default());
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
            report,
        }))
    }

    /// A place in memory, if need be that of the one that was not asked for longest.
    async fn place(&self) -> Result<OwnedSemaphorePermit, Problem> {
        for _ in 0..ATTEMPTS {
            if let Ok(permit) = self.places.clone().try_acquire_owned() {
                return Ok(permit);
            }
            let Some(session) = self.idle_longest(Session::is_elsewhere, Duration::ZERO) else { break };
            self.put_to_sleep(&session).await;
        }
        self.places.clone().try_acquire_owned().map_err(|_| {
            Problem::new(Kind::ServerFull, "as many sessions are watched and busy as there may be; try again later")
        })
    }

    /// Takes a session out of memory, unless somebody watches it.
    async fn put_to_sleep(&self, session: &Arc<Session>) {
        let Some(known) = self.known(session.id) else { return };
        let _moving = known.moving.lock().await;
        if session.is_watched() {
            return;
        }
        *lock(&known.resource) = Some(SessionResource { recording: None, ..session.resource() });
        self.leave(session.id);
        session.stop();
        // However long that takes: nobody else may write its events meanwhile.
        session.ended().cancelled().await;
        tracing::info!(session = %session.id, "a session has left memory");
    }

    /// Takes sessions out of memory that nobody asks for, now and then, for ever.
    pub(in crate::server) async fn watch_over(&self) {
        loop {
            sleep(self.limits.idle_after.min(LOOK_EVERY)).await;
            while let Some(session) = self.idle_longest(Session::is_elsewhere, self.limits.idle_after) {
                self.put_to_sleep(&session).await;
            }
        }
    }

    /// Forgets a session in the store and in memory.
    pub(super) async fn forget(&self, known: &Known) -> Result<(), Problem> {
        let _moving = known.moving.lock().await;
        let (store, id) = (self.store.clone(), known.id);
        self.known(id).ok_or_else(|| Problem::unknown_session(id))?;
        aside(move || store.delete(id)).await?;
        lock(&self.known).retain(|other| other.id != id);
        tracing::info!(request = requests::id(), session = %id, "a session was deleted");
        if let Some(session) = self.leave(id) {
            session.stop();
            // An engine that is choosing ends a little later, and can write nothing any more.
            drop(timeout(END_WITHIN, session.ended().cancelled()).await);
        }
        Ok(())
    }

    /// Has something done by the engine of a robot elsewhere, which comes back to memory for it if need be.
    pub(in crate::server) async fn tell<T: Send + 'static>(
        &self,
        id: &str,
        work: impl Fn(&mut Elsewhere) -> Result<T, Problem> + Clone + Send + 'static,
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

    /// How a session with a robot elsewhere stands, also while its engine is busy.
    pub(in crate::server) async fn standing(&self, id: &str) -> Result<Arc<Standing>, Problem> {
        let session = self.get(id).await?;
        let standing = session.standing().borrow().clone();
        standing.ok_or_else(|| Problem::not_outside(id))
    }

    /// All sessions, oldest first, and those that are damaged.
    pub(in crate::server) async fn list(&self) -> Result<(Vec<SessionResource>, Vec<DamagedSession>), Problem> {
        let all = lock(&self.all).clone();
        let steps = all.iter().filter(|session| !session.is_elsewhere());
        let mut resources: Vec<(f64, SessionResource)> =
            steps.map(|session| (session.made_s, session.resource())).collect();
        let (known, mut damaged) = (lock(&self.known).clone(), Vec::new());
        for known in known {
            let resource = match all.iter().find(|session| session.id == known.id) {
                Some(session) => Some(session.resource()),
                None => match self.described(&known).await {
                    // One that cannot be read keeps nobody from the others.
                    Err(problem) if problem.is(Kind::Damaged) => {
                        damaged.push(DamagedSession { id: known.id.to_string(), detail: problem.detail.into() });
                        None
                    }
                    described => described?,
                },
            };
            resources.extend(resource.map(|resource| (known.made_s, resource)));
        }
        resources.sort_by(|(a, _), (b, _)| a.total_cmp(b));
        Ok((resources.into_iter().map(|(_, resource)| resource).collect(), damaged))
    }

    /// A session as it can be shown without replaying it. `None` for one that this program cannot take up: who asks for it is
    /// told why.
    async fn described(&self, known: &Known) -> Result<Option<SessionResource>, Problem> {
        let remembered = lock(&known.resource).clone();
        if remembered.is_some() {
            return Ok(remembered);
        }
        let (Some(Stored { setup, events, .. }), id) = (self.load(known.id).await?, known.id) else { return Ok(None) };
        let opened =
            spawn_blocking(move || ask_tell::Session::replay(setup, Vec::new())).await.map_err(|_| no_engine())?;
        let Ok(session) = opened else { return Ok(None) };
        let resource = SessionResource {
            id: id.to_string(),
            world: WorldKind::Outside,
            description: session.description().clone(),
            step: counted(&events),
            remaining: None,
            recording: None,
            file: None,
            recording_failure: None,
            failure: None,
            status: None,
            channels: session.channels().to_vec(),
        };
        *lock(&known.resource) = Some(resource.clone());
        Ok(Some(resource))
    }

    async fn load(&self, id: Uuid) -> Result<Option<Stored>, Problem> {
        let store = self.store.clone();
        aside(move || store.load(id)).await
    }
}

/// How many observations of these events count.
fn counted(events: &[ask_tell::Event]) -> u64 {
    use ask_tell::Happened;
    let mut excluded = std::collections::BTreeSet::new();
    let mut told = 0;
    for event in events {
        match &event.happened {
            Happened::Observed { .. } => told += 1,
            Happened::Excluded { observation } => drop(excluded.insert(*observation)),
            Happened::Included { observation } => drop(excluded.remove(observation)),
            _ => {}
        }
    }
    told - excluded.len() as u64
}
