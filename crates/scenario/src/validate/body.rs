//! The robot of a scenario, joint by joint.

use std::ops::Range;

use nalgebra::Point3;
use toml::Spanned;

use super::{
    Check,
    described::{BASE, Links},
    equipment::Outfit,
    raw,
};
use crate::Robot;
use body_schema_engine::{
    kinematics::{Joint, JointBox, JointKind, Line, Tree},
    model::{Block, Correction, Layout, Load, State},
    numeric_range::are_usable,
    sensing::{Keys, TargetKind},
};

impl Check<'_> {
    pub(super) fn robot(&mut self, scenario: &raw::Scenario) -> Option<Robot> {
        let raw = &scenario.robot;
        let described = self.described(scenario);
        if raw.urdf.is_some() && described.is_none() {
            return None;
        }
        let place = raw.urdf.as_ref().map_or_else(|| raw.joints.span(), Spanned::span);
        let marker = match (&raw.marker_m, scenario.targets.first()) {
            (Some(marker), None) => self.point("robot.marker_m", marker),
            (None, Some(_)) if !raw.learn_marker => Point3::origin(),
            (None, Some(target)) => {
                let hint = "remove `learn_marker`; say `known = { to_m = … }` of the target instead";
                self.problem(target.span(), "robot.learn_marker", "targets take the marker's place", hint);
                Point3::origin()
            }
            (Some(marker), Some(_)) => {
                let hint = "remove it, or the [[target]]s";
                self.problem(marker.span(), "robot.marker_m", "targets take the marker's place", hint);
                Point3::origin()
            }
            (None, None) => {
                let hint = "add `marker_m = [x, y, z]`, where the marker on the hand is at θ = 0, or a [[target]]";
                self.problem(place.clone(), "robot.marker_m", "missing", hint);
                Point3::origin()
            }
        };
        let mut names: Vec<String> = Vec::new();
        let (mut joints, mut limits, mut learned) = (Vec::new(), Vec::new(), Vec::new());
        for (index, spanned) in raw.joints.get_ref().iter().enumerate() {
            let joint = spanned.get_ref();
            let name = joint.name.get_ref();
            let key = |field: &str| format!("robot.joint[{index}].{field}");
            if name.is_empty() || names.contains(name) {
                let hint = "give each joint a name of its own";
                self.problem(joint.name.span(), key("name"), format!("{name:?} is empty or taken"), hint);
            }
            names.push(name.clone());
            learned.push(joint.learned);
            joints.extend(self.joint(joint, spanned.span(), &key));
            limits.extend(self.limits(joint, spanned.span(), &key));
        }
        if let Some(described) = &described {
            let chain = &described.chain;
            names = chain.names();
            joints = chain.state().joints;
            match chain.limits() {
                Ok(within) => limits.extend_from_slice(within.joints()),
                Err(error) => {
                    let what = format!("{}: {error}", described.file);
                    self.problem(place.clone(), "robot.urdf", what, "correct its <limit>s");
                    return None;
                }
            }
        }
        let (held, partly) = self.learned(scenario, &names);
        let offsets = self.offsets(scenario, &names, &joints);
        learned.resize(names.len(), true);
        learned.iter_mut().zip(held).for_each(|(learned, held)| *learned &= held);
        if names.is_empty() {
            self.problem(place.clone(), "robot.joint", "there is no joint", "add a [[robot.joint]]");
        }
        let tree = described.as_deref().map_or_else(|| self.tree(raw, &names), |described| described.chain.tree());
        let branches = described.is_none() && !tree.is_serial();
        let links = Links { joints: &names, described: described.as_deref(), branches };
        let outfit = self.outfit(scenario, links);
        let mut state = State::arm(joints, marker);
        state.targets[0].link = links.last().0;
        state.tree = tree;
        let is_whole = state.joints.len() == names.len();
        let mut blocks: Vec<Block> = (0..names.len()).filter(|joint| learned[*joint]).map(Block::Axis).collect();
        for (index, spanned) in raw.joints.get_ref().iter().enumerate().filter(|_| is_whole) {
            state.corrections[index] = self.correction(index, spanned.get_ref());
            blocks.extend(spanned.get_ref().learn_ratio.then_some(Block::Ratio(index)));
            blocks.extend(spanned.get_ref().learn_offset.then_some(Block::Offset(index)));
            blocks.extend(spanned.get_ref().learn_eccentricity.then_some(Block::Eccentricity(index)));
            let compliance = Load::ALL.map(|load| Block::Compliance(index, load));
            blocks.extend(compliance.into_iter().filter(|_| spanned.get_ref().learn_compliance));
        }
        outfit.equip(&mut state);
        blocks.extend(offsets.iter().chain(&outfit.known).map(|(block, _)| *block));
        blocks.extend(raw.learn_marker.then_some(Block::Target(0)));
        let Outfit { mut equipment, mut known, baselines, .. } = outfit;
        known.extend(partly.into_iter().chain(offsets));
        if equipment.targets.is_empty() {
            let (name, points) = ("marker".to_owned(), vec![Point3::origin()]);
            equipment.targets.push(TargetKind { name, points, facing: None, partly_seen: None });
        }
        let mut up_to_motion = false;
        if let Some(prediction) = &scenario.prediction {
            let prediction = prediction.get_ref();
            up_to_motion = prediction.up_to_motion;
            if let Some(hand) = self.hand("prediction.of", &prediction.of, &equipment) {
                state.hand = hand;
            }
            if let Some(name) = &prediction.seen_in {
                state.seen_from = self.hand("prediction.in", name, &equipment);
                if state.seen_from == Some(state.hand) {
                    let hint = "name another camera or target, or leave `in` out for the frame of the measurements";
                    self.problem(name.span(), "prediction.in", "it is always at the same place in its own frame", hint);
                }
            }
        }
        let gravity = self.gravity(raw, &names, &state.joints);
        if blocks.iter().any(|block| matches!(block, Block::Compliance(..))) || gives_way(&state) {
            state.loads = Some(state.loads_under(gravity.up, gravity.elbow).into());
        }
        let layout = Layout::new(&state, blocks.iter().copied());
        if layout.dimension() == 0 {
            let hint = "set `learned = true` on a joint, or `learn_marker = true`";
            self.problem(place.clone(), "robot.joint", "nothing is to be learned", hint);
        }
        let complete = state.joints.len() == names.len() && limits.len() == names.len() && !names.is_empty();
        let limits = JointBox::new(limits).map_err(|error| {
            self.problem(place.clone(), "robot.joint", error.to_string(), "write limits that a robot can have");
        });
        let limits = limits.ok().filter(|_| complete)?;
        let (sockets, held_out_sockets, spacings) = Default::default();
        let shapes = self.shapes(raw, described.as_deref());
        let mut robot = Robot {
            names,
            state,
            layout,
            limits,
            body: raw.body.map(Into::into),
            known,
            equipment,
            sockets,
            held_out_sockets,
            spacings,
            baselines,
            up_to_motion,
            gravity,
            described,
            shapes,
        };
        self.sockets(scenario, &mut robot);
        blocks.extend((0..robot.sockets.len()).map(Block::Socket));
        robot.layout = Layout::new(&robot.state, blocks);
        Some(robot)
    }

    /// Takes the joints away that stand at 0 by `first_joints`: what hangs on them is fixed to the last joint that moves.
    pub(super) fn first_joints(&mut self, scenario: &mut raw::Scenario) {
        let Some(first) = &scenario.robot.first_joints else { return };
        let refused = if scenario.robot.urdf.is_some() {
            Some(("the joints come from a description", "name the last link that moves instead: `tip = \"…\"`"))
        } else if scenario.measurements.is_some() {
            Some(("the robot that was measured moved all its joints", "remove it; `learned = false` holds a joint"))
        } else {
            None
        };
        if let Some((what, hint)) = refused {
            return self.problem(first.span(), "robot.first_joints", what, hint);
        }
        let all = scenario.robot.joints.get_ref().len();
        let count = self.count("robot.first_joints", Some(first), all, all.max(1) as u64);
        scenario.robot.joints.get_mut().truncate(count);
    }

    /// Takes the targets away that `first_targets` leaves out, and the sensors that measure them.
    pub(super) fn first_targets(&mut self, scenario: &mut raw::Scenario) {
        let Some(first) = &scenario.robot.first_targets else { return };
        if scenario.measurements.is_some() {
            let hint = "remove it, and the [[target]]s that are not to count";
            return self.problem(
                first.span(),
                "robot.first_targets",
                "which targets were measured the table says",
                hint,
            );
        }
        let all = scenario.targets.len();
        let count = self.count("robot.first_targets", Some(first), all, all.max(1) as u64);
        let gone: Vec<String> =
            scenario.targets.drain(count.min(all)..).map(|target| target.get_ref().name.get_ref().clone()).collect();
        if let Some(sensors) = &mut scenario.sensor {
            let is_left = |keys: &Keys| {
                [&keys.target, &keys.to, &keys.seen_in].into_iter().flatten().all(|name| !gone.contains(name))
            };
            sensors.get_mut().0.retain(|keys| is_left(keys.get_ref()));
        }
    }

    /// Which joint carries which. Without `parent` a joint hangs on the one before it.
    fn tree(&mut self, raw: &raw::Robot, names: &[String]) -> Tree {
        let mut parents = Vec::new();
        for (index, joint) in raw.joints.get_ref().iter().enumerate() {
            let usual = index.checked_sub(1);
            let Some(parent) = &joint.get_ref().parent else {
                parents.push(usual);
                continue;
            };
            let found = names.iter().take(index).position(|name| name == parent.get_ref());
            if found.is_none() && parent.get_ref() != BASE {
                let known = names.iter().take(index).map(String::as_str).chain([BASE]).collect::<Vec<_>>().join(", ");
                let what = match names.iter().any(|name| name == parent.get_ref()) {
                    true => format!("joint `{}` does not stand before this one", parent.get_ref()),
                    false => format!("there is no joint `{}`", parent.get_ref()),
                };
                let hint = format!("write one of {known}; a joint stands after the one that carries it");
                self.problem(parent.span(), format!("robot.joint[{index}].parent"), what, hint);
            }
            parents.push(found);
        }
        Tree::new(parents).unwrap_or_default()
    }

    /// The true correction of a joint's readings.
    fn correction(&mut self, index: usize, raw: &raw::Joint) -> Correction {
        let key = |field: &str| format!("robot.joint[{index}].{field}");
        let mut correction = Correction { compliance: self.compliance(index, raw), ..Correction::default() };
        if let Some(ratio) = &raw.ratio {
            correction.ratio = self.number(&key("ratio"), ratio, |ratio| ratio != 0.0, "a number other than 0");
        }
        let (wanted, given, other) = match raw.kind {
            JointKind::Revolute => ("offset_deg", &raw.offset_deg, &raw.offset_m),
            JointKind::Prismatic => ("offset_m", &raw.offset_m, &raw.offset_deg),
        };
        if let Some(other) = other {
            self.problem(
                other.span(),
                key("offset"),
                "this unit does not fit the kind of joint",
                format!("write `{wanted}`"),
            );
        }
        if let Some(offset) = given {
            let offset = self.number(&key(wanted), offset, |_| true, "a number");
            correction.offset = if raw.kind == JointKind::Revolute { offset.to_radians() } else { offset };
        }
        if raw.kind == JointKind::Prismatic
            && let Some(span) =
                raw.eccentricity_deg.as_ref().map(|given| given.span()).or(raw.learn_eccentricity.then_some(0..0))
        {
            let what = "an encoder off its centre misreads a joint that turns, not one that slides";
            self.problem(span, key("eccentricity"), what, "remove it");
        } else if let Some(given) = &raw.eccentricity_deg {
            let [sine, cosine] = given.get_ref().0;
            if !are_usable(&[sine, cosine]) {
                self.problem(
                    given.span(),
                    key("eccentricity_deg"),
                    "it is out of range",
                    "write `[sine, cosine]`, in degrees",
                );
            }
            (correction.sine, correction.cosine) = (sine.to_radians(), cosine.to_radians());
        }
        correction
    }

    fn joint(&mut self, raw: &raw::Joint, span: Range<usize>, key: &dyn Fn(&str) -> String) -> Option<Joint> {
        let direction = self.unit(&key("axis"), &raw.axis);
        match (raw.kind, &raw.point_m) {
            (JointKind::Revolute, Some(point)) => {
                let point = self.point(&key("point_m"), point);
                direction.map(|direction| Joint::Revolute(Line { point, direction }))
            }
            (JointKind::Revolute, None) => {
                let hint = "add `point_m = [x, y, z]`, any point on the axis at θ = 0, in metres";
                self.problem(span, key("point_m"), "a revolute joint needs it", hint);
                None
            }
            (JointKind::Prismatic, None) => direction.map(Joint::Prismatic),
            (JointKind::Prismatic, Some(point)) => {
                self.problem(point.span(), key("point_m"), "a prismatic joint has only a direction", "remove it");
                None
            }
        }
    }

    fn limits(&mut self, raw: &raw::Joint, span: Range<usize>, key: &dyn Fn(&str) -> String) -> Option<(f64, f64)> {
        let (wanted, given, other, unit) = match raw.kind {
            JointKind::Revolute => ("limits_deg", &raw.limits_deg, &raw.limits_m, "degrees"),
            JointKind::Prismatic => ("limits_m", &raw.limits_m, &raw.limits_deg, "metres"),
        };
        if let Some(other) = other {
            let hint = format!("write `{wanted}`, in {unit}");
            self.problem(other.span(), key("limits"), "this unit does not fit the kind of joint", hint);
            return None;
        }
        let Some(given) = given else {
            let hint = format!("add `{wanted} = [lower, upper]`, in {unit}");
            self.problem(span, key(wanted), "missing", hint);
            return None;
        };
        let raw::Exactly([lower, upper]) = *given.get_ref();
        if !are_usable(&[lower, upper]) {
            self.problem(given.span(), key(wanted), "a limit is out of range", format!("write two numbers, in {unit}"));
            return None;
        }
        if lower >= upper {
            let what = format!("the lower limit {lower} is not below the upper {upper}");
            let hint = if lower > upper {
                format!("write [{upper:?}, {lower:?}]")
            } else {
                "give the joint a range; a joint that cannot move teaches nothing".to_owned()
            };
            self.problem(given.span(), key(wanted), what, hint);
            return None;
        }
        Some(match raw.kind {
            JointKind::Revolute => (lower.to_radians(), upper.to_radians()),
            JointKind::Prismatic => (lower, upper),
        })
    }
}

/// Whether joints of it truly do.
fn gives_way(state: &State) -> bool {
    state.corrections.iter().any(|correction| correction.compliance != [0.0; 2])
}
