//! The equipment of a robot: targets and cameras, carried or beside it.

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, UnitVector3, Vector3};
use toml::Spanned;

use super::{Check, described::Links, raw};
use crate::{BaselineSpec, Known};
use body_schema_engine::{
    model::{Block, Device, Hand, Place, State, Target},
    numeric_range::are_usable,
    sensing::{Baseline, CameraKind, Equipment, Facing, PartlySeen, TargetKind},
};

/// The angle from its facing direction within which a target is seen, unless stated otherwise, degrees.
const FACING_WITHIN_DEG: f64 = 80.0;
/// Where a camera is guessed to stand of which nobody says where, and the point that it looks at: before the robot, metres.
const GUESSED_AT_M: Point3<f64> = Point3::new(1.0, 0.0, 0.5);
const GUESSED_LOOKS_AT_M: Point3<f64> = Point3::new(0.0, 0.0, 0.2);

/// Base, targets, cameras, and the prior of those that are learned.
#[derive(Default)]
pub(super) struct Outfit {
    pub base: Isometry3<f64>,
    pub targets: Vec<Target>,
    pub devices: Vec<Device>,
    pub equipment: Equipment,
    pub known: Vec<(Block, Known)>,
    pub baselines: Vec<BaselineSpec>,
}

impl Check<'_> {
    /// The targets and cameras of a file, on these links.
    pub(super) fn outfit(&mut self, raw: &raw::Scenario, links: Links<'_>) -> Outfit {
        let mut outfit = Outfit::default();
        if let Some(spanned) = &raw.base {
            let base = spanned.get_ref();
            let at = self.point("base.at_m", &base.at_m);
            let rotation = self.rotation("base.rpy_deg", &base.rpy_deg);
            outfit.base = Isometry3::from_parts(Translation3::from(at.coords), rotation);
            outfit.known.extend(self.known("base", &base.known, spanned).map(|known| (Block::Base, known)));
        }
        for (index, target) in raw.targets.iter().enumerate() {
            self.target(&format!("target[{index}]"), target, links, &mut outfit);
        }
        for (index, camera) in raw.cameras.iter().enumerate() {
            self.camera(&format!("camera[{index}]"), camera, links, &mut outfit);
        }
        self.baselines(raw, &mut outfit);
        outfit
    }

    fn target(&mut self, key: &str, spanned: &Spanned<raw::Target>, links: Links<'_>, outfit: &mut Outfit) {
        let raw = spanned.get_ref();
        let field = |field: &str| format!("{key}.{field}");
        let kinds = &outfit.equipment.targets;
        self.free_name(&field("name"), &raw.name, kinds.iter().map(|kind| kind.name.as_str()));
        let link = raw.link.as_ref().map_or(Some(links.last()), |link| self.link(&field("link"), link, links));
        if raw.link.is_none() && links.branches {
            let hint = format!("add `link = …`: {}", links.names().join(", "));
            self.problem(spanned.span(), field("link"), "missing: the robot branches, and has no last link", hint);
        }
        let (link, frame) = link.unwrap_or_default();
        let at = match &raw.at_m {
            Some(at) => self.point(&field("at_m"), at),
            None => {
                let hint = "add `at_m = [x, y, z]`, where it is at θ = 0, in metres";
                self.problem(spanned.span(), field("at_m"), "missing", hint);
                Point3::origin()
            }
        };
        let is_body = raw.rpy_deg.is_some() || raw.points_m.is_some();
        let rotation =
            raw.rpy_deg.as_ref().map_or(UnitQuaternion::identity(), |rpy| self.rotation(&field("rpy_deg"), rpy));
        let points = raw.points_m.as_ref().map_or_else(
            || vec![Point3::origin()],
            |points| points.get_ref().iter().map(|raw::Exactly(point)| Point3::from(*point)).collect(),
        );
        if let Some(given) = &raw.points_m
            && (points.is_empty() || points.iter().any(|point| !are_usable(&point.coords)))
        {
            let hint = "write at least one point, three finite numbers each, in metres";
            self.problem(given.span(), field("points_m"), "these are no points", hint);
        }
        let within = raw.facing_within_deg.as_ref().map_or(FACING_WITHIN_DEG, |within| {
            self.number(
                &field("facing_within_deg"),
                within,
                |x| x > 0.0 && x <= 180.0,
                "an angle from 0 to 180 degrees",
            )
        });
        let facing = raw.facing.as_ref().and_then(|direction| {
            Some(Facing { direction: self.unit(&field("facing"), direction)?, within: within.to_radians() })
        });
        let partly_seen = self.partly_seen(key, raw, points.len(), within.to_radians());
        if let (Some(facing), false) = (&raw.facing, is_body) {
            let hint = "add `rpy_deg = [0.0, 0.0, 0.0]`: a body is turned with its link, a point has no direction";
            self.problem(facing.span(), field("facing"), "a point faces nothing", hint);
        }
        let place = if is_body {
            Place::Pose(frame * Isometry3::from_parts(Translation3::from(at.coords), rotation))
        } else {
            Place::Point(frame * at)
        };
        if let Some(known) = self.known(key, &raw.known, spanned) {
            outfit.known.push((Block::Target(outfit.targets.len()), known));
        }
        outfit.targets.push(Target { link, place });
        outfit.equipment.targets.push(TargetKind { name: raw.name.get_ref().clone(), points, facing, partly_seen });
    }

    /// How a target of so many points is seen point by point, each within an angle (radians) of the direction that it faces.
    fn partly_seen(&mut self, key: &str, raw: &raw::Target, points: usize, within: f64) -> Option<PartlySeen> {
        let field = |field: &str| format!("{key}.{field}");
        let Some(said) = raw.partly_seen.as_ref().filter(|said| *said.get_ref()) else {
            let facings = raw.points_facing.as_ref().map(|it| (it.span(), "points_facing"));
            let least = raw.least_points.as_ref().map(|it| (it.span(), "least_points"));
            for (span, name) in facings.into_iter().chain(least) {
                let what = "the target is seen whole or not at all";
                self.problem(span, field(name), what, "add `partly_seen = true`, or remove this key");
            }
            return None;
        };
        if raw.points_m.is_none() {
            let hint = "add `points_m`, or remove this key: a point is seen or not";
            self.problem(said.span(), field("partly_seen"), "there are no points that could be absent", hint);
        }
        let mut facing = Vec::new();
        if let Some(given) = &raw.points_facing {
            let (span, given) = (given.span(), given.get_ref());
            if raw.facing.is_some() {
                let hint = "remove `facing`, or `points_facing`";
                self.problem(span.clone(), field("points_facing"), "beside `facing`: the body and its points", hint);
            }
            if given.len() != points {
                let what = format!("{} directions for {points} points", given.len());
                self.problem(span.clone(), field("points_facing"), what, "write one direction for each of `points_m`");
            }
            for direction in given {
                let direction = self.unit(&field("points_facing"), &Spanned::new(span.clone(), *direction));
                facing.extend(direction.map(|direction| Facing { direction, within }));
            }
        } else if let (Some(within), None) = (&raw.facing_within_deg, &raw.facing) {
            let hint = "add `points_facing`, or `facing`, or remove this key";
            self.problem(within.span(), field("facing_within_deg"), "nothing says what faces where", hint);
        }
        let least = raw.least_points.as_ref().map_or(1, |least| {
            let count = usize::try_from(*least.get_ref()).unwrap_or(usize::MAX);
            if !(1..=points.max(1)).contains(&count) {
                let hint = format!("write a whole number from 1 to {points}, the number of points");
                self.problem(least.span(), field("least_points"), format!("{count} is out of range"), hint);
            }
            count
        });
        Some(PartlySeen { least_points: least, facing: facing.into() })
    }

    fn camera(&mut self, key: &str, spanned: &Spanned<raw::Camera>, links: Links<'_>, outfit: &mut Outfit) {
        let raw = spanned.get_ref();
        let field = |field: &str| format!("{key}.{field}");
        let kinds = &outfit.equipment.cameras;
        self.free_name(&field("name"), &raw.name, kinds.iter().map(|kind| kind.name.as_str()));
        let carried = raw.link.as_ref().map(|link| self.link(&field("link"), link, links).unwrap_or_default());
        let (link, frame) = carried.map_or((None, Isometry3::identity()), |(link, frame)| (Some(link), frame));
        let guess = if raw.link.is_some() { Point3::origin() } else { GUESSED_AT_M };
        let at = raw.at_m.as_ref().map_or(guess, |at| self.point(&field("at_m"), at));
        let is_guessed = raw.at_m.is_none() && raw.known.is_anywhere();
        if raw.at_m.is_none() && !is_guessed {
            let hint = match raw.link {
                Some(_) => {
                    "add `at_m = [x, y, z]`, where it is on its link at θ = 0, in metres; or `known = \"unknown\"` if nobody knows"
                }
                None => {
                    "add `at_m = [x, y, z]`, where it stands in the frame of the base, in metres; or `known = \"unknown\"` if nobody knows"
                }
            };
            self.problem(spanned.span(), field("at_m"), "missing", hint);
        }
        let rotation = match (&raw.rpy_deg, &raw.looks_at_m) {
            (None, None) if is_guessed && raw.link.is_some() => UnitQuaternion::identity(),
            (None, None) if is_guessed => looking(&(GUESSED_LOOKS_AT_M - at)).unwrap_or_default(),
            (Some(rpy), None) => self.rotation(&field("rpy_deg"), rpy),
            (None, Some(point)) => {
                let towards = self.point(&field("looks_at_m"), point) - at;
                looking(&towards).unwrap_or_else(|| {
                    let hint = "name another point, not straight above or below the camera";
                    self.problem(point.span(), field("looks_at_m"), "upright is undefined there", hint);
                    UnitQuaternion::identity()
                })
            }
            _ => {
                let hint = "write either `looks_at_m = [x, y, z]`, the picture then being upright, or `rpy_deg = […]`";
                self.problem(spanned.span(), field("rpy_deg, looks_at_m"), "one of the two must be given", hint);
                UnitQuaternion::identity()
            }
        };
        let lens = self.lens(key, raw, spanned.span());
        let number = outfit.devices.len();
        if let Some(known) = self.known(key, &raw.known, spanned) {
            outfit.known.push((Block::Device(number), known));
        }
        if let Some(px) = &raw.known_to_px {
            let px = self.positive(&field("known_to_px"), px);
            outfit.known.push((
                Block::Intrinsics(number),
                Known::Within { length_m: Known::EXACTLY, angle_rad: Known::EXACTLY, other: px },
            ));
        }
        for (index, sd) in lens.learned.iter().enumerate().filter(|(_, sd)| **sd > 0.0) {
            let known = Known::Within { length_m: Known::EXACTLY, angle_rad: Known::EXACTLY, other: *sd };
            outfit.known.push((Block::Distortion(number, index), known));
        }
        let pose = frame * Isometry3::from_parts(Translation3::from(at.coords), rotation);
        let (intrinsics, distortion) = (Some(lens.intrinsics), lens.distortion);
        outfit.devices.push(Device { link, pose, intrinsics, distortion });
        outfit.equipment.cameras.push(CameraKind { name: raw.name.get_ref().clone(), size_px: lens.size_px });
    }

    /// The known places of cameras in the frames of others.
    fn baselines(&mut self, raw: &raw::Scenario, outfit: &mut Outfit) {
        for (camera, spanned) in raw.cameras.iter().enumerate() {
            let raw::Camera { stereo_with, baseline, .. } = spanned.get_ref();
            let field = |field: &str| format!("camera[{camera}].{field}");
            let (sigma_m, sigma_deg) = (baseline.known_to_m.as_ref(), baseline.known_to_deg.as_ref());
            let (other, sigma_m, sigma_deg) = match (stereo_with, sigma_m, sigma_deg, &baseline.anywhere_m) {
                (None, None, None, None) => continue,
                (Some(other), Some(sigma_m), Some(sigma_deg), None) => (other, sigma_m, sigma_deg),
                _ => {
                    let what = "a pair has another camera, and a baseline that is known so well";
                    let hint =
                        "write both, as `stereo_with = \"left_eye\"` and `baseline = { to_m = 0.0005, to_deg = 0.1 }`";
                    self.problem(spanned.span(), field("baseline"), what, hint);
                    continue;
                }
            };
            let sigma_m = self.positive(&field("baseline.to_m"), sigma_m);
            let sigma_rad = self.positive(&field("baseline.to_deg"), sigma_deg).to_radians();
            let others = outfit.equipment.cameras.iter().enumerate().filter(|(index, _)| *index != camera);
            let others: Vec<(usize, &str)> = others.map(|(index, kind)| (index, kind.name.as_str())).collect();
            let found = others.iter().find(|(_, name)| name == other.get_ref());
            let is_learned = |index: usize| outfit.known.iter().any(|(block, _)| *block == Block::Device(index));
            let refused = match found {
                None if others.is_empty() => Some((
                    "there is no other camera".to_owned(),
                    "remove it, or add the other [[camera]] of the pair".to_owned(),
                )),
                None => {
                    let names: Vec<&str> = others.iter().map(|(_, name)| *name).collect();
                    Some((
                        format!("there is no other camera `{}`", other.get_ref()),
                        format!("write one of {}", names.join(", ")),
                    ))
                }
                Some((from, _)) if outfit.devices[camera].link != outfit.devices[*from].link => {
                    let hint = "remove it, or write the same `link` for both: a baseline is fixed";
                    Some(("the two cameras are on different links".to_owned(), hint.to_owned()))
                }
                Some((from, _)) if !is_learned(camera) && !is_learned(*from) => {
                    let hint =
                        "add `known = { to_m = …, to_deg = … }` to both, or remove it: where they are is known exactly";
                    Some(("neither of the two cameras is learned".to_owned(), hint.to_owned()))
                }
                Some(_) => None,
            };
            match (refused, found) {
                (Some((what, hint)), _) => self.problem(other.span(), field("stereo_with"), what, hint),
                (None, Some((from, _))) => {
                    outfit.baselines.push(BaselineSpec {
                        between: Baseline { camera, from: *from },
                        sigma_m,
                        sigma_rad,
                    });
                }
                (None, None) => {}
            }
        }
    }

    /// The prior knowledge of a place; `None` if it is known exactly, so that it is not learned.
    pub(super) fn known<T>(&mut self, key: &str, raw: &raw::Known, spanned: &Spanned<T>) -> Option<Known> {
        let field = |field: &str| format!("{key}.{field}");
        if let Some(within) = &raw.anywhere_m {
            if raw.known_to_m.is_some() || raw.known_to_deg.is_some() {
                let hint = "remove `anywhere_m`, or `known_to_m` and `known_to_deg`";
                self.problem(spanned.span(), field("anywhere_m"), "of what may be anywhere nothing is known", hint);
            }
            return Some(Known::Anywhere { within_m: self.positive(&field("anywhere_m"), within) });
        }
        if raw.known_to_m.is_none() && raw.known_to_deg.is_none() {
            return None;
        }
        let length_m = raw.known_to_m.as_ref().map_or(Known::EXACTLY, |x| self.positive(&field("known_to_m"), x));
        let angle = raw.known_to_deg.as_ref().map(|x| self.positive(&field("known_to_deg"), x).to_radians());
        Some(Known::Within { length_m, angle_rad: angle.unwrap_or(Known::EXACTLY), other: Known::EXACTLY })
    }

    pub(super) fn free_name<'a>(
        &mut self,
        key: &str,
        name: &Spanned<String>,
        mut taken: impl Iterator<Item = &'a str>,
    ) {
        if name.get_ref().is_empty() || taken.any(|other| other == name.get_ref()) {
            let what = format!("{:?} is empty or taken", name.get_ref());
            self.problem(name.span(), key, what, "give each a name of its own");
        }
    }

    /// The link with this name, and the frame in which places on it are written.
    fn link(&mut self, key: &str, name: &Spanned<String>, links: Links<'_>) -> Option<(usize, Isometry3<f64>)> {
        let found = links.find(name.get_ref());
        if found.is_none() {
            let (what, hint) = links.unfound(name.get_ref());
            self.problem(name.span(), key, what, hint);
        }
        found
    }

    fn rotation(&mut self, key: &str, value: &Spanned<raw::Exactly<f64, 3>>) -> UnitQuaternion<f64> {
        let raw::Exactly(angles) = *value.get_ref();
        if !are_usable(&angles) {
            self.problem(value.span(), key, "an angle is out of range", "write roll, pitch and yaw, in degrees");
            return UnitQuaternion::identity();
        }
        let [roll, pitch, yaw] = angles.map(f64::to_radians);
        UnitQuaternion::from_euler_angles(roll, pitch, yaw)
    }

    /// The hand: the target or camera with this name.
    pub(super) fn hand(&mut self, key: &str, name: &Spanned<String>, equipment: &Equipment) -> Option<Hand> {
        let target = equipment.targets.iter().position(|kind| kind.name == *name.get_ref()).map(Hand::Target);
        let camera = || equipment.cameras.iter().position(|kind| kind.name == *name.get_ref()).map(Hand::Device);
        let found = target.or_else(camera);
        if found.is_none() {
            let targets = equipment.targets.iter().map(|kind| kind.name.as_str());
            let names: Vec<&str> = targets.chain(equipment.cameras.iter().map(|kind| kind.name.as_str())).collect();
            let what = format!("there is no target or camera `{}`", name.get_ref());
            self.problem(name.span(), key, what, format!("write one of {}", names.join(", ")));
        }
        found
    }
}

impl Outfit {
    /// Adds the equipment to a robot.
    pub fn equip(&self, state: &mut State) {
        if !self.targets.is_empty() {
            state.targets.clone_from(&self.targets);
        }
        state.devices.clone_from(&self.devices);
        state.base = self.base;
    }
}

/// A camera that looks along `towards`, x to the right of an upright picture and y down.
fn looking(towards: &Vector3<f64>) -> Option<UnitQuaternion<f64>> {
    let z = UnitVector3::try_new(*towards, 1e-9)?;
    let x = UnitVector3::try_new(z.cross(&Vector3::z()), 1e-9)?;
    let matrix = Matrix3::from_columns(&[x.into_inner(), z.cross(&x), z.into_inner()]);
    Some(UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(matrix)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_camera_that_looks_along_x_has_y_at_its_left() {
        let camera = looking(&Vector3::x()).expect("level");
        assert!((camera * Vector3::z() - Vector3::x()).norm() < 1e-12, "it looks along x");
        assert!((camera * Vector3::x() + Vector3::y()).norm() < 1e-12, "−y is at its right");
        assert!((camera * Vector3::y() + Vector3::z()).norm() < 1e-12, "down is down");
        assert!(looking(&Vector3::z()).is_none());
    }
}
