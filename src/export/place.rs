//! The place of an export: a new folder, or that of an earlier one.

use std::{ffi::OsStr, fs, io, path::Path};

use serde::Deserialize;

use super::{ExportError, MANIFEST, SCENARIOS, SERVICE_WORKER, SESSIONS, error::Doing};
use body_schema_files::AtomicFolder;

/// The folder in which those of an earlier export wait to be removed.
const OLD: &str = ".old";
/// The folders of an export that another may not have, the runs of format 1 among them.
const OWN: [&str; 3] = [SCENARIOS, SESSIONS, "runs"];

/// What every version of the manifest says.
#[derive(Deserialize)]
struct AnyManifest {
    #[serde(rename = "format")]
    _format: u32,
}

/// Whether the folder holds an export; an error if it holds something else.
pub(super) fn examine(out: &Path, force: bool) -> Result<bool, ExportError> {
    if !out.exists() {
        return Ok(false);
    }
    let is_other = |entry: io::Result<fs::DirEntry>| {
        entry.map_or(true, |entry| !AtomicFolder::is_hidden(&entry.file_name().to_string_lossy()))
    };
    let is_empty = !fs::read_dir(out).doing("read the folder", out)?.any(is_other);
    let text = fs::read(out.join(MANIFEST)).unwrap_or_default();
    let is_export = serde_json::from_slice::<AnyManifest>(&text).is_ok();
    if is_empty || is_export || force { Ok(is_export) } else { Err(ExportError::NotEmpty(out.to_owned())) }
}

/// Puts a new export in the place of an earlier one, whose scenarios and sessions are removed with the rest of the new one's hidden
/// folder.
pub(super) fn put(from: &Path, to: &Path, is_export: bool) -> Result<(), ExportError> {
    let old = from.join(OLD);
    fs::create_dir(&old).doing("make the folder", &old)?;
    let own = || OWN.map(|name| (to.join(name), old.join(name))).into_iter();
    let mut moved = own().filter(|(place, _)| is_export && place.exists());
    let placed = moved.try_for_each(|(place, aside)| fs::rename(&place, aside).doing("replace", &place));
    placed.and_then(|()| place(from, to)).inspect_err(|_| {
        for (place, aside) in own().filter(|(_, aside)| aside.exists()) {
            // Those of the new one, if there are any. What then cannot be put back nobody can.
            let _ = fs::remove_dir_all(&place);
            let _ = fs::rename(aside, place);
        }
    })
}

/// Moves all files of a folder to their places in another, last those by which the new one is known.
fn place(from: &Path, to: &Path) -> Result<(), ExportError> {
    let entries =
        fs::read_dir(from).and_then(Iterator::collect::<io::Result<Vec<_>>>).doing("read the folder", from)?;
    let mut names: Vec<_> = entries.iter().map(fs::DirEntry::file_name).filter(|name| name != OLD).collect();
    names.sort_by_key(|name| [MANIFEST, SERVICE_WORKER].map(OsStr::new).contains(&name.as_os_str()));
    for name in names {
        let (old, new) = (from.join(&name), to.join(&name));
        if old.is_dir() && new.exists() {
            place(&old, &new)?;
        } else {
            fs::rename(&old, &new).doing("write", &new)?;
        }
    }
    Ok(())
}
