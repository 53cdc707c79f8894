//! Another library agrees where the links of a robot are whose joints branch: yourdfpy, which knows nothing of this project.

use std::{collections::BTreeMap, fmt::Write, path::Path, process::Command};

use body_schema::{
    kinematics::{Joint, Line},
    model::State,
};
use nalgebra::{Isometry3, Matrix4, Point3, Translation3, UnitQuaternion, UnitVector3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Deserialize;

/// A posture as the other library has it.
#[derive(Deserialize)]
struct Posture {
    /// By joint, rad or m.
    positions: BTreeMap<String, f64>,
    /// By link, row by row.
    poses: BTreeMap<String, [[f64; 4]; 4]>,
}

/// A random robot as a description, as a state, and the frame of each link at θ = 0.
fn robot(rng: &mut ChaCha8Rng) -> (String, State, Vec<Isometry3<f64>>) {
    let mut text = "<robot name=\"tree\">\n<link name=\"base\"/>\n".to_owned();
    let (mut joints, mut parents, mut rests) = (Vec::new(), Vec::new(), vec![Isometry3::identity()]);
    for index in 0..rng.random_range(2..=14) {
        let parent = if rng.random_bool(0.4) { index } else { rng.random_range(0..=index) };
        let mut vector = |size: f64| Vector3::from_fn(|_, _| rng.random_range(-size..size));
        let (xyz, rpy, axis) = (vector(1.0), vector(3.0), vector(1.0));
        let rotation = UnitQuaternion::from_euler_angles(rpy.x, rpy.y, rpy.z);
        let rest = rests[parent] * Isometry3::from_parts(Translation3::from(xyz), rotation);
        let direction = UnitVector3::new_normalize(rest * axis);
        let slides = rng.random_bool(0.25);
        joints.push(if slides {
            Joint::Prismatic(direction)
        } else {
            Joint::Revolute(Line { point: rest.translation.vector.into(), direction })
        });
        parents.push(parent.checked_sub(1));
        rests.push(rest);
        let name = |link: usize| if link == 0 { "base".to_owned() } else { format!("link{link}") };
        // Its axis has to be a unit vector: what is described is no scale.
        let axis = axis.normalize();
        let kind = if slides { "prismatic" } else { "continuous" };
        let limit = if slides { "<limit lower=\"-2\" upper=\"2\" effort=\"1\" velocity=\"1\"/>" } else { "" };
        let _ = writeln!(
            text,
            "<link name=\"{child}\"/>\n<joint name=\"joint{index}\" type=\"{kind}\"><parent link=\"{parent}\"/><child link=\"{child}\"/>\
             <origin xyz=\"{} {} {}\" rpy=\"{} {} {}\"/><axis xyz=\"{} {} {}\"/>{limit}</joint>",
            xyz.x,
            xyz.y,
            xyz.z,
            rpy.x,
            rpy.y,
            rpy.z,
            axis.x,
            axis.y,
            axis.z,
            child = name(index + 1),
            parent = name(parent),
        );
    }
    text.push_str("</robot>\n");
    let last = joints.len();
    let state = State::branching(joints, parents, (last, Point3::origin())).expect("a tree");
    (text, state, rests)
}

/// Of random branching robots, every link at random postures. Which Python has the library `BODY_SCHEMA_PYTHON` says
/// (`pip install -r tests/requirements.txt`); without that variable `python3` may lack it.
#[test]
fn another_library_finds_the_links_of_branching_robots() {
    let asked = std::env::var("BODY_SCHEMA_PYTHON");
    let python = asked.clone().unwrap_or_else(|_| "python3".to_owned());
    let library = Command::new(&python).args(["-c", "import yourdfpy"]).output();
    if !library.is_ok_and(|output| output.status.success()) {
        assert!(asked.is_err(), "{python} has no yourdfpy");
        eprintln!("{python} has no yourdfpy: not compared");
        return;
    }
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("trees");
    std::fs::create_dir_all(&folder).expect("a folder");
    let mut rng = ChaCha8Rng::seed_from_u64(33);
    let robots: Vec<_> = (0..24).map(|_| robot(&mut rng)).collect();
    assert!(robots.iter().filter(|(_, state, _)| !state.tree.is_serial()).count() > 12);
    let paths: Vec<_> = (0..robots.len()).map(|index| folder.join(format!("{index}.urdf"))).collect();
    for ((text, ..), path) in robots.iter().zip(&paths) {
        std::fs::write(path, text).expect("written");
    }
    let output = Command::new(&python).arg("tests/tree/link_poses.py").args(&paths).output().expect("it starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let theirs: Vec<Vec<Posture>> = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(theirs.len(), robots.len());
    let mut greatest = 0.0_f64;
    for ((_, state, rests), postures) in robots.iter().zip(&theirs) {
        for Posture { positions, poses } in postures {
            let q: Vec<f64> = (0..state.joints.len()).map(|joint| positions[&format!("joint{joint}")]).collect();
            assert_eq!(poses.len(), rests.len());
            for (link, (moved, rest)) in state.links(&q).iter().zip(rests).enumerate() {
                let theirs = &poses[&if link == 0 { "base".to_owned() } else { format!("link{link}") }];
                let wanted = Matrix4::from_fn(|row, column| theirs[row][column]);
                greatest = greatest.max(((moved * rest).to_homogeneous() - wanted).amax());
            }
        }
    }
    assert!(greatest < 1e-12, "{greatest:e}");
}
