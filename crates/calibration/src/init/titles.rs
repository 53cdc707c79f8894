//! What the columns of a table were taken for, and a table whose titles say something else.

use std::collections::BTreeMap;

use body_schema_engine::kinematics::JointKind;
use body_schema_table::{Quantity, Table, TableError, Title, split};

use super::columns::{Measured, of_joint};

/// A column, and what its title was taken for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Taken {
    /// The title.
    pub title: String,
    /// The title that says the same and nothing else: a joint's name, `hand_x`, `place`. `None` for a column that is passed over.
    pub role: Option<String>,
    /// What it measures; `None` for labels and columns that are passed over.
    pub quantity: Option<Quantity>,
}

impl Taken {
    /// Every column of `titles`, in order.
    pub(super) fn all(titles: &[String], joints: &[(String, JointKind)], measured: &Measured) -> Vec<Self> {
        let of_joints = joints.iter().filter_map(|(name, kind)| {
            Some((of_joint(titles, name, *kind)?, (name.clone(), Some(Quantity::of(*kind)))))
        });
        let sensed = measured.sensors.iter().flat_map(|sensor| &sensor.columns);
        let sensed = sensed.filter_map(|title| {
            let parts = Title::parse(title)?;
            Some((title, (Title { unit: "", ..parts }.to_string(), Some(parts.component.quantity()))))
        });
        let labels = measured.sockets.iter().flat_map(|(place, socket)| [place, socket]);
        let labels = labels.map(|title| (title, (title.clone(), None)));
        let roles: BTreeMap<&String, (String, Option<Quantity>)> = of_joints.chain(sensed).chain(labels).collect();
        let taken = |title: &String| {
            let (role, quantity) = roles.get(title).cloned().map_or((None, None), |(role, is)| (Some(role), is));
            Self { title: title.clone(), role, quantity }
        };
        titles.iter().filter(|title| !title.is_empty()).map(taken).collect()
    }

    /// Whether it is an angle or a length whose title says no unit, so that it is read as radians or metres.
    pub fn says_no_unit(&self) -> bool {
        matches!(self.quantity, Some(Quantity::Angle | Quantity::Length)) && split(&self.title).1.is_empty()
    }
}

/// The table with units behind the titles of `columns` that say none, as in `elbow_deg`; all else of it stays as it is.
///
/// # Errors
///
/// [`TableError`] if the table has no titles.
pub fn with_units(
    table: &str,
    columns: &[Taken],
    angle: Option<&str>,
    length: Option<&str>,
) -> Result<String, TableError> {
    let said = |title: &str| {
        let column = columns.iter().find(|column| column.title == title && column.says_no_unit())?;
        let unit = if column.quantity == Some(Quantity::Angle) { angle } else { length };
        unit.map(|unit| format!("{title}_{unit}"))
    };
    retitled(table, &said)
}

/// The table with other titles for some columns: `roles` has what they hold, as [`Taken::role`], by the titles that they have. Units at
/// their ends stay. Another column whose title says the same is passed over from then on.
///
/// # Errors
///
/// [`TableError`] if the table has no titles, or not one of these.
pub fn with_roles(table: &str, roles: &BTreeMap<String, Option<String>>) -> Result<String, TableError> {
    let titles = Table::open(table.as_bytes())?.titles().clone();
    if let Some(unknown) = roles.keys().find(|title| !titles.all().contains(title)) {
        let what = format!("line 1: there is no column `{unknown}`");
        return Err(TableError::new(what, format!("its columns are {}", titles.all().join(", "))));
    }
    let unused = |title: &str| Some(format!("{title}_unused"));
    let is_said = |title: &str| roles.values().flatten().any(|role| split(title).0.eq_ignore_ascii_case(role));
    let said = |title: &str| match roles.get(title) {
        Some(Some(role)) => match split(title).1 {
            "" => Some(role.clone()),
            unit => Some(format!("{role}_{unit}")),
        },
        Some(None) => unused(title),
        None if is_said(title) => unused(title),
        None => None,
    };
    retitled(table, &said)
}

/// The table with other titles, where `said` has one.
fn retitled(table: &str, said: &dyn Fn(&str) -> Option<String>) -> Result<String, TableError> {
    let titles = Table::open(table.as_bytes())?.titles().clone();
    let all = titles.all().iter().map(|title| said(title).unwrap_or_else(|| title.clone()));
    let mut reader = csv::ReaderBuilder::new().has_headers(false).flexible(true).from_reader(table.as_bytes());
    let mut line = csv::WriterBuilder::new().terminator(csv::Terminator::Any(b'\n')).from_writer(Vec::new());
    // Both lines were read already: what cannot be read was refused there.
    let _ = reader.read_record(&mut csv::StringRecord::new());
    let written = line.write_record(all).ok().and_then(|()| line.into_inner().ok());
    let written = written.and_then(|line| String::from_utf8(line).ok()).unwrap_or_default();
    let end = usize::try_from(reader.position().byte()).unwrap_or(table.len());
    let (line, rest) = table.split_at_checked(end).unwrap_or((table, ""));
    // Of an end of two characters the reader takes the second with the next line.
    let rest = if line.ends_with('\r') { rest.strip_prefix('\n').unwrap_or(rest) } else { rest };
    Ok(format!("{written}{rest}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn taken(title: &str, quantity: Quantity) -> Taken {
        Taken { title: title.to_owned(), role: Some(title.to_owned()), quantity: Some(quantity) }
    }

    #[test]
    fn units_stand_behind_titles_that_have_none() {
        let angles = ["turn", "a, b"].map(|title| taken(title, Quantity::Angle));
        let lengths = ["hand_x", "lift", "hand_y_m"].map(|title| taken(title, Quantity::Length));
        let columns = [&angles[..], &lengths].concat();
        for end in ["\n", "\r\n", "\r"] {
            let rows = format!("{end}0.1,2,3,\"4\",5{end}# no comment{end}");
            let table = format!("\u{feff}turn, lift ,hand_x,hand_y_m,\"a, b\"{end}{rows}");
            let titles = "turn_deg,lift_mm,hand_x_mm,hand_y_m,\"a, b_deg\"\n";
            assert_eq!(with_units(&table, &columns, Some("deg"), Some("mm")), Ok(format!("{titles}{rows}")));
        }
        assert_eq!(with_units("turn,lift\n1,2", &columns, Some("deg"), None).as_deref(), Ok("turn_deg,lift\n1,2"));
        assert!(with_units("", &columns, Some("deg"), None).is_err());
    }

    #[test]
    fn columns_hold_what_is_said_of_them() {
        let roles = |all: &[(&str, Option<&str>)]| {
            all.iter().map(|(title, role)| ((*title).to_owned(), role.map(str::to_owned))).collect::<BTreeMap<_, _>>()
        };
        let table = "A1 (deg),A2,elbow_deg,Elbow,x\n1,2,3,4,5\n";
        let said = roles(&[("A1 (deg)", Some("elbow")), ("A2", Some("hand_x")), ("x", None)]);
        let titles = "elbow_deg,hand_x,elbow_deg_unused,Elbow_unused,x_unused";
        assert_eq!(with_roles(table, &said), Ok(format!("{titles}\n1,2,3,4,5\n")));
        assert_eq!(with_roles(table, &roles(&[])).as_deref(), Ok(table));
        let error = with_roles(table, &roles(&[("A3", None)])).expect_err("no such column");
        assert!(error.to_string().contains("`A3`") && error.to_string().contains("A1 (deg), A2"), "{error}");
    }
}
