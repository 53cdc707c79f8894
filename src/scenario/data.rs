//! Recorded measurements, read from CSV.

use nalgebra::Point3;

/// Recorded joint positions and marker positions, row by row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Recording {
    /// Joint positions, rad or m per joint.
    pub configurations: Vec<Vec<f64>>,
    /// Measured markers, metres.
    pub markers_m: Vec<Point3<f64>>,
}

impl Recording {
    /// Reads the named columns of a CSV text with a header line. An error says which line or column is at fault.
    pub fn from_csv(text: &str, joint_columns: &[&str], marker_columns: &[String; 3]) -> Result<Self, String> {
        let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(text.as_bytes());
        let header = reader.headers().map_err(|error| error.to_string())?.clone();
        let column = |name: &str| {
            header.iter().position(|title| title == name).ok_or_else(|| {
                let known: Vec<&str> = header.iter().collect();
                format!("has no column `{name}`; its columns are {}", known.join(", "))
            })
        };
        let joints = joint_columns.iter().map(|name| column(name)).collect::<Result<Vec<_>, _>>()?;
        let marker = marker_columns.iter().map(|name| column(name)).collect::<Result<Vec<_>, _>>()?;
        let mut recording = Self::default();
        for record in reader.records() {
            let record = record.map_err(|error| error.to_string())?;
            let line = record.position().map_or(0, csv::Position::line);
            let number = |index: &usize| {
                let text = record.get(*index).unwrap_or_default();
                text.parse::<f64>().ok().filter(|value| value.is_finite()).ok_or_else(|| {
                    let title = header.get(*index).unwrap_or_default();
                    format!("line {line}, column `{title}`: `{text}` is not a finite number")
                })
            };
            recording.configurations.push(joints.iter().map(number).collect::<Result<_, _>>()?);
            let marker = marker.iter().map(number).collect::<Result<Vec<_>, _>>()?;
            recording.markers_m.push(Point3::from_slice(&marker));
        }
        Ok(recording)
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
        let recording = Recording::from_csv(
            TEXT.split_inclusive('\n').take(2).collect::<String>().as_str(),
            &["b", "a"],
            &marker(),
        )
        .expect("a valid table");
        assert_eq!(recording.configurations, vec![vec![0.25, 0.5]]);
        assert_eq!(recording.markers_m, vec![Point3::new(1.0, 2.0, 3.0)]);
    }

    #[test]
    fn names_what_is_wrong() {
        let error = Recording::from_csv(TEXT, &["a"], &marker()).expect_err("a NaN");
        assert!(error.contains("line 3") && error.contains("`a`"), "{error}");
        let error = Recording::from_csv(TEXT, &["c"], &marker()).expect_err("no such column");
        assert!(error.contains("no column `c`") && error.contains("x, y, z, a, b"), "{error}");
        let error = Recording::from_csv("x,y,z,a\n1,2\n", &["a"], &marker()).expect_err("a short row");
        assert!(error.contains("line"), "{error}");
    }
}
