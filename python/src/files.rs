//! Files that are named in Python.

use std::path::Path;

use body_schema_scenario::{Scenario, ScenarioError, builtin};

use crate::refusal::Failure;

/// The text of a file, in which a byte order mark is no part.
pub fn text(path: &str) -> Result<String, Failure> {
    let text = std::fs::read_to_string(path);
    let text = text.map_err(|error| Failure::new("EngineError", format!("cannot read {path}: {error}")))?;
    Ok(text.strip_prefix('\u{feff}').map_or_else(|| text.clone(), str::to_owned))
}

/// A built-in scenario by its name, or that of a file that ends with `.toml`.
pub fn scenario(name: &str) -> Result<Scenario, Failure> {
    parsed(name, Scenario::parse)
}

/// A scenario as [`scenario`] has it, or the robot of a calibration file that has neither a table nor a simulated world.
pub fn robot(name: &str) -> Result<Scenario, Failure> {
    parsed(name, |name, text, open| {
        let has = |begin: &str| text.lines().any(|line| line.trim_start().starts_with(begin));
        match has("urdf") && !has("[measurements]") && !has("[initial_error]") {
            true => Scenario::parse_outside(name, text, open),
            false => Scenario::parse(name, text, open),
        }
    })
}

type Open<'a> = &'a dyn Fn(&str) -> Result<String, String>;

fn parsed(
    name: &str,
    parse: impl FnOnce(&str, &str, Open<'_>) -> Result<Scenario, ScenarioError>,
) -> Result<Scenario, Failure> {
    let path = Path::new(name);
    if path.extension().is_none_or(|end| end != "toml") {
        return Ok(builtin(name)?);
    }
    let folder = path.parent().unwrap_or(Path::new("")).to_path_buf();
    let open = |file: &str| std::fs::read_to_string(folder.join(file)).map_err(|error| error.to_string());
    Ok(parse(name, &text(name)?, &open)?)
}
