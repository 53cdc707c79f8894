//! Recorded measurements, read from CSV.

use nalgebra::Point3;

use crate::table::{Column, Columns, Layout, Quantity, Table, TableError};

/// Recorded joint positions and marker positions, row by row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Measurements {
    /// Joint positions, rad or m per joint.
    pub configurations: Vec<Vec<f64>>,
    /// Measured markers, metres.
    pub markers_m: Vec<Point3<f64>>,
    /// The line of the file that each row stands on, counted from 1.
    pub lines: Vec<usize>,
    /// The titles of the joints' columns.
    pub columns: Vec<String>,
    /// The titles of the marker's.
    pub marker: String,
    /// Columns that repeat another in every row, with that other; only where one of the two is used here.
    pub repeated: Vec<(String, String)>,
}

impl Measurements {
    /// Reads the named columns of a CSV text with a header line: columns are separated by commas, and a number has a
    /// decimal point if anything (`0.03`, `.03`, `3e-2`). Titles may end with a unit (see [`table`](crate::table)). An error says which line or column is at fault.
    pub fn from_csv(text: &str, joint_columns: &[&str], marker_columns: &[String; 3]) -> Result<Self, TableError> {
        let table = Table::open(text.as_bytes())?;
        let titles = table.titles();
        // A title's end says its unit, as everywhere; without one it is rad or m.
        let joint = |title: &&str| {
            let (angle, length) = (titles.titled(title, Quantity::Angle)?, titles.titled(title, Quantity::Length)?);
            Ok(Column { factor: angle.factor * length.factor, ..angle })
        };
        let joints = joint_columns.iter().map(joint).collect::<Result<_, TableError>>()?;
        let readings = vec![titles.reading_titled(Layout::Position, marker_columns)?];
        let columns = joint_columns.iter().map(|title| (*title).to_owned()).collect();
        let mut measurements = Self { columns, marker: marker_columns.join(", "), ..Self::default() };
        let mut rows = table.rows(Columns { joints, readings, labels: Vec::new() });
        for row in rows.by_ref() {
            let row = row?;
            let Some(Some(marker)) = row.observation.readings.first() else {
                let what = format!("line {}, column `{}` is empty", row.line, marker_columns[0]);
                return Err(TableError::new(what, "write a number, or remove the line"));
            };
            measurements.markers_m.push(Point3::from_slice(marker));
            measurements.configurations.push(row.positions);
            measurements.lines.push(row.line);
        }
        let is_used = |title: &String| marker_columns.contains(title) || joint_columns.contains(&title.as_str());
        measurements.repeated = rows.repeated_columns();
        measurements.repeated.retain(|(repeating, repeated)| is_used(repeating) || is_used(repeated));
        Ok(measurements)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "x,y,z,a,b\n1,2,3,0.5,0.25\n4,5,6,nan,1\n";

    fn marker() -> [String; 3] {
        ["x", "y", "z"].map(String::from)
    }

    #[test]
    fn reads_columns_by_name() {
        let measurements = Measurements::from_csv(
            TEXT.split_inclusive('\n').take(2).collect::<String>().as_str(),
            &["b", "a"],
            &marker(),
        )
        .expect("a valid table");
        assert_eq!(measurements.configurations, vec![vec![0.25, 0.5]]);
        assert_eq!(measurements.markers_m, vec![Point3::new(1.0, 2.0, 3.0)]);
    }

    #[test]
    fn numbers_may_leave_out_the_zero_before_the_point() {
        let text = "\u{feff}x,y,z,a\n.03,-.5,+1.,3e-2\n";
        let measurements = Measurements::from_csv(text, &["a"], &marker()).expect("a valid table");
        assert_eq!(measurements.markers_m, vec![Point3::new(0.03, -0.5, 1.0)]);
        assert_eq!(measurements.configurations, vec![vec![0.03]]);
    }

    #[test]
    fn names_what_is_wrong_and_how_to_mend_it() {
        for (text, joint, what, mend) in [
            (TEXT, "a", "line 3, column `a`: `nan` is not a finite number", "such as 0.03"),
            (TEXT, "c", "has no column `c`; its columns are x, y, z, a, b", "correct the name"),
            ("x,y,z,elbow\n1,2,3,4\n", "elbo", "has no column `elbo`", "did you mean `elbow`"),
            ("x,y,z,a\n1,2\n", "a", "line 2 has 2 values, line 1 names 4 columns", "one value per column"),
            ("x,y,z,a\n1,2,,4\n", "a", "line 2, column `z` is empty", "write a number"),
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
            let error = Measurements::from_csv(text, &[joint], &marker()).expect_err(text);
            assert!(error.what.contains(what) && error.mend.contains(mend), "{text:?}: {error}");
        }
    }
}
