//! What a file leaves out whose robot is a URDF.

use toml::{
    Spanned,
    de::{DeTable, DeValue, Error},
};

use super::Source;

/// What is said where such a file says nothing, key by key.
const MEASURED: &str = include_str!("../measured.toml");
/// What is said of any robot that a description tells: whoever has one asks where the hand will be.
const DESCRIBED: &str = "[selection]\ncriterion = \"i\"\n";

/// Adds to a document whose robot is a URDF what it leaves out: the list of joints, which the description has, the criterion, and
/// where its measurements are a table, or it stands elsewhere, the keys of [`MEASURED`].
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
    if source == Source::Outside || document.contains_key("measurements") {
        add(document, DeTable::parse(MEASURED)?.into_inner());
    }
    Ok(())
}

/// Adds what is missing, in tables too.
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
