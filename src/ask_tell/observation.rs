//! What a robot tells after it has moved.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{ChannelShape, Fault, Shape, channel::SOCKET};
use crate::{
    experiment::Executed,
    kinematics::JointKind,
    magnitude::is_usable,
    scenario::{Described, Scenario},
    selection::Movement,
    sensing::{Observation as Readings, Occasion},
    similar::similar,
};

/// A movement as it was executed, and what was seen after it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "app", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct Observation {
    /// The suggestion that it carries out, if it does.
    #[serde(default, deserialize_with = "crate::whole::whole_or_none", skip_serializing_if = "Option::is_none")]
    pub suggestion_id: Option<u64>,
    /// Where the joints were, by name, in the units of the URDF (rad, m).
    pub configuration: BTreeMap<String, f64>,
    /// By channel what it saw, in the shape of its kind (see the [module](super)); null where it saw nothing.
    #[serde(default)]
    #[cfg_attr(feature = "app", schema(value_type = BTreeMap<String, Value>))]
    pub measurements: BTreeMap<String, Value>,
}

/// What is answered to an observation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "app", derive(utoipa::ToSchema))]
pub struct Answer {
    /// Its number, counted from 1: by it it is excluded.
    pub observation: u64,
    /// Whether any channel had a reading.
    pub seen: bool,
    /// How far it was from what was expected, root mean square over its equations in standard deviations of the innovation,
    /// `√(eᵀ S⁻¹ e / d)`: about 1 where all is well. Null where nothing was seen, and without a covariance.
    pub innovation_sigmas: Option<f64>,
    /// The probability that it is an outlier, after it was taken in: the greatest of its channels'. Null where nothing was
    /// seen, and for an estimator that knows of no outliers.
    pub outlier_probability: Option<f64>,
    /// The mean error of predictions over the workspace that is expected now, millimetres; null without a covariance.
    pub expected_error_mm: Option<f64>,
    /// Whether the body seems to have changed: what was learned before is dropped then, and pending suggestions are superseded.
    pub body_seems_changed: bool,
}

/// How far beyond its limits a joint may be said to be, as a share of its range: more is a mistake.
const BEYOND: f64 = 0.1;

impl Observation {
    /// The movement and its readings, by the channels of a scenario.
    pub(super) fn read(&self, scenario: &Scenario, shapes: &[ChannelShape]) -> Result<Executed, Fault> {
        let configuration = self.positions(scenario)?;
        let known = || shapes.iter().map(|shape| shape.name.as_str());
        // One who holds a target in a socket may name the target.
        let held = |name: &str| {
            let sockets = shapes.iter().find(|shape| shape.name == SOCKET)?;
            let target = scenario.robot.sockets.first().map(|socket| socket.target)?;
            (scenario.robot.equipment.targets.get(target)?.name == name).then_some(sockets)
        };
        let (mut readings, mut socket) = (Readings::missed(scenario.rig.channels().len()), None);
        let always = scenario.rig.channels().iter().enumerate();
        let always: Vec<usize> =
            always.filter(|(_, channel)| channel.occasion() == Occasion::Always).map(|(index, _)| index).collect();
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
            let channel = match shape {
                Shape::Sockets { .. } => {
                    let number = shape.socket(&field, told)?;
                    socket = Some(number);
                    scenario.rig.holds(number).map(|(channel, _)| channel)
                }
                _ => always.get(index).copied(),
            };
            channel.into_iter().for_each(|channel| readings.readings[channel] = Some(reading.clone()));
        }
        let proposal = self.suggestion_id.and_then(|id| id.checked_sub(1));
        Ok(Executed { proposal, movement: Movement { configuration, row: None, socket }, observation: readings })
    }

    fn positions(&self, scenario: &Scenario) -> Result<Vec<f64>, Fault> {
        let names = &scenario.robot.names;
        if let Some(name) = self.configuration.keys().find(|name| !names.contains(name)) {
            return Err(unknown(&format!("configuration.{name}"), "joint", name, names.iter().map(String::as_str)));
        }
        let of = |name: &String| {
            let field = || format!("configuration.{name}");
            let position = self.configuration.get(name);
            let position = position.ok_or_else(|| Fault::new(field(), "missing", "tell where every joint was"))?;
            match is_usable(*position) {
                true => Ok(*position),
                false => {
                    Err(Fault::new(field(), "it is no number that a joint can have", "write a number, in rad or m"))
                }
            }
        };
        names.iter().map(of).collect()
    }

    /// That no joint is said to be where it can hardly be.
    pub(super) fn check_limits(&self, described: &Described) -> Result<(), Fault> {
        for segment in described.chain.moving() {
            let (Some((lower, upper)), Some(position)) = (segment.limits, self.configuration.get(&segment.name)) else {
                continue;
            };
            // Where there is no limit to one side, of a turn.
            let range = if (upper - lower).is_finite() { upper - lower } else { std::f64::consts::TAU };
            let slack = BEYOND * range;
            if !(lower - slack..=upper + slack).contains(position) {
                let unit = if segment.kind.moves() == Some(JointKind::Prismatic) { "metres" } else { "radians" };
                let what = format!("{position} is far beyond its limits in the URDF, {lower} and {upper}");
                let mend = format!("write {unit}, or correct the limits");
                return Err(Fault::new(format!("configuration.{}", segment.name), what, mend));
            }
        }
        Ok(())
    }
}

fn unknown<'a>(field: &str, kind: &str, name: &str, known: impl Iterator<Item = &'a str> + Clone) -> Fault {
    let mend = match similar(name, known.clone()) {
        Some(known) => format!("did you mean `{known}`?"),
        None => format!("write some of {}", known.collect::<Vec<_>>().join(", ")),
    };
    Fault::new(field, format!("there is no such {kind}"), mend)
}
