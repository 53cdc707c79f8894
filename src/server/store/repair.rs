//! Repairing a store: whole sessions are left alone, and of the others the reliable part is kept.

use std::path::{Path, PathBuf};

use rusqlite::params;
use serde::Serialize;
use uuid::Uuid;

use super::{FILE, Store, StoreError, lock::Lock, salvage};
use body_schema_ask_tell::{ReplayError, Session};

/// A data directory that no server uses while this exists.
pub struct Held {
    directory: PathBuf,
    lock: Option<Lock>,
}

/// A finding about one file or session.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// A file or a session.
    pub name: String,
    /// Its state.
    pub state: State,
    /// The finding in words.
    pub detail: String,
}

/// The state of something that may have been damaged.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum State {
    /// Nothing is wrong.
    Whole,
    /// It is damaged, and was left as it is.
    Damaged,
    /// It was damaged, and its reliable part is restored.
    Mended,
    /// It is damaged, and nothing can be done.
    Lost,
}

impl Finding {
    /// A finding about `name`.
    pub fn new(name: impl Into<String>, state: State, detail: impl Into<String>) -> Self {
        Self { name: name.into(), state, detail: detail.into() }
    }
}

impl Held {
    /// Holds a directory, if a server keeps sessions there at times.
    ///
    /// # Errors
    ///
    /// [`StoreError::Held`] while a server does.
    pub fn take(directory: &Path) -> Result<Self, StoreError> {
        let is_kept = directory.join(FILE).exists();
        let lock = is_kept.then(|| Lock::take(directory)).transpose()?;
        Ok(Self { directory: directory.to_owned(), lock })
    }

    /// Examines all sessions that are kept there, and repairs them unless it is only to `look`: a copy of the file is put
    /// aside first. Of a damaged session the events before the first damaged one are kept.
    ///
    /// # Errors
    ///
    /// [`StoreError`] if the file belongs to another program, cannot be read, or cannot be written.
    pub fn repair(self, look: bool) -> Result<Vec<Finding>, StoreError> {
        let path = self.directory.join(FILE);
        let Some(lock) = self.lock else { return Ok(Vec::new()) };
        if let (Some(fault), true) = (salvage::fault(&path, "integrity_check")?, look) {
            return Ok(vec![Finding::new(FILE, State::Damaged, fault)]);
        }
        // Nobody may begin to use it meanwhile, and to look changes nothing.
        let (store, _lock) = match look {
            true => (Store::read(&self.directory)?, Some(lock)),
            false => (Store::held(&self.directory, lock)?, None),
        };
        let state = if store.damage().is_empty() { State::Whole } else { State::Mended };
        let file = match store.damage() {
            [] => Finding::new(FILE, state, "every page is as SQLite wrote it"),
            damage => Finding::new(FILE, state, damage.join("; ")),
        };
        let mut findings = vec![file];
        let (mut aside, all) = (None, store.all()?);
        let nameless = store.count()?.saturating_sub(all.len());
        if nameless > 0 {
            let detail = format!("{nameless} sessions have no id that can be read; they are left as they are");
            findings.push(Finding::new(FILE, State::Lost, detail));
        }
        for (id, _) in all {
            findings.push(store.hint(id, look, &mut aside)?);
        }
        findings.extend(aside.map(|aside: PathBuf| {
            Finding::new(FILE, State::Whole, format!("as it was before, it is {}", aside.display()))
        }));
        Ok(findings)
    }
}

impl Store {
    fn hint(&self, id: Uuid, look: bool, aside: &mut Option<PathBuf>) -> Result<Finding, StoreError> {
        let name = format!("session {id}");
        let (stored, damage) = match self.load_so_far(id) {
            Ok(Some(found)) => found,
            Ok(None) => return Ok(Finding::new(name, State::Lost, "it is not there any more")),
            Err(error @ (StoreError::Damaged { .. } | StoreError::Newer { .. })) => {
                return Ok(Finding::new(name, State::Lost, format!("{error}; it is left as it is")));
            }
            Err(error) => return Err(error),
        };
        let count = stored.events.len();
        let (kept, fault) = match (Session::replay(stored.setup, stored.events), damage) {
            (Ok(_), None) => return Ok(Finding::new(name, State::Whole, format!("{count} events"))),
            (Ok(_), Some(damage)) => (count, damage),
            (Err(ReplayError::Event { index, what }), _) => {
                (index - 1, format!("event {index} cannot have happened: {what}"))
            }
            (Err(error), _) => return Ok(Finding::new(name, State::Lost, format!("{error}; it is left as it is"))),
        };
        if look {
            return Ok(Finding::new(name, State::Damaged, format!("{fault}; the {kept} events before it can be kept")));
        }
        if aside.is_none() {
            *aside = Some(salvage::put_aside(&self.path, "before-repair")?);
        }
        self.truncate(id, kept)?;
        Ok(Finding::new(name, State::Mended, format!("{fault}; the {kept} events before it are kept")))
    }

    /// Deletes all events of a session except the first `kept`.
    fn truncate(&self, id: Uuid, kept: usize) -> Result<(), StoreError> {
        let mut connection = self.connection();
        let written = (|| {
            let transaction = connection.transaction()?;
            transaction.execute(
                "DELETE FROM event WHERE session = (SELECT number FROM session WHERE id = ?1) AND number > ?2",
                params![id.to_string(), i64::try_from(kept).unwrap_or(i64::MAX)],
            )?;
            transaction.execute("UPDATE session SET damage = NULL, counted = NULL WHERE id = ?1", [id.to_string()])?;
            transaction.commit()
        })();
        written.map_err(self.told())
    }
}
