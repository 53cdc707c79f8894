//! What was read and measured: columns, targets, rows.

use body_schema_engine::kinematics::JointKind;
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use crate::median::median;

/// A column of readings that may drive a joint.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// Its title.
    pub title: String,
    /// The kind of joint that the unit in its title allows; `None` where it names no unit.
    pub kind: Option<JointKind>,
    /// The factor by which the numbers of the table were multiplied to give rad or m.
    pub factor: f64,
}

/// Something of which the place was measured.
#[derive(Clone, Debug, PartialEq)]
pub struct Target {
    /// Its name; may be empty where there is only one.
    pub name: String,
    /// Whether its rotation was measured too.
    pub is_pose: bool,
}

/// A measured place in the frame of the measurements, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reading {
    /// A point.
    Point(Point3<f64>),
    /// A pose.
    Pose(Isometry3<f64>),
}

impl Reading {
    /// The point, or the origin of the pose, metres.
    pub fn point(&self) -> Point3<f64> {
        match self {
            Self::Point(point) => *point,
            Self::Pose(pose) => pose.translation.vector.into(),
        }
    }
}

impl Reading {
    /// The median of several, coordinate by coordinate; `None` of none.
    fn middle(all: &[Self]) -> Option<Self> {
        let (first, others) = all.split_first()?;
        if others.is_empty() {
            return Some(*first);
        }
        let of = |number: &dyn Fn(&Self) -> Vector3<f64>| {
            Vector3::from_fn(|axis, _| median(all.iter().map(|reading| number(reading)[axis]).collect()))
        };
        let place = of(&|reading| reading.point().coords);
        Some(match first {
            Self::Point(_) => Self::Point(place.into()),
            Self::Pose(pose) => {
                let turn = |reading: &Self| match reading {
                    Self::Pose(other) => (pose.rotation.inverse() * other.rotation).scaled_axis(),
                    Self::Point(_) => Vector3::zeros(),
                };
                let turn = pose.rotation * UnitQuaternion::from_scaled_axis(of(&turn));
                Self::Pose(Isometry3::from_parts(Translation3::from(place), turn))
            }
        })
    }
}

/// A posture and what was measured in it.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// The line of the table, counted from 1.
    pub line: usize,
    /// The positions θ by column, rad or m.
    pub positions: Vec<f64>,
    /// The readings by target; `None` where there is none.
    pub readings: Vec<Option<Reading>>,
}

/// A table of readings and measured places.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Data {
    /// The columns that may drive joints.
    pub columns: Vec<Column>,
    /// The targets.
    pub targets: Vec<Target>,
    /// The rows.
    pub rows: Vec<Row>,
}

impl Data {
    /// The middle θ₀ of every column's range, rad or m; 0 without rows.
    pub fn middle(&self) -> Vec<f64> {
        (0..self.columns.len()).map(|column| self.range(column).map_or(0.0, |(low, high)| 0.5 * (low + high))).collect()
    }

    /// The least and the greatest value of a column, rad or m.
    pub fn range(&self, column: usize) -> Option<(f64, f64)> {
        let values = self.rows.iter().map(|row| row.positions[column]);
        values.fold(None, |range, x| Some(range.map_or((x, x), |(low, high): (f64, f64)| (low.min(x), high.max(x)))))
    }

    /// The number of readings.
    pub fn readings(&self) -> usize {
        self.rows.iter().map(|row| row.readings.iter().flatten().count()).sum()
    }

    /// These data with the given rows alone.
    pub fn with_rows(&self, rows: Vec<Row>) -> Self {
        Self { columns: self.columns.clone(), targets: self.targets.clone(), rows }
    }

    /// These data with one row for each posture, its readings the medians of those of all its rows: to read once more where the robot stands
    /// tells of noise, and nothing of what it is.
    pub(crate) fn by_posture(&self) -> Self {
        let positions: Vec<Vec<f64>> = self.rows.iter().map(|row| row.positions.clone()).collect();
        let numbers = body_schema_diagnostics::postures(&positions);
        let mut postures: Vec<Vec<&Row>> = Vec::new();
        for (row, number) in self.rows.iter().zip(numbers) {
            match postures.get_mut(number) {
                Some(rows) => rows.push(row),
                None => postures.push(vec![row]),
            }
        }
        let merged = postures.iter().map(|rows| {
            let of = |target: usize| {
                Reading::middle(&rows.iter().filter_map(|row| row.readings[target]).collect::<Vec<_>>())
            };
            Row { readings: (0..self.targets.len()).map(of).collect(), ..rows[0].clone() }
        });
        self.with_rows(merged.collect())
    }

    /// These data with the given targets alone.
    pub(crate) fn of_targets(&self, targets: &[usize]) -> Self {
        let rows = self
            .rows
            .iter()
            .map(|row| Row { readings: targets.iter().map(|target| row.readings[*target]).collect(), ..row.clone() });
        Self {
            columns: self.columns.clone(),
            targets: targets.iter().map(|target| self.targets[*target].clone()).collect(),
            rows: rows.filter(|row| row.readings.iter().any(Option::is_some)).collect(),
        }
    }
}
