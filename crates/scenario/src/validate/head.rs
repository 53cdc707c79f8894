//! The head that watches.

use std::{ops::Range, sync::Arc};

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use toml::Spanned;

use super::{Check, raw};
use crate::{Prior, Robot, error::did_you_mean};
use body_schema_engine::{
    kinematics::JointKind,
    model::{Links, State},
    normal::StandardNormal,
    selection::Watch,
    sensing::{Head, MeasurementModel, Servo, UnfitServo},
};

/// The limits of pan and tilt, unless stated otherwise, degrees.
const SERVO_DEG: f64 = 15.0;
/// The number of robots drawn to judge whether a pose may be in view, and the share of them, one in so many, that must
/// be seen.
const DRAWS: usize = 2000;
const LEAST_SEEN: usize = 200;
/// The half-angle of the lens, unless stated otherwise, degrees.
const LENS_DEG: f64 = 20.0;

impl Check<'_> {
    pub(super) fn head(&mut self, spanned: &Spanned<raw::Head>, robot: &Robot) -> Option<Watch> {
        let raw = spanned.get_ref();
        let problems = self.problems.len();
        let position = self.point("head.position_m", &raw.position_m);
        let mut angle = |key: &str, value: &Option<Spanned<f64>>, default: f64, lowest: f64| {
            let hint = format!("an angle from {lowest} up to 89 degrees");
            let given = value.as_ref().map(|angle| {
                self.number(&format!("head.{key}"), angle, |angle| (lowest..=89.0).contains(&angle), &hint)
            });
            given.unwrap_or(default).to_radians()
        };
        let pan_limit = angle("pan_limit_deg", &raw.pan_limit_deg, SERVO_DEG, 0.0);
        let tilt_limit = angle("tilt_limit_deg", &raw.tilt_limit_deg, SERVO_DEG, 0.0);
        let lens_half_angle = angle("lens_half_angle_deg", &raw.lens_half_angle_deg, LENS_DEG, 1.0);
        let baseline = raw.eye_baseline_m.as_ref().map(|length| self.positive("head.eye_baseline_m", length));
        let look = self.unit("head.look", &raw.look)?;
        if look.z.abs() > 0.999 {
            let hint = "look aside a little: z tells the head what upright is";
            self.problem(raw.look.span(), "head.look", "it is along z", hint);
            return None;
        }
        let head = Head { position, look, pan_limit, tilt_limit, lens_half_angle, baseline };
        let visible_pose = self.pose("head.visible_pose_deg", &raw.visible_pose_deg, robot)?;
        let marker = robot.state.marker_at(&visible_pose);
        if self.problems.len() > problems {
            return None;
        }
        if !head.sees(&marker) {
            let beyond = -head.clearance(&marker).to_degrees();
            let what = format!("the marker is not in view there: it is {beyond:.1} degrees outside");
            let hint = format!(
                "name a pose in view, or look towards this one with `look = [{:.6}, {:.6}, {:.6}]`",
                (marker - position).normalize().x,
                (marker - position).normalize().y,
                (marker - position).normalize().z
            );
            self.problem(raw.visible_pose_deg.span(), "head.visible_pose_deg", what, hint);
            return None;
        }
        Some(Watch { head: Some(head), visible_pose })
    }

    /// A posture in view, without a head: one at which a sensor that sees some postures only sees something. For a robot elsewhere
    /// places are uncertain, as `prior` says.
    pub(super) fn view(
        &mut self,
        spanned: &Spanned<raw::View>,
        robot: &Robot,
        measurement_model: &MeasurementModel,
        prior: Option<&Prior>,
    ) -> Option<Watch> {
        let raw = &spanned.get_ref().visible_pose_deg;
        let key = "view.visible_pose_deg";
        let visible_pose = self.pose(key, raw, robot)?;
        let visible_pose = measurement_model.aimed(&robot.state, &visible_pose).into_owned();
        let within = clearance(measurement_model, &robot.state, &visible_pose);
        if within < 0.0 && !prior.is_some_and(|prior| may_be_seen(measurement_model, robot, prior, &visible_pose)) {
            let (what, hint) = match prior {
                Some(_) => (
                    "whatever is known of where things are allows",
                    "name a pose in view, or say how wrong `base`, `camera` and `target` may be: `known = { to_m = …, to_deg = … }`",
                ),
                None => ("as described", "name a pose in view"),
            };
            let what = format!("nothing is in view there, {what}: it is {:.1} degrees outside", -within.to_degrees());
            self.problem(raw.span(), key, what, hint);
            return None;
        }
        if !measurement_model.has_view() {
            let hint = "remove it; only cameras see some postures and others not";
            self.problem(spanned.span(), "view", "these sensors see everything", hint);
        }
        Some(Watch { head: None, visible_pose })
    }

    /// The joints that aim a camera by themselves, if any are named.
    pub(super) fn servo(&mut self, spanned: &Spanned<raw::View>, robot: &Robot) -> Option<Arc<Servo>> {
        let view = spanned.get_ref();
        let Some(named) = &view.servo else {
            let camera = view.camera.as_ref().map(|camera| ("view.camera", camera.span()));
            let target = view.target.as_ref().map(|target| ("view.target", target.span()));
            for (key, span) in camera.into_iter().chain(target) {
                self.problem(span, key, "no joint aims it", "add `servo = [\"JOINT\", …]`, or remove this");
            }
            return None;
        };
        let names = &robot.names;
        let mut joints = Vec::new();
        for joint in named.get_ref() {
            match names.iter().position(|name| name == joint.get_ref()) {
                Some(index) if joints.contains(&index) => {
                    self.problem(joint.span(), "view.servo", "it is named twice", "name it once");
                }
                Some(index) => joints.push(index),
                None => {
                    let hint = did_you_mean(joint.get_ref(), names.iter().map(String::as_str), || {
                        format!("write some of {}", names.join(", "))
                    });
                    self.problem(joint.span(), "view.servo", format!("there is no joint `{}`", joint.get_ref()), hint);
                }
            }
        }
        if joints.len() < named.get_ref().len() {
            return None;
        }
        let cameras = robot.equipment.cameras.iter().map(|camera| camera.name.as_str());
        let targets = robot.equipment.targets.iter().map(|target| target.name.as_str());
        let carried = robot.state.devices.iter().position(|device| device.link.is_some()).unwrap_or(0);
        let place = view.camera.as_ref().map_or(named.span(), Spanned::span);
        let name = view.camera.as_ref().map(|camera| camera.get_ref().as_str());
        let camera = self.named("view.camera", name, &cameras.collect::<Vec<&str>>(), carried, place)?;
        let place = view.target.as_ref().map_or(named.span(), Spanned::span);
        let wanted = match view.target.as_ref().map(Spanned::get_ref) {
            None => vec![None],
            Some(raw::Names::One(name)) => vec![Some(name.as_str())],
            Some(raw::Names::Several(names)) => names.iter().map(|name| Some(name.as_str())).collect(),
        };
        let (known, mut aims) = (targets.collect::<Vec<&str>>(), Vec::new());
        for name in wanted {
            let target = self.named("view.target", name, &known, 0, place.clone())?;
            if aims.contains(&target) {
                self.problem(
                    place.clone(),
                    "view.target",
                    format!("`{}` is named twice", known[target]),
                    "name it once",
                );
            }
            aims.push(target);
        }
        match Servo::new(&robot.state, &robot.limits, &joints, camera, &aims) {
            Ok(servo) => Some(Arc::new(servo)),
            Err(unfit) => {
                let what = match unfit {
                    UnfitServo::None if joints.is_empty() => "no joint is named".to_owned(),
                    UnfitServo::None => "they aim at nothing".to_owned(),
                    UnfitServo::Camera(joint) => format!("`{}` does not move the camera", names[joint]),
                    UnfitServo::Target(joint) => {
                        format!("`{}` moves what it is to aim at as well as the camera", names[joint])
                    }
                };
                let hint = "name joints between the camera and where its branch leaves that of the target";
                self.problem(named.span(), "view.servo", what, hint);
                None
            }
        }
    }

    /// The index of a name; `usual` where none is given.
    fn named(
        &mut self,
        key: &str,
        name: Option<&str>,
        known: &[&str],
        usual: usize,
        place: Range<usize>,
    ) -> Option<usize> {
        let found = match name {
            Some(name) => known.iter().position(|known| *known == name),
            None => Some(usual).filter(|usual| *usual < known.len()),
        };
        if found.is_none() {
            let what = name.map_or("there is none".to_owned(), |name| format!("there is no `{name}`"));
            let hint = match known.is_empty() {
                true => "add a [[camera]] on the neck and a [[target]] on the hand".to_owned(),
                false => format!("write one of {}", known.join(", ")),
            };
            self.problem(place, key, what, hint);
        }
        found
    }

    /// The positions of a pose (degrees or metres as the kind of each joint says), within the limits.
    pub(super) fn pose(&mut self, key: &str, raw: &Spanned<Vec<f64>>, robot: &Robot) -> Option<Vec<f64>> {
        let (given, wanted) = (raw.get_ref(), robot.state.joints.len());
        if given.len() != wanted {
            let what = format!("it has {} positions, the robot {wanted} joints", given.len());
            self.problem(raw.span(), key, what, "write one position per joint, base first");
            return None;
        }
        let mut pose = Vec::new();
        for ((&value, name), (joint, &(lower, upper))) in
            given.iter().zip(&robot.names).zip(robot.state.joints.iter().zip(robot.limits.joints()))
        {
            let revolute = joint.kind() == JointKind::Revolute;
            let position = if revolute { value.to_radians() } else { value };
            // A NaN is not within; a pose on a limit may miss it by a rounding error.
            if !(position >= lower - 1e-9 && position <= upper + 1e-9) {
                let shown = |limit: f64| if revolute { limit.to_degrees() } else { limit };
                let hint = format!("write a number from {:.4} to {:.4} for this joint", shown(lower), shown(upper));
                self.problem(raw.span(), key, format!("{value} is outside the limits of `{name}`"), hint);
                return None;
            }
            pose.push(position.clamp(lower, upper));
        }
        Some(pose)
    }
}

/// The greatest clearance of any channel, radians: how far it is inside what it can see.
fn clearance(measurement_model: &MeasurementModel, state: &State, pose: &[f64]) -> f64 {
    let mut clearances = vec![0.0; measurement_model.sensors().len()];
    measurement_model.clearances(None, &Links::of(state, pose), &mut clearances);
    clearances.into_iter().fold(f64::NEG_INFINITY, f64::max)
}

/// Whether something may be in view at a pose of a robot with this prior: whether it is for one robot in [`LEAST_SEEN`] drawn from
/// the prior.
fn may_be_seen(measurement_model: &MeasurementModel, robot: &Robot, prior: &Prior, pose: &[f64]) -> bool {
    let layout = &robot.layout;
    let deviations = prior.standard_deviations(layout);
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let seen = (0..DRAWS).filter(|_| {
        let delta = deviations.map(|deviation| deviation * rng.sample::<f64, _>(StandardNormal));
        clearance(measurement_model, &robot.state.retract(layout, &delta), pose) >= 0.0
    });
    seen.take(DRAWS / LEAST_SEEN).count() == DRAWS / LEAST_SEEN
}
