//! A scenario with some of its values replaced: for sweeps, and for who turns a knob.

use std::{fmt, str::FromStr};

use toml::{Table, Value};

use crate::{Scenario, ScenarioError, error::Problem};

/// The most values that are replaced at once, and the longest of them in characters: more are a slip.
const MOST: usize = 32;
const LONGEST: usize = 400;

/// A key of a scenario and the value that it is to have, as people write it: `sensor.sigma_m=0.002`.
#[derive(Clone, Debug, PartialEq)]
pub struct Replacement {
    /// The dotted path of the key; a part may be the name or the number, from 0, of a table in an array.
    pub key: String,
    /// The value.
    pub value: Value,
}

impl FromStr for Replacement {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (key, value) = text.split_once('=').ok_or_else(|| format!("`{text}` has no `=`; write KEY=VALUE"))?;
        let (key, value) = (key.trim(), value.trim());
        if key.is_empty() || key.split('.').any(str::is_empty) {
            return Err(format!("`{key}` is no key; write it as in a scenario file, say sensor.sigma_m"));
        }
        if key == "name" {
            return Err("`name`: a scenario keeps its name; change another key".to_owned());
        }
        if text.chars().count() > LONGEST {
            return Err(format!("`{key}`: the value is longer than {LONGEST} characters; write it in a scenario file"));
        }
        let is_one_line = !value.contains(['\n', '\r']);
        let read = is_one_line.then(|| format!("value = {value}").parse::<Table>().ok()).flatten();
        let read = read.and_then(|mut table| table.remove("value")).ok_or_else(|| {
            format!("`{key}`: `{value}` is no value in TOML; write a number, true, false, \"text\", [a, list] or {{ a = 1 }}")
        })?;
        Ok(Self { key: key.to_owned(), value: read })
    }
}

impl fmt::Display for Replacement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}={}", self.key, self.value)
    }
}

impl Scenario {
    /// This scenario with other values of some keys, held to all that a scenario file is held to. Its name stays, and
    /// its [`replaced`](Self::replaced) tells what is other.
    ///
    /// # Errors
    ///
    /// [`ScenarioError::Invalid`] if a path leads nowhere, or if the values do not make a valid scenario.
    pub fn with(&self, replacements: &[Replacement]) -> Result<Self, ScenarioError> {
        let told: Vec<String> = replacements.iter().map(ToString::to_string).collect();
        let file = format!("{} with {}", self.name, told.join(" and "));
        let refused = |key: &str, what: String, hint: String| ScenarioError::Invalid {
            file: file.clone(),
            problems: vec![Problem { line: 1, key: key.to_owned(), what, hint }],
        };
        if replacements.len() > MOST {
            let what = format!("{} values are replaced", replacements.len());
            return Err(refused("(all)", what, format!("replace {MOST} at most, or write a scenario file")));
        }
        let values: Vec<(String, Value)> =
            replacements.iter().map(|one| (one.key.clone(), one.value.clone())).collect();
        let text = edited(&self.source, &values).map_err(|what| {
            let key = replacements.first().map_or("(all)", |one| one.key.as_str());
            refused(key, what, "write a key of the scenario file, with its tables in front".to_owned())
        })?;
        let scenario = Self::parse(&file, &text, &|name| self.data_file(name))?;
        Ok(Self { replaced: self.replaced.iter().cloned().chain(told).collect(), ..scenario })
    }
}

/// The TOML `text` with the value at each dotted path replaced, say `filter.measurement_variance_m2`. A path leads
/// through tables that exist, and through arrays of tables by a table's name or number; its last key may be new.
/// Comments are lost.
///
/// # Errors
///
/// A sentence that says why `text` is no TOML, or which part of a path is no table.
pub fn edited(text: &str, values: &[(String, Value)]) -> Result<String, String> {
    let document: Table = text.parse().map_err(|error: toml::de::Error| error.message().to_owned())?;
    let mut document = Value::Table(document);
    for (path, value) in values {
        let (parents, key) = path.rsplit_once('.').unwrap_or(("", path));
        let mut at = &mut document;
        for part in parents.split('.').filter(|part| !part.is_empty()) {
            at = match at {
                Value::Table(table) => table.get_mut(part),
                Value::Array(tables) => element(tables, part),
                _ => None,
            }
            .ok_or_else(|| format!("`{path}`: there is no table `{part}` in this scenario"))?;
        }
        let table = at.as_table_mut().ok_or_else(|| format!("`{path}`: `{parents}` is no table in this scenario"))?;
        table.insert(key.to_owned(), value.clone());
    }
    toml::to_string(&document).map_err(|error| error.to_string())
}

/// The table of an array that has this name, or this number.
fn element<'a>(tables: &'a mut [Value], part: &str) -> Option<&'a mut Value> {
    let named = |table: &Value| table.get("name").and_then(Value::as_str) == Some(part);
    let place = tables.iter().position(named).or_else(|| part.parse().ok())?;
    tables.get_mut(place)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{BUILTIN, builtin};

    fn replacements(texts: &[&str]) -> Vec<Replacement> {
        texts.iter().map(|text| text.parse().expect("a replacement")).collect()
    }

    #[test]
    fn replaces_a_value_and_leaves_the_rest() {
        let values = [("filter.measurement_variance_m2".to_owned(), Value::Float(0.5)), ("steps".into(), 7.into())];
        let text = edited(BUILTIN[0].text, &values).expect("paths that exist");
        let scenario = Scenario::parse("edited", &text, &|_| Err("no data".into())).expect("still valid");
        assert_eq!((scenario.filter.variance, scenario.steps), (0.5, 7));
        assert_eq!(scenario.robot.names.len(), 6);
        let error = edited(BUILTIN[0].text, &[("filtre.x".into(), 1.into())]).expect_err("no such table");
        assert!(error.contains("filtre"), "{error}");
        let in_array = edited(BUILTIN[0].text, &[("robot.joint.elbow.limits_deg".into(), Value::Array(Vec::new()))]);
        assert!(in_array.expect("a joint by its name").contains("limits_deg = []"));
    }

    #[test]
    fn a_scenario_tells_what_was_replaced_and_is_held_to_the_same() {
        let scenario = builtin("arm-6dof").expect("built in");
        let turned = scenario.with(&replacements(&["sensor.sigma_m = 0.002", "robot.joint.elbow.learned=false"]));
        let turned = turned.expect("valid");
        assert_eq!(turned.replaced, ["sensor.sigma_m=0.002", "robot.joint.elbow.learned=false"]);
        assert!((turned.measurement_model.sigma() - 0.002).abs() < 1e-12 && turned.name == "arm-6dof");
        assert!(scenario.replaced.is_empty());
        let broken = "change={step = 20, tilt = {joint = \"elbow\", angle_deg = 20.0, towards = [0.6, 0.0, 0.8]}}";
        let broken = scenario.with(&replacements(&[broken])).expect("a change of the body");
        assert_eq!(broken.experiment(1, None).expect("an experiment").setting().change_at, Some(20));
        for (text, word) in [
            ("sensor.sigma_m=-1", "sensor.sigma_m"),
            ("sensor.sigma=1", "sensor.sigma"),
            ("nothing.here=1", "there is no table `nothing`"),
        ] {
            let error = scenario.with(&replacements(&[text])).expect_err(text).to_string();
            assert!(error.contains(word), "{text}: {error}");
        }
    }

    #[test]
    fn measured_data_come_along() {
        let scenario = builtin("tiago-mocap").expect("built in");
        let turned = scenario.with(&replacements(&["selection.evaluations=50"])).expect("valid");
        assert_eq!(turned.data, scenario.data);
    }

    #[test]
    fn what_is_no_replacement_is_said() {
        for (text, word) in [
            ("sensor.sigma_m", "KEY=VALUE"),
            ("=1", "is no key"),
            ("a..b=1", "is no key"),
            ("name=\"other\"", "keeps its name"),
            ("steps=many", "no value in TOML"),
            ("steps=1\nname=\"x\"", "no value in TOML"),
        ] {
            let error = text.parse::<Replacement>().expect_err(text);
            assert!(error.contains(word), "{text}: {error}");
        }
        let long = format!("title=\"{}\"", "x".repeat(500));
        assert!(long.parse::<Replacement>().is_err_and(|error| error.contains("longer than")));
    }
}
