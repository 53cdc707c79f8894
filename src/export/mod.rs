//! The page without a server: a folder that any static host serves, whose engine computes in the visitor's browser.
//!
//! ```text
//! index.html, *.js, *.css          the page, as the server has it, with relative addresses
//! calibrate.html                   the page of a visitor's own robot
//! sw.js                            what keeps the folder in the browser: see the module `offline`
//! panel/, viewer/, engine/         its WebAssembly, compressed; the page unpacks it
//! export.json                      what is here beside the page, and with what it opens
//! first.json.gz                    the first steps of the first story, for as long as the engine is on its way
//! scenarios/NAME.toml, NAME/0, …   scenario files of one's own, and the files that they name
//! sessions/ID.json                 sessions with robots elsewhere: setup and events
//! ```
//!
//! Nothing in it needs a server that computes, sets headers or knows a media type: everything is fetched as bytes from
//! addresses relative to the page, so that the folder works below any address.

mod error;
mod first;
mod offline;
mod opening;
mod page;
mod place;

use std::{
    collections::BTreeMap,
    fs::{self, Metadata},
    path::{Path, PathBuf},
};

use serde::Serialize;

pub use error::ExportError;
pub use opening::Opening;

use body_schema_ask_tell::Session;
use body_schema_files::{AtomicFolder, undisturbed};
use body_schema_scenario::Scenario;
use error::Doing;

/// The name of the manifest, which marks a folder as an export and lists its content.
const MANIFEST: &str = "export.json";
/// The service worker, which browsers ask for to learn whether there is another version of the folder.
const SERVICE_WORKER: &str = "sw.js";
/// The folders of scenario files and of sessions.
const SCENARIOS: &str = "scenarios";
const SESSIONS: &str = "sessions";
/// The version of the form; raised when the meaning of a file changes.
const FORMAT: u32 = 2;

/// An export: what to write, and how.
pub struct Export<'a> {
    /// Scenarios that are added to the built-in ones.
    pub scenarios: Vec<&'a Scenario>,
    /// Sessions with robots elsewhere, by their ids.
    pub sessions: Vec<(String, &'a Session)>,
    /// What the page opens with, where its address does not say.
    pub opening: Opening<'a>,
    /// The address at which the folder will be served, with a slash at its end, if known: previews of links to it have
    /// a picture only then.
    pub address: Option<String>,
    /// Another build of the page's panel than this program's, for work on it.
    pub panel_dir: Option<PathBuf>,
    /// The commit that the program was built from, if known: certificates of the page name it.
    pub commit: Option<&'a str>,
}

/// What an export wrote.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Written {
    /// The number of files.
    pub files: u64,
    /// The size of all files, bytes.
    pub bytes: u64,
}

/// The content of a folder.
#[derive(Debug, Serialize)]
struct Manifest {
    format: u32,
    version: &'static str,
    /// The query of the address that the page has where nobody gave it another.
    opens: String,
    scenarios: Vec<Added>,
    sessions: Vec<Kept>,
    /// The address of the first steps of what the page opens with, if they are here.
    first: Option<String>,
    /// The sizes of compressed files when unpacked, bytes, by address.
    unpacked: BTreeMap<String, usize>,
}

/// A scenario of the folder.
#[derive(Debug, Serialize)]
struct Added {
    /// Its name in messages.
    file: String,
    /// The address of its text.
    source: String,
    /// The addresses of the files that it names, by the names that it has for them.
    data: BTreeMap<String, String>,
}

/// A session of the folder.
#[derive(Debug, Serialize)]
struct Kept {
    id: String,
    /// The address of its setup and its events.
    events: String,
}

impl Export<'_> {
    /// Writes the folder. One that holds another export is replaced; one that holds anything else is refused unless `force` says to
    /// write beside it. Everything is written to a hidden folder first, and takes its place once it is complete; if that fails the
    /// folder is unchanged.
    ///
    /// # Errors
    ///
    /// [`ExportError::NotEmpty`] if the folder holds something else and `force` is not set, [`ExportError::Page`] if the page's files
    /// are missing, [`ExportError::File`] if a file cannot be written.
    pub fn write(&self, out: &Path, force: bool) -> Result<Written, ExportError> {
        let is_export = place::examine(out, force)?;
        let is_there = out.exists();
        let aside = if is_there { AtomicFolder::within(out) } else { AtomicFolder::beside(out) };
        let aside = aside.doing("write into the folder", out)?;
        let folder = aside.path();
        let files = page::Files::load(self.panel_dir.as_deref())?;
        files.write(folder, &self.opening, self.address.as_deref(), self.commit)?;
        let manifest = Manifest {
            format: FORMAT,
            version: env!("CARGO_PKG_VERSION"),
            opens: self.opening.query(),
            scenarios: self.scenarios.iter().map(|scenario| add(scenario, folder)).collect::<Result<_, _>>()?,
            sessions: self.sessions.iter().map(|(id, session)| keep(id, session, folder)).collect::<Result<_, _>>()?,
            first: first::write_steps(folder, &self.opening)?,
            unpacked: files.unpacked(),
        };
        write(&folder.join(MANIFEST), &serde_json::to_vec(&manifest)?)?;
        offline::write(folder, &files.versions())?;
        match is_there {
            true => undisturbed(|| place::put(folder, out, is_export))?,
            false => aside.replace(out).doing("write", out)?,
        }
        measure(out)
    }
}

fn add(scenario: &Scenario, out: &Path) -> Result<Added, ExportError> {
    let name = &scenario.name;
    let source = format!("{SCENARIOS}/{name}.toml");
    write(&out.join(&source), scenario.source.as_bytes())?;
    let mut data = BTreeMap::new();
    for (number, (file, text)) in scenario.data.iter().enumerate() {
        // Their own names may lead anywhere.
        let place = format!("{SCENARIOS}/{name}/{number}");
        write(&out.join(&place), text.as_bytes())?;
        data.insert(file.clone(), place);
    }
    Ok(Added { file: format!("{name}.toml"), source, data })
}

fn keep(id: &str, session: &Session, out: &Path) -> Result<Kept, ExportError> {
    let events = format!("{SESSIONS}/{id}.json");
    write(&out.join(&events), session.to_json().as_bytes())?;
    Ok(Kept { id: id.to_owned(), events })
}

fn write(path: &Path, bytes: &[u8]) -> Result<(), ExportError> {
    let folder = path.parent().unwrap_or(Path::new(""));
    fs::create_dir_all(folder).doing("make the folder", folder)?;
    fs::write(path, bytes).doing("write", path)
}

/// The number and size of all files below a folder.
fn measure(folder: &Path) -> Result<Written, ExportError> {
    let mut sum = Written { files: 0, bytes: 0 };
    walk(folder, "", &mut |_, _, metadata| {
        sum = Written { files: sum.files + 1, bytes: sum.bytes + metadata.len() };
        Ok(())
    })?;
    Ok(sum)
}

/// What is done with a file: its path below the folder with `/`, its place, and what the file system says of it.
type Each<'a> = dyn FnMut(String, &Path, &Metadata) -> Result<(), ExportError> + 'a;

/// Goes through all files of a folder, which is at the path `below`, and of the folders in it.
fn walk(folder: &Path, below: &str, each: &mut Each<'_>) -> Result<(), ExportError> {
    for entry in fs::read_dir(folder).doing("read the folder", folder)? {
        let entry = entry.doing("read the folder", folder)?;
        let (place, path) = (entry.path(), format!("{below}{}", entry.file_name().to_string_lossy()));
        let metadata = entry.metadata().doing("read", &place)?;
        match metadata.is_dir() {
            true => walk(&place, &format!("{path}/"), each)?,
            false => each(path, &place, &metadata)?,
        }
    }
    Ok(())
}
