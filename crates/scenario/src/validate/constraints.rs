//! The constraints on movements.

use std::cmp::Ordering;

use toml::Spanned;

use super::{Check, raw};
use crate::{Robot, WorldSpec, error::did_you_mean};
use body_schema_engine::{
    kinematics::{JointBox, JointKind},
    selection::{Constraints, Infeasible, Obstacle, Outline},
};

impl Check<'_> {
    /// The constraints of a robot, checked to leave feasible movements.
    pub(super) fn constraints(
        &mut self,
        spanned: &Spanned<raw::Constraints>,
        robot: &Robot,
        world: Option<&WorldSpec>,
    ) -> Option<Constraints> {
        let (raw, problems) = (spanned.get_ref(), self.problems.len());
        let outline = Outline::new(&robot.state, &robot.names, &robot.equipment);
        let mut constraints = Constraints::new(robot.names.clone(), robot.limits.clone(), outline);
        self.tighten(raw, robot, &mut constraints);
        for (index, obstacle) in raw.boxes.iter().enumerate() {
            let obstacle = self.obstacle(index, obstacle.get_ref(), &constraints.obstacles);
            constraints.obstacles.push(obstacle);
        }
        let height = raw.minimum_height_m.as_ref();
        constraints.minimum_height =
            height.map(|height| self.number("constraints.minimum_height_m", height, |_| true, "a number, in metres"));
        let clearance = raw.self_clearance_m.as_ref().map(|it| self.not_negative("constraints.self_clearance_m", it));
        self.travel(raw, robot, &mut constraints);
        if let Some(least) = clearance.filter(|_| self.problems.len() == problems) {
            constraints.hold_apart(least, []);
        }
        constraints.start = raw.start_deg.as_ref().and_then(|start| self.pose("constraints.start_deg", start, robot));
        if let (Some(given), Some(start), true) = (&raw.start_deg, &constraints.start, self.problems.len() == problems)
            && let Some(violation) = constraints.violation(None, start)
        {
            let hint = "name a posture that the constraints allow";
            self.problem(given.span(), "constraints.start_deg", violation.to_string(), hint);
        }
        constraints.allowed = raw.allowed_deg.as_ref().map(|allowed| self.allowed(allowed, robot));
        if self.problems.len() > problems {
            return None;
        }
        if let Some(WorldSpec::Simulated { watch: Some(watch), .. }) = world
            && let Some(violation) = constraints.violation(None, &watch.visible_pose)
        {
            let what = format!("they exclude the pose that is known to be in view: {violation}");
            self.problem(spanned.span(), "constraints", what, "name another `visible_pose_deg`, or allow this one");
        }
        for (index, socket) in robot.sockets.iter().enumerate() {
            if let Some(violation) = constraints.violation(None, &socket.posture) {
                let what = format!("they exclude the posture with which socket {index} begins: {violation}");
                self.problem(spanned.span(), "constraints", what, "name another `posture_deg`, or allow this one");
            }
        }
        if let Err(nothing) = feasible(&constraints, world) {
            let hint = "widen it, or remove it";
            self.problem(spanned.span(), "constraints", format!("no posture is feasible: {nothing}"), hint);
        }
        Some(constraints)
    }

    /// Tighter limits, each within the joint's own.
    fn tighten(&mut self, raw: &raw::Constraints, robot: &Robot, constraints: &mut Constraints) {
        let mut limits = robot.limits.joints().to_vec();
        let tables = [
            ("limits_deg", &raw.limits_deg, JointKind::Revolute, "degrees"),
            ("limits_m", &raw.limits_m, JointKind::Prismatic, "metres"),
        ];
        for (table, given, kind, unit) in tables {
            for (name, range) in given {
                let key = format!("constraints.{table}.{}", name.get_ref());
                let Some(joint) = robot.names.iter().position(|known| known == name.get_ref()) else {
                    let hint = did_you_mean(name.get_ref(), robot.names.iter().map(String::as_str), || {
                        format!("name one of {}", robot.names.join(", "))
                    });
                    self.problem(name.span(), key, "there is no such joint", hint);
                    continue;
                };
                if robot.state.joints[joint].kind() != kind {
                    let other = if kind == JointKind::Revolute { "limits_m" } else { "limits_deg" };
                    let hint = format!("write it in `{other}`");
                    self.problem(name.span(), key, "this unit does not fit the kind of joint", hint);
                    continue;
                }
                let shown = |x: f64| if kind == JointKind::Revolute { x.to_degrees() } else { x };
                let raw::Exactly([lower, upper]) = *range.get_ref();
                if lower.partial_cmp(&upper) != Some(Ordering::Less) {
                    let what = format!("the lower limit {lower} is not below the upper {upper}");
                    self.problem(range.span(), key, what, format!("write the lower one first, in {unit}"));
                    continue;
                }
                let within = |x: f64| if kind == JointKind::Revolute { x.to_radians() } else { x };
                let (own, given) = (limits[joint], (within(lower), within(upper)));
                if given.0 < own.0 - 1e-9 || given.1 > own.1 + 1e-9 {
                    let what = format!("the joint's own limits are {:.4} and {:.4}", shown(own.0), shown(own.1));
                    self.problem(range.span(), key, what, format!("write limits within them, in {unit}"));
                    continue;
                }
                limits[joint] = (given.0.max(own.0), given.1.min(own.1));
            }
        }
        constraints.tightened = JointBox::new(limits).unwrap_or_else(|_| robot.limits.clone());
    }

    fn obstacle(&mut self, index: usize, raw: &raw::ForbiddenBox, others: &[Obstacle]) -> Obstacle {
        let key = |field: &str| format!("constraints.box[{index}].{field}");
        self.free_name(&key("name"), &raw.name, others.iter().map(|other| other.name.as_str()));
        let lower = self.point(&key("lower_m"), &raw.lower_m);
        let upper = self.point(&key("upper_m"), &raw.upper_m);
        if let Some(side) = (0..3).find(|side| lower[*side] >= upper[*side]) {
            let what = format!("{} along {} is not above the lower corner's {}", upper[side], AXES[side], lower[side]);
            let hint = "write the least coordinates in `lower_m` and the greatest in `upper_m`";
            self.problem(raw.upper_m.span(), key("upper_m"), what, hint);
        }
        Obstacle { name: raw.name.get_ref().clone(), lower, upper }
    }

    fn travel(&mut self, raw: &raw::Constraints, robot: &Robot, constraints: &mut Constraints) {
        let kinds = || robot.state.joints.iter().map(body_schema_engine::kinematics::Joint::kind);
        for (key, given, kind) in [
            ("constraints.greatest_travel_deg", &raw.greatest_travel_deg, JointKind::Revolute),
            ("constraints.greatest_travel_m", &raw.greatest_travel_m, JointKind::Prismatic),
        ] {
            let Some(given) = given else { continue };
            let travel = self.positive(key, given);
            if !kinds().any(|found| found == kind) {
                self.problem(given.span(), key, "no joint of this robot is measured in this unit", "remove it");
            }
            let travel = if kind == JointKind::Revolute { travel.to_radians() } else { travel };
            let joints = constraints.greatest_travel.iter_mut().zip(kinds());
            joints.filter(|(_, found)| *found == kind).for_each(|(greatest, _)| *greatest = travel);
        }
        let price = raw.travel_price.as_ref();
        constraints.price = price.map_or(0.0, |price| self.not_negative("constraints.travel_price", price));
    }

    fn allowed(&mut self, raw: &Spanned<Vec<Spanned<Vec<f64>>>>, robot: &Robot) -> Vec<Vec<f64>> {
        if raw.get_ref().is_empty() {
            let hint = "add a posture, or remove the key to allow all";
            self.problem(raw.span(), "constraints.allowed_deg", "nothing is allowed", hint);
        }
        let postures = raw.get_ref().iter().enumerate();
        postures
            .filter_map(|(index, posture)| self.pose(&format!("constraints.allowed_deg[{index}]"), posture, robot))
            .collect()
    }
}

const AXES: [&str; 3] = ["x", "y", "z"];

/// Checks that there is a feasible movement: an allowed posture, a recorded row, or one found by draws.
fn feasible(constraints: &Constraints, world: Option<&WorldSpec>) -> Result<(), Infeasible> {
    let from = constraints.start.as_deref();
    match (world, &constraints.allowed) {
        (Some(WorldSpec::Measured { measurements, .. }), _) => {
            constraints.of(from, &measurements.configurations, |row| row).map(drop)
        }
        (_, Some(allowed)) => constraints.of(from, allowed, |posture| posture).map(drop),
        (_, None) => constraints.some(from).map(drop),
    }
}
