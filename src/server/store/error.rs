//! Errors of keeping sessions.

use std::{io, path::PathBuf};

use rusqlite::ErrorCode;

/// Why sessions cannot be kept, or read again.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// The data directory cannot be made or written to.
    #[error(
        "sessions cannot be kept in {}: {source}; name a folder that may be written to with --data-dir, or keep nothing \
         with --ephemeral", path.display()
    )]
    Folder {
        /// The directory.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// Another server keeps its sessions there.
    #[error(
        "another body-schema server keeps its sessions in {}; end it, name another folder with --data-dir, or keep nothing \
         with --ephemeral", path.display()
    )]
    Held {
        /// The directory.
        path: PathBuf,
    },
    /// A later version has written it.
    #[error(
        "{} was written in version {found} of its form, and this program knows {known}; update body-schema, or name another \
         folder with --data-dir", path.display()
    )]
    Newer {
        /// The file.
        path: PathBuf,
        /// Its version.
        found: u32,
        /// The latest known.
        known: u32,
    },
    /// The file belongs to another program.
    #[error("{} is no store of body-schema; name another folder with --data-dir", path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
    },
    /// What was read is not what was written.
    #[error("{} is damaged: {what}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        what: String,
    },
    /// The file was moved or removed while it was in use: what is written to it would be lost.
    #[error("{} has disappeared; put it back, or start the server again", path.display())]
    Gone {
        /// The file.
        path: PathBuf,
    },
    /// Another program has written to the file, or has cut it off.
    #[error(
        "{} is not as it was left; end the server, and run `body-schema repair` on its folder", path.display()
    )]
    Changed {
        /// The file.
        path: PathBuf,
    },
    /// The store holds as many sessions as it may.
    #[error("{0} sessions are kept already, as many as allowed; delete some")]
    Full(usize),
    /// The file is as large as it may be.
    #[error("the kept sessions take {0} bytes, as many as allowed; delete some")]
    Large(u64),
    /// SQLite has failed.
    #[error("{}: {source}", path.display())]
    Sqlite {
        /// The file.
        path: PathBuf,
        /// Why.
        source: rusqlite::Error,
    },
}

impl StoreError {
    /// Whether a write failed for want of space: it may succeed later.
    pub fn is_for_want_of_space(&self) -> bool {
        if matches!(self, Self::Gone { .. } | Self::Changed { .. }) {
            return true;
        }
        let Self::Sqlite { source, .. } = self else { return false };
        matches!(
            source.sqlite_error_code(),
            Some(ErrorCode::DiskFull | ErrorCode::SystemIoFailure | ErrorCode::CannotOpen | ErrorCode::ReadOnly)
        )
    }

    /// Whether the session to which something was appended no longer exists.
    pub fn is_for_want_of_a_session(&self) -> bool {
        let Self::Sqlite { source, .. } = self else { return false };
        source.sqlite_error_code() == Some(ErrorCode::ConstraintViolation)
    }
}
