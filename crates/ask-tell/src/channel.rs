//! The channels of a session: their names, and the JSON shapes of their readings.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::Fault;
use body_schema_engine::{
    numeric_range::is_usable,
    sensing::{MeasurementModel, Occasion, Part, Subject, present},
};
use body_schema_scenario::{Robot, SocketSpec};
use body_schema_table::Rotation;

/// A channel's name, and the JSON shape of its readings.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ChannelShape {
    /// Its key among the measurements.
    pub name: String,
    /// The shape of its readings.
    #[serde(flatten)]
    pub shape: Shape,
}

/// The shape of a reading; see the table of the [module](super).
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(tag = "channel", rename_all = "snake_case")]
pub enum Shape {
    /// `[x, y, z]`, metres.
    Position,
    /// `{"position": [x, y, z], "quaternion": [x, y, z, w]}`.
    Pose,
    /// `[[u, v], …]`, pixels.
    Pixels {
        /// The number of pairs.
        points: usize,
        /// The least number of points of a reading, where some may be absent: a pair is then null, or `[null, null]`. With fewer nothing
        /// is read. Absent itself where a reading is whole.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        least_points: Option<usize>,
    },
    /// A number that is not negative, metres.
    Distance,
    /// A number, metres.
    Depth,
    /// `{"socket": "PLACE/NAME"}`.
    Sockets {
        /// The allowed values.
        sockets: Vec<String>,
    },
}

/// The key of all sockets together.
pub(super) const SOCKET: &str = "socket";

/// The channels of a robot's readings: those that always read, in the order of the measurement model, then that of the sockets.
pub(super) fn shapes(robot: &Robot, measurement_model: &MeasurementModel) -> Vec<ChannelShape> {
    let mut shapes: Vec<ChannelShape> = Vec::new();
    let always = measurement_model.sensors().iter().filter(|sensor| sensor.subject().occasion == Occasion::Always);
    for (wanted, shape) in always.map(|sensor| named(robot, sensor.subject())) {
        let is_taken = |name: &String| name == SOCKET || shapes.iter().any(|other| other.name == *name);
        let numbered = (2..).map(|number| format!("{wanted}_{number}"));
        let name = std::iter::once(wanted.clone()).chain(numbered).find(|name| !is_taken(name)).unwrap_or_default();
        shapes.push(ChannelShape { name, shape });
    }
    if !robot.sockets.is_empty() {
        let sockets = robot.sockets.iter().map(SocketSpec::label).collect();
        shapes.push(ChannelShape { name: SOCKET.to_owned(), shape: Shape::Sockets { sockets } });
    }
    shapes
}

fn named(robot: &Robot, subject: &Subject) -> (String, Shape) {
    let equipment = &robot.equipment;
    let target = subject.target.and_then(|target| equipment.targets.get(target));
    let name = target.map_or_else(|| "marker".to_owned(), |target| target.name.clone());
    let name = match subject.seen_from.and_then(|observer| equipment.name(observer)) {
        Some(observer) => format!("{observer}_{name}"),
        None => name,
    };
    match (subject.sight(), subject.parts.as_slice()) {
        (Some((camera, _)), _) => {
            let camera = equipment.cameras.get(camera).map_or("camera", |camera| camera.name.as_str());
            (
                format!("{camera}_{name}"),
                Shape::Pixels { points: subject.equations() / 2, least_points: subject.least_points },
            )
        }
        (None, [Part::Norm]) => (format!("{name}_distance"), Shape::Distance),
        (None, [Part::Lengths(1)]) => (format!("{name}_depth"), Shape::Depth),
        (None, _) if subject.is_pose() => (name, Shape::Pose),
        (None, _) => (name, Shape::Position),
    }
}

impl Shape {
    /// The channel's own numbers from a reading in JSON.
    pub(super) fn read(&self, field: &str, told: &Value) -> Result<Vec<f64>, Fault> {
        let refuse = |hint: &str| Err(Fault::new(field, format!("{} is no reading of it", shown(told)), hint));
        match self {
            Self::Position => numbers(told, 3).map_or_else(|| refuse("write [x, y, z] in metres"), Ok),
            Self::Distance | Self::Depth => match told.as_f64().filter(|x| is_usable(*x)) {
                Some(x) if x >= 0.0 || *self == Self::Depth => Ok(vec![x]),
                _ => refuse("write a length in metres"),
            },
            Self::Pixels { points, least_points } => {
                let is_absent = |pair: &Value| {
                    let nothing = || pair.as_array().is_some_and(|it| it.len() == 2 && it.iter().all(Value::is_null));
                    least_points.is_some() && (pair.is_null() || nothing())
                };
                let pair = |pair: &Value| if is_absent(pair) { Some(vec![f64::NAN; 2]) } else { numbers(pair, 2) };
                let pairs = || told.as_array()?.iter().map(pair).collect::<Option<Vec<_>>>();
                let single = || (*points == 1).then(|| numbers(told, 2)).flatten();
                match pairs().filter(|pairs| pairs.len() == *points) {
                    Some(pairs) => Ok(pairs.concat()),
                    None => single().map_or_else(
                        || {
                            let is_any_absent =
                                || told.as_array().is_some_and(|pairs| pairs.iter().any(|pair| pair.is_null()));
                            let absent = match least_points {
                                Some(_) => ", null for one that is not seen",
                                None if is_any_absent() => {
                                    "; a target whose points may be seen one by one has `partly_seen = true`"
                                }
                                None => "",
                            };
                            refuse(&format!(
                                "write [[u, v], …] in pixels, {points} of them, one for each point{absent}"
                            ))
                        },
                        Ok,
                    ),
                }
            }
            Self::Pose => {
                let only = told.as_object().is_some_and(|told| told.len() == 2);
                let parts = told.get("position").and_then(|it| numbers(it, 3)).zip(told.get("quaternion"));
                let Some((mut reading, rotation)) = parts.filter(|_| only) else {
                    return refuse("write {\"position\": [x, y, z], \"quaternion\": [x, y, z, w]}, in metres");
                };
                let Some(vector) = numbers(rotation, 4).and_then(|numbers| Rotation::Quaternion.read(&numbers)) else {
                    let what = format!("{} is no unit quaternion", shown(rotation));
                    return Err(Fault::new(format!("{field}.quaternion"), what, "write x, y, z, w of length 1"));
                };
                reading.extend_from_slice(vector.as_slice());
                Ok(reading)
            }
            Self::Sockets { .. } => self.socket(field, told).map(|_| vec![0.0; 3]),
        }
    }

    /// Whether a reading has fewer points than are read.
    pub(super) fn is_too_little(&self, reading: &[f64]) -> bool {
        matches!(self, Self::Pixels { least_points: Some(least), .. } if present(reading) < 2 * least)
    }

    /// The index of the socket named in JSON.
    pub(super) fn socket(&self, field: &str, told: &Value) -> Result<usize, Fault> {
        let Self::Sockets { sockets } = self else {
            return Err(Fault::new(field, "this channel knows no sockets", "remove it"));
        };
        let alone = || told.as_object().filter(|told| told.len() == 1)?.get(SOCKET)?.as_str();
        let name = told.as_str().or_else(alone);
        let found = name.and_then(|name| sockets.iter().position(|socket| socket == name));
        let hint = || format!("write {{\"socket\": \"{}\"}}, or another of {}", sockets[0], sockets.join(", "));
        found.ok_or_else(|| Fault::new(field, format!("{} is no socket of this session", shown(told)), hint()))
    }
}

/// A list of `count` numbers that can be a reading.
fn numbers(told: &Value, count: usize) -> Option<Vec<f64>> {
    let list = told.as_array().filter(|list| list.len() == count)?;
    list.iter().map(|x| x.as_f64().filter(|x| is_usable(*x))).collect()
}

/// A value as it is shown in an error.
fn shown(told: &Value) -> String {
    const MOST: usize = 80;
    let text = told.to_string();
    if text.chars().count() > MOST { format!("{}…", text.chars().take(MOST).collect::<String>()) } else { text }
}
