//! Another library agrees where the links of described robots are whose joints branch: pinocchio, which knows nothing of this project.
//!
//! Which Python has it, the variable `BODY_SCHEMA_PINOCCHIO` says (`pip install pin example-robot-data`; the latter brings many robots);
//! without that variable nothing is compared.

use std::{collections::BTreeMap, path::Path, process::Command};

use body_schema_robot::{Chain, Urdf};
use nalgebra::{Isometry3, Matrix4};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A posture as the other library has it.
struct Posture {
    /// By joint, rad or m.
    positions: BTreeMap<String, f64>,
    /// By link, in the frame of the root.
    poses: BTreeMap<String, Matrix4<f64>>,
}

fn read(posture: &serde_json::Value) -> Posture {
    let members = |name: &str| posture[name].as_object().expect("an object").iter().map(|(key, it)| (key.clone(), it));
    let pose = |rows: &serde_json::Value| {
        let mut pose = Matrix4::identity();
        (0..12).for_each(|k| pose[(k / 4, k % 4)] = rows[k / 4][k % 4].as_f64().expect("a number"));
        pose
    };
    Posture {
        positions: members("positions").map(|(name, it)| (name, it.as_f64().expect("a number"))).collect(),
        poses: members("poses").map(|(name, it)| (name, pose(it))).collect(),
    }
}

/// Branches of the robot from some link to some others that hang on it, if there are any that move.
fn some_branches(urdf: &Urdf, rng: &mut ChaCha8Rng) -> Option<Chain> {
    let links = urdf.links();
    let base = &links[rng.random_range(0..links.len())];
    let hangs = |link: &&String| urdf.carriers(link).iter().any(|joint| joint.parent == base.as_str());
    let behind: Vec<&str> = links.iter().filter(hangs).map(String::as_str).collect();
    if behind.is_empty() {
        return None;
    }
    let tips: Vec<&str> = (0..rng.random_range(1..=5)).map(|_| behind[rng.random_range(0..behind.len())]).collect();
    let chain = urdf.branches(base, &tips).ok()?;
    assert!(chain.tips().eq(tips.iter().copied()) && chain.tip() == tips[0]);
    Some(chain)
}

/// How far the links of a chain, and those of its kinematic model, are from where the other library has them.
fn apart(chain: &Chain, posture: &Posture) -> f64 {
    let q: Vec<f64> = chain.names().iter().map(|name| posture.positions[name]).collect();
    let base = posture.poses[&chain.base].try_inverse().expect("a pose");
    let (links, state) = (chain.links(&q), chain.state());
    let motions = state.links(&q);
    let by_model = chain.frames().into_iter().map(|(link, frame)| motions[link] * frame);
    let away = |(index, (by_links, by_model)): (usize, (&Isometry3<f64>, Isometry3<f64>))| {
        let wanted = base * posture.poses[chain.link(index)];
        (by_links.to_homogeneous() - wanted).amax().max((by_model.to_homogeneous() - wanted).amax())
    };
    links.iter().zip(by_model).enumerate().map(away).fold(0.0, f64::max)
}

#[test]
fn pinocchio_finds_the_links_of_branches() {
    let Ok(python) = std::env::var("BODY_SCHEMA_PINOCCHIO") else { return eprintln!("not compared with pinocchio") };
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let scenarios = std::fs::read_dir(here.join("../../scenarios")).expect("a folder");
    let ours = scenarios.map(|entry| entry.expect("an entry").path());
    let ours: Vec<_> = ours.filter(|path| path.extension().is_some_and(|end| end == "urdf")).collect();
    let output =
        Command::new(&python).arg(here.join("tests/all/link_poses.py")).args(&ours).output().expect("it starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let (mut rng, mut robots, mut branching, mut greatest) = (ChaCha8Rng::seed_from_u64(1001), 0, 0, 0.0_f64);
    for line in String::from_utf8(output.stdout).expect("text").lines() {
        let read_line: serde_json::Value = serde_json::from_str(line).expect("JSON");
        let path = read_line["path"].as_str().expect("a path");
        let Ok(urdf) = Urdf::parse(&std::fs::read_to_string(path).expect("a file")) else { continue };
        robots += 1;
        let postures: Vec<Posture> = read_line["postures"].as_array().expect("a list").iter().map(read).collect();
        for chain in (0..200).filter_map(|_| some_branches(&urdf, &mut rng)) {
            branching += usize::from(!chain.tree().is_serial());
            let away = postures.iter().map(|posture| apart(&chain, posture)).fold(0.0, f64::max);
            assert!(away < 1e-12, "{path}, from {} to {:?}: {away:e}", chain.base, chain.tips().collect::<Vec<_>>());
            greatest = greatest.max(away);
        }
    }
    eprintln!("{robots} robots, {branching} of their branches branch: at most {greatest:e} apart");
    assert!(robots >= ours.len());
}
