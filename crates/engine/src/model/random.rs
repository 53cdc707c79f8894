//! Random robots, for tests of laws.

use nalgebra::{Isometry3, Point3, UnitVector3, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::{Block, Correction, Device, Load, Loads, Place, State, Target};
use crate::kinematics::{Joint, Line, Tree};

/// A direction drawn uniformly.
pub fn random_direction(rng: &mut ChaCha8Rng) -> UnitVector3<f64> {
    loop {
        let v = Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0));
        if (0.1..1.0).contains(&v.norm()) {
            return UnitVector3::new_normalize(v);
        }
    }
}

/// A point drawn from a cube of two metres.
pub fn random_point(rng: &mut ChaCha8Rng) -> Point3<f64> {
    Point3::from(Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0)))
}

/// A pose within a metre, turned by up to 1.5 rad about each coordinate axis.
pub fn random_pose(rng: &mut ChaCha8Rng) -> Isometry3<f64> {
    Isometry3::new(random_point(rng).coords, Vector3::from_fn(|_, _| rng.random_range(-1.5..1.5)))
}

/// An arm of `joints` joints, about one in four prismatic, with its marker.
pub fn random_arm(rng: &mut ChaCha8Rng, joints: usize) -> State {
    let joints = (0..joints)
        .map(|_| {
            let direction = random_direction(rng);
            if rng.random_range(0..4) == 0 {
                Joint::Prismatic(direction)
            } else {
                Joint::Revolute(Line { point: random_point(rng), direction })
            }
        })
        .collect();
    State::arm(joints, random_point(rng))
}

/// An arm with every kind of block: a base, corrections, targets and devices on any link, sockets.
pub fn random_state(rng: &mut ChaCha8Rng, joints: usize) -> State {
    let mut state = random_arm(rng, joints);
    state.base = random_pose(rng);
    state.corrections = (0..joints)
        .map(|_| Correction {
            offset: rng.random_range(-0.3..0.3),
            ratio: rng.random_range(0.9..1.1),
            sine: rng.random_range(-0.1..0.1),
            cosine: rng.random_range(-0.1..0.1),
            compliance: [0.0; 2],
        })
        .collect();
    state.targets.push(Target { link: rng.random_range(0..=joints), place: Place::Pose(random_pose(rng)) });
    state.targets.push(Target { link: rng.random_range(0..=joints), place: Place::Point(random_point(rng)) });
    state.devices.push(Device {
        link: Some(rng.random_range(0..=joints)),
        pose: random_pose(rng),
        intrinsics: Some([500.0, 510.0, 320.0, 240.0]),
        distortion: None,
    });
    state.devices.push(Device { link: None, pose: random_pose(rng), intrinsics: None, distortion: None });
    state.sockets.extend([random_point(rng), random_point(rng)]);
    let turning: Vec<usize> = (0..joints).filter(|joint| state.joints[*joint].line().is_some()).collect();
    let elbow = (!turning.is_empty()).then(|| turning[rng.random_range(0..turning.len())]);
    state.loads = Some(state.loads_under(random_direction(rng), elbow).into());
    for correction in &mut state.corrections {
        correction.compliance = [(); 2].map(|()| rng.random_range(-0.01..0.01));
    }
    state
}

/// `state` with its joints rearranged on branches.
pub fn branched(state: State, rng: &mut ChaCha8Rng) -> State {
    let parent = |joint: usize| match rng.random_range(0..4) {
        0 => None,
        1 if joint > 0 => Some(rng.random_range(0..joint)),
        _ => joint.checked_sub(1),
    };
    let tree = Tree::new((0..state.joints.len()).map(parent).collect()).expect("parents before children");
    let loads = state.loads.as_deref().map(|loads| Loads { tree: tree.clone(), ..loads.clone() }.into());
    State { tree, loads, ..state }
}

/// A random state whose joints do not give way to loads, and all its blocks but those of loads.
pub fn random_stiff_state(rng: &mut ChaCha8Rng, joints: usize) -> (State, Vec<Block>) {
    stiff(random_state(rng, joints))
}

/// A state whose joints no longer give way to loads, and all its blocks but those of loads.
pub fn stiff(mut state: State) -> (State, Vec<Block>) {
    state.corrections.iter_mut().for_each(|correction| correction.compliance = [0.0; 2]);
    let mut blocks = all_blocks(&state);
    blocks.retain(|block| !matches!(block, Block::Compliance(..)));
    (state, blocks)
}

/// All blocks of a state.
pub fn all_blocks(state: &State) -> Vec<Block> {
    let mut blocks = vec![Block::Base];
    for joint in 0..state.joints.len() {
        blocks.extend([Block::Axis(joint), Block::Offset(joint), Block::Ratio(joint), Block::Eccentricity(joint)]);
        blocks.extend(Load::ALL.map(|load| Block::Compliance(joint, load)));
    }
    blocks.extend((0..state.targets.len()).map(Block::Target));
    blocks.extend((0..state.devices.len()).flat_map(|device| [Block::Device(device), Block::Intrinsics(device)]));
    let coefficients =
        (0..state.devices.len()).flat_map(|device| (0..8).map(move |index| Block::Distortion(device, index)));
    blocks.extend(coefficients);
    blocks.extend((0..state.sockets.len()).map(Block::Socket));
    blocks.retain(|block| block.is_in(state));
    blocks
}
