//! The text of a scenario with some of its values replaced, for sweeps.

use toml::{Table, Value};

/// The TOML `text` with the value at each dotted path replaced, say `filter.measurement_variance_m2`. A path leads
/// through tables that exist; its last key may be new. Comments are lost.
///
/// # Errors
///
/// A sentence that says why `text` is no TOML, or which part of a path is no table.
pub fn edited(text: &str, values: &[(String, Value)]) -> Result<String, String> {
    let mut document: Table = text.parse().map_err(|error: toml::de::Error| error.message().to_owned())?;
    for (path, value) in values {
        let (parents, key) = path.rsplit_once('.').unwrap_or(("", path));
        let mut table = &mut document;
        for part in parents.split('.').filter(|part| !part.is_empty()) {
            table = table
                .get_mut(part)
                .and_then(Value::as_table_mut)
                .ok_or_else(|| format!("`{path}`: there is no table `{part}` in this scenario"))?;
        }
        table.insert(key.to_owned(), value.clone());
    }
    toml::to_string(&document).map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{BUILTIN, Scenario};

    #[test]
    fn replaces_a_value_and_leaves_the_rest() {
        let values = [("filter.measurement_variance_m2".to_owned(), Value::Float(0.5)), ("steps".into(), 7.into())];
        let text = edited(BUILTIN[0].text, &values).expect("paths that exist");
        let scenario = Scenario::parse("edited", &text, &|_| Err("no data".into())).expect("still valid");
        assert_eq!((scenario.filter.variance, scenario.steps), (0.5, 7));
        assert_eq!(scenario.robot.names.len(), 6);
        let error = edited(BUILTIN[0].text, &[("filtre.x".into(), 1.into())]).expect_err("no such table");
        assert!(error.contains("filtre"), "{error}");
    }
}
