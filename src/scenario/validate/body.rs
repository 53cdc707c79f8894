//! The robot of a scenario, joint by joint.

use std::ops::Range;

use super::{Check, raw};
use crate::{
    kinematics::{Joint, JointBox, JointKind, Line},
    model::{Layout, State},
    scenario::Robot,
};

impl Check<'_> {
    pub(super) fn robot(&mut self, raw: &raw::Robot) -> Option<Robot> {
        let marker = self.point("robot.marker_m", &raw.marker_m);
        let mut names: Vec<String> = Vec::new();
        let (mut joints, mut limits, mut learned) = (Vec::new(), Vec::new(), Vec::new());
        for (index, spanned) in raw.joints.get_ref().iter().enumerate() {
            let joint = spanned.get_ref();
            let name = joint.name.get_ref();
            let key = |field: &str| format!("robot.joint[{index}].{field}");
            if name.is_empty() || names.contains(name) {
                let mend = "give each joint a name of its own";
                self.problem(joint.name.span(), key("name"), format!("{name:?} is empty or taken"), mend);
            }
            names.push(name.clone());
            learned.push(joint.learned);
            joints.extend(self.joint(joint, spanned.span(), &key));
            limits.extend(self.limits(joint, spanned.span(), &key));
        }
        if names.is_empty() {
            self.problem(raw.joints.span(), "robot.joint", "there is no joint", "add a [[robot.joint]]");
        }
        let state = State::arm(joints, marker);
        let layout = Layout::of_arm(&state, &learned, raw.learn_marker);
        if layout.dimension() == 0 {
            let mend = "set `learned = true` on a joint, or `learn_marker = true`";
            self.problem(raw.joints.span(), "robot.joint", "nothing is to be learned", mend);
        }
        let complete = state.joints.len() == names.len() && limits.len() == names.len() && !names.is_empty();
        let limits = JointBox::new(limits).map_err(|error| {
            self.problem(raw.joints.span(), "robot.joint", error.to_string(), "write limits that a robot can have");
        });
        let limits = limits.ok().filter(|_| complete)?;
        Some(Robot { names, state, layout, limits, body: raw.body })
    }

    fn joint(&mut self, raw: &raw::Joint, span: Range<usize>, key: &dyn Fn(&str) -> String) -> Option<Joint> {
        let direction = self.unit(&key("axis"), &raw.axis);
        match (raw.kind, &raw.point_m) {
            (JointKind::Revolute, Some(point)) => {
                let point = self.point(&key("point_m"), point);
                direction.map(|direction| Joint::Revolute(Line { point, direction }))
            }
            (JointKind::Revolute, None) => {
                let mend = "add `point_m = [x, y, z]`, any point on the axis at θ = 0, in metres";
                self.problem(span, key("point_m"), "a revolute joint needs it", mend);
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
            let mend = format!("write `{wanted}`, in {unit}");
            self.problem(other.span(), key("limits"), "this unit does not fit the kind of joint", mend);
            return None;
        }
        let Some(given) = given else {
            let mend = format!("add `{wanted} = [lower, upper]`, in {unit}");
            self.problem(span, key(wanted), "missing", mend);
            return None;
        };
        let raw::Exactly([lower, upper]) = *given.get_ref();
        if !(lower.is_finite() && upper.is_finite()) {
            self.problem(given.span(), key(wanted), "a limit is not finite", format!("write two numbers, in {unit}"));
            return None;
        }
        if lower >= upper {
            let what = format!("the lower limit {lower} is not below the upper {upper}");
            let mend = if lower > upper {
                format!("write [{upper:?}, {lower:?}]")
            } else {
                "give the joint a range; a joint that cannot move teaches nothing".to_owned()
            };
            self.problem(given.span(), key(wanted), what, mend);
            return None;
        }
        Some(match raw.kind {
            JointKind::Revolute => (lower.to_radians(), upper.to_radians()),
            JointKind::Prismatic => (lower, upper),
        })
    }
}
