//! Recorded measurements, read from CSV.

use std::{collections::BTreeMap, sync::Arc};

use body_schema_engine::sensing::Observation;
use body_schema_table::{Columns, Table, TableError, Titles};

/// Recorded joint positions and readings, row by row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Measurements {
    /// Joint positions, rad or m per joint that moves.
    pub configurations: Vec<Vec<f64>>,
    /// The observations: the readings of the scenario's measurement model. That something was held in a socket is one of them, unless
    /// the socket is held out.
    pub observations: Vec<Observation>,
    /// The line of its file that each row stands on, counted from 1.
    pub lines: Vec<usize>,
    /// The file of each row; empty where all rows are from one.
    pub files: Vec<Arc<str>>,
    /// The number of each row in its file, from 0; lines without a measurement are counted.
    pub numbers: Vec<usize>,
    /// The socket in which a target was held in each row: its number among the robot's sockets, held-out ones after the
    /// others. Empty without sockets.
    pub sockets: Vec<Option<usize>>,
    /// Columns of text by their titles, row by row.
    pub labels: BTreeMap<String, Vec<String>>,
    /// Observations from before any movement, such as the distance between two sockets.
    pub beforehand: Option<Observation>,
    /// The titles of the joints' columns; empty for a joint without one.
    pub columns: Vec<String>,
    /// The names of the joints without a column: nothing that is measured moves with them, and they are held at 0.
    pub unread: Vec<String>,
    /// The titles of each channel's columns.
    pub readings: Vec<String>,
    /// Columns that repeat another in every row, with that other; only where one of the two is used here.
    pub repeated: Vec<(String, String)>,
}

impl Measurements {
    /// Reads the columns that `wanted` finds among the titles of a CSV text: columns are separated by commas, and a number has a
    /// decimal point if anything (`0.03`, `.03`, `3e-2`). Titles may end with a unit (see [`table`](body_schema_table)). A line
    /// without a measurement is skipped, in a table without labels.
    ///
    /// # Errors
    ///
    /// [`TableError`], which names line and column, if `wanted` does not find its columns, a cell is no number, or no line holds a
    /// measurement.
    pub fn from_csv(
        text: &str,
        wanted: impl FnOnce(&Titles) -> Result<Columns, TableError>,
    ) -> Result<Self, TableError> {
        let table = Table::open(text.as_bytes())?;
        let titles = table.titles().clone();
        let title = |index: usize| titles.all()[index].clone();
        let columns = wanted(&titles)?;
        let readings = columns.readings.iter().map(|reading| {
            let titles: Vec<String> = reading.columns.iter().map(|column| title(column.index)).collect();
            titles.join(", ")
        });
        let mut measurements = Self {
            columns: columns.joints.iter().map(|column| title(column.index)).collect(),
            readings: readings.collect(),
            labels: columns.labels.iter().map(|index| (title(*index), Vec::new())).collect(),
            ..Self::default()
        };
        let of_readings = columns.readings.iter().flat_map(|reading| &reading.columns);
        let used: Vec<String> = columns.joints.iter().chain(of_readings).map(|column| title(column.index)).collect();
        let is_measured = !columns.readings.is_empty() && columns.labels.is_empty();
        let labels: Vec<String> = columns.labels.iter().map(|index| title(*index)).collect();
        let mut rows = table.rows(columns);
        let mut unmeasured = 0;
        for (number, row) in rows.by_ref().enumerate() {
            let row = row?;
            // A line without a reading says nothing; without labels it has no other part in anything.
            if is_measured && row.observation.is_miss() {
                unmeasured += 1;
                continue;
            }
            for (title, label) in labels.iter().zip(row.labels) {
                measurements.labels.entry(title.clone()).or_default().push(label);
            }
            measurements.observations.push(row.observation);
            measurements.configurations.push(row.positions);
            measurements.lines.push(row.line);
            measurements.numbers.push(number);
        }
        if unmeasured > 0 && measurements.rows() == 0 {
            let what = format!("nothing was measured: {} are empty on every line", measurements.readings.join(", "));
            return Err(TableError::new(what, "write numbers into these columns, or name others"));
        }
        measurements.repeated = rows.repeated_columns();
        measurements.repeated.retain(|(repeating, repeated)| used.contains(repeating) || used.contains(repeated));
        Ok(measurements)
    }

    /// The number of rows.
    pub fn rows(&self) -> usize {
        self.configurations.len()
    }

    /// Adds the rows of another file with the same columns; `names` are the two files' names.
    pub(super) fn append(&mut self, other: Self, names: [&str; 2]) {
        let [first, second] = names.map(Arc::from);
        self.files = [vec![first; self.rows()], vec![second; other.rows()]].concat();
        self.configurations.extend(other.configurations);
        self.observations.extend(other.observations);
        self.lines.extend(other.lines);
        self.numbers.extend(other.numbers);
        for (title, labels) in other.labels {
            self.labels.entry(title).or_default().extend(labels);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use body_schema_table::{Layout, Quantity};

    const TEXT: &str = "x,y,z,a,b\n1,2,3,0.5,0.25\n4,5,6,nan,1\n";

    fn read(text: &str, joints: &[&str]) -> Result<Measurements, TableError> {
        Measurements::from_csv(text, |titles| {
            let joints = joints.iter().map(|joint| titles.titled(joint, Quantity::Angle));
            let readings = vec![titles.reading(Layout::Position, "")?];
            Ok(Columns { joints: joints.collect::<Result<_, _>>()?, readings, labels: Vec::new() })
        })
    }

    #[test]
    fn reads_columns_by_name() {
        let measurements =
            read(TEXT.split_inclusive('\n').take(2).collect::<String>().as_str(), &["b", "a"]).expect("a valid table");
        assert_eq!(measurements.configurations, vec![vec![0.25, 0.5]]);
        assert_eq!(measurements.observations, [Observation::of([1.0, 2.0, 3.0])]);
    }

    #[test]
    fn numbers_may_leave_out_the_zero_before_the_point() {
        let text = "\u{feff}x,y,z,a\n.03,-.5,+1.,3e-2\n";
        let measurements = read(text, &["a"]).expect("a valid table");
        assert_eq!(measurements.observations, [Observation::of([0.03, -0.5, 1.0])]);
        assert_eq!(measurements.configurations, vec![vec![0.03]]);
    }

    #[test]
    fn a_line_without_a_reading_counts_for_nothing() {
        for absent in ["nan,nan,nan", "NaN,,", "None,None,None", "-,n/a,NULL", "<NA>,#N/A,--", ",,"] {
            let measurements =
                read(&format!("x,y,z,a\n1,2,3,4\n{absent},5\n4,5,6,7\n"), &["a"]).expect("a valid table");
            assert_eq!(measurements.observations, [Observation::of([1.0, 2.0, 3.0]), Observation::of([4.0, 5.0, 6.0])]);
            assert_eq!((measurements.configurations, measurements.lines), (vec![vec![4.0], vec![7.0]], vec![2, 4]));
        }
    }

    #[test]
    fn names_what_is_wrong_and_how_to_mend_it() {
        for (text, joint, what, hint) in [
            (TEXT, "a", "line 3, column `a`: `nan` is not a finite number", "remove the line"),
            (TEXT, "c", "has no column `c`; its columns are x, y, z, a, b", "correct the name"),
            ("x,y,z,elbow\n1,2,3,4\n", "elbo", "has no column `elbo`", "did you mean `elbow`"),
            ("x,y,z,a\n1,2\n", "a", "line 2 has 2 values, line 1 names 4 columns", "one value per column"),
            ("x,y,z,a\n1,2,,4\n", "a", "line 2, column `z` is empty", "write a number"),
            ("x,y,z,a\n,,,4\n", "a", "nothing was measured: x, y, z are empty on every line", "write numbers"),
            ("x,y,z,a\n1,2,3,4\n1,2,3,N/A\n", "a", "line 3, column `a`: `N/A` is not", "where the joint was"),
            ("x,y,z,a\n1,inf,3,4\n", "a", "line 2, column `y`: `inf` is not a finite number", "such as 0.03"),
            // What spreadsheets write where the comma is decimal.
            ("x;y;z;a\n1;2;3;4\n", "a", "line 1: the columns are separated by semicolons", "write commas"),
            ("x;y;z;a\n1,5;2,5;3,5;4,5\n", "a", "line 1: the columns are separated by semicolons", "1.5, not 1,5"),
            ("x\ty\tz\ta\n1\t2\t3\t4\n", "a", "line 1: the columns are separated by tabs", "write commas"),
            ("x,y,z,a\n1,5,2,5,3,5,4,5\n", "a", "line 2 has 8 values, line 1 names 4 columns", "1.5, not 1,5"),
            ("x,y,z,a\n\"1,5\",2,3,4\n", "a", "line 2, column `x`: `1,5` is not a finite number", "decimal point: 1.5"),
            // What is no text.
            ("x,y,z,a\n1,2,3,\0\n", "a", "is not text: its byte 15 is 0", "export the table as CSV"),
            ("\0\0\0\0", "a", "is not text: its byte 1 is 0", "export the table as CSV"),
        ] {
            let error = read(text, &[joint]).expect_err(text);
            assert!(error.what.contains(what) && error.hint.contains(hint), "{text:?}: {error}");
        }
    }
}
