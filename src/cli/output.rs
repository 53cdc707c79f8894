//! Where results go: files, standard output, tables.

use std::{
    fs::File,
    io::{BufWriter, Write},
    path::{Path, PathBuf},
};

use anyhow::{Context, Result};
use comfy_table::{CellAlignment, ContentArrangement, Table, presets};
use serde::Serialize;

use super::BadInput;

/// Whether a path means standard output.
pub fn is_stdout(path: &Path) -> bool {
    path.as_os_str() == "-"
}

/// Writes `value` as indented JSON to a file, or to standard output for `-`.
pub fn write_json(path: &Path, value: &impl Serialize) -> Result<()> {
    let text = serde_json::to_string_pretty(value).context("cannot write JSON")?;
    if is_stdout(path) {
        writeln!(std::io::stdout().lock(), "{text}")?;
        return Ok(());
    }
    std::fs::write(path, text + "\n").with_context(|| format!("cannot write {}", path.display()))
}

/// Refuses two options that would write to the same file, whatever the ways that lead to it.
pub fn distinct<'a>(outputs: impl IntoIterator<Item = (&'static str, &'a Option<PathBuf>)>) -> Result<()> {
    let mut taken: Vec<(&str, PathBuf)> = Vec::new();
    let given = outputs.into_iter().filter_map(|(option, path)| Some((option, path.as_deref()?)));
    for (option, path) in given.filter(|(_, path)| !is_stdout(path)) {
        let place = resolved(path);
        if let Some((other, _)) = taken.iter().find(|(_, known)| *known == place) {
            let path = path.display();
            return Err(BadInput(format!("{other} and {option} would both write {path}; name two files")).into());
        }
        taken.push((option, place));
    }
    Ok(())
}

/// Where a path leads; of a file that is not there yet, where its folder is.
fn resolved(path: &Path) -> PathBuf {
    let in_folder = || {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        Some(folder.canonicalize().ok()?.join(path.file_name()?))
    };
    path.canonicalize().ok().or_else(in_folder).unwrap_or_else(|| path.to_owned())
}

/// Creates a file for buffered writing.
pub fn create(path: &Path) -> Result<BufWriter<File>> {
    Ok(BufWriter::new(File::create(path).with_context(|| format!("cannot create {}", path.display()))?))
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

/// A number with so many decimals, or a dash.
pub fn number(value: Option<f64>, decimals: usize) -> String {
    value.map_or_else(|| "–".to_owned(), |value| format!("{value:.decimals$}"))
}

/// Prints a line, or a table, to standard output.
pub fn say(text: impl std::fmt::Display) -> Result<()> {
    Ok(writeln!(std::io::stdout(), "{text}")?)
}
