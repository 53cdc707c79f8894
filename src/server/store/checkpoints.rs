//! Checkpoints of sessions. They may be lost, since replaying computes them again.

use std::{
    fs::File,
    io::{self, Read, Write},
    sync::OnceLock,
};

use flate2::{Compression, Crc, read::DeflateDecoder, write::DeflateEncoder};
use rusqlite::{Connection, OptionalExtension, Transaction, params};
use sha2::{Digest, Sha256};
use uuid::Uuid;

use super::{Event, Store, StoreError, append_events, schema};

/// The steps between one checkpoint and the next.
pub const EVERY: u64 = 50;
/// The number of latest steps of which all checkpoints keep what was learned; of earlier steps …
const LATEST: u64 = 4 * EVERY;
/// … one in this many does.
const SPARSE: u64 = 8 * EVERY;
/// The most bytes of the reports of a checkpoint, unpacked.
const MOST_UNPACKED: u64 = 1 << 28;

/// A checkpoint of a session after a step.
#[derive(Clone, Debug, PartialEq)]
pub struct Saved {
    /// The step.
    pub step: u64,
    /// The number of observations received until then, excluded ones included.
    pub told: u64,
    /// [What was learned](body_schema_ask_tell::Checkpoint) up to it; empty where that is not kept any more.
    pub state: Vec<u8>,
    /// The reports since the previous checkpoint, packed.
    pub reports: Vec<u8>,
}

impl Saved {
    fn checksum(&self) -> u32 {
        let mut crc = Crc::new();
        crc.update(&self.state);
        crc.update(&self.reports);
        crc.sum()
    }
}

/// Packs texts without line breaks, one after the other.
pub fn packed<'a>(mut texts: impl Iterator<Item = &'a str>) -> Vec<u8> {
    let mut packed = DeflateEncoder::new(Vec::new(), Compression::fast());
    let written = texts.try_for_each(|text| writeln!(packed, "{text}"));
    // Memory takes all that is written to it.
    written.and_then(|()| packed.finish()).unwrap_or_default()
}

/// Unpacks the lines of what was packed.
///
/// # Errors
///
/// The unpacker's error if the bytes are not as they were written.
pub fn unpacked(packed: &[u8]) -> io::Result<String> {
    let mut text = String::new();
    DeflateDecoder::new(packed).take(MOST_UNPACKED).read_to_string(&mut text)?;
    Ok(text)
}

/// An identifier of this build: another build must learn by itself what this one has learned. `None` if the program cannot read
/// itself.
pub fn build() -> Option<&'static str> {
    static BUILD: OnceLock<Option<String>> = OnceLock::new();
    let read = || {
        let mut program = program().ok()?;
        let mut hash = Sha256::new();
        io::copy(&mut program, &mut hash).ok()?;
        Some(hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect())
    };
    BUILD.get_or_init(read).as_deref()
}

/// The running program's file, even if another has taken its name since.
fn program() -> io::Result<File> {
    if cfg!(target_os = "linux") { File::open("/proc/self/exe") } else { File::open(std::env::current_exe()?) }
}

impl Store {
    /// Stores a checkpoint. It is optional: without room for it nothing is lost but time.
    ///
    /// # Errors
    ///
    /// [`StoreError`] if it cannot be written; it is then not stored.
    pub fn save(&self, id: Uuid, build: &str, saved: &Saved) -> Result<(), StoreError> {
        let mut connection = self.connection();
        self.can_grow(&connection)?;
        self.written(&mut connection, |transaction| insert(transaction, id, build, saved))
    }

    /// The checkpoints of a session by this build, oldest first: those that are as they were written, up to the first that is not.
    /// Empty for a store of an earlier version.
    ///
    /// # Errors
    ///
    /// [`StoreError`] if they cannot be read.
    pub fn saved(&self, id: Uuid, build: &str) -> Result<Vec<Saved>, StoreError> {
        if self.version < schema::CHECKPOINTS {
            return Ok(Vec::new());
        }
        let connection = self.connection();
        let read = (|| {
            let mut select = connection.prepare_cached(
                "SELECT step, told, state, reports, checkpoint.checksum FROM checkpoint
                 JOIN session ON session.number = checkpoint.session WHERE session.id = ?1 AND build = ?2 ORDER BY step",
            )?;
            let rows = select.query_map(params![id.to_string(), build], |row| {
                let (step, told): (i64, i64) = (row.get(0)?, row.get(1)?);
                let (step, told) = (step.unsigned_abs(), told.unsigned_abs());
                let saved = Saved { step, told, state: row.get(2)?, reports: row.get(3)? };
                Ok((saved, row.get::<_, u32>(4)?))
            })?;
            rows.collect::<Result<Vec<_>, _>>()
        })();
        let rows = read.map_err(self.told())?.into_iter();
        // Where what was learned was dropped, its checksum was dropped with it.
        Ok(rows.take_while(|(saved, sum)| saved.checksum() == *sum).map(|(saved, _)| saved).collect())
    }

    /// Appends events to a session that has `revision` of them, which exclude an observation or include it again. Later
    /// checkpoints are dropped, and the new ones are stored.
    ///
    /// # Errors
    ///
    /// [`StoreError`] if they cannot be written; nothing has changed then.
    pub fn rewrite(
        &self,
        id: Uuid,
        revision: usize,
        events: &[Event],
        observation: u64,
        (build, saved): (&str, &[Saved]),
    ) -> Result<(), StoreError> {
        let mut connection = self.connection();
        self.can_grow(&connection)?;
        self.written(&mut connection, |transaction| {
            append_events(transaction, id, revision, events, None)?;
            transaction.execute(
                "DELETE FROM checkpoint
                 WHERE session = (SELECT number FROM session WHERE id = ?1) AND (told >= ?2 OR build != ?3)",
                params![id.to_string(), observation as i64, build],
            )?;
            saved.iter().try_for_each(|saved| insert(transaction, id, build, saved))
        })
    }
}

/// Writes a checkpoint, and drops what was learned up to earlier ones except for a few.
fn insert(transaction: &Transaction<'_>, id: Uuid, build: &str, saved: &Saved) -> rusqlite::Result<()> {
    let Some(session) = number(transaction, id)? else { return Ok(()) };
    transaction.execute("DELETE FROM checkpoint WHERE session = ?1 AND build != ?2", params![session, build])?;
    let Saved { step, told, state, reports } = saved;
    transaction.execute(
        "INSERT OR REPLACE INTO checkpoint (session, step, told, build, state, reports, checksum)
         VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7)",
        params![session, *step as i64, *told as i64, build, state, reports, saved.checksum()],
    )?;
    let mut old = transaction.prepare_cached(
        "SELECT step, reports FROM checkpoint WHERE session = ?1 AND step < ?2 AND step % ?3 != 0 AND length(state) > 0",
    )?;
    let old = old.query_map(params![session, step.saturating_sub(LATEST) as i64, SPARSE as i64], |row| {
        Ok((row.get::<_, i64>(0)?, row.get::<_, Vec<u8>>(1)?))
    })?;
    for (old, reports) in old.collect::<Result<Vec<_>, _>>()? {
        let left = Saved { step: 0, told: 0, state: Vec::new(), reports };
        transaction.execute(
            "UPDATE checkpoint SET state = x'', checksum = ?1 WHERE session = ?2 AND step = ?3",
            params![left.checksum(), session, old],
        )?;
    }
    Ok(())
}

fn number(connection: &Connection, id: Uuid) -> rusqlite::Result<Option<i64>> {
    connection.query_row("SELECT number FROM session WHERE id = ?1", [id.to_string()], |row| row.get(0)).optional()
}
