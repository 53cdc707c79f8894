//! Reading JSON: errors name the field, and a key that is there twice is refused, because some readers take the first of them and
//! others the last.

use std::{collections::HashSet, fmt};

use serde::de::{DeserializeOwned, DeserializeSeed, Deserializer, Error, IgnoredAny, MapAccess, SeqAccess, Visitor};

/// Why a text cannot be read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unreadable {
    /// Whether it is no JSON at all.
    pub is_malformed: bool,
    /// The field that is wrong, with its path, such as `parts[1].length`.
    pub field: Option<String>,
    /// What is wrong.
    pub what: String,
    /// What to do.
    pub hint: &'static str,
}

/// Reads an object.
///
/// # Errors
///
/// [`Unreadable`] if it is no JSON, no object, does not fit `T`, or has a key twice.
pub fn read<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, Unreadable> {
    // Syntax first: a text that breaks off is not blamed on the field where it does.
    serde_json::from_slice::<IgnoredAny>(bytes).map_err(|error| Unreadable {
        is_malformed: true,
        field: None,
        what: format!("the body is not JSON: {error}"),
        hint: "correct the JSON",
    })?;
    let refuse = |field: Option<String>, what: &str, hint: &'static str| {
        Err(Unreadable { is_malformed: false, field, what: what.to_owned(), hint })
    };
    if !bytes.trim_ascii_start().starts_with(b"{") {
        return refuse(None, "the body must be a JSON object", "write {…}");
    }
    if let Some(field) = repeated(bytes) {
        return refuse(Some(field), "it is there twice", "write it once");
    }
    // Then what it says, which also finds numbers that are too large.
    let mut deserializer = serde_json::Deserializer::from_slice(bytes);
    serde_path_to_error::deserialize(&mut deserializer).or_else(|error| {
        let message = error.inner().to_string();
        let path = error.path().to_string();
        // Missing and unknown fields are named in the message only; the path may end above them.
        let named = message.split_once("field `").and_then(|(_, rest)| rest.split_once('`')).map(|(name, _)| name);
        let field = match (named, path.as_str()) {
            (Some(name), ".") => Some(name.to_owned()),
            (None, ".") => None,
            (Some(name), path) if path != name && !path.ends_with(&format!(".{name}")) => {
                Some(format!("{path}.{name}"))
            }
            (_, path) => Some(path.to_owned()),
        };
        let hint = match &message {
            message if message.starts_with("missing field") => "add it",
            message if message.starts_with("unknown field") => "correct its name, or remove it",
            _ => "write a value of the kind that is expected",
        };
        refuse(field, message.split(" at line ").next().unwrap_or(&message), hint)
    })
}

/// The path of the first key that an object has twice; `None` for text that is no JSON.
pub fn repeated(bytes: &[u8]) -> Option<String> {
    let mut found = None;
    let mut deserializer = serde_json::Deserializer::from_slice(bytes);
    // Whatever else is wrong is found by who reads it.
    let _ = Walk { path: String::new(), found: &mut found }.deserialize(&mut deserializer);
    found
}

/// Goes through a value at a path.
struct Walk<'a> {
    path: String,
    found: &'a mut Option<String>,
}

impl<'de> DeserializeSeed<'de> for Walk<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Walk<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a value")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(), A::Error> {
        let mut keys = HashSet::new();
        while let Some(key) = map.next_key::<String>()? {
            let path = if self.path.is_empty() { key.clone() } else { format!("{}.{key}", self.path) };
            if !keys.insert(key) {
                *self.found = Some(path);
                return Err(A::Error::custom("a key is there twice"));
            }
            map.next_value_seed(Walk { path, found: self.found })?;
        }
        Ok(())
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<(), A::Error> {
        for index in 0.. {
            let path = format!("{}[{index}]", self.path);
            if list.next_element_seed(Walk { path, found: self.found })?.is_none() {
                break;
            }
        }
        Ok(())
    }

    fn visit_bool<E: Error>(self, _: bool) -> Result<(), E> {
        Ok(())
    }

    fn visit_i64<E: Error>(self, _: i64) -> Result<(), E> {
        Ok(())
    }

    fn visit_u64<E: Error>(self, _: u64) -> Result<(), E> {
        Ok(())
    }

    fn visit_f64<E: Error>(self, _: f64) -> Result<(), E> {
        Ok(())
    }

    fn visit_str<E: Error>(self, _: &str) -> Result<(), E> {
        Ok(())
    }

    fn visit_unit<E: Error>(self) -> Result<(), E> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use serde_json::Value;

    use super::*;

    #[test]
    fn a_key_that_is_there_twice_is_found_wherever_it_is() {
        for (text, path) in [
            (r#"{"a":1,"b":{"a":2},"c":[{"a":1},{"a":2}]}"#, None),
            (r#"{"a":1,"a":1}"#, Some("a")),
            (r#"{"a":1,"\u0061":1}"#, Some("a")),
            (r#"{"b":{"c":1,"d":2,"c":3}}"#, Some("b.c")),
            (r#"{"b":[0,[{"c":1},{"c":1,"c":null}]]}"#, Some("b[1][1].c")),
            (r#"{"b":[{"c":1e999,"c":2}]}"#, None),
            ("{", None),
            ("", None),
            ("[1, true, null, -1, 0.5, \"x\"]", None),
        ] {
            assert_eq!(repeated(text.as_bytes()).as_deref(), path, "{text}");
        }
        let error = read::<Value>(br#"{"b":{"c":1,"c":3}}"#).expect_err("twice");
        assert_eq!((error.is_malformed, error.field.as_deref(), error.hint), (false, Some("b.c"), "write it once"));
        let error = read::<Value>(br#"{"b":[{"c":1e999,"c":2}]}"#).expect_err("too large");
        assert!(!error.is_malformed && error.field.is_some(), "{error:?}");
        assert!(read::<Value>(b"{").expect_err("broken off").is_malformed);
    }
}
