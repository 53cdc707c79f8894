//! Columns whose titles say no unit, and a table in which they do.

use body_schema_engine::kinematics::JointKind;
use body_schema_table::{Quantity, Title, split};

use super::columns::Sensor;

/// The titles of columns that say no unit: they are read as radians and metres.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Unitless {
    /// Those of angles.
    pub angles: Vec<String>,
    /// Those of lengths.
    pub lengths: Vec<String>,
}

impl Unitless {
    pub(super) fn of<'t>(joints: impl Iterator<Item = (&'t String, JointKind)>, sensors: &'t [Sensor]) -> Self {
        let joints = joints.map(|(title, kind)| (title, Some(Quantity::of(kind))));
        let columns = sensors.iter().flat_map(|sensor| &sensor.columns);
        let sensed = columns.map(|title| (title, Title::parse(title).map(|it| it.component.quantity())));
        let mut unitless = Self::default();
        for (title, quantity) in joints.chain(sensed).filter(|(title, _)| split(title).1.is_empty()) {
            match quantity {
                Some(Quantity::Angle) => unitless.angles.push(title.clone()),
                Some(Quantity::Length) => unitless.lengths.push(title.clone()),
                _ => {}
            }
        }
        unitless
    }

    /// The table with these units behind such titles, as in `elbow_deg`; all else of it stays as it is.
    pub fn said_in(&self, table: &str, angle: Option<&str>, length: Option<&str>) -> String {
        let mut reader = csv::ReaderBuilder::new().has_headers(false).flexible(true).from_reader(table.as_bytes());
        let mut titles = csv::StringRecord::new();
        // What cannot be read is told where it is read.
        if !reader.read_record(&mut titles).unwrap_or(false) {
            return table.to_owned();
        }
        let said = |title: &str| {
            let is_in = |list: &[String]| list.iter().any(|other| other == title.trim());
            let unit = angle.filter(|_| is_in(&self.angles)).or(length.filter(|_| is_in(&self.lengths)));
            unit.map_or_else(|| title.to_owned(), |unit| format!("{}_{unit}", title.trim_end()))
        };
        let mut line = csv::WriterBuilder::new().terminator(csv::Terminator::Any(b'\n')).from_writer(Vec::new());
        let written = line.write_record(titles.iter().map(said)).ok().and_then(|()| line.into_inner().ok());
        let written = written.and_then(|line| String::from_utf8(line).ok()).unwrap_or_default();
        let end = usize::try_from(reader.position().byte()).unwrap_or(table.len());
        let (line, rest) = table.split_at_checked(end).unwrap_or((table, ""));
        // Of an end of two characters the reader takes the second with the next line.
        let rest = if line.ends_with('\r') { rest.strip_prefix('\n').unwrap_or(rest) } else { rest };
        format!("{written}{rest}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_stand_behind_titles_that_have_none() {
        let words = |all: &[&str]| all.iter().map(|word| (*word).to_owned()).collect();
        let unitless = Unitless { angles: words(&["turn", "a, b"]), lengths: words(&["hand_x", "lift"]) };
        for end in ["\n", "\r\n", "\r"] {
            let rows = format!("{end}0.1,2,3,\"4\",5{end}# no comment{end}");
            let table = format!("\u{feff}turn, lift ,hand_x,hand_y_m,\"a, b\"{end}{rows}");
            let titles = "turn_deg, lift_mm,hand_x_mm,hand_y_m,\"a, b_deg\"\n";
            assert_eq!(unitless.said_in(&table, Some("deg"), Some("mm")), format!("{titles}{rows}"));
        }
        assert_eq!(unitless.said_in("turn,lift\n1,2", Some("deg"), None), "turn_deg,lift\n1,2");
        assert_eq!(unitless.said_in("", Some("deg"), None), "");
    }
}
