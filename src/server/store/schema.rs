//! The tables, and their migration from earlier versions.

use std::path::Path;

use rusqlite::{Connection, TransactionBehavior};

use super::StoreError;

/// The application id of our files: `body` in ASCII.
const APPLICATION: u32 = 0x626f_6479;

/// The migration from each version to the next. The version is in `user_version`; an empty file has version 0.
const MIGRATIONS: [&str; 4] = [
    "
    CREATE TABLE session (
        number INTEGER PRIMARY KEY AUTOINCREMENT,
        id TEXT NOT NULL UNIQUE,
        made_s REAL NOT NULL,      -- seconds since 1970
        form INTEGER NOT NULL,     -- the version of setup and events
        setup TEXT NOT NULL,       -- JSON, and so are the others
        shown TEXT NOT NULL
    ) STRICT;
    CREATE TABLE event (
        session INTEGER NOT NULL REFERENCES session (number) ON DELETE CASCADE,
        number INTEGER NOT NULL,   -- counted from 1 in each session
        event TEXT NOT NULL,
        idempotency_key TEXT,
        PRIMARY KEY (session, number)
    ) STRICT, WITHOUT ROWID;
    CREATE UNIQUE INDEX event_by_key ON event (session, idempotency_key) WHERE idempotency_key IS NOT NULL;
",
    "
    ALTER TABLE session ADD COLUMN checksum INTEGER; -- of what is written beside it; null in rows of version 1
    ALTER TABLE session ADD COLUMN damage TEXT;      -- why events are missing, if any are
    ALTER TABLE event ADD COLUMN checksum INTEGER;
",
    "
    ALTER TABLE session ADD COLUMN summary TEXT;     -- how a list shows it, JSON; null where nobody has asked yet
    ALTER TABLE session ADD COLUMN counted INTEGER;  -- how many of its observations count; null where nobody has counted
",
    "
    -- What sessions have come to after some of their steps, so that they need not be replayed from the beginning; it may be lost.
    CREATE TABLE checkpoint (
        session INTEGER NOT NULL REFERENCES session (number) ON DELETE CASCADE,
        step INTEGER NOT NULL,
        told INTEGER NOT NULL,     -- observations until then, those that do not count among them
        build TEXT NOT NULL,       -- who alone can read the state
        state BLOB NOT NULL,       -- what was learned; empty where that is not kept any more
        reports BLOB NOT NULL,     -- of the steps since the checkpoint before, JSON by lines, deflated
        checksum INTEGER NOT NULL,
        PRIMARY KEY (session, step)
    ) STRICT;
",
];

/// The version that this program writes.
pub(super) const KNOWN: u32 = MIGRATIONS.len() as u32;
/// The first version with checksums.
pub(super) const CHECKED: u32 = 2;
/// The first version with list entries.
pub(super) const SUMMED_UP: u32 = 3;
/// The first version with checkpoints.
pub(super) const CHECKPOINTS: u32 = 4;

/// Refuses the file of another program, and one of a later version. Returns the version.
pub(super) fn check(connection: &Connection, path: &Path) -> Result<u32, StoreError> {
    let told = |source: rusqlite::Error| match source.sqlite_error_code() {
        Some(rusqlite::ErrorCode::NotADatabase) => StoreError::Foreign { path: path.to_owned() },
        _ => StoreError::Sqlite { path: path.to_owned(), source },
    };
    let number = |name| connection.pragma_query_value(None, name, |row| row.get::<_, u32>(0)).map_err(told);
    let (found, application) = (number("user_version")?, number("application_id")?);
    let count = connection.query_row("SELECT count(*) FROM sqlite_schema", [], |row| row.get::<_, u32>(0));
    let is_empty = count.map_err(told)? == 0;
    if application != APPLICATION && !is_empty {
        return Err(StoreError::Foreign { path: path.to_owned() });
    }
    if found > KNOWN {
        return Err(StoreError::Newer { path: path.to_owned(), found, known: KNOWN });
    }
    Ok(found)
}

/// Migrates an earlier version to this one: everything or nothing.
pub(super) fn migrate(connection: &mut Connection, path: &Path) -> Result<(), StoreError> {
    let found = check(connection, path)?;
    let migrated = (|| {
        for (version, step) in (1_u32..).zip(MIGRATIONS).skip(found as usize) {
            let transaction = connection.transaction_with_behavior(TransactionBehavior::Immediate)?;
            transaction.execute_batch(step)?;
            transaction.pragma_update(None, "user_version", version)?;
            transaction.pragma_update(None, "application_id", APPLICATION)?;
            transaction.commit()?;
        }
        Ok(())
    })();
    migrated.map_err(|source| StoreError::Sqlite { path: path.to_owned(), source })
}
