//! Which columns make a reading.

use nalgebra::{Quaternion, UnitQuaternion};

use super::{Column, Quantity, TableError, Titles};

/// What a sensor's reading looks like in a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// x, y, z.
    Position,
    /// x, y, z and a rotation: a rotation vector, roll, pitch and yaw, or a quaternion.
    Pose,
    /// u, v of so many points.
    Pixels(usize),
    /// A length.
    Distance,
}

/// How a rotation is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Rotation {
    None,
    Vector,
    RollPitchYaw,
    Quaternion,
}

impl Rotation {
    const ALL: [(Self, &'static [&'static str]); 3] = [
        (Self::Vector, &["rx", "ry", "rz"]),
        (Self::RollPitchYaw, &["roll", "pitch", "yaw"]),
        (Self::Quaternion, &["qx", "qy", "qz", "qw"]),
    ];

    fn quantity(self) -> Quantity {
        if self == Self::Quaternion { Quantity::Number } else { Quantity::Angle }
    }
}

/// The columns of one sensor's readings.
#[derive(Clone, Debug, PartialEq)]
pub struct Reading {
    /// In the order of the layout.
    pub columns: Vec<Column>,
    rotation: Rotation,
}

impl Titles {
    /// The columns of a reading whose titles begin with `prefix` (and `_`); without one they begin with nothing.
    ///
    /// # Errors
    ///
    /// [`TableError`] where one of them is missing or there twice.
    pub fn reading(&self, layout: Layout, prefix: &str) -> Result<Reading, TableError> {
        let name = |end: &str| if prefix.is_empty() { end.to_owned() } else { format!("{prefix}_{end}") };
        let all = |ends: &[&str], quantity: Quantity| -> Result<Vec<Column>, TableError> {
            ends.iter().map(|end| self.find(&name(end), quantity)).collect()
        };
        let mut rotation = Rotation::None;
        let columns = match layout {
            Layout::Position => all(&["x", "y", "z"], Quantity::Length)?,
            Layout::Distance => all(&["distance"], Quantity::Length)?,
            Layout::Pixels(1) if self.find(&name("u"), Quantity::Pixels).is_ok() => all(&["u", "v"], Quantity::Pixels)?,
            Layout::Pixels(points) => {
                let ends: Vec<String> = (1..=points).flat_map(|k| [format!("u{k}"), format!("v{k}")]).collect();
                all(&ends.iter().map(String::as_str).collect::<Vec<_>>(), Quantity::Pixels)?
            }
            Layout::Pose => {
                let is_there = |(kind, ends): &&(Rotation, &[&str])| self.find(&name(ends[0]), kind.quantity()).is_ok();
                let (kind, ends) = Rotation::ALL.iter().find(is_there).unwrap_or(&Rotation::ALL[0]);
                rotation = *kind;
                let mut columns = all(&["x", "y", "z"], Quantity::Length)?;
                columns.extend(all(ends, kind.quantity())?);
                columns
            }
        };
        Ok(Reading { columns, rotation })
    }

    /// The columns of a reading by their titles, in the order of the layout. Six of a pose end with a rotation vector,
    /// unless they are titled as roll, pitch and yaw; seven end with a quaternion x, y, z, w.
    ///
    /// # Errors
    ///
    /// [`TableError`] where one of them is missing, or there are too few or too many for the layout.
    pub fn reading_titled(&self, layout: Layout, titles: &[String]) -> Result<Reading, TableError> {
        let (wanted, said) = match layout {
            Layout::Position => (vec![Quantity::Length; 3], "3".to_owned()),
            Layout::Distance => (vec![Quantity::Length], "1".to_owned()),
            Layout::Pixels(points) => (vec![Quantity::Pixels; 2 * points], (2 * points).to_string()),
            Layout::Pose if titles.len() == 7 => {
                ([vec![Quantity::Length; 3], vec![Quantity::Number; 4]].concat(), "7".to_owned())
            }
            Layout::Pose => ([vec![Quantity::Length; 3], vec![Quantity::Angle; 3]].concat(), "6 or 7".to_owned()),
        };
        if titles.len() != wanted.len() {
            let what = format!("{} columns are named for a reading: {}", titles.len(), titles.join(", "));
            return Err(TableError::new(what, format!("name {said}")));
        }
        let columns = titles.iter().zip(wanted).map(|(title, quantity)| self.titled(title, quantity));
        let says = |title: &String, angle: &str| title.to_lowercase().contains(angle);
        let is_roll_pitch_yaw = || titles[3..].iter().zip(["roll", "pitch", "yaw"]).all(|(title, of)| says(title, of));
        let rotation = match layout {
            Layout::Pose if titles.len() == 7 => Rotation::Quaternion,
            Layout::Pose if is_roll_pitch_yaw() => Rotation::RollPitchYaw,
            Layout::Pose => Rotation::Vector,
            _ => Rotation::None,
        };
        Ok(Reading { columns: columns.collect::<Result<_, _>>()?, rotation })
    }
}

impl Reading {
    /// A sensor's own numbers (see [`Observation`](crate::sensing::Observation)) from those of its columns; `None` for a
    /// quaternion that is none.
    pub(super) fn of(&self, mut numbers: Vec<f64>) -> Option<Vec<f64>> {
        let rotation = match (self.rotation, numbers.get(3..)) {
            (Rotation::RollPitchYaw, Some(&[roll, pitch, yaw])) => UnitQuaternion::from_euler_angles(roll, pitch, yaw),
            (Rotation::Quaternion, Some(&[x, y, z, w])) => {
                let quaternion = Quaternion::new(w, x, y, z);
                if (quaternion.norm() - 1.0).abs() > 0.01 {
                    return None;
                }
                UnitQuaternion::new_normalize(quaternion)
            }
            _ => return Some(numbers),
        };
        numbers.truncate(3);
        numbers.extend_from_slice(rotation.scaled_axis().as_slice());
        Some(numbers)
    }
}
