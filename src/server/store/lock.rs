//! Locks that let one process at a time use a data directory.

use std::{
    fs::{File, OpenOptions, TryLockError},
    io,
    path::{Path, PathBuf},
    time::Duration,
};

use super::{StoreError, checks::FileId};

/// The name of the lock file; it stays, and means nothing by itself.
const FILE: &str = "sessions.lock";

/// A server that is about to end may hold its directory for a moment, as may a process that it is just starting: it is looked at again so
/// often, after so long.
const GLANCES: u32 = 10;
const GLANCE: Duration = Duration::from_millis(50);

/// A held data directory. The operating system releases it when the process ends, however it ends.
pub(super) struct Lock {
    path: PathBuf,
    place: Option<FileId>,
    /// The lock file, locked as long as it is open.
    _file: File,
}

impl Lock {
    pub(super) fn take(directory: &Path) -> Result<Self, StoreError> {
        let path = directory.join(FILE);
        Self::of(path, directory)
    }

    /// A lock on the file in which sessions are kept: removing the other lock admits nobody.
    pub(super) fn of_file(file: &Path, directory: &Path) -> Result<Self, StoreError> {
        Self::of(file.to_owned(), directory)
    }

    fn of(path: PathBuf, directory: &Path) -> Result<Self, StoreError> {
        let folder = |source| StoreError::Folder { path: directory.to_owned(), source };
        let file = open(&path).map_err(folder)?;
        let mut taken = file.try_lock();
        for _ in 0..GLANCES {
            if !matches!(taken, Err(TryLockError::WouldBlock)) {
                break;
            }
            std::thread::sleep(GLANCE);
            taken = file.try_lock();
        }
        match taken {
            Ok(()) => Ok(Self { place: FileId::of(&path), path, _file: file }),
            Err(TryLockError::WouldBlock) => Err(StoreError::Held { path: directory.to_owned() }),
            Err(TryLockError::Error(source)) => Err(folder(source)),
        }
    }

    /// Whether it still keeps others away: if the lock file was removed and made anew, others would be let in.
    pub(super) fn is_held(&self) -> bool {
        self.place.is_none() || FileId::of(&self.path) == self.place
    }
}

/// Refuses a path that is no file, such as a pipe, which would be waited for without end.
pub(super) fn refuse_what_is_no_file(path: &Path) -> io::Result<()> {
    match std::fs::metadata(path) {
        Ok(found) if !found.is_file() => Err(io::Error::other(format!("{} is no file; move it away", path.display()))),
        _ => Ok(()),
    }
}

/// Opens a file of ours, made if necessary, that nobody else on this machine may read.
pub(super) fn open(path: &Path) -> io::Result<File> {
    refuse_what_is_no_file(path)?;
    let mut options = OpenOptions::new();
    options.create(true).truncate(false).read(true).write(true);
    #[cfg(unix)]
    {
        use std::os::unix::fs::OpenOptionsExt;
        options.mode(0o600);
    }
    let file = options.open(path)?;
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // One that an earlier version has made; that of another owner may stay as it is.
        drop(file.set_permissions(std::fs::Permissions::from_mode(0o600)));
    }
    Ok(file)
}
