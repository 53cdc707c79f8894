//! The robot of a URDF.

use std::{ops::Range, sync::Arc};

use nalgebra::Isometry3;
use toml::Spanned;

use super::{Check, raw};
use crate::{
    Described, Known,
    error::{did_you_mean, suggest},
};
use body_schema_engine::{
    kinematics::{Joint, JointKind},
    model::Block,
};
use body_schema_robot::{Chain, CouplingError, Urdf, UrdfError};

/// The name of the link that carries joints without a parent.
pub(super) const BASE: &str = "base";

/// The names of links: by the joints that move them, or by a description.
#[derive(Clone, Copy)]
pub(super) struct Links<'a> {
    pub joints: &'a [String],
    pub described: Option<&'a Described>,
    /// Whether joints branch, so that there is no last link.
    pub branches: bool,
}

impl Links<'_> {
    /// The last link, the first tip of a description, and the frame in which places on it are written, at θ = 0.
    pub fn last(&self) -> (usize, Isometry3<f64>) {
        let tip = self.described.and_then(|Described { urdf, chain, .. }| urdf.fixed_on(chain, chain.tip()));
        tip.unwrap_or_else(|| (self.joints.len(), Isometry3::identity()))
    }

    /// The link with this name, and the frame in which places on it are written, at θ = 0.
    pub fn find(&self, name: &str) -> Option<(usize, Isometry3<f64>)> {
        let Some(described) = self.described else {
            let joint = self.joints.iter().position(|joint| joint == name).map(|index| index + 1);
            let link = if name == BASE { Some(0) } else { joint };
            return link.map(|link| (link, Isometry3::identity()));
        };
        described.urdf.fixed_on(&described.chain, name)
    }

    /// Why a link that is not [found](Self::find) is not among those of the robot, and what to do.
    pub fn unfound(&self, name: &str) -> (String, String) {
        let Some(Described { urdf, chain, .. }) = self.described else {
            let hint = format!("write `base`, or the joint that moves it: {}", self.names().join(", "));
            return (format!("there is no joint `{name}`"), hint);
        };
        if !urdf.links().iter().any(|link| link == name) {
            let hint = format!("write one of the links: {}", self.names().join(", "));
            return (format!("there is no link `{name}`"), hint);
        }
        let tips: Vec<&str> = chain.tips().chain([name]).collect();
        match urdf.branches(&chain.base, &tips) {
            Err(UrdfError { what, hint, .. }) => (what, hint),
            Ok(with) => {
                let joints: Vec<String> = with.names().into_iter().skip(chain.moving().count()).collect();
                let what = format!("link `{name}` moves by joints that `robot.tips` leaves out: {}", joints.join(", "));
                (what, format!("add \"{name}\" to `robot.tips`, or leave `tips` out"))
            }
        }
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

/// The links that a scenario names, between which its joints are.
pub(super) struct Ends<'r> {
    base: Option<&'r str>,
    /// The tips: those of `tips`, or that of `tip`.
    tips: Vec<&'r str>,
    /// Without `tips`: the links of targets and cameras.
    carriers: Vec<&'r str>,
}

impl<'r> Ends<'r> {
    pub fn of(scenario: &'r raw::Scenario) -> Self {
        let raw = &scenario.robot;
        let text = |link: &'r Spanned<String>| link.get_ref().as_str();
        let targets = scenario.targets.iter().filter_map(|target| target.get_ref().link.as_ref());
        let cameras = scenario.cameras.iter().filter_map(|camera| camera.get_ref().link.as_ref());
        let (tips, carriers) = match &raw.tips {
            Some(tips) => (tips.get_ref().iter().map(text).collect(), Vec::new()),
            None => (raw.tip.iter().map(text).collect(), targets.chain(cameras).map(text).collect()),
        };
        Self { base: raw.base.as_ref().map(text), tips, carriers }
    }

    /// Whether the base need not be named, if links branch.
    fn are_several(&self) -> bool {
        self.tips.len() + self.carriers.len() > 1
    }

    /// The base: as it is named, or the nearest link that carries all others, if these branch.
    fn base<'u>(&self, urdf: &'u Urdf) -> Option<&'u str>
    where
        'r: 'u,
    {
        let known = |link: &&&str| urdf.links().iter().any(|it| it == **link);
        let ends: Vec<&str> = self.tips.iter().chain(self.carriers.iter().filter(known)).copied().collect();
        self.base.or_else(|| urdf.ancestor(&ends).filter(|link| !ends.contains(link)))
    }

    /// The joints from `base` to the tips and then to each carrier that moves by others. A carrier that does not hang on the base is
    /// left out.
    fn joints(&self, urdf: &Urdf, base: &str) -> Result<Chain, UrdfError> {
        let mut tips = self.tips.clone();
        let mut chain = (!tips.is_empty()).then(|| urdf.branches(base, &tips)).transpose()?;
        for carrier in &self.carriers {
            if chain.as_ref().is_some_and(|chain| urdf.fixed_on(chain, carrier).is_some()) {
                continue;
            }
            tips.push(carrier);
            match urdf.branches(base, &tips) {
                Ok(with) => chain = Some(with),
                Err(_) => drop(tips.pop()),
            }
        }
        // Where nothing hangs on the base the first says why.
        chain.map_or_else(|| urdf.branches(base, self.carriers.get(..1).unwrap_or_default()), Ok)
    }

    /// The joints, as far as the scenario says between which links they are.
    pub fn chain(&self, urdf: &Urdf) -> Option<Chain> {
        self.joints(urdf, self.base(urdf)?).ok()
    }
}

/// The prior deviations of zeros where they alone are learned, as of servos that were put together by eye: about 6 degrees, and 10 mm.
const ONLY_ZERO_RAD: f64 = 0.1;
const ONLY_ZERO_M: f64 = 0.01;

/// Whether the zeros of a description's joints alone are learned.
fn only_zeros(scenario: &raw::Scenario) -> bool {
    let learn = scenario.robot.learn.as_ref().map(|learn| *learn.get_ref());
    learn == Some(raw::Learn::Zeros) && scenario.robot.urdf.is_some()
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
            let span = |value: &Option<Spanned<String>>| value.as_ref().map(Spanned::span);
            let tips = raw.tips.as_ref().map(Spanned::span);
            if let Some(learn) = raw.learn.as_ref() {
                let hint = "write `learned = false` and `learn_offset = true` of the [[robot.joint]]s";
                self.problem(learn.span(), "robot.learn", "it is about the joints of a URDF, and there is none", hint);
            }
            if let Some((joint, _)) = raw.coupled.iter().next() {
                let hint = "add `urdf = \"robot.urdf\"`, or remove it";
                self.problem(joint.span(), "robot.coupled", "it names a joint of a URDF, and there is none", hint);
            }
            for (key, span) in [("base", span(&raw.base)), ("tip", span(&raw.tip)), ("tips", tips)] {
                let hint = "add `urdf = \"robot.urdf\"`, or remove it";
                let what = "it names a link of a URDF, and there is none";
                span.into_iter().for_each(|span| self.problem(span, format!("robot.{key}"), what, hint));
            }
            return None;
        };
        if let Some(joint) = raw.joints.get_ref().first() {
            let hint = "remove the [[robot.joint]]s, or `urdf`, `base` and `tip`";
            self.problem(joint.span(), "robot.joint", "the joints are those of the URDF", hint);
            return None;
        }
        let ends = self.ends(scenario, file.span())?;
        let name = file.get_ref().clone();
        let text = self.opened(&name).map_err(|error| {
            let hint = "name a file beside the scenario that can be read, a URDF as text in UTF-8";
            self.problem(file.span(), "robot.urdf", format!("{name} {error}"), hint);
        });
        let mut refuse = |UrdfError { line, what, hint, .. }: UrdfError| {
            self.problem(file.span(), "robot.urdf", format!("{name}, line {line}: {what}"), hint);
        };
        let mut urdf = Urdf::parse(&text.ok()?).map_err(&mut refuse).ok()?;
        self.couple(raw, &mut urdf)?;
        let mut refuse = |UrdfError { line, what, hint, .. }: UrdfError| {
            self.problem(file.span(), "robot.urdf", format!("{name}, line {line}: {what}"), hint);
        };
        let Some(base) = ends.base(&urdf) else {
            self.missing_end(file.span(), "base");
            return None;
        };
        let chain = ends.joints(&urdf, base).map_err(&mut refuse).ok()?;
        if scenario.measurements.is_none() && chain.readings.len() < chain.moving().count() {
            let hint = "write its joints as [[robot.joint]]s, each moving by itself";
            self.problem(
                file.span(),
                "robot.urdf",
                "a joint follows others, and simulated joints move by themselves",
                hint,
            );
            return None;
        }
        Some(Arc::new(Described { file: name, urdf, chain }))
    }

    /// Lets joints follow sums of others; `None` has left a problem behind.
    fn couple(&mut self, raw: &raw::Robot, urdf: &mut Urdf) -> Option<()> {
        let mut all = Some(());
        for (joint, sum) in &raw.coupled {
            if let Err(CouplingError { what, hint }) = urdf.couple(joint.get_ref(), sum.get_ref()) {
                self.problem(sum.span(), format!("robot.coupled.{}", joint.get_ref()), what, hint);
                all = None;
            }
        }
        all
    }

    /// The links between which the joints are; `None` has left a problem behind.
    fn ends<'r>(&mut self, scenario: &'r raw::Scenario, file: Range<usize>) -> Option<Ends<'r>> {
        let (raw, ends) = (&scenario.robot, Ends::of(scenario));
        if let (Some(tip), Some(_)) = (&raw.tip, &raw.tips) {
            let hint =
                "leave one of the two; of several tips the first is the one on which targets are that name no link";
            self.problem(tip.span(), "robot.tip", "`tips` names tips too", hint);
            return None;
        }
        if let Some(tips) = raw.tips.as_ref().filter(|tips| tips.get_ref().is_empty()) {
            self.problem(
                tips.span(),
                "robot.tips",
                "it names no link",
                "name the links at which branches end, or leave it out",
            );
            return None;
        }
        // A target that names no link is on the tip.
        let needs_tip = scenario.targets.iter().any(|target| target.get_ref().link.is_none());
        let (has_base, has_tip) = (
            ends.base.is_some() || ends.are_several(),
            !ends.tips.is_empty() || !(ends.carriers.is_empty() || needs_tip),
        );
        for (key, _) in [("base", has_base), ("tip", has_tip)].into_iter().filter(|(_, is_given)| !is_given) {
            self.missing_end(file.clone(), key);
        }
        (has_base && has_tip).then_some(ends)
    }

    fn missing_end(&mut self, file: Range<usize>, key: &str) {
        let hint = format!("add `{key} = \"…\"`, a link of the URDF, the two ends of the chain being `base` and `tip`");
        self.problem(file, format!("robot.{key}"), "missing", hint);
    }

    /// The joints of a description whose readings have a learned offset, with its prior deviation.
    pub(super) fn offsets(
        &mut self,
        scenario: &raw::Scenario,
        names: &[String],
        joints: &[Joint],
    ) -> Vec<(Block, Known)> {
        let (prior, mut offsets) = (scenario.prior.get_ref(), Vec::new());
        if scenario.robot.offsets.is_empty() && only_zeros(scenario) {
            let held = |name: &String| scenario.robot.hold.iter().any(|held| held.get_ref() == name);
            for (index, joint) in joints.iter().enumerate().filter(|(index, _)| !held(&names[*index])) {
                let (key, sd, usual) = match joint.kind() {
                    JointKind::Prismatic => ("prior.offset_m", &prior.offset_m, ONLY_ZERO_M),
                    JointKind::Revolute => ("prior.offset_rad", &prior.offset_rad, ONLY_ZERO_RAD),
                };
                let size = sd.as_ref().map_or(usual, |sd| self.positive(key, sd));
                offsets.push((Block::Offset(index), Known::Within { length_m: size, angle_rad: size, other: size }));
            }
        }
        for given in &scenario.robot.offsets {
            let name = given.get_ref();
            let Some(index) = names.iter().position(|joint| joint == name).filter(|_| scenario.robot.urdf.is_some())
            else {
                let hint = match suggest(name, names.iter().map(String::as_str)) {
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
            let usual = match joints.get(index).map(Joint::kind) {
                Some(JointKind::Prismatic) => ONLY_ZERO_M,
                _ => ONLY_ZERO_RAD,
            };
            let size = match sd {
                Some(sd) => Some(self.positive(key, sd)),
                None => only_zeros(scenario).then_some(usual),
            };
            match size {
                Some(size) => {
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
        let mut learned = vec![!only_zeros(scenario); names.len()];
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
                let hint = did_you_mean(given, names.iter().map(String::as_str), || {
                    format!("write some of {}, or `….direction` or `….point` of one", names.join(", "))
                });
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
