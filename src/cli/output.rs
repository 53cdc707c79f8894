//! Outputs of commands: files, standard output, tables.

use std::{
    fs::File,
    io::{BufWriter, ErrorKind, Write},
    path::{Path, PathBuf},
};

use anyhow::{Context, Result};
use body_schema_files as atomic;
use body_schema_files::AtomicFile;
use comfy_table::{CellAlignment, ContentArrangement, Table, presets};
use serde::Serialize;

use super::BadInput;

/// Whether a path means standard output.
pub fn is_stdout(path: &Path) -> bool {
    path.as_os_str() == "-" || path == Path::new("/dev/stdout")
}

/// Writes `value` as indented JSON to a file, or to standard output for `-`.
pub fn write_json(path: &Path, value: &impl Serialize) -> Result<()> {
    let text = serde_json::to_string_pretty(value).context("cannot write JSON")?;
    if is_stdout(path) {
        return say(text);
    }
    atomic::write(path, (text + "\n").as_bytes()).with_context(|| cannot(path))
}

/// Writes a text to a file, whole or not at all.
pub fn write(path: &Path, text: &str) -> Result<()> {
    atomic::write(path, text.as_bytes()).with_context(|| cannot(path))
}

/// The beginning of an error about writing a file.
pub fn cannot(path: &Path) -> String {
    format!("cannot write {}; what was there before is as it was", path.display())
}

/// Begins a file that is written piece by piece, and gets its name once it is committed.
pub fn create(path: &Path) -> Result<(BufWriter<File>, AtomicFile)> {
    let (file, whole) = AtomicFile::create(path).with_context(|| cannot(path))?;
    Ok((BufWriter::new(file), whole))
}

/// The outputs of a command, by the options that name them. They are checked before any work is done.
#[derive(Default)]
pub struct Outputs<'a> {
    files: Vec<(&'static str, &'a Path)>,
    folders: Vec<(&'static str, &'a Path)>,
}

impl<'a> Outputs<'a> {
    /// Adds a file, if one is requested.
    pub fn file(mut self, option: &'static str, path: Option<&'a Path>) -> Self {
        self.files.extend(path.filter(|path| !is_stdout(path)).map(|path| (option, path)));
        self
    }

    /// Adds a folder whose files are replaced.
    pub fn folder(mut self, option: &'static str, path: Option<&'a Path>) -> Self {
        self.folders.extend(path.map(|path| (option, path)));
        self
    }

    /// Refuses an output that would overwrite an input or another output, through whatever links; then one that cannot be written.
    pub fn check(&self, inputs: &[PathBuf]) -> Result<()> {
        for (index, (option, path)) in self.files.iter().enumerate() {
            let shown = path.display();
            if let Some(input) = inputs.iter().find(|input| is_file(input) && is_same(input, path)) {
                let input = input.display();
                return refuse(format!(
                    "{option} {shown} would write over {input}, which this command reads; name another file with {option}"
                ));
            }
            if let Some((other, _)) = self.files[..index].iter().find(|(_, other)| is_same(other, path)) {
                return refuse(format!("{other} and {option} would both write {shown}; name two files"));
            }
            if let Some((other, folder)) = self.folders.iter().find(|(_, folder)| is_within(path, folder)) {
                let folder = folder.display();
                return refuse(format!(
                    "{option} {shown} lies in {folder}, whose files {other} replaces; name a file elsewhere with {option}"
                ));
            }
        }
        for (option, folder) in &self.folders {
            if let Some(input) = inputs.iter().find(|input| is_within(input, folder)) {
                let (input, folder) = (input.display(), folder.display());
                return refuse(format!(
                    "{option} {folder} would replace the files of a folder in which {input} lies, which this command reads; name \
                     another folder with {option}"
                ));
            }
        }
        for (option, path) in &self.files {
            atomic::check(path).with_context(|| {
                format!(
                    "cannot write {}; name a file in a folder that is there and may be written to with {option}",
                    path.display()
                )
            })?;
        }
        for (option, folder) in &self.folders {
            atomic::check_folder(folder).with_context(|| {
                format!("cannot write {}; name a folder that may be written to with {option}", folder.display())
            })?;
        }
        Ok(())
    }
}

fn refuse(why: String) -> Result<()> {
    Err(BadInput(why).into())
}

fn is_file(path: &Path) -> bool {
    path.metadata().is_ok_and(|found| found.is_file())
}

/// Whether two paths lead to one file: through links of both kinds, and also where there is no file yet.
fn is_same(one: &Path, other: &Path) -> bool {
    let is_linked = || is_file(one) && is_file(other) && same_file::is_same_file(one, other).unwrap_or(false);
    resolved(one) == resolved(other) || is_linked()
}

/// Whether a path is a folder's, or leads into it.
fn is_within(path: &Path, folder: &Path) -> bool {
    resolved(path).starts_with(resolved(folder))
}

/// The path behind all links, whether or not there is anything yet.
fn resolved(path: &Path) -> PathBuf {
    let place = atomic::destination(path).ok().flatten().unwrap_or_else(|| path.to_owned());
    let mut above = place.ancestors().skip(1);
    let in_folder = || {
        let folder = above.find_map(|folder| {
            let named = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
            Some((folder, named.canonicalize().ok()?))
        });
        let (folder, found) = folder?;
        Some(found.join(place.strip_prefix(folder).ok()?))
    };
    place.canonicalize().ok().or_else(in_folder).unwrap_or_else(|| place.clone())
}

/// The results of a command that could not be written. All others are written and printed all the same.
#[derive(Default)]
pub struct Failures(Vec<anyhow::Error>);

impl Failures {
    pub fn keep(&mut self, written: Result<()>) {
        self.0.extend(written.err());
    }

    /// Returns an error if anything failed.
    pub fn end(self) -> Result<()> {
        let mut failures = self.0;
        let Some(last) = failures.pop() else { return Ok(()) };
        failures.iter().for_each(|failure| tell(format_args!("error: {}", super::told(failure))));
        Err(last)
    }
}

/// Prints text to standard error, if that is open.
pub fn tell(text: impl std::fmt::Display) {
    drop(writeln!(std::io::stderr(), "{text}"));
}

/// A plain table: first column to the left, the others to the right.
pub fn table<const N: usize>(header: [impl ToString; N], rows: impl IntoIterator<Item = [String; N]>) -> Table {
    let mut table = Table::new();
    table.load_style(presets::ASCII_MARKDOWN).set_content_arrangement(ContentArrangement::Disabled);
    table.set_header(header.map(|title| title.to_string()));
    for row in rows {
        table.add_row(row);
    }
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}

/// A number with this many decimals, or a dash.
pub fn number(value: Option<f64>, decimals: usize) -> String {
    value.map_or_else(|| "–".to_owned(), |value| format!("{value:.decimals$}"))
}

/// Prints a line, or a table, to standard output. A reader that has read enough, such as `head`, may close it.
pub fn say(text: impl std::fmt::Display) -> Result<()> {
    match writeln!(std::io::stdout(), "{text}") {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        said => said.context("cannot write to standard output"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_that_are_not_there_yet_are_told_apart() {
        let folder = tempfile::tempdir().expect("a folder");
        let place = |name: &str| folder.path().join(name);
        std::fs::create_dir(place("sub")).expect("a folder");
        assert!(is_same(&place("a"), &place("sub/../a")) && !is_same(&place("a"), &place("b")));
        assert!(is_within(&place("new/a"), &place("sub/../new")) && is_within(&place("new"), &place("new")));
        assert!(!is_within(&place("newer"), &place("new")));
        let check = |inputs: &[PathBuf]| Outputs::default().file("--csv", Some(&place("a"))).check(inputs);
        check(&[place("a")]).expect("what is not there is not read");
        std::fs::write(place("a"), "").expect("written");
        std::fs::hard_link(place("a"), place("b")).expect("a link");
        assert!(check(&[place("b")]).is_err_and(|error| super::super::exit_code(&error) == 2));
    }
}
