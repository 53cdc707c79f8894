//! Loading scenarios and their data.

use std::{
    fs::File,
    io::{ErrorKind, Read},
    path::{Path, PathBuf},
};

use anyhow::Result;
use body_schema_ask_tell::Session;
use body_schema_scenario::{BUILTIN, Scenario, ScenarioError, builtin};
use body_schema_table::{Guard, MOST_BYTES};

use super::BadInput;

/// The most bytes of a scenario file or a description.
const MOST_TEXT: u64 = 16 << 20;

/// Reads the text of a scenario, as [`Scenario::parse`] does.
type Parse = fn(&str, &str, &dyn Fn(&str) -> Result<String, String>) -> Result<Scenario, ScenarioError>;

/// Loads a built-in scenario by name, or else a file by path.
pub fn load_scenario(name: &str) -> Result<Scenario> {
    load(name, Scenario::parse)
}

/// Loads a scenario as [`load_scenario`] does, or a calibration file without a table: of a robot that is still to be
/// measured.
pub fn load_robot(name: &str) -> Result<Scenario> {
    load(name, |file, text, open| {
        let is_unmeasured = |keys: toml::Table| {
            let robot = keys.get("robot").and_then(toml::Value::as_table);
            let is_described = robot.is_some_and(|robot| robot.contains_key("urdf"));
            is_described && !keys.contains_key("measurements") && !keys.contains_key("initial_error")
        };
        // What is no TOML is told by whoever reads it.
        match text.parse().is_ok_and(is_unmeasured) {
            true => Scenario::parse_outside(file, text, open),
            false => Scenario::parse(file, text, open),
        }
    })
}

fn load(name: &str, parse: Parse) -> Result<Scenario> {
    let path = PathBuf::from(name);
    if BUILTIN.iter().any(|builtin| builtin.name == name) {
        return Ok(builtin(name)?);
    }
    let looks_like_a_path = path.extension().is_some() || name.contains(std::path::MAIN_SEPARATOR) || path.exists();
    if !looks_like_a_path {
        return Ok(builtin(name)?);
    }
    let text =
        read_text(&path, MOST_TEXT).map_err(|error| BadInput(format!("the scenario {} {error}", path.display())))?;
    if text.trim_start().starts_with('{') {
        return of_session(&path, &text);
    }
    let folder = path.parent().map(PathBuf::from).unwrap_or_default();
    Ok(parse(name, &text, &|file| read_data(&folder.join(file)))?)
}

/// What was measured in a session, as it was saved.
fn of_session(path: &Path, text: &str) -> Result<Scenario> {
    let bad = |why: &dyn std::fmt::Display| BadInput(format!("the session {}: {why}", path.display()));
    let session = Session::from_json(text).map_err(|error| bad(&error))?;
    Ok(session.results().map_err(|error| bad(&error))?.into_scenario())
}

/// The files that a scenario was read from; empty for a built-in one.
pub fn files_of(name: &str, scenario: &Scenario) -> Vec<PathBuf> {
    if BUILTIN.iter().any(|builtin| builtin.name == name) {
        return Vec::new();
    }
    let path = PathBuf::from(name);
    let folder = path.parent().map(PathBuf::from).unwrap_or_default();
    scenario.data.iter().map(|(file, _)| folder.join(file)).chain([path.clone()]).collect()
}

/// The text of a table, or of a robot's description; which of the two is decided by the file's name.
pub(super) fn read_data(path: &Path) -> Result<String, String> {
    let is_description =
        path.extension().is_some_and(|end| ["urdf", "xml", "xacro"].iter().any(|it| end.eq_ignore_ascii_case(it)));
    read_text(path, if is_description { MOST_TEXT } else { MOST_BYTES })
}

/// The text of a file of at most `most` bytes. An error continues a sentence that begins with the file's name. Endless or binary
/// input is refused as soon as it is recognised.
pub(super) fn read_text(path: &Path, most: u64) -> Result<String, String> {
    let file = File::open(path).map_err(|error| format!("cannot be read: {error}"))?;
    let long = file.metadata().map(|found| found.len()).ok().filter(|long| *long > most);
    if let Some(long) = long {
        return Err(format!("has {} MiB, and {} MiB at most are read", long.div_ceil(1 << 20), most >> 20));
    }
    let mut bytes = Vec::new();
    Guard::new(file, most).read_to_end(&mut bytes).map_err(|error| match error.kind() {
        ErrorKind::InvalidData => error.to_string(),
        _ => format!("cannot be read: {error}"),
    })?;
    String::from_utf8(bytes)
        .map_err(|error| format!("is not text in UTF-8: its byte {} is not", error.utf8_error().valid_up_to() + 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_text_is_said() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("data.csv");
        let error = |bytes: &[u8]| {
            std::fs::write(&path, bytes).expect("written");
            read_text(&path, 100).expect_err("no text")
        };
        assert_eq!(error(b"x,y\n\x80"), "is not text in UTF-8: its byte 5 is not");
        assert_eq!(error(b"\xff\xfex\0"), "is text in UTF-16; save it in UTF-8");
        assert_eq!(error(b"x,y\n1,\0"), "is not text: its byte 7 is 0");
        assert!(read_text(&folder.path().join("none"), 1).expect_err("no file").starts_with("cannot be read: "));
    }

    #[test]
    fn what_is_too_long_is_not_read() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("long.urdf");
        File::create(&path).and_then(|file| file.set_len(MOST_TEXT + 1)).expect("a file with a hole");
        assert_eq!(read_data(&path).expect_err("long"), "has 17 MiB, and 16 MiB at most are read");
    }
}
