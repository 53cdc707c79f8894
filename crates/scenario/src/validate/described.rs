//! The robot of a URDF.

use std::sync::Arc;

use nalgebra::Isometry3;
use toml::Spanned;

use super::{Check, body::BASE, raw};
use crate::{Described, Known, error::similar};
use body_schema_engine::{
    kinematics::{Joint, JointKind},
    model::Block,
};
use body_schema_robot::{Chain, Urdf, UrdfError};

/// The names of links: by the joints that move them, or by a description.
#[derive(Clone, Copy)]
pub(super) struct Links<'a> {
    pub joints: &'a [String],
    pub described: Option<&'a Described>,
    /// Whether joints branch, so that there is no last link.
    pub branches: bool,
}

impl Links<'_> {
    /// The last link, and the frame in which places on it are written, at θ = 0.
    pub fn last(&self) -> (usize, Isometry3<f64>) {
        let frame = self.described.and_then(|described| described.chain.frames().pop());
        (self.joints.len(), frame.map_or_else(Isometry3::identity, |(_, frame)| frame))
    }

    /// The link with this name, and the frame in which places on it are written, at θ = 0.
    pub fn find(&self, name: &str) -> Option<(usize, Isometry3<f64>)> {
        let Some(described) = self.described else {
            let joint = self.joints.iter().position(|joint| joint == name).map(|index| index + 1);
            let link = if name == BASE { Some(0) } else { joint };
            return link.map(|link| (link, Isometry3::identity()));
        };
        let Described { urdf, chain, .. } = described;
        let on_chain = |chain: &Chain| {
            let names = std::iter::once(&chain.base).chain(chain.segments.iter().map(|segment| &segment.link));
            names.zip(chain.frames()).find(|(link, _)| *link == name).map(|(_, frame)| frame)
        };
        // A link beside the chain, as a camera's, may be fixed to one of its links.
        let beside = || urdf.chain(&chain.base, name).ok().filter(|other| chain.names().starts_with(&other.names()));
        on_chain(chain).or_else(|| on_chain(&beside()?))
    }

    /// The known names.
    pub fn names(&self) -> Vec<&str> {
        match self.described {
            Some(Described { chain, .. }) => {
                let links = chain.segments.iter().map(|segment| segment.link.as_str());
                std::iter::once(chain.base.as_str()).chain(links).collect()
            }
            None => std::iter::once(BASE).chain(self.joints.iter().map(String::as_str)).collect(),
        }
    }
}

/// The held parts of an axis.
#[derive(Clone, Copy, Default)]
struct HeldParts {
    direction: bool,
    point: bool,
}

impl Check<'_> {
    /// The description that a scenario names instead of joints; `None` if it names none, or if it has left a problem behind.
    pub(super) fn described(&mut self, scenario: &raw::Scenario) -> Option<Arc<Described>> {
        let raw = &scenario.robot;
        let Some(file) = &raw.urdf else {
            let keys = [("base", &raw.base), ("tip", &raw.tip)];
            for (key, value) in keys.into_iter().filter_map(|(key, value)| Some((key, value.as_ref()?))) {
                let hint = "add `urdf = \"robot.urdf\"`, or remove it";
                self.problem(
                    value.span(),
                    format!("robot.{key}"),
                    "it names a link of a URDF, and there is none",
                    hint,
                );
            }
            return None;
        };
        if let Some(joint) = raw.joints.get_ref().first() {
            let hint = "remove the [[robot.joint]]s, or `urdf`, `base` and `tip`";
            self.problem(joint.span(), "robot.joint", "the joints are those of the URDF", hint);
            return None;
        }
        let mut link = |key: &str, value: &Option<Spanned<String>>| {
            if value.is_none() {
                let hint = format!(
                    "add `{key} = \"…\"`, a link of the URDF, the two ends of the chain being `base` and `tip`"
                );
                self.problem(file.span(), format!("robot.{key}"), "missing", hint);
            }
            value.as_ref().map(|value| value.get_ref().clone())
        };
        let (base, tip) = (link("base", &raw.base), link("tip", &raw.tip));
        let (base, tip) = (base?, tip?);
        let name = file.get_ref().clone();
        let text = self.opened(&name).map_err(|error| {
            let hint = "name a file beside the scenario that can be read, a URDF as text in UTF-8";
            self.problem(file.span(), "robot.urdf", format!("{name} {error}"), hint);
        });
        let mut refuse = |UrdfError { line, what, hint, .. }: UrdfError| {
            self.problem(file.span(), "robot.urdf", format!("{name}, line {line}: {what}"), hint);
        };
        let urdf = Urdf::parse(&text.ok()?).map_err(&mut refuse).ok()?;
        let chain = urdf.chain(&base, &tip).map_err(&mut refuse).ok()?;
        if scenario.measurements.is_none() && chain.readings.len() < chain.moving().count() {
            let hint = "write its joints as [[robot.joint]]s, each moving by itself";
            self.problem(
                file.span(),
                "robot.urdf",
                "a joint mimics another, and simulated joints move by themselves",
                hint,
            );
            return None;
        }
        Some(Arc::new(Described { file: name, urdf, chain }))
    }

    /// The joints of a description whose readings have a learned offset, with its prior deviation.
    pub(super) fn offsets(
        &mut self,
        scenario: &raw::Scenario,
        names: &[String],
        joints: &[Joint],
    ) -> Vec<(Block, Known)> {
        let (prior, mut offsets) = (scenario.prior.get_ref(), Vec::new());
        for given in &scenario.robot.offsets {
            let name = given.get_ref();
            let Some(index) = names.iter().position(|joint| joint == name).filter(|_| scenario.robot.urdf.is_some())
            else {
                let hint = match similar(name, names.iter().map(String::as_str)) {
                    _ if scenario.robot.urdf.is_none() => {
                        "write `learn_offset = true` of the [[robot.joint]]".to_owned()
                    }
                    Some(known) => format!("did you mean `{known}`?"),
                    None => format!("write some of {}", names.join(", ")),
                };
                self.problem(given.span(), "robot.offsets", format!("the URDF has no joint `{name}`"), hint);
                continue;
            };
            let (key, sd) = match joints.get(index).map(Joint::kind) {
                Some(JointKind::Prismatic) => ("prior.offset_m", &prior.offset_m),
                _ => ("prior.offset_rad", &prior.offset_rad),
            };
            match sd {
                Some(sd) => {
                    let size = self.positive(key, sd);
                    let known = Known::Within { length_m: size, angle_rad: size, other: size };
                    offsets.push((Block::Offset(index), known));
                }
                None => {
                    let hint = "add it to [prior]: the standard deviation of an offset";
                    self.problem(given.span(), key, "an offset is learned", hint);
                }
            }
        }
        offsets
    }

    /// Whether each joint is learned: all that are not held. An axis with only `joint.direction` or `joint.point` held is
    /// learned, with that part known.
    pub(super) fn learned(&mut self, scenario: &raw::Scenario, names: &[String]) -> (Vec<bool>, Vec<(Block, Known)>) {
        let prior = scenario.prior.get_ref();
        let (point_m, direction_rad) = (*prior.point_m.get_ref(), *prior.direction_rad.get_ref());
        let mut learned = vec![true; names.len()];
        let mut held_parts = vec![HeldParts::default(); names.len()];
        for held in &scenario.robot.hold {
            let given = held.get_ref();
            let joint = |name: &str| names.iter().position(|joint| joint == name);
            let part = |end: &str| given.strip_suffix(end).and_then(joint);
            if let Some(joint) = joint(given) {
                learned[joint] = false;
            } else if let Some(joint) = part(".direction") {
                held_parts[joint].direction = true;
            } else if let Some(joint) = part(".point") {
                held_parts[joint].point = true;
            } else {
                let hint = match similar(given, names.iter().map(String::as_str)) {
                    Some(known) => format!("did you mean `{known}`?"),
                    None => format!("write some of {}, or `….direction` or `….point` of one", names.join(", ")),
                };
                self.problem(held.span(), "robot.hold", format!("there is no joint `{given}`"), hint);
            }
        }
        let mut known = Vec::new();
        for (joint, held) in held_parts.iter().enumerate() {
            let within = |length_m, angle_rad| Known::Within { length_m, angle_rad, other: Known::EXACTLY };
            match held {
                HeldParts { direction: true, point: true } => learned[joint] = false,
                HeldParts { direction: true, point: false } => {
                    known.push((Block::Axis(joint), within(point_m, Known::EXACTLY)));
                }
                HeldParts { direction: false, point: true } => {
                    known.push((Block::Axis(joint), within(Known::EXACTLY, direction_rad)));
                }
                HeldParts { direction: false, point: false } => {}
            }
        }
        (learned, known)
    }
}
