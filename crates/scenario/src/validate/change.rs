//! A change of the body.

use nalgebra::UnitVector3;
use toml::Spanned;

use super::{Check, raw};
use crate::{ChangeSpec, Robot, error::did_you_mean};
use body_schema_engine::{
    elementary::{cos, sin},
    kinematics::{Joint, Line},
};

impl Check<'_> {
    pub(super) fn change(&mut self, raw: &raw::Change, robot: &Robot) -> Option<ChangeSpec> {
        let step = self.at_least_one("change.step", &raw.step);
        let mut truth = robot.state.clone();
        if raw.tilt.is_none() && raw.shift.is_none() {
            self.problem(raw.step.span(), "change", "nothing changes", "add `tilt = { … }` or `shift = { … }`");
        }
        if let Some(tilt) = &raw.tilt {
            let index = self.learned_joint("change.tilt.joint", &tilt.joint, robot)?;
            let angle = self.positive("change.tilt.angle_deg", &tilt.angle_deg).to_radians();
            let towards = self.unit("change.tilt.towards", &tilt.towards)?;
            let joint = &mut truth.joints[index];
            let axis = joint.direction();
            let across = towards.into_inner() - axis.into_inner() * axis.dot(&towards);
            if across.norm() < 1e-3 {
                let hint = "name a direction that differs from the axis";
                self.problem(tilt.towards.span(), "change.tilt.towards", "it is along the axis", hint);
                return None;
            }
            let tilted = UnitVector3::new_normalize(axis.into_inner() * cos(angle) + across.normalize() * sin(angle));
            *joint = match *joint {
                Joint::Revolute(line) => Joint::Revolute(Line { direction: tilted, ..line }),
                Joint::Prismatic(_) => Joint::Prismatic(tilted),
            };
        }
        if let Some(shift) = &raw.shift {
            let first = self.learned_joint("change.shift.joint", &shift.joint, robot)?;
            let by = self.point("change.shift.by_m", &shift.by_m).coords;
            // What hangs on the joint shifts with it; another branch does not.
            let tree = &robot.state.tree;
            let shifts = |index: usize| index == first || tree.moves(first, index + 1);
            let known = (0..robot.names.len()).find(|&index| shifts(index) && !robot.layout.is_learned(index));
            if known.is_some() || robot.layout.marker().is_none() {
                let what = "all that the link carries shifts, and some of it counts as known";
                let hint = "set `learned = true` on the joints behind it, and `learn_marker = true`";
                self.problem(shift.joint.span(), "change.shift.joint", what, hint);
                return None;
            }
            for (_, joint) in truth.joints.iter_mut().enumerate().filter(|(index, _)| shifts(*index)) {
                if let Joint::Revolute(line) = joint {
                    line.point += by;
                }
            }
            if tree.is_serial() || tree.moves(first, truth.hand_link()) {
                let marker = truth.marker() + by;
                truth = truth.with_marker(marker);
            }
        }
        Some(ChangeSpec { step, truth })
    }

    fn learned_joint(&mut self, key: &str, name: &Spanned<String>, robot: &Robot) -> Option<usize> {
        let index = robot.names.iter().position(|known| known == name.get_ref());
        match index {
            Some(index) if robot.layout.is_learned(index) => Some(index),
            Some(_) => {
                let hint = "set `learned = true` on it, or name another joint";
                self.problem(name.span(), key, format!("`{}` counts as known", name.get_ref()), hint);
                None
            }
            None => {
                let hint = did_you_mean(name.get_ref(), robot.names.iter().map(String::as_str), || {
                    format!("name one of {}", robot.names.join(", "))
                });
                self.problem(name.span(), key, format!("there is no joint `{}`", name.get_ref()), hint);
                None
            }
        }
    }
}
