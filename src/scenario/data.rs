//! Recorded measurements, read from CSV.

use nalgebra::Point3;

use super::error::similar;

/// Recorded joint positions and marker positions, row by row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Measurements {
    /// Joint positions, rad or m per joint.
    pub configurations: Vec<Vec<f64>>,
    /// Measured markers, metres.
    pub markers_m: Vec<Point3<f64>>,
}

/// What is wrong with a data file, and how to mend it.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{what}; {mend}")]
pub struct DataError {
    /// What was found, and where.
    pub what: String,
    /// How to mend it.
    pub mend: String,
}

impl DataError {
    fn new(what: impl Into<String>, mend: impl Into<String>) -> Self {
        Self { what: what.into(), mend: mend.into() }
    }
}

impl Measurements {
    /// Reads the named columns of a CSV text with a header line: columns are separated by commas, and a number has a
    /// decimal point if anything (`0.03`, `.03`, `3e-2`). An error says which line or column is at fault.
    pub fn from_csv(text: &str, joint_columns: &[&str], marker_columns: &[String; 3]) -> Result<Self, DataError> {
        if let Some(at) = text.find('\0') {
            return Err(DataError::new(format!("is not text: its byte {} is 0", at + 1), AS_TEXT));
        }
        let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(text.as_bytes());
        let header = reader.headers().map_err(|error| unreadable(&error))?.clone();
        let column =
            |name: &str| header.iter().position(|title| title == name).ok_or_else(|| unknown_column(name, &header));
        let joints = joint_columns.iter().map(|name| column(name)).collect::<Result<Vec<_>, _>>()?;
        let marker = marker_columns.iter().map(|name| column(name)).collect::<Result<Vec<_>, _>>()?;
        let mut measurements = Self::default();
        for record in reader.records() {
            let record = record.map_err(|error| unreadable(&error))?;
            let line = record.position().map_or(0, csv::Position::line);
            let number = |index: &usize| {
                let title = header.get(*index).unwrap_or_default();
                number(record.get(*index).unwrap_or_default(), &format!("line {line}, column `{title}`"))
            };
            measurements.configurations.push(joints.iter().map(number).collect::<Result<_, _>>()?);
            let marker = marker.iter().map(number).collect::<Result<Vec<_>, _>>()?;
            measurements.markers_m.push(Point3::from_slice(&marker));
        }
        Ok(measurements)
    }
}

const AS_TEXT: &str = "export the table as CSV, text in UTF-8";

/// A finite number. A comma in it is refused: it may separate decimals or thousands.
fn number(text: &str, place: &str) -> Result<f64, DataError> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        _ if text.is_empty() => Err(DataError::new(format!("{place} is empty"), "write a number, or remove the line")),
        _ => {
            let with_point = text.replacen(',', ".", 1);
            let mend = if with_point != text && with_point.parse::<f64>().is_ok() {
                format!("write a decimal point: {with_point}")
            } else {
                "write a number such as 0.03, or remove the line".to_owned()
            };
            Err(DataError::new(format!("{place}: `{text}` is not a finite number"), mend))
        }
    }
}

fn unknown_column(name: &str, header: &csv::StringRecord) -> DataError {
    let line = header.iter().collect::<Vec<_>>().join(", ");
    for (separator, plural) in [(';', "semicolons"), ('\t', "tabs")] {
        if line.split(separator).any(|title| title.trim() == name) {
            let what = format!("line 1: the columns are separated by {plural}");
            return DataError::new(what, "write commas between columns, and a decimal point in numbers: 1.5, not 1,5");
        }
    }
    let mend = match similar(name, header.iter()) {
        Some(known) => format!("did you mean `{known}`?"),
        None => "correct the name of the column, here or in the scenario".to_owned(),
    };
    DataError::new(format!("has no column `{name}`; its columns are {line}"), mend)
}

/// What the reader of CSV cannot read, in our own words.
fn unreadable(error: &csv::Error) -> DataError {
    match error.kind() {
        csv::ErrorKind::UnequalLengths { pos, expected_len, len } => {
            let line = pos.as_ref().map_or(0, csv::Position::line);
            let what = format!("line {line} has {len} values, line 1 names {expected_len} columns");
            DataError::new(what, "give it one value per column, with a decimal point in numbers: 1.5, not 1,5")
        }
        _ => DataError::new(error.to_string(), AS_TEXT),
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
