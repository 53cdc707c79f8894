//! Why sessions cannot be kept.

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
    /// The file is that of another program.
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
    #[error("{} is not there any more; put it back, or start the server again", path.display())]
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
    /// As many sessions as may be.
    #[error("{0} sessions are kept already, the most that there may be; delete some")]
    Full(usize),
    /// The file is as large as it may be.
    #[error("the sessions that are kept take {0} bytes, the most that they may; delete some")]
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
    /// Whether what failed is to write, as on a full disk: it may succeed later.
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

    /// Whether the session to which something was appended is no more.
    pub fn is_for_want_of_a_session(&self) -> bool {
        let Self::Sqlite { source, .. } = self else { return false };
        source.sqlite_error_code() == Some(ErrorCode::ConstraintViolation)
    }
}
