//! Sessions with robots elsewhere, kept: one SQLite file in the data directory.
//!
//! A session is its setup and its events, and they are all that is written. Whoever appends is told once they are on the
//! disk (write-ahead log, full synchronisation); an error means that nothing was written.

mod error;
mod lock;
mod schema;

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    sync::{Mutex, MutexGuard, PoisonError},
};

use rusqlite::{Connection, OptionalExtension, Transaction, TransactionBehavior, params};
use serde::{Deserialize, Serialize};
use uuid::Uuid;

pub use error::StoreError;
use lock::Lock;

use crate::{
    ask_tell::{Event, Happened, Setup, VERSION},
    recording::EllipsoidSize,
};

/// The file within the data directory.
const FILE: &str = "sessions.sqlite";
/// How large a store in memory may be.
const MOST_MEMORY_BYTES: i64 = 1 << 30;

/// What is kept of all sessions.
pub struct Store {
    connection: Mutex<Connection>,
    /// What errors call it.
    path: PathBuf,
    /// How many sessions are kept at most.
    most: usize,
    /// Held as long as the store is.
    _lock: Option<Lock>,
}

/// A session as it was kept.
#[derive(Debug)]
pub struct Stored {
    /// What it is about.
    pub setup: Setup,
    /// How it is shown.
    pub shown: Shown,
    /// What happened.
    pub events: Vec<Event>,
    /// By `Idempotency-Key` the number of the observation that came with it.
    pub keys: BTreeMap<String, u64>,
}

/// How a session is shown, which has no bearing on what is computed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Shown {
    /// How large the ellipsoids of its recording are.
    #[serde(default)]
    pub ellipsoids: EllipsoidSize,
}

impl Store {
    /// One that keeps nothing beyond its own life.
    ///
    /// # Errors
    ///
    /// [`StoreError::Sqlite`] without memory.
    pub fn in_memory() -> Result<Self, StoreError> {
        let path = PathBuf::from("memory");
        let told = |source| StoreError::Sqlite { path: path.clone(), source };
        let connection = Connection::open_in_memory().map_err(told)?;
        let page: i64 = connection.pragma_query_value(None, "page_size", |row| row.get(0)).map_err(told)?;
        connection.pragma_update(None, "max_page_count", MOST_MEMORY_BYTES / page.max(1)).map_err(told)?;
        Self::ready(connection, path, None)
    }

    /// That of a data directory, which is made if need be, for this process alone until it ends.
    ///
    /// # Errors
    ///
    /// [`StoreError`] where the directory cannot be written, another process holds it, or a later version has written it.
    pub fn open(directory: &Path) -> Result<Self, StoreError> {
        let folder = |source| StoreError::Folder { path: directory.to_owned(), source };
        std::fs::create_dir_all(directory).map_err(folder)?;
        let lock = Lock::take(directory)?;
        let path = directory.join(FILE);
        let opened = Connection::open(&path).and_then(|connection| {
            connection.pragma_update(None, "journal_mode", "WAL")?;
            connection.pragma_update(None, "synchronous", "FULL")?;
            Ok(connection)
        });
        let opened = opened.map_err(|source| StoreError::Sqlite { path: path.clone(), source });
        opened.and_then(|connection| Self::ready(connection, path, Some(lock))).map_err(|error| match error {
            // What keeps a store from being made: the folder, or the disk that it is on.
            StoreError::Sqlite { source, .. } => folder(std::io::Error::other(source)),
            error => error,
        })
    }

    /// That of a data directory for reading alone, also while a server holds it.
    ///
    /// # Errors
    ///
    /// [`StoreError`] where there is none, or a later version has written it.
    pub fn read(directory: &Path) -> Result<Self, StoreError> {
        let path = directory.join(FILE);
        let told = |source| StoreError::Sqlite { path: path.clone(), source };
        let connection =
            Connection::open_with_flags(&path, rusqlite::OpenFlags::SQLITE_OPEN_READ_WRITE).map_err(told)?;
        connection.pragma_update(None, "query_only", true).map_err(told)?;
        schema::check(&connection, &path)?;
        Ok(Self { connection: Mutex::new(connection), path, most: usize::MAX, _lock: None })
    }

    fn ready(mut connection: Connection, path: PathBuf, lock: Option<Lock>) -> Result<Self, StoreError> {
        schema::migrate(&mut connection, &path)?;
        let told = |source| StoreError::Sqlite { path: path.clone(), source };
        connection.pragma_update(None, "foreign_keys", true).map_err(told)?;
        Ok(Self { connection: Mutex::new(connection), path, most: usize::MAX, _lock: lock })
    }

    /// The same, but that it takes in no session beyond so many.
    pub fn holding(self, most: usize) -> Self {
        Self { most, ..self }
    }

    /// Keeps a new session, and what happened in it so far.
    ///
    /// # Errors
    ///
    /// [`StoreError`]: it is not kept then.
    pub fn insert(
        &self,
        id: Uuid,
        made_s: f64,
        setup: &Setup,
        shown: Shown,
        events: &[Event],
    ) -> Result<(), StoreError> {
        let (setup, shown) = (json(setup), json(&shown));
        let mut connection = self.connection();
        let count = connection.query_row("SELECT count(*) FROM session", [], |row| row.get::<_, i64>(0));
        if usize::try_from(count.map_err(self.told())?).is_ok_and(|count| count >= self.most) {
            return Err(StoreError::Full(self.most));
        }
        let written = (|| {
            let transaction = connection.transaction_with_behavior(TransactionBehavior::Immediate)?;
            transaction.execute(
                "INSERT INTO session (id, made_s, form, setup, shown) VALUES (?1, ?2, ?3, ?4, ?5)",
                params![id.to_string(), made_s, VERSION, setup, shown],
            )?;
            insert_events(&transaction, id, 0, events, None)?;
            transaction.commit()
        })();
        written.map_err(self.told())
    }

    /// Appends events to a session that has `revision` of them. A `key` is that of the observation among them.
    ///
    /// # Errors
    ///
    /// [`StoreError`]: none is appended then.
    pub fn append(&self, id: Uuid, revision: usize, events: &[Event], key: Option<&str>) -> Result<(), StoreError> {
        let mut connection = self.connection();
        let written = (|| {
            let transaction = connection.transaction_with_behavior(TransactionBehavior::Immediate)?;
            insert_events(&transaction, id, revision, events, key)?;
            transaction.commit()
        })();
        written.map_err(self.told())
    }

    /// A session as it was kept; `None` if there is none of that id.
    ///
    /// # Errors
    ///
    /// [`StoreError`] where it cannot be read.
    pub fn load(&self, id: Uuid) -> Result<Option<Stored>, StoreError> {
        let connection = self.connection();
        let session = connection.query_row(
            "SELECT number, form, setup, shown FROM session WHERE id = ?1",
            [id.to_string()],
            |row| {
                Ok((row.get::<_, i64>(0)?, row.get::<_, u32>(1)?, row.get::<_, String>(2)?, row.get::<_, String>(3)?))
            },
        );
        let Some((number, form, setup, shown)) = session.optional().map_err(self.told())? else { return Ok(None) };
        if form > VERSION {
            return Err(StoreError::Newer { path: self.path.clone(), found: form, known: VERSION });
        }
        let rows = (|| {
            let mut select = connection
                .prepare_cached("SELECT event, idempotency_key FROM event WHERE session = ?1 ORDER BY number")?;
            let rows =
                select.query_map([number], |row| Ok((row.get::<_, String>(0)?, row.get::<_, Option<String>>(1)?)))?;
            rows.collect::<Result<Vec<_>, _>>()
        })();
        let (mut events, mut keys, mut observations) = (Vec::new(), BTreeMap::new(), 0);
        for (event, key) in rows.map_err(self.told())? {
            let event: Event = self.parsed(&event)?;
            observations += u64::from(matches!(event.happened, Happened::Observed { .. }));
            events.push(event);
            keys.extend(key.map(|key| (key, observations)));
        }
        Ok(Some(Stored { setup: self.parsed(&setup)?, shown: self.parsed(&shown)?, events, keys }))
    }

    /// The ids of all sessions and when they were made, seconds since 1970, oldest first.
    ///
    /// # Errors
    ///
    /// [`StoreError`] where they cannot be read.
    pub fn all(&self) -> Result<Vec<(Uuid, f64)>, StoreError> {
        let connection = self.connection();
        let rows = (|| {
            let mut select = connection.prepare_cached("SELECT id, made_s FROM session ORDER BY number")?;
            let rows = select.query_map([], |row| Ok((row.get::<_, String>(0)?, row.get(1)?)))?;
            rows.collect::<Result<Vec<_>, _>>()
        })();
        let parsed = |(id, made_s): (String, f64)| match Uuid::parse_str(&id) {
            Ok(id) => Ok((id, made_s)),
            Err(error) => Err(self.damaged(error)),
        };
        rows.map_err(self.told())?.into_iter().map(parsed).collect()
    }

    /// Forgets a session and all its events.
    ///
    /// # Errors
    ///
    /// [`StoreError`]: it is kept then.
    pub fn delete(&self, id: Uuid) -> Result<(), StoreError> {
        let deleted = self.connection().execute("DELETE FROM session WHERE id = ?1", [id.to_string()]);
        deleted.map(drop).map_err(self.told())
    }

    fn connection(&self) -> MutexGuard<'_, Connection> {
        // A transaction that was left is rolled back when it is dropped.
        self.connection.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn told(&self) -> impl Fn(rusqlite::Error) -> StoreError + Copy + use<'_> {
        |source| StoreError::Sqlite { path: self.path.clone(), source }
    }

    fn parsed<T: for<'a> Deserialize<'a>>(&self, text: &str) -> Result<T, StoreError> {
        serde_json::from_str(text).map_err(|error| self.damaged(error))
    }

    fn damaged(&self, error: impl std::fmt::Display) -> StoreError {
        StoreError::Damaged { path: self.path.clone(), what: error.to_string() }
    }
}

fn insert_events(
    transaction: &Transaction<'_>,
    id: Uuid,
    revision: usize,
    events: &[Event],
    key: Option<&str>,
) -> Result<(), rusqlite::Error> {
    let mut insert = transaction.prepare_cached(
        "INSERT INTO event (session, number, event, idempotency_key)
         VALUES ((SELECT number FROM session WHERE id = ?1), ?2, ?3, ?4)",
    )?;
    for (number, event) in (revision as i64 + 1..).zip(events) {
        let key = key.filter(|_| matches!(event.happened, Happened::Observed { .. }));
        insert.execute(params![id.to_string(), number, json(event), key])?;
    }
    Ok(())
}

/// What is kept holds numbers, texts and lists alone, so that it can be written.
fn json(value: &impl Serialize) -> String {
    serde_json::to_string(value).unwrap_or_default()
}

#[cfg(test)]
mod tests;
