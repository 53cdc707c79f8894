//! The compliance of a robot under its load.

use nalgebra::Vector3;

use super::{Check, raw};
use crate::{Gravity, error::suggest};
use body_schema_engine::{
    kinematics::{Joint, JointKind},
    numeric_range::are_usable,
};

impl Check<'_> {
    /// The upward direction, and the joint of the elbow.
    pub(super) fn gravity(&mut self, raw: &raw::Robot, names: &[String], joints: &[Joint]) -> Gravity {
        let up = raw.up.as_ref().and_then(|up| self.unit("robot.up", up)).unwrap_or_else(Vector3::z_axis);
        let elbow = raw.elbow.as_ref().and_then(|given| {
            let found = names.iter().position(|name| name == given.get_ref());
            let turns = |joint: &usize| joints.get(*joint).is_some_and(|joint| joint.kind() == JointKind::Revolute);
            if found.as_ref().is_some_and(turns) {
                return found;
            }
            let what = match found {
                Some(_) => format!("`{}` slides", given.get_ref()),
                None => format!("there is no joint `{}`", given.get_ref()),
            };
            let hint = match suggest(given.get_ref(), names.iter().map(String::as_str)).filter(|_| found.is_none()) {
                Some(known) => format!("did you mean `{known}`?"),
                None => "name a joint that turns; without this key it is the middle one".to_owned(),
            };
            self.problem(given.span(), "robot.elbow", what, hint);
            None
        });
        Gravity { up, elbow }
    }

    /// The true compliance of a joint to the loads at the target and at the elbow, rad per N·m of 1 kg.
    pub(super) fn compliance(&mut self, index: usize, raw: &raw::Joint) -> [f64; 2] {
        let key = |field: &str| format!("robot.joint[{index}].{field}");
        let given = raw.compliance_deg_per_nm.as_ref();
        if raw.kind == JointKind::Prismatic {
            if let Some(span) = given.map(|given| given.span()).or(raw.learn_compliance.then_some(0..0)) {
                let what = "a joint that slides bears no torque";
                self.problem(span, key("compliance_deg_per_nm"), what, "remove it");
            }
            return [0.0; 2];
        }
        let Some(given) = given else { return [0.0; 2] };
        let raw::Exactly(numbers) = *given.get_ref();
        if !are_usable(&numbers) {
            let hint = "write `[target, elbow]`, in degrees per N·m of 1 kg there";
            self.problem(given.span(), key("compliance_deg_per_nm"), "it is out of range", hint);
        }
        numbers.map(f64::to_radians)
    }
}
