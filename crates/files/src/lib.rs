//! Files and folders that have their names only once they are whole.
//!
//! A file is written under a hidden name beside its destination, and is renamed when it is complete: a full disk, an error or a
//! signal leaves what was there before. Devices, pipes and FIFOs are written to as they are.

mod mesh;

use std::{
    collections::BTreeSet,
    fs::{self, File, OpenOptions},
    io::{self, Write},
    path::{Path, PathBuf},
    sync::{Mutex, MutexGuard, PoisonError},
};

use tempfile::{Builder, TempDir, TempPath};

pub use mesh::mesh;

/// What the hidden names begin and end with.
const BEGIN: &str = ".body-schema-";
const END: &str = ".unfinished";
/// The most symbolic links that are followed in a row.
const MOST_LINKS: usize = 40;

/// The files and folders that this process is writing. While the lock is held, none is begun and none gets its name.
static UNFINISHED: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

fn unfinished() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    // A list of paths is whole whatever panicked.
    UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Ends the process, and removes everything unfinished.
pub fn exit(code: i32) -> ! {
    let paths = unfinished();
    for path in paths.iter() {
        // Other threads may still write into a folder. What cannot be removed stays: there is nobody left to tell.
        let _ = fs::remove_file(path);
        let _ = (0..3).any(|_| !path.exists() || fs::remove_dir_all(path).is_ok());
    }
    std::process::exit(code)
}

/// Does work that no signal may interrupt. The work must begin no file or folder, and give none its name.
pub fn undisturbed<T>(work: impl FnOnce() -> T) -> T {
    let _list = unfinished();
    work()
}

/// Takes a path off the list when it is dropped.
#[derive(Debug)]
struct Listed(PathBuf);

impl Drop for Listed {
    fn drop(&mut self) {
        unfinished().remove(&self.0);
    }
}

/// A file that is being written. It replaces its destination when it is [committed](Self::commit); otherwise it is removed.
#[derive(Debug)]
pub struct AtomicFile {
    /// The hidden file; `None` where the destination is written to directly.
    hidden: Option<Hidden>,
}

#[derive(Debug)]
struct Hidden {
    // In this order: it is removed, then taken off the list.
    path: TempPath,
    _listed: Listed,
    destination: PathBuf,
}

impl AtomicFile {
    /// Begins a file that is to be at `path`, and opens it for writing. Symbolic links stay, and what they lead to is replaced; a file
    /// that is there keeps its permissions.
    ///
    /// # Errors
    ///
    /// The system's error if nothing can be written there: there is no such folder, `path` is a folder, or it or its folder is
    /// read-only.
    pub fn create(path: &Path) -> io::Result<(File, Self)> {
        let Some(destination) = destination(path)? else {
            return Ok((File::create(path)?, Self { hidden: None }));
        };
        let permissions = match fs::metadata(&destination) {
            Ok(found) => {
                // A file that may not be written to is not replaced either.
                OpenOptions::new().write(true).open(&destination)?;
                Some(found.permissions())
            }
            Err(error) if error.kind() == io::ErrorKind::NotFound => None,
            Err(error) => return Err(error),
        };
        let mut list = unfinished();
        let named = Builder::new()
            .prefix(BEGIN)
            .suffix(END)
            .make_in(folder_of(&destination), |path| OpenOptions::new().write(true).create_new(true).open(path))?;
        let (file, path) = named.into_parts();
        list.insert(path.to_path_buf());
        drop(list);
        let listed = Listed(path.to_path_buf());
        let begun = Self { hidden: Some(Hidden { path, _listed: listed, destination }) };
        if let Some(permissions) = permissions {
            file.set_permissions(permissions)?;
        }
        Ok((file, begun))
    }

    /// Gives the file its name, once its bytes are on the disk.
    ///
    /// # Errors
    ///
    /// The system's error if the bytes cannot be stored or the file cannot be renamed; the destination is then
    /// unchanged.
    pub fn commit(self) -> io::Result<()> {
        self.named(|path, destination| path.persist(destination).map_err(io::Error::from))
    }

    /// Gives the file its name, once its bytes are on the disk, unless there is something at the destination.
    ///
    /// # Errors
    ///
    /// The system's error if there is something at the destination, the bytes cannot be stored, or the file cannot be
    /// renamed; the destination is then unchanged.
    pub fn commit_new(self) -> io::Result<()> {
        self.named(|path, destination| path.persist_noclobber(destination).map_err(io::Error::from))
    }

    fn named(self, rename: impl FnOnce(TempPath, &Path) -> io::Result<()>) -> io::Result<()> {
        let Some(Hidden { path, _listed, destination }) = self.hidden else { return Ok(()) };
        OpenOptions::new().write(true).open(&path)?.sync_all()?;
        rename(path, &destination)
    }
}

/// Writes a file whole or not at all.
///
/// # Errors
///
/// The system's error if the file cannot be created, written or renamed; the destination is then unchanged.
pub fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let (mut file, whole) = AtomicFile::create(path)?;
    file.write_all(bytes)?;
    drop(file);
    whole.commit()
}

/// Checks, without changing anything, that a file can be written at `path`.
///
/// # Errors
///
/// The system's error if there is no such folder, `path` is a folder, or it or its folder is read-only.
pub fn check(path: &Path) -> io::Result<()> {
    match destination(path)? {
        // Whoever opens a FIFO waits for its reader.
        None => Ok(()),
        Some(_) => AtomicFile::create(path).map(drop),
    }
}

/// Checks, without changing anything, that a folder can be made at `folder`, or written into.
///
/// # Errors
///
/// The system's error if `folder`, or the nearest existing folder above it, is no folder or may not be written to.
pub fn check_folder(folder: &Path) -> io::Result<()> {
    let is_there = |path: &&Path| fs::symlink_metadata(path).is_ok();
    let above = folder.ancestors().find(is_there).unwrap_or(Path::new("."));
    AtomicFolder::within(above).map(drop)
}

/// The place at which a file is written, behind all symbolic links; `None` where what is there is no file, or where a descriptor is
/// meant.
///
/// # Errors
///
/// The system's error if it is a folder or cannot be examined.
pub fn destination(path: &Path) -> io::Result<Option<PathBuf>> {
    let name = path.file_name().ok_or(io::ErrorKind::IsADirectory)?;
    let mut place = folder_of(path).join(name);
    for _ in 0..MOST_LINKS {
        // What a name there leads to is open already, as /dev/stdout is.
        if place.starts_with("/proc") || place.starts_with("/dev/fd") {
            return Ok(None);
        }
        match fs::symlink_metadata(&place) {
            Ok(found) if found.is_symlink() => place = folder_of(&place).join(fs::read_link(&place)?),
            Ok(found) if found.is_dir() => return Err(io::ErrorKind::IsADirectory.into()),
            Ok(found) => return Ok(found.is_file().then_some(place)),
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                fs::metadata(folder_of(&place))?;
                return Ok(Some(place));
            }
            Err(error) => return Err(error),
        }
    }
    Err(io::Error::other("too many symbolic links lead to one another"))
}

fn folder_of(path: &Path) -> PathBuf {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    folder.unwrap_or(Path::new(".")).to_owned()
}

/// A folder that is there, behind all symbolic links: they stay.
fn behind_links(folder: &Path) -> PathBuf {
    folder.canonicalize().unwrap_or_else(|_| folder.to_owned())
}

/// A hidden folder that is being filled. It is removed unless it [replaces](Self::replace) another.
#[derive(Debug)]
pub struct AtomicFolder {
    // In this order: it is removed, then taken off the list.
    folder: TempDir,
    _listed: Listed,
}

impl AtomicFolder {
    /// Begins a folder inside `folder`, which is made if it is not there.
    ///
    /// # Errors
    ///
    /// The system's error if nothing can be written there.
    pub fn within(folder: &Path) -> io::Result<Self> {
        fs::create_dir_all(folder)?;
        let mut list = unfinished();
        let mut builder = Builder::new();
        builder.prefix(BEGIN).suffix(END);
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o777));
        // The library names the hidden folder, which tells nobody anything.
        let folder = builder.tempdir_in(folder).map_err(|error| io::Error::from(error.kind()))?;
        list.insert(folder.path().to_owned());
        drop(list);
        let listed = Listed(folder.path().to_owned());
        Ok(Self { folder, _listed: listed })
    }

    /// Begins a folder beside another, which it is to [replace](Self::replace).
    ///
    /// # Errors
    ///
    /// The system's error if nothing can be written there.
    pub fn beside(folder: &Path) -> io::Result<Self> {
        Self::within(&folder_of(&behind_links(folder)))
    }

    /// The folder's path while it is filled.
    pub fn path(&self) -> &Path {
        self.folder.path()
    }

    /// Whether a name is that of a folder that is being filled, or of one left by a process that was killed.
    pub fn is_hidden(name: &str) -> bool {
        name.starts_with(BEGIN) && name.ends_with(END)
    }

    /// Puts this folder in the place of another, or where there is none; nothing of the other is left.
    ///
    /// # Errors
    ///
    /// The system's error if that fails; the other folder is then unchanged.
    pub fn replace(self, other: &Path) -> io::Result<()> {
        let other = &behind_links(other);
        if !other.exists() {
            return fs::rename(self.path(), other);
        }
        let before = self.path().with_extension("before");
        undisturbed(|| {
            fs::set_permissions(self.path(), fs::metadata(other)?.permissions())?;
            fs::rename(other, &before)?;
            fs::rename(self.path(), other).or_else(|error| fs::rename(&before, other).and(Err(error)))
        })?;
        fs::remove_dir_all(&before)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> = fs::read_dir(folder)
            .expect("a folder")
            .map(|entry| entry.expect("an entry").file_name().into_string().expect("text"))
            .collect();
        names.sort();
        names
    }

    #[test]
    fn a_file_is_there_whole_or_as_it_was() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a");
        fs::write(&path, "before").expect("written");
        let (mut file, whole) = AtomicFile::create(&path).expect("begun");
        file.write_all(b"after").expect("written");
        assert_eq!((fs::read_to_string(&path).expect("read").as_str(), names(folder.path()).len()), ("before", 2));
        drop(whole);
        assert_eq!(
            (fs::read_to_string(&path).expect("read").as_str(), names(folder.path())),
            ("before", vec!["a".into()])
        );
        write(&path, b"after").expect("written");
        assert_eq!(
            (fs::read_to_string(&path).expect("read").as_str(), names(folder.path())),
            ("after", vec!["a".into()])
        );
        let (_, whole) = AtomicFile::create(&path).expect("begun");
        assert_eq!(whole.commit_new().expect_err("there").kind(), io::ErrorKind::AlreadyExists);
        assert_eq!(
            (fs::read_to_string(&path).expect("read").as_str(), names(folder.path())),
            ("after", vec!["a".into()])
        );
        assert!(unfinished().iter().all(|path| !path.starts_with(folder.path())), "nothing is listed any more");
    }

    #[cfg(unix)]
    #[test]
    fn links_permissions_and_devices_stay() {
        use std::os::unix::fs::{PermissionsExt, symlink};
        let folder = tempfile::tempdir().expect("a folder");
        let place = |name: &str| folder.path().join(name);
        symlink("there", place("link")).expect("a link");
        symlink("link", place("far")).expect("a link");
        write(&place("far"), b"1").expect("written to what is not there yet");
        fs::set_permissions(place("there"), fs::Permissions::from_mode(0o640)).expect("set");
        write(&place("far"), b"2").expect("written");
        let mode = fs::metadata(place("there")).expect("a file").permissions().mode();
        assert_eq!((fs::read_to_string(place("there")).expect("read").as_str(), mode & 0o777), ("2", 0o640));
        assert!(fs::symlink_metadata(place("link")).expect("a link").is_symlink());
        symlink("loop", place("loop")).expect("a link");
        check(&place("loop")).expect_err("a loop");
        write(Path::new("/dev/null"), b"x").expect("written");
        assert_eq!(destination(Path::new("/dev/stdout")).expect("a descriptor"), None);
        for nothing in ["none/a", ".", "", "/"] {
            check(&place(nothing)).expect_err(nothing);
        }
        assert_eq!(names(folder.path()), ["far", "link", "loop", "there"]);
    }

    #[test]
    fn a_folder_replaces_another_or_is_removed() {
        let folder = tempfile::tempdir().expect("a folder");
        let place = folder.path().join("out");
        for round in ["one", "two"] {
            let new = AtomicFolder::beside(&place).expect("begun");
            assert!(AtomicFolder::is_hidden(&new.path().file_name().expect("a name").to_string_lossy()));
            fs::write(new.path().join(round), "").expect("written");
            new.replace(&place).expect("replaced");
            assert_eq!((names(&place), names(folder.path())), (vec![round.to_owned()], vec!["out".to_owned()]));
        }
        drop(AtomicFolder::beside(&place).expect("begun"));
        check_folder(&folder.path().join("a/b/c")).expect("possible");
        check_folder(&place.join("two/a")).expect_err("a file");
        assert_eq!(names(folder.path()), ["out"]);
    }
}
