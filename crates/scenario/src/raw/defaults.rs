//! The defaults of a file whose robot is a URDF.

use toml::{
    Spanned,
    de::{DeTable, DeValue, Error},
};

use super::Source;

/// The defaults of a file with a table, or about a robot elsewhere, key by key.
const MEASURED: &str = include_str!("../measured.toml");
/// The defaults for any robot with a description: its user asks where the hand will be.
const DESCRIBED: &str = "[selection]\ncriterion = \"i\"\n";

/// Adds the defaults to a document whose robot is a URDF: the list of joints from the description, the criterion, and, for a
/// table or a robot elsewhere, the keys of [`MEASURED`].
pub(super) fn complete(document: &mut DeTable<'_>, source: Source) -> Result<(), Error> {
    let Some(DeValue::Table(robot)) = document.get_mut("robot").map(Spanned::get_mut) else { return Ok(()) };
    let Some(urdf) = robot.get("urdf").map(Spanned::span) else { return Ok(()) };
    if !robot.contains_key("joint") {
        let none = Spanned::new(urdf.clone(), DeValue::Array(Default::default()));
        robot.insert(Spanned::new(urdf, "joint".into()), none);
    }
    if document.contains_key("selection") {
        add(document, DeTable::parse(DESCRIBED)?.into_inner());
    }
    if source == Source::External || document.contains_key("measurements") {
        add(document, DeTable::parse(MEASURED)?.into_inner());
    }
    Ok(())
}

/// Adds missing keys, in nested tables too.
fn add<'a>(to: &mut DeTable<'a>, from: DeTable<'a>) {
    for (key, value) in from {
        match (to.get_mut(&key).map(Spanned::get_mut), value.get_ref()) {
            (Some(DeValue::Table(given)), DeValue::Table(_)) => {
                if let DeValue::Table(more) = value.into_inner() {
                    add(given, more);
                }
            }
            (Some(_), _) => {}
            (None, _) => drop(to.insert(key, value)),
        }
    }
}
