//! The robot as a URDF, and the calibration file that goes with it.
//!
//! Frames are parallel to that of the measurements where all columns are at the middle of their ranges. The frame of joint i is at a
//! point of its axis w; a URDF's joint moves by `O Rot(w, q)` from its parent's frame F_p to F_i, which gives `O = F_p⁻¹ F_i Rot(w, −q₀)`, q₀ its
//! position at the middle.

use std::fmt::Write as _;

use body_schema_engine::kinematics::{Joint, JointKind};
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, UnitVector3, Vector3};

use crate::{answer::joint_name, data::Data, robot::Robot};

/// The link that stands still: the frame of the measurements.
pub const BASE: &str = "measurement_frame";
/// The radius of the capsules, m.
const RADIUS_M: f64 = 0.015;
/// Links shorter than this have no cylinder, m.
const SHORT_M: f64 = 1e-3;

/// Where every joint's frame is at the middle posture, m.
fn frames(robot: &Robot) -> Vec<Point3<f64>> {
    let mut frames: Vec<Point3<f64>> = Vec::new();
    let hand: Point3<f64> = robot.targets.first().map_or(Point3::origin(), |held| held.home.translation.vector.into());
    for joint in &robot.joints {
        let near = joint.parent.map_or(hand, |parent| frames[parent]);
        frames.push(match &joint.axis {
            Joint::Revolute(line) => line.slid_towards(&near).point,
            Joint::Prismatic(_) => near,
        });
    }
    frames
}

/// The name of the link behind every joint.
fn link(data: &Data, robot: &Robot, joint: Option<usize>) -> String {
    joint.map_or_else(|| BASE.to_owned(), |joint| format!("{}_link", joint_name(data, robot.joints[joint].column())))
}

/// The robot as a URDF: a joint per column, coupled ones as joints that mimic, links as capsules, limits as far as columns went.
pub fn urdf(data: &Data, robot: &Robot, name: &str) -> String {
    let frames = frames(robot);
    let mut text = format!("<?xml version=\"1.0\"?>\n<robot name=\"{}\">\n", escaped(name));
    let ends = |joint: Option<usize>| -> Vec<Vector3<f64>> {
        let at = joint.map_or(Point3::origin(), |joint| frames[joint]);
        let children = robot.joints.iter().enumerate().filter(|(_, child)| child.parent == joint);
        let targets = robot.targets.iter().filter(|held| held.carrier == joint && joint.is_some());
        children
            .map(|(index, _)| frames[index] - at)
            .chain(targets.map(|held| held.home.translation.vector - at.coords))
            .collect()
    };
    write_link(&mut text, BASE, &if robot.joints.is_empty() { Vec::new() } else { ends(None) });
    let mut dummies: Vec<usize> = Vec::new();
    for (index, joint) in robot.joints.iter().enumerate() {
        let own = link(data, robot, Some(index));
        write_link(&mut text, &own, &ends(Some(index)));
        let parent = joint.parent.map_or(Point3::origin(), |parent| frames[parent]);
        let w = joint.axis.direction();
        let kind = joint.axis.kind();
        let mut from = link(data, robot, joint.parent);
        let mut offset = Isometry3::from_parts(Translation3::from(frames[index] - parent), UnitQuaternion::identity());
        for (at, drive) in joint.drives.iter().enumerate() {
            let is_last = at + 1 == joint.drives.len();
            let middle = drive.ratio * robot.middle[drive.column];
            let back = match kind {
                JointKind::Revolute => Isometry3::rotation(w.into_inner() * -middle),
                JointKind::Prismatic => {
                    Isometry3::from_parts(Translation3::from(w.into_inner() * -middle), UnitQuaternion::identity())
                }
            };
            let title = joint_name(data, drive.column);
            let is_plain = at == 0 && !drive.is_free;
            let of = joint_name(data, joint.column());
            let called = if is_plain { title.clone() } else { format!("{of}_by_{title}") };
            let to = if is_last { own.clone() } else { format!("{own}_{}", at + 1) };
            if !is_last {
                write_link(&mut text, &to, &[]);
            }
            let mimic = (!is_plain).then_some((title.as_str(), drive.ratio));
            write_joint(
                &mut text,
                &called,
                kind,
                [&from, &to],
                &(offset * back),
                &w,
                range(data, drive.column, drive.ratio),
                mimic,
            );
            let has_own = robot.joints.iter().any(|joint| !joint.drives[0].is_free && joint.column() == drive.column);
            if !is_plain && !has_own && !dummies.contains(&drive.column) {
                dummies.push(drive.column);
            }
            (from, offset) = (to, Isometry3::identity());
        }
    }
    // A column that no joint follows one to one: a joint that reads it and carries nothing.
    for column in dummies {
        let name = joint_name(data, column);
        write_link(&mut text, &format!("{name}_reading"), &[]);
        let to = format!("{name}_reading");
        let kind = data.columns[column].kind.unwrap_or_else(|| {
            let of = robot.joints.iter().find(|joint| joint.drives.iter().any(|drive| drive.column == column));
            of.map_or(JointKind::Revolute, |joint| joint.axis.kind())
        });
        write_joint(
            &mut text,
            &name,
            kind,
            [BASE, &to],
            &Isometry3::identity(),
            &Vector3::z_axis(),
            range(data, column, 1.0),
            None,
        );
    }
    text += "</robot>\n";
    text
}

/// As far as a column went, times a ratio, in order.
fn range(data: &Data, column: usize, ratio: f64) -> (f64, f64) {
    let (low, high) = data.range(column).unwrap_or((0.0, 0.0));
    let (one, other) = (low * ratio, high * ratio);
    (one.min(other), one.max(other))
}

fn numbers(vector: &Vector3<f64>) -> String {
    format!("{:.9} {:.9} {:.9}", vector.x, vector.y, vector.z)
}

/// Roll, pitch and yaw about fixed axes.
fn rpy(rotation: &UnitQuaternion<f64>) -> Vector3<f64> {
    let (roll, pitch, yaw) = rotation.euler_angles();
    Vector3::new(roll, pitch, yaw)
}

#[allow(clippy::too_many_arguments, reason = "the parts of one element")]
fn write_joint(
    text: &mut String,
    name: &str,
    kind: JointKind,
    [parent, child]: [&str; 2],
    origin: &Isometry3<f64>,
    axis: &UnitVector3<f64>,
    (low, high): (f64, f64),
    mimic: Option<(&str, f64)>,
) {
    let kind = match kind {
        JointKind::Revolute => "revolute",
        JointKind::Prismatic => "prismatic",
    };
    let mimic = mimic.map_or(String::new(), |(of, ratio)| {
        format!("    <mimic joint=\"{}\" multiplier=\"{ratio:.9}\" offset=\"0\"/>\n", escaped(of))
    });
    let _ = write!(
        text,
        "  <joint name=\"{}\" type=\"{kind}\">\n    <parent link=\"{}\"/>\n    <child link=\"{}\"/>\n    <origin xyz=\"{}\" rpy=\"{}\"/>\n    \
         <axis xyz=\"{}\"/>\n    <limit lower=\"{low:.6}\" upper=\"{high:.6}\" effort=\"0\" velocity=\"0\"/>\n{mimic}  </joint>\n",
        escaped(name),
        escaped(parent),
        escaped(child),
        numbers(&origin.translation.vector),
        numbers(&rpy(&origin.rotation)),
        numbers(axis),
    );
}

/// A link with a capsule to each of its ends: a cylinder and two balls.
fn write_link(text: &mut String, name: &str, ends: &[Vector3<f64>]) {
    if ends.is_empty() {
        let _ = writeln!(text, "  <link name=\"{}\"/>", escaped(name));
        return;
    }
    let _ = writeln!(text, "  <link name=\"{}\">", escaped(name));
    let mut visual = |at: &Vector3<f64>, turn: &UnitQuaternion<f64>, shape: &str| {
        let _ = writeln!(
            text,
            "    <visual><origin xyz=\"{}\" rpy=\"{}\"/><geometry>{shape}</geometry></visual>",
            numbers(at),
            numbers(&rpy(turn))
        );
    };
    let ball = format!("<sphere radius=\"{RADIUS_M}\"/>");
    visual(&Vector3::zeros(), &UnitQuaternion::identity(), &ball);
    for end in ends.iter().filter(|end| end.norm() > SHORT_M) {
        let turn = UnitQuaternion::rotation_between(&Vector3::z(), end)
            .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI));
        visual(&(end * 0.5), &turn, &format!("<cylinder radius=\"{RADIUS_M}\" length=\"{:.6}\"/>", end.norm()));
        visual(end, &UnitQuaternion::identity(), &ball);
    }
    text.push_str("  </link>\n");
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// What the calibration file needs to know besides the robot.
#[derive(Clone, Copy, Debug)]
pub struct Sources<'a> {
    /// The name of the calibration.
    pub name: &'a str,
    /// The URDF's file.
    pub urdf_file: &'a str,
    /// The table's file.
    pub table_file: &'a str,
    /// The titles of every target's columns.
    pub measured: &'a [Vec<String>],
    /// The noise of places, m.
    pub sigma_m: f64,
    /// That of rotations, degrees.
    pub sigma_deg: f64,
}

/// The calibration file: the robot just found, to be refined by the same table. Targets that no joint moves are left out.
pub fn calibration(data: &Data, robot: &Robot, sources: &Sources<'_>) -> String {
    let frames = frames(robot);
    let quoted = |text: &str| format!("{text:?}");
    let mut text = format!(
        "# Written by `body-schema discover`: the robot that the table alone shows, to be refined by it.\n\nname = {}\n\n[robot]\nurdf = {}\n\
         base = \"{BASE}\"\n",
        quoted(sources.name),
        quoted(sources.urdf_file),
    );
    let mut tips: Vec<usize> = robot.targets.iter().filter_map(|held| held.carrier).collect();
    tips.sort_unstable();
    tips.dedup();
    let names: Vec<String> = tips.iter().map(|tip| quoted(&link(data, robot, Some(*tip)))).collect();
    match names.as_slice() {
        [only] => _ = writeln!(text, "tip = {only}"),
        _ => _ = writeln!(text, "tips = [{}]", names.join(", ")),
    }
    let _ = write!(
        text,
        "\n# The URDF's base is the frame of the measurements.\n[base]\nat_m = [0.0, 0.0, 0.0]\nrpy_deg = [0.0, 0.0, 0.0]\n\n# What was found is \
         as good as the table, not as a drawing.\n[prior]\ndirection_rad = 0.05\npoint_m = 0.02\n"
    );
    for (index, (target, held)) in data.targets.iter().zip(&robot.targets).enumerate() {
        let Some(carrier) = held.carrier else { continue };
        let name = if target.name.is_empty() { "target".to_owned() } else { target.name.clone() };
        let at = held.home.translation.vector - frames[carrier].coords;
        let list = |vector: &Vector3<f64>| format!("[{:.6}, {:.6}, {:.6}]", vector.x, vector.y, vector.z);
        let _ = write!(
            text,
            "\n[[target]]\nname = {}\nlink = {}\nat_m = {}\n",
            quoted(&name),
            quoted(&link(data, robot, Some(carrier))),
            list(&at)
        );
        let titles: Vec<String> = sources.measured[index].iter().map(|title| quoted(title)).collect();
        if target.is_pose {
            let _ = writeln!(text, "rpy_deg = {}", list(&(rpy(&held.home.rotation) * (180.0 / std::f64::consts::PI))));
            let _ = writeln!(text, "known = {{ to_m = 0.05, to_deg = 10.0 }}");
        } else {
            let _ = writeln!(text, "known = {{ to_m = 0.05 }}");
        }
        let channel = if target.is_pose { "pose" } else { "position" };
        let _ = write!(
            text,
            "\n[[sensor]]\nchannel = \"{channel}\"\ntarget = {}\nsigma_m = {:.6}\n",
            quoted(&name),
            sources.sigma_m
        );
        if target.is_pose {
            let _ = writeln!(text, "sigma_deg = {:.4}", sources.sigma_deg.max(1e-3));
        }
        let _ = writeln!(text, "columns = [{}]", titles.join(", "));
    }
    let _ = write!(text, "\n[measurements]\nfile = {}\n\n[held_out]\nfolds = 5\n", quoted(sources.table_file));
    text
}
