//! Laws of robots whose joints branch, over random ones.

use nalgebra::{DVector, Isometry3, Matrix3, Matrix6xX, Vector6};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{
    Block, Frame, KinematicData, Layout, Points, State, Target, Whitening,
    laws::{random_case, unit},
    random::{all_blocks, branched, random_arm, random_state, random_stiff_state},
};
use crate::{
    kinematics::{Tree, TreeError},
    simd::{GROUP, levels},
};

const STEP: f64 = 1e-6;

/// Of a robot of this size, each of its frames.
fn frames(state: &State) -> Vec<Frame> {
    let links = (0..=state.joints.len()).map(Frame::Link);
    let targets = (0..state.targets.len()).map(Frame::Target);
    links.chain(targets).chain((0..state.devices.len()).map(Frame::Device)).collect()
}

/// A random robot on branches, and readings.
fn case(seed: u64, joints: usize) -> (State, Vec<f64>, ChaCha8Rng) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let state = random_state(&mut rng, joints);
    let state = branched(state, &mut rng);
    let readings = (0..joints).map(|_| rng.random_range(-3.0..3.0)).collect();
    (state, readings, rng)
}

/// The velocity of the origin, and the angular velocity, between two poses that are 2 [`STEP`]s apart.
fn difference(above: &Isometry3<f64>, below: &Isometry3<f64>) -> Vector6<f64> {
    let linear = (above.translation.vector - below.translation.vector) / (2.0 * STEP);
    let angular = (above.rotation * below.rotation.inverse()).scaled_axis() / (2.0 * STEP);
    Vector6::from_iterator(linear.iter().chain(angular.iter()).copied())
}

/// The joints that move a link as an arm of their own, with the link as its last.
fn arm_of(state: &State, link: usize) -> (State, Vec<usize>) {
    let mut path: Vec<usize> = state.tree.path(link).collect();
    path.reverse();
    let mut arm = State::arm(path.iter().map(|joint| state.joints[*joint]).collect(), state.marker());
    arm.corrections = path.iter().map(|joint| state.corrections[*joint]).collect();
    arm.base = state.base;
    (arm, path)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// Of every frame by the readings, absolute and from any other frame, where joints give way too.
    #[test]
    fn jacobians_equal_central_differences(seed: u64, joints in 1_usize..=9) {
        let (state, readings, mut rng) = case(seed, joints);
        let frames = frames(&state);
        for frame in &frames {
            let seen_from = frames[rng.random_range(0..frames.len())];
            let (found, relative) =
                (state.frame_jacobian(*frame, &readings), state.relative_jacobian(*frame, seen_from, &readings));
            for joint in 0..joints {
                let at = |sign: f64| {
                    let mut moved = readings.clone();
                    moved[joint] += sign * STEP;
                    moved
                };
                let (above, below) = (at(1.0), at(-1.0));
                let wanted = difference(&state.frame_at(*frame, &above), &state.frame_at(*frame, &below));
                let tolerance = 1e-7 * (1.0 + wanted.amax());
                prop_assert!((found.column(joint) - wanted).amax() < tolerance, "{frame:?} {joint}");
                let [above, below] = [above, below].map(|readings| state.relative(*frame, seen_from, &readings));
                let wanted = difference(&above, &below);
                let tolerance = 1e-7 * (1.0 + wanted.amax() + above.translation.vector.norm());
                prop_assert!((relative.column(joint) - wanted).amax() < tolerance, "{frame:?} from {seen_from:?} {joint}");
            }
        }
    }

    /// By every parameter, what is seen from another frame, and the adjoint.
    #[test]
    fn a_relative_measurement_moves_by_the_difference_of_twists(seed: u64, joints in 1_usize..=9) {
        let (state, layout, readings, mut rng) = random_case(seed, joints);
        let mut data = KinematicData::new(&state, &layout);
        data.at(&readings);
        let frames = frames(&state);
        for frame in &frames {
            let seen_from = frames[rng.random_range(0..frames.len())];
            let found: Matrix6xX<f64> = data.relative_twists(*frame, seen_from);
            for k in 0..layout.dimension() {
                let at = |sign: f64| {
                    let moved = state.retract(&layout, &unit(layout.dimension(), k, sign * STEP));
                    moved.relative(*frame, seen_from, &readings)
                };
                let wanted = difference(&at(1.0), &at(-1.0));
                let scale = 1.0 + wanted.amax() + data.pose(*frame).translation.vector.norm()
                    + data.pose(seen_from).translation.vector.norm();
                prop_assert!((found.column(k) - wanted).amax() < 4e-7 * scale, "{frame:?} from {seen_from:?} {k}");
            }
            let by_twist = Vector6::from_fn(|_, _| rng.random_range(-1.0..1.0));
            let twists = data.frame_twists(*frame);
            let apart: DVector<f64> = data.adjoint(*frame, &by_twist) - twists.tr_mul(&by_twist);
            prop_assert!(apart.amax() < 1e-12 * (1.0 + twists.amax()));
        }
    }

    /// A joint moves what descends from it, and not a bit of anything else.
    #[test]
    fn only_ancestors_move_a_link(seed: u64, joints in 1_usize..=12) {
        let (state, readings, _) = case(seed, joints);
        // A joint that gives way does to what the whole robot does.
        let state = State { loads: None, ..state };
        let layout = Layout::new(&state, all_blocks(&state));
        let mut data = KinematicData::new(&state, &layout);
        data.at(&readings);
        let before = state.links(&readings);
        for joint in 0..joints {
            let mut moved = readings.clone();
            moved[joint] += 0.3;
            let after = state.links(&moved);
            for link in 0..=joints {
                let is_ancestor = state.tree.path(link).any(|ancestor| ancestor == joint);
                prop_assert_eq!(state.tree.moves(joint, link), is_ancestor);
                let twists = data.frame_twists(Frame::Link(link));
                let range = layout.block(Block::Axis(joint)).expect("learned");
                prop_assert_eq!(twists.columns(range.start, range.len()).amax() > 0.0, is_ancestor);
                let jacobian = state.frame_jacobian(Frame::Link(link), &readings);
                prop_assert_eq!(jacobian.column(joint).amax() > 0.0, is_ancestor);
                if !is_ancestor {
                    prop_assert_eq!(before[link], after[link]);
                }
            }
        }
    }

    /// A branch is the arm of its joints to the last bit, by whatever way it is computed.
    #[test]
    fn a_branch_has_the_bits_of_its_arm(seed: u64, joints in 1_usize..=9) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let (state, _) = random_stiff_state(&mut rng, joints);
        let mut state = branched(state, &mut rng);
        let link = rng.random_range(0..=joints);
        state.targets.truncate(1);
        state.targets[0].link = link;
        let readings: Vec<f64> = (0..joints).map(|_| rng.random_range(-3.0..3.0)).collect();
        let (arm, path) = arm_of(&state, link);
        let of_arm: Vec<f64> = path.iter().map(|joint| readings[*joint]).collect();
        prop_assert_eq!(Some(state.links(&readings)[link]), arm.links(&of_arm).last().copied());
        prop_assert_eq!(state.frame_at(Frame::Target(0), &readings), arm.frame_at(Frame::Target(0), &of_arm));
        prop_assert_eq!(state.marker_at(&readings), arm.marker_at(&of_arm));
        let kinds = |joint: usize| [Block::Axis(joint), Block::Offset(joint), Block::Ratio(joint), Block::Eccentricity(joint)];
        let ends = [Block::Base, Block::Target(0)];
        let tree_layout = Layout::new(&state, path.iter().flat_map(|joint| kinds(*joint)).chain(ends));
        let arm_layout = Layout::new(&arm, (0..path.len()).flat_map(kinds).chain(ends));
        prop_assert_eq!(tree_layout.dimension(), arm_layout.dimension());
        let m = arm_layout.dimension();
        let (mut of_tree, mut alone) = (KinematicData::new(&state, &tree_layout), KinematicData::new(&arm, &arm_layout));
        let frame = Frame::Target(0);
        prop_assert_eq!(of_tree.at(&readings).frame_twists(frame), alone.at(&of_arm).frame_twists(frame));
        // And in lanes, with the slopes.
        let whitening = [(0, Whitening::Full(Matrix3::from_fn(|_, _| rng.random_range(-5.0..5.0))))];
        let [of_tree, alone] = [(&state, &tree_layout), (&arm, &arm_layout)]
            .map(|(state, layout)| Points::new(state, layout, &whitening).expect("no loads"));
        let factors: Vec<f64> = (0..m * 3 * GROUP).map(|_| rng.random_range(-1.0..1.0)).collect();
        for level in levels() {
            let look_up = |points: &Points, readings: &[f64]| {
                let (mut x, mut rows) = (vec![0.0; 3], vec![0.0; m * 3 * GROUP]);
                let mut slopes = vec![0.0; readings.len() * GROUP];
                fearless_simd::dispatch!(level, simd => points.rows(simd, &[readings], &mut x, &mut rows));
                fearless_simd::dispatch!(level, simd => points.slopes(simd, &[readings], &factors, &mut x, &mut slopes));
                let posture = points.at(readings);
                let still = (posture.readings().to_vec(), posture.rows().to_vec());
                (x, rows, slopes.into_iter().step_by(GROUP).collect::<Vec<_>>(), still)
            };
            let (found, wanted) = (look_up(&of_tree, &readings), look_up(&alone, &of_arm));
            prop_assert_eq!((&found.0, &found.1, &found.3), (&wanted.0, &wanted.1, &wanted.3));
            for (joint, slope) in found.2.iter().enumerate() {
                let expected = path.iter().position(|other| *other == joint).map_or(0.0, |place| wanted.2[place]);
                prop_assert_eq!(*slope, expected);
            }
        }
    }
}

#[test]
fn a_tree_that_makes_no_sense_is_refused() {
    let arm = random_arm(&mut ChaCha8Rng::seed_from_u64(1), 3);
    let tree =
        |parents: &[Option<usize>], link| State::branching(arm.joints.clone(), parents.to_vec(), (link, arm.marker()));
    assert_eq!(tree(&[None, Some(0)], 1), Err(TreeError::Count { joints: 3, parents: 2 }));
    assert_eq!(tree(&[None, Some(0), Some(2)], 1), Err(TreeError::Order { joint: 2, parent: 2 }));
    assert_eq!(tree(&[None, Some(0), Some(0)], 4), Err(TreeError::Link { link: 4, joints: 3 }));
    assert_eq!(tree(&[None, Some(0), Some(1)], 3), Ok(arm.clone()));
    let branching = tree(&[None, Some(0), Some(0)], 2).expect("a tree");
    assert_eq!(branching.tree, Tree::new(vec![None, Some(0), Some(0)]).expect("a tree"));
    assert!(matches!(branching.targets[0], Target { link: 2, .. }));
}

/// What is stored comes back, as text and in bytes; what was stored as text before there were trees is an arm.
#[test]
fn what_is_stored_comes_back() {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let (arm, _) = random_stiff_state(&mut rng, 4);
    let arm = State { loads: None, ..arm };
    let stored = serde_json::to_string(&arm).expect("JSON");
    let of_before = stored.replace("\"parents\":[],", "");
    assert_ne!(of_before, stored);
    assert_eq!(serde_json::from_str::<State>(&stored).expect("an arm"), arm);
    assert_eq!(serde_json::from_str::<State>(&of_before).expect("an arm"), arm);
    let tree = State { tree: Tree::new(vec![None, None, Some(0), Some(1)]).expect("a tree"), ..arm.clone() };
    for state in [&arm, &tree] {
        let bytes = postcard::to_allocvec(state).expect("bytes");
        assert_eq!(&postcard::from_bytes::<State>(&bytes).expect("a robot"), state);
    }
    let stored = serde_json::to_string(&tree).expect("JSON");
    assert!(stored.contains("\"parents\":[null,null,0,1]"), "{stored}");
    assert_eq!(serde_json::from_str::<State>(&stored).expect("a tree"), tree);
}
