//! Sessions with robots elsewhere, kept: one SQLite file in the data directory.
//!
//! A session is its setup and its events, and only these are written. Appending returns once they are on the disk (rollback journal,
//! full synchronisation); an error means that nothing was written. Everything is in one file, and in no log beside it.

mod checkpoints;
mod checks;
mod error;
mod lock;
mod repair;
mod salvage;
mod schema;

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    sync::{
        Mutex, MutexGuard, PoisonError,
        atomic::{AtomicU64, Ordering},
    },
};

use rusqlite::{Connection, OptionalExtension, Transaction, TransactionBehavior, params};
use serde::{Deserialize, Serialize};
use uuid::Uuid;

pub use checkpoints::{EVERY, Saved, build, packed, unpacked};
use checks::{FileId, checksum};
pub use error::StoreError;
use lock::Lock;
pub use repair::{Finding, Held, State};

use body_schema_ask_tell::{Event, Happened, Setup, VERSION};
use body_schema_recording::EllipsoidSize;

/// The name of the file within the data directory.
const FILE: &str = "sessions.sqlite";
/// The most bytes of a store in memory.
const MOST_MEMORY_BYTES: i64 = 1 << 30;

/// The store of all sessions.
pub struct Store {
    connection: Mutex<Connection>,
    /// The path in errors.
    path: PathBuf,
    /// The identity of the file when it was opened.
    place: Option<FileId>,
    /// The version of its form.
    version: u32,
    /// The most sessions that are kept.
    most: usize,
    /// The most bytes of the file.
    most_bytes: u64,
    /// The damage found when it was opened.
    damage: Vec<String>,
    /// The size of the file after the last write, bytes.
    left: AtomicU64,
    /// The locks of the folder and of the file, held as long as the store exists.
    locks: Vec<Lock>,
}

/// A session as it was kept.
#[derive(Debug)]
pub struct Stored {
    /// Its setup.
    pub setup: Setup,
    /// Its display options.
    pub shown: Shown,
    /// Its events.
    pub events: Vec<Event>,
    /// The number of each observation that came with an `Idempotency-Key`, by that key.
    pub keys: BTreeMap<String, u64>,
}

impl Stored {
    /// The number of its observations that count.
    pub fn counted(&self) -> u64 {
        counted(&self.events).max(0).unsigned_abs()
    }
}

/// The display options of a session, which have no bearing on what is computed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Shown {
    /// How large the ellipsoids of its recording are.
    #[serde(default)]
    pub ellipsoids: EllipsoidSize,
}

impl Store {
    /// A store in memory, which keeps nothing beyond its own life.
    ///
    /// # Errors
    ///
    /// [`StoreError::Sqlite`] if there is no memory.
    pub fn in_memory() -> Result<Self, StoreError> {
        let path = PathBuf::from("memory");
        let told = |source| StoreError::Sqlite { path: path.clone(), source };
        let connection = Connection::open_in_memory().map_err(told)?;
        let page: i64 = connection.pragma_query_value(None, "page_size", |row| row.get(0)).map_err(told)?;
        connection.pragma_update(None, "max_page_count", MOST_MEMORY_BYTES / page.max(1)).map_err(told)?;
        Self::ready(connection, path, Vec::new())
    }

    /// Opens the store of a data directory, which is made if necessary, for this process alone until it ends.
    ///
    /// A damaged file is put aside under another name, and what can be read of it is kept; [`damage`](Self::damage) describes
    /// it.
    ///
    /// # Errors
    ///
    /// [`StoreError`] if the directory cannot be written, another process holds it, or a later version has written it.
    pub fn open(directory: &Path) -> Result<Self, StoreError> {
        let folder = |source| StoreError::Folder { path: directory.to_owned(), source };
        std::fs::create_dir_all(directory).map_err(folder)?;
        Self::held(directory, Lock::take(directory)?)
    }

    fn held(directory: &Path, lock: Lock) -> Result<Self, StoreError> {
        let path = directory.join(FILE);
        let folder = |source| StoreError::Folder { path: directory.to_owned(), source };
        lock::refuse_what_is_no_file(&path).map_err(folder)?;
        let damage = salvage::salvage(&path)?;
        let mut locks = vec![lock];
        // Elsewhere SQLite itself could not read what is locked.
        if cfg!(unix) {
            locks.push(Lock::of_file(&path, directory)?);
        }
        let opened = connected(&path).and_then(|connection| Self::ready(connection, path, locks));
        let store = opened.map_err(|error| match error {
            // What keeps a store from being made: the folder, or the disk that it is on.
            StoreError::Sqlite { source, .. } => {
                StoreError::Folder { path: directory.to_owned(), source: std::io::Error::other(source) }
            }
            error => error,
        })?;
        Ok(Self { damage, ..store })
    }

    /// Opens the store of a data directory for reading only, also while a server holds it.
    ///
    /// # Errors
    ///
    /// [`StoreError`] if there is no store, or a later version has written it.
    pub fn read(directory: &Path) -> Result<Self, StoreError> {
        let path = directory.join(FILE);
        let told = |source| StoreError::Sqlite { path: path.clone(), source };
        let connection =
            Connection::open_with_flags(&path, rusqlite::OpenFlags::SQLITE_OPEN_READ_WRITE).map_err(told)?;
        connection.pragma_update(None, "query_only", true).map_err(told)?;
        let version = schema::check(&connection, &path)?;
        Ok(Self::of(connection, path, version, Vec::new()))
    }

    fn ready(mut connection: Connection, path: PathBuf, locks: Vec<Lock>) -> Result<Self, StoreError> {
        schema::migrate(&mut connection, &path)?;
        let told = |source| StoreError::Sqlite { path: path.clone(), source };
        connection.pragma_update(None, "foreign_keys", true).map_err(told)?;
        Ok(Self::of(connection, path, schema::KNOWN, locks))
    }

    fn of(connection: Connection, path: PathBuf, version: u32, locks: Vec<Lock>) -> Self {
        let (place, connection, left) = (FileId::of(&path), Mutex::new(connection), AtomicU64::new(length(&path)));
        let (most, most_bytes, damage) = (usize::MAX, u64::MAX, Vec::new());
        Self { connection, path, place, version, most, most_bytes, damage, left, locks }
    }

    /// The damage found when it was opened, in words.
    pub fn damage(&self) -> &[String] {
        &self.damage
    }

    /// This store with limits: it accepts at most this many sessions, and nothing once its file has this many bytes.
    pub fn holding(self, most: usize, most_bytes: u64) -> Self {
        Self { most, most_bytes, ..self }
    }

    /// Stores a new session, with its events so far.
    ///
    /// # Errors
    ///
    /// [`StoreError`] if it cannot be written; it is then not stored.
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
        self.can_grow(&connection)?;
        if self.count_in(&connection)? >= self.most {
            return Err(StoreError::Full(self.most));
        }
        self.written(&mut connection, |transaction| {
            transaction.execute(
                "INSERT INTO session (id, made_s, form, setup, shown, checksum, counted) VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7)",
                params![id.to_string(), made_s, VERSION, setup, shown, checksum([&setup, &shown]), counted(events)],
            )?;
            insert_events(transaction, id, 0, events, None)
        })
    }

    /// Appends events to a session that has `revision` of them. `key` is that of the observation among them.
    ///
    /// # Errors
    ///
    /// [`StoreError`] if they cannot be written; none is then appended.
    pub fn append(&self, id: Uuid, revision: usize, events: &[Event], key: Option<&str>) -> Result<(), StoreError> {
        let mut connection = self.connection();
        self.can_grow(&connection)?;
        self.written(&mut connection, |transaction| append_events(transaction, id, revision, events, key))
    }

    /// Loads a session; `None` if there is none with this id.
    ///
    /// # Errors
    ///
    /// [`StoreError`] if it cannot be read, or is not as it was written: half a session is none.
    pub fn load(&self, id: Uuid) -> Result<Option<Stored>, StoreError> {
        let Some((stored, damage)) = self.load_so_far(id)? else { return Ok(None) };
        match damage {
            Some(what) => Err(self.damaged(format!("session {id}: {what}"))),
            None => Ok(Some(stored)),
        }
    }

    /// Loads a session up to where it is damaged, with the damage.
    fn load_so_far(&self, id: Uuid) -> Result<Option<(Stored, Option<String>)>, StoreError> {
        let connection = self.connection();
        let (checked, damage) = match self.version >= schema::CHECKED {
            true => ("checksum", "damage"),
            false => ("NULL", "NULL"),
        };
        let select = format!("SELECT number, form, setup, shown, {checked}, {damage} FROM session WHERE id = ?1");
        let session = connection.query_row(&select, [id.to_string()], |row| {
            let (number, form): (i64, u32) = (row.get(0)?, row.get(1)?);
            let (setup, shown): (String, String) = (row.get(2)?, row.get(3)?);
            let (checksum, damage): (Option<u32>, Option<String>) = (row.get(4)?, row.get(5)?);
            Ok((number, form, setup, shown, checksum, damage))
        });
        let found = session.optional().map_err(self.told())?;
        let Some((number, form, setup, shown, sum, damage)) = found else { return Ok(None) };
        if form > VERSION {
            return Err(StoreError::Newer { path: self.path.clone(), found: form, known: VERSION });
        }
        let unusable = |what: String| self.damaged(format!("session {id}: its setup {what}"));
        if sum.is_some_and(|sum| sum != checksum([&setup, &shown])) {
            return Err(unusable("is not as it was written".to_owned()));
        }
        let cannot = |error: serde_json::Error| unusable(format!("cannot be read: {error}"));
        let (setup, shown) =
            (serde_json::from_str(&setup).map_err(cannot)?, serde_json::from_str(&shown).map_err(cannot)?);
        let mut stored = Stored { setup, shown, events: Vec::new(), keys: BTreeMap::new() };
        let select =
            format!("SELECT number, event, idempotency_key, {checked} FROM event WHERE session = ?1 ORDER BY number");
        let mut select = connection.prepare_cached(&select).map_err(self.told())?;
        let rows = select.query_map([number], |row| {
            let (number, event): (i64, String) = (row.get(0)?, row.get(1)?);
            let (key, checksum): (Option<String>, Option<u32>) = (row.get(2)?, row.get(3)?);
            Ok((number, event, key, checksum))
        });
        let mut observations = 0;
        for (row, expected) in rows.map_err(self.told())?.zip(1_i64..) {
            let broken = match row {
                Err(error) => format!("event {expected} cannot be read: {error}"),
                Ok((number, ..)) if number != expected => format!("event {expected} is missing"),
                Ok((_, event, key, sum)) if sum.is_some_and(|sum| sum != event_checksum(&event, key.as_deref())) => {
                    format!("event {expected} is not as it was written")
                }
                Ok((_, event, key, _)) => match serde_json::from_str::<Event>(&event) {
                    Err(error) => format!("event {expected} cannot be read: {error}"),
                    Ok(event) => {
                        observations += u64::from(matches!(event.happened, Happened::Observed { .. }));
                        stored.events.push(event);
                        stored.keys.extend(key.map(|key| (key, observations)));
                        continue;
                    }
                },
            };
            return Ok(Some((stored, Some(broken))));
        }
        Ok(Some((stored, damage)))
    }

    /// The ids of all sessions and when they were made, seconds since 1970, oldest first. A session without a readable id
    /// cannot be asked for; [`Held::repair`] reports it.
    ///
    /// # Errors
    ///
    /// [`StoreError`] if they cannot be read.
    pub fn all(&self) -> Result<Vec<(Uuid, f64)>, StoreError> {
        let connection = self.connection();
        let rows = (|| {
            let mut select = connection.prepare_cached("SELECT id, made_s FROM session ORDER BY number")?;
            let rows = select.query_map([], |row| Ok((row.get::<_, String>(0)?, row.get(1)?)))?;
            rows.collect::<Result<Vec<_>, _>>()
        })();
        let rows = rows.map_err(self.told())?.into_iter();
        Ok(rows.filter_map(|(id, made_s)| Some((Uuid::parse_str(&id).ok()?, made_s))).collect())
    }

    /// The list entry of a session, as it was [noted](Self::note), and the number of its observations that count; `None` if it is
    /// not known, or there is no such session.
    ///
    /// # Errors
    ///
    /// [`StoreError`] if it cannot be read.
    pub fn summary(&self, id: Uuid) -> Result<Option<(String, u64)>, StoreError> {
        if self.version < schema::SUMMED_UP {
            return Ok(None);
        }
        let select =
            "SELECT summary, counted FROM session WHERE id = ?1 AND summary IS NOT NULL AND counted IS NOT NULL";
        let connection = self.connection();
        let found = connection.query_row(select, [id.to_string()], |row| Ok((row.get(0)?, row.get::<_, i64>(1)?)));
        let found = found.optional().map_err(self.told())?;
        Ok(found.map(|(summary, counted)| (summary, counted.max(0).unsigned_abs())))
    }

    /// Notes the list entry of a session that has these events.
    ///
    /// # Errors
    ///
    /// [`StoreError`] if it cannot be written; nothing is lost but the time to compute it again.
    pub fn note(&self, id: Uuid, summary: &str, events: &[Event]) -> Result<(), StoreError> {
        let connection = self.connection();
        self.is_there()?;
        let counted = counted(events);
        let update = "UPDATE session SET summary = ?1, counted = ?2 WHERE id = ?3";
        let noted = connection.execute(update, params![summary, counted, id.to_string()]);
        self.is_left();
        noted.map(drop).map_err(self.told())
    }

    /// Deletes a session and all its events.
    ///
    /// # Errors
    ///
    /// [`StoreError`] if that cannot be written; the session is then kept.
    pub fn delete(&self, id: Uuid) -> Result<(), StoreError> {
        let connection = self.connection();
        self.is_there()?;
        let deleted = connection.execute("DELETE FROM session WHERE id = ?1", [id.to_string()]);
        self.is_left();
        deleted.map(drop).map_err(self.told())
    }

    fn connection(&self) -> MutexGuard<'_, Connection> {
        // A transaction that was left is rolled back when it is dropped.
        self.connection.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Writes in a transaction: everything or nothing.
    fn written(
        &self,
        connection: &mut Connection,
        write: impl FnOnce(&Transaction<'_>) -> Result<(), rusqlite::Error>,
    ) -> Result<(), StoreError> {
        let written = (|| {
            let transaction = connection.transaction_with_behavior(TransactionBehavior::Immediate)?;
            write(&transaction)?;
            transaction.commit()
        })();
        self.is_left();
        written.map_err(self.told())
    }

    fn told(&self) -> impl Fn(rusqlite::Error) -> StoreError + Copy + use<'_> {
        |source| StoreError::Sqlite { path: self.path.clone(), source }
    }

    fn count(&self) -> Result<usize, StoreError> {
        self.count_in(&self.connection())
    }

    fn count_in(&self, connection: &Connection) -> Result<usize, StoreError> {
        let count = connection.query_row("SELECT count(*) FROM session", [], |row| row.get::<_, u32>(0));
        Ok(count.map_err(self.told())? as usize)
    }

    /// Checks that what is written now would be found later: the file is where it was and as long as it was left, and nobody else was
    /// let in. To be called by the holder of the connection.
    fn is_there(&self) -> Result<(), StoreError> {
        let path = || self.path.clone();
        match &self.place {
            Some(place) if FileId::of(&self.path).as_ref() != Some(place) => Err(StoreError::Gone { path: path() }),
            Some(_) if length(&self.path) != self.left.load(Ordering::Relaxed) => {
                Err(StoreError::Changed { path: path() })
            }
            _ if !self.locks.iter().all(Lock::is_held) => Err(StoreError::Gone { path: path().with_extension("lock") }),
            _ => Ok(()),
        }
    }

    /// Remembers the size of the file, whatever became of the write.
    fn is_left(&self) {
        if self.place.is_some() {
            self.left.store(length(&self.path), Ordering::Relaxed);
        }
    }

    fn can_grow(&self, connection: &Connection) -> Result<(), StoreError> {
        self.is_there()?;
        if self.most_bytes == u64::MAX {
            return Ok(());
        }
        let number = |name| connection.pragma_query_value(None, name, |row| row.get::<_, u32>(0)).map_err(self.told());
        // Pages that were freed by sessions that are no more are used again first.
        let used = number("page_count")?.saturating_sub(number("freelist_count")?);
        let bytes = u64::from(used) * u64::from(number("page_size")?);
        if bytes < self.most_bytes { Ok(()) } else { Err(StoreError::Large(self.most_bytes)) }
    }

    fn damaged(&self, error: impl std::fmt::Display) -> StoreError {
        StoreError::Damaged { path: self.path.clone(), what: error.to_string() }
    }
}

fn connected(path: &Path) -> Result<Connection, StoreError> {
    // Made here, if it is not there: SQLite would let others read it.
    lock::open(path).map_err(|source| StoreError::Folder { path: path.to_owned(), source })?;
    let opened = Connection::open(path).and_then(|connection| {
        // Whatever an earlier version has left in a log beside the file becomes part of it.
        connection.pragma_update(None, "journal_mode", "TRUNCATE")?;
        connection.pragma_update(None, "synchronous", "FULL")?;
        Ok(connection)
    });
    opened.map_err(|source| StoreError::Sqlite { path: path.to_owned(), source })
}

/// The change in the number of counting observations by these events.
fn counted(events: &[Event]) -> i64 {
    let by = |event: &Event| match event.happened {
        Happened::Observed { .. } | Happened::Included { .. } => 1,
        Happened::Excluded { .. } => -1,
        _ => 0,
    };
    events.iter().map(by).sum()
}

/// The size of a file, bytes; 0 if there is none.
fn length(path: &Path) -> u64 {
    std::fs::metadata(path).map_or(0, |found| found.len())
}

fn event_checksum(event: &str, key: Option<&str>) -> u32 {
    checksum([event, key.unwrap_or_default()])
}

fn insert_events(
    transaction: &Transaction<'_>,
    id: Uuid,
    revision: usize,
    events: &[Event],
    key: Option<&str>,
) -> Result<(), rusqlite::Error> {
    let mut insert = transaction.prepare_cached(
        "INSERT INTO event (session, number, event, idempotency_key, checksum)
         VALUES ((SELECT number FROM session WHERE id = ?1), ?2, ?3, ?4, ?5)",
    )?;
    for (number, event) in (revision as i64 + 1..).zip(events) {
        let key = key.filter(|_| matches!(event.happened, Happened::Observed { .. }));
        let event = json(event);
        insert.execute(params![id.to_string(), number, event, key, event_checksum(&event, key)])?;
    }
    Ok(())
}

/// Appends events in a transaction to a session that exists, and counts its observations.
fn append_events(
    transaction: &Transaction<'_>,
    id: Uuid,
    revision: usize,
    events: &[Event],
    key: Option<&str>,
) -> Result<(), rusqlite::Error> {
    insert_events(transaction, id, revision, events, key)?;
    let more = counted(events);
    if more != 0 {
        let id = id.to_string();
        transaction.execute("UPDATE session SET counted = counted + ?1 WHERE id = ?2", params![more, id])?;
    }
    Ok(())
}

/// JSON of a kept value, which holds only numbers, texts and lists, so that it can always be written.
fn json(value: &impl Serialize) -> String {
    serde_json::to_string(value).unwrap_or_default()
}

#[cfg(test)]
mod tests;
