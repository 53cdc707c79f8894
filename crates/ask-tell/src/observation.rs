//! Observations that a robot reports after it has moved.

use std::{collections::BTreeMap, f64::consts::TAU, fmt};

use serde::{
    Deserialize, Deserializer, Serialize,
    de::{MapAccess, Visitor, value::MapAccessDeserializer},
};
use serde_json::Value;

use super::{ChannelShape, Fault, Shape, channel::SOCKET};
use body_schema_engine::{
    kinematics::JointKind,
    numeric_range::is_usable,
    selection::Movement,
    sensing::{CameraKind, Observation as Readings, Occasion},
    suggest::did_you_mean,
};
use body_schema_experiment::Executed;
use body_schema_robot::Segment;
use body_schema_scenario::Scenario;

/// A movement as it was executed, with what was seen after it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct Observation {
    /// The suggestion that it carries out, if any.
    #[serde(default, deserialize_with = "crate::integer::integer_or_none", skip_serializing_if = "Option::is_none")]
    pub suggestion_id: Option<u64>,
    /// The positions of the joints by name, in the units of the URDF (rad, m).
    #[serde(deserialize_with = "by_name")]
    pub configuration: BTreeMap<String, f64>,
    /// The readings by channel, in the shape of its kind (see the [module](super)); null where it saw nothing.
    #[serde(default)]
    #[cfg_attr(feature = "openapi", schema(value_type = BTreeMap<String, Value>))]
    pub measurements: BTreeMap<String, Value>,
}

/// The answer to an observation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Answer {
    /// Its number, counted from 1, by which it can be excluded.
    pub observation: u64,
    /// Whether any channel had a reading.
    pub seen: bool,
    /// The distance from what was expected, root mean square over its equations in standard deviations of the innovation,
    /// `√(eᵀ S⁻¹ e / d)`: about 1 where all is well. Null where nothing was seen, and without a covariance.
    pub innovation_sigmas: Option<f64>,
    /// The probability that it is an outlier after it was absorbed, the greatest of its channels'. Null where nothing was
    /// seen, and for an estimator without outliers.
    pub outlier_probability: Option<f64>,
    /// The expected mean error of predictions over the workspace now, millimetres; null without a covariance.
    pub expected_error_mm: Option<f64>,
    /// Whether the body seems to have changed: what was learned before is dropped then, and pending suggestions are superseded.
    pub body_seems_changed: bool,
}

/// The share of its range by which a joint may be reported beyond its limits, and the share of a picture's size by which a point may
/// be reported outside it; more is a mistake.
const BEYOND: f64 = 0.1;
/// The most turns by which a joint may be reported beyond where it was asked to go, whatever its limits; more means
/// that the number is in degrees.
const TURNS: f64 = 2.0;

/// Reads positions by name. A list is refused: it does not say which joint is which.
fn by_name<'de, D: Deserializer<'de>>(deserializer: D) -> Result<BTreeMap<String, f64>, D::Error> {
    struct ByName;

    impl<'de> Visitor<'de> for ByName {
        type Value = BTreeMap<String, f64>;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("the position of every joint by its name, as {\"elbow\": 0.5}, since a list does not say which joint is which")
        }

        fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
            BTreeMap::deserialize(MapAccessDeserializer::new(map))
        }
    }

    deserializer.deserialize_map(ByName)
}

/// Whether two values are equal, numbers compared as numbers: 1 is 1.0.
fn are_same(one: &Value, other: &Value) -> bool {
    match (one, other) {
        (Value::Number(one), Value::Number(other)) => one == other || one.as_f64() == other.as_f64(),
        (Value::Array(one), Value::Array(other)) => {
            one.len() == other.len() && one.iter().zip(other).all(|(one, other)| are_same(one, other))
        }
        (Value::Object(one), Value::Object(other)) => {
            let is_there = |(key, value): (&String, &Value)| other.get(key).is_some_and(|other| are_same(value, other));
            one.len() == other.len() && one.iter().all(is_there)
        }
        _ => one == other,
    }
}

impl Observation {
    /// Whether two observations have the same content, with numbers compared as numbers: 1 is 1.0.
    pub fn tells_the_same(&self, other: &Self) -> bool {
        let Self { suggestion_id, configuration, measurements } = self;
        let is_there =
            |(name, told): (&String, &Value)| other.measurements.get(name).is_some_and(|other| are_same(told, other));
        *suggestion_id == other.suggestion_id
            && *configuration == other.configuration
            && measurements.len() == other.measurements.len()
            && measurements.iter().all(is_there)
    }

    /// The movement and its readings, in the order of a scenario's channels.
    pub(super) fn read(&self, scenario: &Scenario, shapes: &[ChannelShape]) -> Result<Executed, Fault> {
        let configuration = positions("configuration", &self.configuration, scenario, "tell where every joint was")?;
        let known = || shapes.iter().map(|shape| shape.name.as_str());
        // One who holds a target in a socket may name the target.
        let held = |name: &str| {
            let sockets = shapes.iter().find(|shape| shape.name == SOCKET)?;
            let target = scenario.robot.sockets.first().map(|socket| socket.target)?;
            (scenario.robot.equipment.targets.get(target)?.name == name).then_some(sockets)
        };
        let (mut readings, mut socket) = (Readings::missed(scenario.measurement_model.sensors().len()), None);
        let always = scenario.measurement_model.sensors().iter().enumerate();
        let always: Vec<usize> = always
            .filter(|(_, sensor)| sensor.subject().occasion == Occasion::Always)
            .map(|(index, _)| index)
            .collect();
        for (name, told) in &self.measurements {
            let field = format!("measurements.{name}");
            let found = shapes.iter().enumerate().find(|(_, shape)| shape.name == *name);
            let (index, ChannelShape { shape, .. }) = match found {
                Some(found) => found,
                None => (shapes.len(), held(name).ok_or_else(|| unknown(&field, "channel", name, known()))?),
            };
            if told.is_null() {
                continue;
            }
            let reading = shape.read(&field, told)?;
            if shape.is_too_little(&reading) {
                continue;
            }
            let channel = match shape {
                Shape::Sockets { .. } => {
                    let number = shape.socket(&field, told)?;
                    if socket.replace(number).is_some_and(|other| other != number) {
                        let what = "a target is held in one socket at a time, and two are named";
                        return Err(Fault::new(field, what, "report one observation per socket"));
                    }
                    scenario.measurement_model.holds(number).map(|(channel, _)| channel)
                }
                _ => always.get(index).copied(),
            };
            channel.into_iter().for_each(|channel| readings.readings[channel] = Some(reading.clone()));
        }
        let proposal = self.suggestion_id.and_then(|id| id.checked_sub(1));
        Ok(Executed { proposal, movement: Movement { configuration, row: None, socket }, observation: readings })
    }

    /// Refuses implausible numbers: a joint far beyond where it can go, or a point far outside a picture. Such numbers are in another
    /// unit, or belong to another joint.
    pub(super) fn check_reach(
        &self,
        scenario: &Scenario,
        shapes: &[ChannelShape],
        executed: &Executed,
    ) -> Result<(), Fault> {
        let Scenario { robot, measurement_model, .. } = scenario;
        if let Some(described) = robot.described.as_deref() {
            let asked = robot.limits.joints();
            let mut joints = described.chain.moving().zip(asked).zip(&executed.movement.configuration);
            joints.try_for_each(|((segment, asked), position)| within_reach(segment, *asked, *position))?;
        }
        let always = measurement_model.sensors().iter().zip(&executed.observation.readings);
        let always = always.filter(|(sensor, _)| sensor.subject().occasion == Occasion::Always);
        for ((sensor, reading), ChannelShape { name, .. }) in always.zip(shapes) {
            let camera = sensor.subject().sight().and_then(|(camera, _)| robot.equipment.cameras.get(camera));
            if let (Some(camera), Some(reading)) = (camera, reading) {
                within_picture(&format!("measurements.{name}"), camera, reading)?;
            }
        }
        Ok(())
    }
}

/// Positions in the order of the joints; `field` has them by name, and `hint` says what to do where one is missing.
pub(super) fn positions(
    field: &str,
    configuration: &BTreeMap<String, f64>,
    scenario: &Scenario,
    hint: &str,
) -> Result<Vec<f64>, Fault> {
    let names = &scenario.robot.names;
    if let Some(name) = configuration.keys().find(|name| !names.contains(name)) {
        return Err(unknown(&format!("{field}.{name}"), "joint", name, names.iter().map(String::as_str)));
    }
    let of = |name: &String| {
        let field = || format!("{field}.{name}");
        let position = configuration.get(name);
        let position = position.ok_or_else(|| Fault::new(field(), "missing", hint))?;
        match is_usable(*position) {
            true => Ok(*position),
            false => Err(Fault::new(field(), "it is no number that a joint can have", "write a number, in rad or m")),
        }
    };
    names.iter().map(of).collect()
}

/// Refuses a joint far beyond its limits, or turned further than it was asked to by more than [`TURNS`].
fn within_reach(segment: &Segment, asked: (f64, f64), position: f64) -> Result<(), Fault> {
    let turns = segment.kind.moves() == Some(JointKind::Revolute);
    let refuse = |what: String, hint: &str| Err(Fault::new(format!("configuration.{}", segment.name), what, hint));
    if let Some((lower, upper)) = segment.limits {
        // Where there is no limit to one side, of a turn.
        let range = if (upper - lower).is_finite() { upper - lower } else { TAU };
        let slack = BEYOND * range;
        if !(lower - slack..=upper + slack).contains(&position) {
            let what = format!("{position} is far beyond its limits in the URDF, {lower} and {upper}");
            let hint = format!("write {}, or correct the limits", if turns { "radians" } else { "metres" });
            return refuse(what, &hint);
        }
    }
    let (from, to) = asked;
    if turns && !(from - TURNS * TAU..=to + TURNS * TAU).contains(&position) {
        let what =
            format!("{position} is more than {TURNS} turns beyond where it is asked to go, {from:.4} to {to:.4}");
        return refuse(what, "write radians, and leave out whole turns");
    }
    Ok(())
}

/// Refuses points far outside a camera's picture.
fn within_picture(field: &str, camera: &CameraKind, reading: &[f64]) -> Result<(), Fault> {
    let [width, height] = camera.size_px;
    let is_within = |x: f64, size: f64| (-BEYOND * size..=(1.0 + BEYOND) * size).contains(&x);
    let outside = |point: &&[f64]| {
        point.iter().all(|x| !x.is_nan()) && !matches!(point, [u, v] if is_within(*u, width) && is_within(*v, height))
    };
    let Some(point) = reading.chunks(2).find(outside) else { return Ok(()) };
    let what = format!("{point:?} is far outside the picture of `{}`, {width} x {height} px", camera.name);
    Err(Fault::new(
        field,
        what,
        "write pixels from the picture's upper left corner, or correct `size_px` of the camera",
    ))
}

fn unknown<'a>(field: &str, kind: &str, name: &str, known: impl Iterator<Item = &'a str> + Clone) -> Fault {
    let hint = did_you_mean(name, known.clone(), || format!("write some of {}", known.collect::<Vec<_>>().join(", ")));
    Fault::new(field, format!("there is no such {kind}"), hint)
}
