//! What a table's titles name: joints, and the targets and cameras that links may carry.

use body_schema_engine::kinematics::JointKind;
use body_schema_robot::{JointEnds, Urdf};

use super::columns::{self, Measured};

/// A target or a camera of a table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Carried {
    /// Its name.
    pub name: String,
    /// Whether it is a camera.
    pub is_camera: bool,
    /// The link that carries it; none that is known of a camera stands beside the robot.
    pub link: Option<String>,
    /// Whether somebody says so.
    pub(super) is_said: bool,
}

/// The target that is held in sockets.
pub const BALL: &str = "ball";
/// What a camera's frame may be called behind its name, the likeliest first, and what a link may be.
pub const FRAMES: [&str; 4] = ["_optical_frame", "", "_frame", "_link"];

/// What is measured beside all joints that have columns; `on` has names of targets and cameras, as links' are.
pub fn measured(urdf: &Urdf, titles: &[String], on: &[(String, String)]) -> Measured {
    let moving = urdf.joints().filter(|joint| joint.kind != "fixed");
    let of_joints: Vec<String> = moving.filter_map(|joint| column(titles, &joint)).cloned().collect();
    columns::measured(titles, &of_joints, &known(urdf, on))
}

/// The names that targets and cameras may have: those of `on`, and of links, whatever is behind these.
pub fn known<'a>(urdf: &'a Urdf, on: &'a [(String, String)]) -> Vec<&'a str> {
    let of_links = urdf.links().iter().flat_map(|link| FRAMES.iter().filter_map(|frame| link.strip_suffix(frame)));
    on.iter().map(|(name, _)| name.as_str()).chain(of_links).collect()
}

/// The column of a joint.
pub fn column<'t>(titles: &'t [String], joint: &JointEnds) -> Option<&'t String> {
    let kind = if joint.kind == "prismatic" { JointKind::Prismatic } else { JointKind::Revolute };
    columns::of_joint(titles, joint.name, kind)
}

/// The targets and cameras that `measured` names, each with the name that it shares with others of its kind.
pub fn names(measured: &Measured) -> Vec<(Carried, &str)> {
    let mut all: Vec<(Carried, &str)> = Vec::new();
    for sensor in &measured.sensors {
        let target = (&sensor.name, false, sensor.group.as_str());
        let camera = sensor.camera.as_ref().map(|camera| (camera, true, camera.as_str()));
        for (name, is_camera, group) in [Some(target), camera].into_iter().flatten() {
            if !all.iter().any(|(it, _)| it.name == *name && it.is_camera == is_camera) {
                all.push((Carried { name: name.clone(), is_camera, link: None, is_said: false }, group));
            }
        }
    }
    if measured.sockets.is_some() {
        all.push((Carried { name: BALL.to_owned(), is_camera: false, link: None, is_said: false }, BALL));
    }
    all
}

/// The names of the cameras and targets in the titles of a table of a robot, of targets with numbers the name that they share: those of
/// which [`Sources::on`](super::Sources::on) may say the link.
pub fn carried(urdf: &Urdf, titles: &[String]) -> Vec<String> {
    let mut carried: Vec<String> = Vec::new();
    for (_, name) in names(&measured(urdf, titles, &[])) {
        if !carried.iter().any(|known| known == name) {
            carried.push(name.to_owned());
        }
    }
    carried
}
