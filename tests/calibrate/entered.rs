//! The sets that do not ship are entered as docs/robots/README.md says.

use std::fmt::Write as _;

use body_schema::{
    calibration::{Case, Silent, calibrate},
    model::{Frame, State},
    scenario::Scenario,
};
use nalgebra::Point3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use super::axes_alone;
use crate::ask_tell::robot::put_off;

/// A URDF of these joints, each with its parent, its child, its origin and its axis, and of links that are fixed to others.
fn urdf(joints: &[(&str, &str, &str, &str, &str)], fixed: &[(&str, &str, &str)]) -> String {
    let mut links: Vec<&str> = joints.iter().flat_map(|joint| [joint.1, joint.2]).collect();
    links.extend(fixed.iter().flat_map(|link| [link.0, link.1]));
    links.sort_unstable();
    links.dedup();
    let mut text = "<robot name=\"entered\">".to_owned();
    for link in links {
        let _ = write!(text, "<link name=\"{link}\"/>");
    }
    for (name, parent, child, xyz, axis) in joints {
        let _ = write!(
            text,
            "<joint name=\"{name}\" type=\"revolute\"><parent link=\"{parent}\"/><child link=\"{child}\"/><origin xyz=\"{xyz}\"/>\
             <axis xyz=\"{axis}\"/><limit lower=\"-1\" upper=\"1\" effort=\"1\" velocity=\"1\"/></joint>"
        );
    }
    for (parent, child, xyz) in fixed {
        let _ = write!(
            text,
            "<joint name=\"to_{child}\" type=\"fixed\"><parent link=\"{parent}\"/><child link=\"{child}\"/><origin xyz=\"{xyz}\"/></joint>"
        );
    }
    text + "</robot>"
}

/// The file of a set in the documentation, by the name that it has there.
fn documented(name: &str) -> String {
    let page = std::fs::read_to_string("docs/robots/README.md").expect("readable");
    let files = page.split("```toml\n").skip(1).filter_map(|rest| rest.split("```").next());
    let mut named = files.filter(|text| text.starts_with(&format!("name = \"{name}\"")));
    named.next().unwrap_or_else(|| panic!("no file of {name}")).to_owned()
}

/// How far the first target is believed from where the second frame has it, at new postures, as described and calibrated, mm: by the file of the
/// documentation, with rows that `measured` makes of postures of a robot that is a little off its description.
fn calibrated(
    name: &str,
    urdf: &str,
    titles: &[String],
    (rows, seen_from): (usize, Frame),
    measured: impl Fn(&State, &[f64], &mut ChaCha8Rng) -> Option<Vec<String>>,
) -> [f64; 2] {
    let text = documented(name);
    let read = |table: &str| {
        let open = |file: &str| Ok(if file.ends_with(".urdf") { urdf.to_owned() } else { table.to_owned() });
        Scenario::parse(&format!("{name}.toml"), &text, &open).unwrap_or_else(|error| panic!("{error}"))
    };
    // A first table, of which nothing is taken but how the robot is understood.
    let joints = titles.iter().filter(|title| urdf.contains(&format!("joint name=\"{title}\""))).count();
    let line = |cells: &[String]| cells.join(",") + "\n";
    let first: Vec<String> = (0..titles.len()).map(|column| format!("0.{}", column % 9 + 1)).collect();
    let second: Vec<String> = (0..titles.len()).map(|column| format!("0.{}", (column + 4) % 9 + 1)).collect();
    let robot = read(&(line(titles) + &line(&first) + &line(&second))).robot;
    let mut rng = ChaCha8Rng::seed_from_u64(1001);
    let mut truth = robot.state.clone();
    put_off(&mut truth, |_| false, &mut rng);
    let mut table = line(titles);
    let mut count = 0;
    while count < rows {
        let positions: Vec<f64> = (0..joints).map(|_| rng.random_range(-0.9..0.9)).collect();
        let by_name = |name: &String| titles.iter().position(|title| title == name).map_or(0.0, |at| positions[at]);
        let theta: Vec<f64> = robot.names.iter().map(by_name).collect();
        let Some(reading) = measured(&truth, &theta, &mut rng) else { continue };
        let cells: Vec<String> = positions.iter().map(f64::to_string).chain(reading).collect();
        table += &line(&cells);
        count += 1;
    }
    let scenario = read(&table);
    let case = Case::new(&scenario).unwrap_or_else(|error| panic!("{error}"));
    let calibration = calibrate(&case, &axes_alone(), &Silent).unwrap_or_else(|error| panic!("{error}"));
    let postures: Vec<Vec<f64>> =
        (0..200).map(|_| robot.names.iter().map(|_| rng.random_range(-0.9..0.9)).collect()).collect();
    let at = |state: &State, theta: &[f64]| state.relative(Frame::Target(0), seen_from, theta).translation.vector;
    [&calibration.nominal, &calibration.fit].map(|fit| {
        let errors = postures.iter().map(|theta| (at(fit.state(), theta) - at(&truth, theta)).norm());
        1e3 * errors.sum::<f64>() / postures.len() as f64
    })
}

fn titles(joints: &[(&str, &str, &str, &str, &str)], others: impl IntoIterator<Item = String>) -> Vec<String> {
    joints.iter().map(|joint| joint.0.to_owned()).chain(others).collect()
}

/// The cube in the hand of a humanoid, of which the camera on its head sees some corners. Waist and neck have no column.
#[test]
fn a_humanoid_with_a_cube_in_its_hand() {
    let arm = [
        ("left_shoulder_pitch_joint", "torso_link", "left_shoulder_pitch_link", "0 0.1 0.24", "0 1 0"),
        ("left_shoulder_roll_joint", "left_shoulder_pitch_link", "left_shoulder_roll_link", "0 0.04 -0.01", "1 0 0"),
        ("left_shoulder_yaw_joint", "left_shoulder_roll_link", "left_shoulder_yaw_link", "0 0 -0.1", "0 0 1"),
        ("left_elbow_joint", "left_shoulder_yaw_link", "left_elbow_link", "0.016 0 -0.08", "0 1 0"),
        ("left_wrist_roll_joint", "left_elbow_link", "left_wrist_roll_link", "0.1 0 -0.01", "1 0 0"),
        ("left_wrist_pitch_joint", "left_wrist_roll_link", "left_wrist_pitch_link", "0.038 0 0", "0 1 0"),
        ("left_wrist_yaw_joint", "left_wrist_pitch_link", "left_wrist_yaw_link", "0.046 0 0", "0 0 1"),
    ];
    let mut joints = arm.to_vec();
    joints.push(("waist_yaw_joint", "pelvis", "torso_link", "0 0 0", "0 0 1"));
    let urdf = urdf(&joints, &[("torso_link", "d435_link", "0.06 0.02 0.43")]);
    let corners = documented_points();
    let columns = (1..=corners.len()).flat_map(|k| ["u", "v"].map(|axis| format!("eye_cube_{axis}{k}")));
    let [before, after] =
        calibrated("g1", &urdf, &titles(&arm, columns), (39, Frame::Device(0)), |truth, theta, rng| {
            let cube = truth.relative(Frame::Target(0), Frame::Device(0), theta);
            let mut cells = Vec::new();
            for corner in &corners {
                let at = cube * Point3::from(*corner);
                let uv = [605.0 * at.x / at.z + 320.0, 605.0 * at.y / at.z + 240.0];
                let in_view = at.z > 0.1 && (0.0..640.0).contains(&uv[0]) && (0.0..480.0).contains(&uv[1]);
                // One corner in four is not found.
                let is_found = in_view && rng.random_bool(0.75);
                cells.extend(uv.map(|x| {
                    let noise: f64 = rng.sample(StandardNormal);
                    if is_found { (x + 0.3 * noise).to_string() } else { String::new() }
                }));
            }
            let seen = cells.iter().filter(|cell| !cell.is_empty()).count();
            (seen >= 8).then_some(cells)
        });
    assert!(after < 4.0 && after < 0.3 * before, "{before} mm as described, {after} mm calibrated");
}

/// The known points of the cube in the documentation.
fn documented_points() -> Vec<[f64; 3]> {
    let file: toml::Table = documented("g1").parse().expect("TOML");
    let points = file["target"][0]["points_m"].as_array().expect("points").iter();
    points.map(|point| [0, 1, 2].map(|axis| point[axis].as_float().expect("a number"))).collect()
}

/// A finger of one arm on the skin of the other.
#[test]
fn a_robot_with_skin_that_touches_itself() {
    let joints = [
        ("LShoulderPitch", "torso", "LShoulder", "0 0.098 0.1", "0 1 0"),
        ("LShoulderRoll", "LShoulder", "LBicep", "0 0 0", "0 0 1"),
        ("LElbowYaw", "LBicep", "LElbow", "0.105 0.015 0", "1 0 0"),
        ("LElbowRoll", "LElbow", "l_gripper", "0 0 0", "0 0 1"),
        ("RShoulderPitch", "torso", "RShoulder", "0 -0.098 0.1", "0 1 0"),
        ("RShoulderRoll", "RShoulder", "RBicep", "0 0 0", "0 0 1"),
        ("RElbowYaw", "RBicep", "RElbow", "0.105 -0.015 0", "1 0 0"),
        ("RElbowRoll", "RElbow", "RForeArm", "0 0 0", "0 0 1"),
    ];
    let columns = ["x", "y", "z"].map(|axis| format!("skin_finger_{axis}"));
    let [before, after] = calibrated(
        "nao",
        &urdf(&joints, &[]),
        &titles(&joints, columns),
        (60, Frame::Target(1)),
        |truth, theta, rng| {
            let at = truth.relative(Frame::Target(0), Frame::Target(1), theta);
            let noisy = |x: &f64| (x + 0.003 * rng.sample::<f64, _>(StandardNormal)).to_string();
            Some(at.translation.vector.iter().map(noisy).collect())
        },
    );
    assert!(after < 4.0 && after < 0.7 * before, "{before} mm as described, {after} mm calibrated");
}
