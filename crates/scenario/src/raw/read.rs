//! Reading the keys of a file, and its errors.

use std::ops::Range;

use toml::de::DeTable;

use super::{Scenario, Source, defaults::complete};
use crate::error::{Problem, suggest};

/// Reads the keys of `text`.
pub fn read(text: &str, source: Source) -> Result<Scenario, Problem> {
    let mut document = DeTable::parse(text).map_err(|error| problem(text, "", &error))?;
    complete(document.get_mut(), source).map_err(|error| problem(text, "", &error))?;
    let deserializer = toml::Deserializer::from(document);
    serde_path_to_error::deserialize(deserializer).map_err(|error| {
        let path = readable_path(&error.path().to_string());
        problem(text, &path, error.inner())
    })
}

/// The line (from 1) of a byte offset.
pub fn line_of(text: &str, offset: usize) -> usize {
    text.as_bytes().iter().take(offset).filter(|&&byte| byte == b'\n').count() + 1
}

/// The place where `key` is given a value in the table that begins at `table`; the table itself if that cannot be
/// found.
pub fn key_in(text: &str, table: Range<usize>, key: &str) -> Range<usize> {
    let mut at = text[..table.start].rfind('\n').map_or(0, |end| end + 1);
    for (index, line) in text[at..].split_inclusive('\n').enumerate() {
        if index > 0 && line.trim_start().starts_with('[') {
            break;
        }
        if line.trim_start().strip_prefix(key).is_some_and(|rest| rest.trim_start().starts_with('=')) {
            return at..at + line.len();
        }
        at += line.len();
    }
    table
}

/// A path without what `Spanned` adds, except for the index of a sequence.
fn readable_path(path: &str) -> String {
    let mut readable = String::new();
    for part in path.split('.') {
        let (name, index) = part.find('[').map_or((part, ""), |bracket| part.split_at(bracket));
        if !(name.starts_with("$__") || name == "?" || name.is_empty()) {
            if !readable.is_empty() {
                readable.push('.');
            }
            readable.push_str(name);
        }
        readable.push_str(index);
    }
    readable
}

fn problem(text: &str, path: &str, error: &toml::de::Error) -> Problem {
    let message = error.message().to_owned();
    let line = error.span().map_or(1, |span| line_of(text, span.start));
    let quoted: Vec<&str> = message.split('`').skip(1).step_by(2).collect();
    let below = |key: &str| match path {
        "" => key.to_owned(),
        _ if path == key || path.ends_with(&format!(".{key}")) => path.to_owned(),
        _ => format!("{path}.{key}"),
    };
    match quoted.split_first() {
        Some((unknown, expected)) if message.starts_with("unknown field") => {
            let with_unit = expected.iter().find(|known| known.starts_with(&format!("{unknown}_")));
            let is_of_camera = path.starts_with("camera") || path.starts_with("sensor");
            let elsewhere = if path.is_empty() || path == *unknown { table_of(unknown) } else { None };
            let hint = match (with_unit, suggest(unknown, expected.iter().copied())) {
                _ if let Some(table) = elsewhere => format!("write it below [{table}]"),
                _ if is_of_camera && bends(unknown) => DISTORTION.to_owned(),
                (Some(known), _) => format!("write `{known}`: the unit belongs to the key"),
                (None, Some(known)) => format!("did you mean `{known}`? The keys here are {}", expected.join(", ")),
                (None, None) => format!("remove it; the keys here are {}", expected.join(", ")),
            };
            Problem { line, key: below(unknown), what: "unknown key".into(), hint }
        }
        Some((missing, _)) if message.starts_with("missing field") => Problem {
            line,
            key: below(missing),
            what: "missing".into(),
            hint: format!("add `{missing} = …` here; the built-in scenarios show each key with its meaning"),
        },
        Some((value, expected)) if message.starts_with("unknown variant") => Problem {
            line,
            key: path.to_owned(),
            what: format!("`{value}` is not a choice"),
            hint: format!("write one of {}", expected.join(", ")),
        },
        _ if let Some(number) = error.span().and_then(|span| without_zero(text, span.start)) => Problem {
            line,
            key: "(file)".to_owned(),
            what: format!("`{number}` is no number in TOML"),
            hint: format!("write {}", number.replacen('.', "0.", 1)),
        },
        _ => {
            let key = if path.is_empty() { "(file)".to_owned() } else { path.to_owned() };
            let (what, hint) = match message.split_once(", expected ") {
                Some((what, _)) if key.ends_with("size_px") => {
                    (what.to_owned(), "write two, width and height".to_owned())
                }
                Some((what, _)) if key.ends_with("centre_px") => (what.to_owned(), "write two, cx and cy".to_owned()),
                Some((what, expected)) => (what.to_owned(), format!("write {expected}{}", unit(&key))),
                None => (message.clone(), "correct the TOML on this line".to_owned()),
            };
            Problem { line, key, what, hint }
        }
    }
}

/// Keys that are looked for outside their tables, and these.
const BELOW: [(&str, &[&str]); 3] = [
    ("robot", &["learn", "hold", "offsets", "urdf", "tip", "tips", "coupled", "reading_sigma_deg"]),
    ("prior", &["direction_rad", "point_m", "offset_rad", "offset_m"]),
    ("held_out", &["folds", "rows"]),
];

/// The table to which a key belongs.
fn table_of(key: &str) -> Option<&'static str> {
    BELOW.iter().find(|(_, keys)| keys.contains(&key)).map(|(table, _)| *table)
}

/// The advice for a lens with distortion under another name.
const DISTORTION: &str = "write `distortion = [k1, k2, p1, p2, k3]` in the `[[camera]]`, in OpenCV's order, and `model = \"fisheye\"` for \
                          [k1, k2, k3, k4] of a fisheye; without it points are read as a pinhole sees them";

/// Whether a key describes a lens's distortion.
fn bends(key: &str) -> bool {
    const COEFFICIENTS: [&str; 11] = ["k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2", "d", "k", "coeffs"];
    let key = key.to_ascii_lowercase();
    key.starts_with("dist") && !key.starts_with("distance")
        || key.starts_with("radial")
        || key.starts_with("tangential")
        || COEFFICIENTS.contains(&key.as_str())
}

/// The unit that a key names, as the end of a sentence.
fn unit(key: &str) -> &'static str {
    match key.rsplit_once('_') {
        Some((_, "m")) => " in metres",
        Some((_, "deg")) => " in degrees",
        _ => "",
    }
}

/// The number around a byte offset whose first digit is missing, such as `.03`.
fn without_zero(text: &str, offset: usize) -> Option<&str> {
    let is_part = |c: char| c.is_ascii_alphanumeric() || "+-.".contains(c);
    let start = offset - text.get(..offset)?.rsplit(|c| !is_part(c)).next()?.len();
    let word = text[start..].split(|c| !is_part(c)).next()?;
    let digits = word.trim_start_matches(['+', '-']).strip_prefix('.')?;
    (digits.starts_with(|c: char| c.is_ascii_digit()) && word.parse::<f64>().is_ok()).then_some(word)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_of_a_table_is_sent_there() {
        let hint = |text: &str| match read(text, Source::File) {
            Ok(_) => panic!("{text} was taken"),
            Err(problem) => problem.hint,
        };
        for (table, keys) in BELOW {
            for key in keys {
                assert_eq!(hint(&format!("{key} = 1\n")), format!("write it below [{table}]"));
                let there = read(&format!("[{table}]\n{key} = 1\n"), Source::File).expect_err("no scenario");
                assert!(there.what != "unknown key", "{table}.{key}: {there}");
            }
        }
        assert!(hint("stps = 1\n").starts_with("did you mean `steps`?"));
        assert_eq!(hint("[[camera]]\nname = \"eye\"\nsize_px = 640\n"), "write two, width and height");
    }
}
