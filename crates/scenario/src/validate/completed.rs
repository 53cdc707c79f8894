//! Completing a scenario with a URDF from the titles of its table: its targets, the sensors that measure them, and the prior
//! of their places.

use std::ops::Range;

use toml::Spanned;

use super::raw;
use body_schema_engine::sensing::Keys;
use body_schema_table::Titles;

/// The prior deviation of an unknown base, metres.
const BASE_M: f64 = 1.0;
/// The prior deviation of an unknown angle, degrees: a radian.
const RADIAN_DEG: f64 = 57.3;
/// The prior deviation of a target from the frame of its link.
const TARGET_M: f64 = 0.3;
/// The units of learned noise: of lengths, of rotations and of pictures.
const SIGMA_M: f64 = 0.001;
const SIGMA_DEG: f64 = 0.1;
const SIGMA_PX: f64 = 1.0;

/// Completes a scenario whose robot is a URDF and whose measurements are a table with these titles; or, without titles,
/// one of a robot elsewhere, whose targets' positions are measured unless it says otherwise.
pub(super) fn complete(raw: &mut raw::Scenario, titles: Option<&Titles>) {
    let span = raw.measurements.as_ref().map_or(0..0, Spanned::span);
    let has_sockets = titles.map_or(!raw.sockets.is_empty(), |titles| titles.label("socket").is_ok());
    if (raw.sensor.is_none() || titles.is_none()) && raw.held.is_none() && has_sockets {
        raw.held = Some(Spanned::new(span.clone(), raw::Sockets::default()));
    }
    if raw.sensor.is_none() && raw.held.is_none() {
        let named: Vec<String> = raw.targets.iter().map(|target| target.get_ref().name.get_ref().clone()).collect();
        let titled = || titles.map_or_else(|| vec!["marker".to_owned()], prefixes);
        let seen = if named.is_empty() { titled() } else { named };
        let keys = seen.into_iter().map(|name| Spanned::new(span.clone(), keys_of(name, titles)));
        raw.sensor = Some(Spanned::new(span.clone(), raw::Sensors(keys.collect())));
    }
    for keys in raw.sensor.iter_mut().flat_map(|sensors| &mut sensors.get_mut().0) {
        sigmas(keys.get_mut());
    }
    targets(raw, &span);
    // A picture of a camera that stands beside the robot is told from where that camera is known, or learned, to be.
    let is_absolute = |keys: &Spanned<Keys>| match frame_of(keys.get_ref(), raw) {
        Frame::Measurements => true,
        Frame::Camera(camera) => {
            camera.link.is_none() && camera.known.is_exact() && keys.get_ref().channel.as_deref() != Some("pixels")
        }
        Frame::Target => false,
    };
    let sees_absolutely = raw.sensor.iter().flat_map(|sensors| &sensors.get_ref().0).any(is_absolute);
    if raw.base.is_none() && sees_absolutely {
        let nowhere = || Spanned::new(span.clone(), raw::Exactly([0.0; 3]));
        let known = within(&span, BASE_M, true);
        raw.base = Some(Spanned::new(span.clone(), raw::Base { at_m: nowhere(), rpy_deg: nowhere(), known }));
    }
    let name = raw.targets.first().map(|target| target.get_ref().name.get_ref().clone());
    let is_alone = raw.sensor.is_none() || sees_itself(raw);
    if let (None, true, Some(name)) = (&raw.prediction, is_alone, name) {
        // Nothing tells where the whole stands.
        let of = Spanned::new(span.clone(), name);
        raw.prediction = Some(Spanned::new(span, raw::Prediction { of, seen_in: None, up_to_motion: true }));
    }
}

/// What a sensor measures from.
enum Frame<'a> {
    /// The frame of the measurements, in which nobody knows where the robot stands.
    Measurements,
    /// A camera: a picture of it, or its frame.
    Camera(&'a raw::Camera),
    /// A target, which is on the robot.
    Target,
}

/// What a sensor measures from. A name that is nobody's is told where sensors are read, and counts as the frame of the measurements.
fn frame_of<'a>(keys: &Keys, raw: &'a raw::Scenario) -> Frame<'a> {
    let camera = |name: Option<&String>| {
        let mut cameras = raw.cameras.iter().map(Spanned::get_ref);
        cameras.find(|camera| name.is_none_or(|name| name == camera.name.get_ref()))
    };
    let is_target = |name: &String| raw.targets.iter().any(|target| target.get_ref().name.get_ref() == name);
    let seen_by = match (keys.channel.as_deref(), &keys.seen_in, &keys.to) {
        (_, Some(name), _) | (_, _, Some(name)) if is_target(name) => return Frame::Target,
        (Some("pixels" | "depth"), None, _) => camera(keys.camera.as_ref()),
        (_, Some(name), _) => camera(Some(name)),
        _ => None,
    };
    seen_by.map_or(Frame::Measurements, Frame::Camera)
}

/// Whether all that is measured is measured from the robot itself, or from cameras that stand where nobody knows exactly.
fn sees_itself(raw: &raw::Scenario) -> bool {
    let is_adrift = |keys: &Keys| match frame_of(keys, raw) {
        Frame::Measurements => false,
        Frame::Camera(camera) if camera.link.is_some() => raw.base.is_none(),
        Frame::Camera(camera) => !camera.known.is_exact(),
        Frame::Target => true,
    };
    let mut sensors = raw.sensor.iter().flat_map(|sensors| &sensors.get_ref().0).map(Spanned::get_ref).peekable();
    sensors.peek().is_some() && sensors.all(is_adrift)
}

/// The targets that titles name: the part before x, y and z.
fn prefixes(titles: &Titles) -> Vec<String> {
    let mut found: Vec<String> = Vec::new();
    for prefix in titles.prefixes() {
        let is_place = titles.has_position(prefix);
        let name = if prefix.is_empty() { "marker" } else { prefix };
        if is_place && !found.iter().any(|known| known.eq_ignore_ascii_case(name)) {
            found.push(name.to_owned());
        }
    }
    found
}

/// A sensor of a target's pose if its titles have a rotation, otherwise of its position.
fn keys_of(target: String, titles: Option<&Titles>) -> Keys {
    let has_pose = |prefix: &&str| titles.is_some_and(|titles| titles.has_pose(prefix));
    let is_pose = ["", &target].iter().any(has_pose);
    let channel = if is_pose { "pose" } else { "position" };
    Keys { channel: Some(channel.to_owned()), target: Some(target), ..Keys::default() }
}

fn sigmas(keys: &mut Keys) {
    match keys.channel.as_deref() {
        Some("pixels") => drop(keys.sigma_px.get_or_insert(SIGMA_PX)),
        Some("pose") if keys.covariance.is_none() => {
            keys.sigma_m.get_or_insert(SIGMA_M);
            keys.sigma_deg.get_or_insert(SIGMA_DEG);
        }
        _ if keys.covariance_m2.is_none() && keys.covariance.is_none() => drop(keys.sigma_m.get_or_insert(SIGMA_M)),
        _ => {}
    }
}

/// Adds the targets that sensors and sockets name, on the tip. Targets whose place is nowhere stated get a wide prior.
fn targets(raw: &mut raw::Scenario, span: &Range<usize>) {
    let sensors: Vec<Keys> =
        raw.sensor.iter().flat_map(|sensors| &sensors.get_ref().0).map(|keys| keys.get_ref().clone()).collect();
    if raw.targets.is_empty() {
        let named = sensors.iter().map(|keys| keys.target.clone().unwrap_or_else(|| "marker".to_owned()));
        let held =
            raw.held.iter().map(|held| held.get_ref().target.as_ref().map_or("ball", |name| name.get_ref()).to_owned());
        let mut names: Vec<String> = Vec::new();
        for name in named.chain(held) {
            if !names.contains(&name) {
                names.push(name);
            }
        }
        raw.targets = names.into_iter().map(|name| Spanned::new(span.clone(), target(name, span))).collect();
    }
    for (index, target) in raw.targets.iter_mut().enumerate() {
        let target = target.get_mut();
        let is_meant = |keys: &&Keys| keys.target.as_ref().map_or(index == 0, |name| name == target.name.get_ref());
        let is_pose = sensors.iter().filter(is_meant).any(|keys| keys.channel.as_deref() == Some("pose"));
        let nothing = || Spanned::new(span.clone(), raw::Exactly([0.0; 3]));
        if is_pose && target.rpy_deg.is_none() {
            target.rpy_deg = Some(nothing());
        }
        if target.at_m.is_none() {
            target.at_m = Some(nothing());
            if target.known.is_exact() {
                target.known = within(span, TARGET_M, target.rpy_deg.is_some());
            }
        }
    }
}

fn target(name: String, span: &Range<usize>) -> raw::Target {
    raw::Target {
        name: Spanned::new(span.clone(), name),
        link: None,
        at_m: None,
        rpy_deg: None,
        points_m: None,
        facing: None,
        facing_within_deg: None,
        partly_seen: None,
        points_facing: None,
        least_points: None,
        known: raw::Known::default(),
    }
}

fn within(span: &Range<usize>, to_m: f64, is_turned: bool) -> raw::Known {
    let known = |size: f64| Spanned::new(span.clone(), size);
    raw::Known { known_to_m: Some(known(to_m)), known_to_deg: is_turned.then(|| known(RADIAN_DEG)), anywhere_m: None }
}
