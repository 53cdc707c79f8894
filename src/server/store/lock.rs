//! One process at a time.

use std::{
    fs::{File, OpenOptions, TryLockError},
    io,
    path::{Path, PathBuf},
};

use super::{StoreError, checks::FileId};

/// The file that is locked; it stays, and means nothing by itself.
const FILE: &str = "sessions.lock";

/// A data directory held: the operating system lets go of it when the process ends, however it does.
pub(super) struct Lock {
    path: PathBuf,
    place: Option<FileId>,
    /// It is locked as long as it is open.
    _file: File,
}

impl Lock {
    pub(super) fn take(directory: &Path) -> Result<Self, StoreError> {
        let path = directory.join(FILE);
        Self::of(path, directory)
    }

    /// That of the file itself in which sessions are kept: who removes the other lock admits nobody by that.
    pub(super) fn of_file(file: &Path, directory: &Path) -> Result<Self, StoreError> {
        Self::of(file.to_owned(), directory)
    }

    fn of(path: PathBuf, directory: &Path) -> Result<Self, StoreError> {
        let folder = |source| StoreError::Folder { path: directory.to_owned(), source };
        let file = open(&path).map_err(folder)?;
        match file.try_lock() {
            Ok(()) => Ok(Self { place: FileId::of(&path), path, _file: file }),
            Err(TryLockError::WouldBlock) => Err(StoreError::Held { path: directory.to_owned() }),
            Err(TryLockError::Error(source)) => Err(folder(source)),
        }
    }

    /// Whether it still keeps others away: whoever removes it and makes another would be let in.
    pub(super) fn is_held(&self) -> bool {
        self.place.is_none() || FileId::of(&self.path) == self.place
    }
}

/// What is no file, as a pipe, would be waited for without end.
pub(super) fn refuse_what_is_no_file(path: &Path) -> io::Result<()> {
    match std::fs::metadata(path) {
        Ok(found) if !found.is_file() => Err(io::Error::other(format!("{} is no file; move it away", path.display()))),
        _ => Ok(()),
    }
}

/// A file of ours, made if need be, that nobody else on this machine may read.
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
