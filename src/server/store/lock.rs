//! One process at a time.

use std::{
    fs::{File, TryLockError},
    path::Path,
};

use super::StoreError;

/// The file that is locked; it stays, and means nothing by itself.
const FILE: &str = "sessions.lock";

/// A data directory held: the operating system lets go of it when the process ends, however it does.
pub(super) struct Lock(#[expect(dead_code, reason = "it is locked as long as it is open")] File);

impl Lock {
    pub(super) fn take(directory: &Path) -> Result<Self, StoreError> {
        let folder = |source| StoreError::Folder { path: directory.to_owned(), source };
        let file =
            File::options().create(true).truncate(false).write(true).open(directory.join(FILE)).map_err(folder)?;
        match file.try_lock() {
            Ok(()) => Ok(Self(file)),
            Err(TryLockError::WouldBlock) => Err(StoreError::Held { path: directory.to_owned() }),
            Err(TryLockError::Error(source)) => Err(folder(source)),
        }
    }
}
