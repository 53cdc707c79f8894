//! Salvaging a damaged file: what can be read of it is kept, and the file itself is put aside.

use std::{
    ffi::OsString,
    fs,
    path::{Path, PathBuf},
};

use rusqlite::{Connection, ErrorCode, params};

use super::{StoreError, connected, schema};

/// The endings of the names of temporary files beside the store.
const LOGS: [&str; 3] = ["-wal", "-shm", "-journal"];
/// The most faults of a file that are reported.
const MOST_FAULTS: u32 = 3;

/// Repairs the file at `path` if it is damaged, and returns the damage in words; nothing if the file is whole or does
/// not exist.
pub(super) fn salvage(path: &Path) -> Result<Vec<String>, StoreError> {
    let Some(fault) = fault(path, "quick_check")? else { return Ok(Vec::new()) };
    let aside = put_aside(path, "damaged")?;
    let part = beside(path, ".part");
    remove(&part)?;
    let mut told = vec![format!("{} is damaged ({fault}); it is put aside as {}", path.display(), aside.display())];
    {
        let mut new = connected(&part)?;
        schema::migrate(&mut new, &part)?;
        match connected(path) {
            Ok(old) => told.extend(copied(&old, &new, &part)?),
            Err(error) => told.push(format!("nothing of it can be read: {error}")),
        }
    }
    // What the old file's log holds belongs to no other.
    for end in LOGS {
        remove_file(&beside(path, end))?;
    }
    fs::rename(&part, path).map_err(|source| StoreError::Folder { path: path.to_owned(), source })?;
    Ok(told)
}

/// The fault of a file; `None` if it is whole, does not exist, or belongs to another program.
pub(super) fn fault(path: &Path, check: &str) -> Result<Option<String>, StoreError> {
    if !path.exists() {
        return Ok(None);
    }
    let checked = Connection::open(path).and_then(|connection| {
        let mut select = connection.prepare(&format!("PRAGMA {check}({MOST_FAULTS})"))?;
        let faults = select.query_map([], |row| row.get::<_, String>(0))?;
        faults.collect::<Result<Vec<_>, _>>()
    });
    match checked {
        Ok(faults) if faults == ["ok"] => Ok(None),
        Ok(faults) => Ok(Some(faults.join("; ").replace('\n', " "))),
        Err(error) if is_damage(&error) => Ok(Some(error.to_string())),
        Err(source) => Err(StoreError::Sqlite { path: path.to_owned(), source }),
    }
}

fn is_damage(error: &rusqlite::Error) -> bool {
    matches!(error.sqlite_error_code(), Some(ErrorCode::DatabaseCorrupt | ErrorCode::NotADatabase))
}

/// Copies a file, with its log, to a free name.
pub(super) fn put_aside(path: &Path, why: &str) -> Result<PathBuf, StoreError> {
    let names = (1..).map(|number: u32| beside(path, &format!(".{why}-{number}")));
    let mut free = names.filter(|name| !name.exists());
    let aside = free.next().unwrap_or_else(|| beside(path, why));
    for end in ["", "-wal", "-journal"] {
        let (from, to) = (beside(path, end), beside(&aside, end));
        if from.exists() {
            fs::copy(&from, &to).map_err(|source| StoreError::Folder { path: to, source })?;
        }
    }
    Ok(aside)
}

fn beside(path: &Path, end: &str) -> PathBuf {
    let mut name = OsString::from(path);
    name.push(end);
    name.into()
}

fn remove(path: &Path) -> Result<(), StoreError> {
    [""].iter().chain(&LOGS).try_for_each(|end| remove_file(&beside(path, end)))
}

fn remove_file(path: &Path) -> Result<(), StoreError> {
    match fs::remove_file(path) {
        Err(source) if source.kind() != std::io::ErrorKind::NotFound => {
            Err(StoreError::Folder { path: path.to_owned(), source })
        }
        _ => Ok(()),
    }
}

/// Copies whatever can be read. A session that lacks events is marked, so that it is not taken for whole.
fn copied(old: &Connection, new: &Connection, path: &Path) -> Result<Vec<String>, StoreError> {
    let told = |source| StoreError::Sqlite { path: path.to_owned(), source };
    let mut report = Vec::new();
    new.execute_batch("BEGIN").map_err(told)?;
    // From both ends, since pages in the middle may be the ones that are broken.
    let (sessions, broken) = from_both_ends(old, "SELECT * FROM session ORDER BY number", session);
    report.extend(broken.map(|error| format!("sessions may be missing: {error}")));
    for (number, values) in &sessions {
        let [id, made_s, form, setup, shown, sum, damage] = values;
        new.execute(
            "INSERT OR IGNORE INTO session (number, id, made_s, form, setup, shown, checksum, damage)
             VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8)",
            params![number, id, made_s, form, setup, shown, sum, damage],
        )
        .map_err(told)?;
        let select = format!("SELECT * FROM event WHERE session = {number} ORDER BY number");
        let (events, broken) = from_both_ends(old, &select, event);
        for (event, [text, key, sum]) in &events {
            new.execute(
                "INSERT OR IGNORE INTO event (session, number, event, idempotency_key, checksum) VALUES (?1, ?2, ?3, ?4, ?5)",
                params![number, event, text, key, sum],
            )
            .map_err(told)?;
        }
        if let Some(error) = broken {
            let damage = format!("events may be missing: {error}");
            report.push(format!("session {}: {damage}", words(id)));
            new.execute("UPDATE session SET damage = ?1 WHERE number = ?2", params![damage, number]).map_err(told)?;
        }
    }
    new.execute_batch("COMMIT").map_err(told)?;
    report.push(format!("{} sessions of it could be read", sessions.len()));
    Ok(report)
}

type Value = rusqlite::types::Value;
type Row<const N: usize> = (i64, [Value; N]);

fn words(value: &Value) -> &str {
    if let Value::Text(text) = value { text } else { "without an id" }
}

/// A row of `session`, in any version.
fn session(row: &rusqlite::Row<'_>) -> rusqlite::Result<Row<7>> {
    let maybe = |name| row.get::<_, Value>(name).unwrap_or(Value::Null);
    let [id, made_s, form, setup, shown] =
        ["id", "made_s", "form", "setup", "shown"].map(|name| row.get::<_, Value>(name));
    Ok((row.get("number")?, [id?, made_s?, form?, setup?, shown?, maybe("checksum"), maybe("damage")]))
}

fn event(row: &rusqlite::Row<'_>) -> rusqlite::Result<Row<3>> {
    let maybe = |name| row.get::<_, Value>(name).unwrap_or(Value::Null);
    Ok((row.get("number")?, [row.get("event")?, maybe("idempotency_key"), maybe("checksum")]))
}

/// All rows up to the first that cannot be read, and then those after the last.
fn from_both_ends<const N: usize>(
    old: &Connection,
    select: &str,
    read: fn(&rusqlite::Row<'_>) -> rusqlite::Result<Row<N>>,
) -> (Vec<Row<N>>, Option<String>) {
    let (mut rows, broken) = rows(old, select, read);
    if broken.is_some() {
        let (after, _) = self::rows(old, &format!("{select} DESC"), read);
        let last = rows.last().map(|(number, _)| *number);
        rows.extend(after.into_iter().rev().filter(|(number, _)| last.is_none_or(|last| *number > last)));
    }
    (rows, broken)
}

fn rows<const N: usize>(
    old: &Connection,
    select: &str,
    read: fn(&rusqlite::Row<'_>) -> rusqlite::Result<Row<N>>,
) -> (Vec<Row<N>>, Option<String>) {
    let mut found = Vec::new();
    let broken = (|| {
        let mut select = old.prepare(select)?;
        for row in select.query_map([], read)? {
            found.push(row?);
        }
        Ok::<(), rusqlite::Error>(())
    })();
    (found, broken.err().map(|error| error.to_string()))
}
