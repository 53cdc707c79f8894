//! A robot as it is drawn: its branches, and the lines along them.
//!
//! The first branch leads from the base to the hand. Every other leads to a link that carries no joint, from where it leaves the
//! branches before it, so that every joint is in one branch. An arm is one branch.

use nalgebra::Point3;

use super::{Frame, Links, State};

/// A branch: joints of which each carries the next.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Branch {
    /// The joint that carries the first one of them; `None` if that is on the base.
    pub carrier: Option<usize>,
    /// The joints in order, those nearer to the base first.
    pub joints: Vec<usize>,
    /// What is drawn at its end: the hand, or else a device or a target that its last link carries; `None` if that carries nothing.
    pub end: Option<Frame>,
}

impl State {
    /// The branches, that of the hand first, then by their last links.
    pub fn branches(&self) -> Vec<Branch> {
        let (count, hand) = (self.joints.len(), self.hand.frame());
        if self.tree.is_serial() {
            return vec![Branch { carrier: None, joints: (0..count).collect(), end: Some(hand) }];
        }
        let mut is_taken = vec![false; count];
        let mut branch = |link: usize, end: Option<Frame>| {
            let mut joints: Vec<usize> = self.tree.path(link).take_while(|joint| !is_taken[*joint]).collect();
            joints.reverse();
            joints.iter().for_each(|joint| is_taken[*joint] = true);
            Branch { carrier: joints.first().and_then(|first| self.tree.parent(*first)), joints, end }
        };
        let hand_link = self.hand_link();
        let mut branches = vec![branch(hand_link, Some(hand))];
        let carries = |link: usize| (0..count).any(|joint| self.tree.link_before(joint) == link);
        let ends = (1..=count).filter(|link| *link != hand_link && !carries(*link));
        branches.extend(ends.map(|link| branch(link, self.carried_by(link))));
        branches
    }

    /// The first device on a link, or else the first target.
    fn carried_by(&self, link: usize) -> Option<Frame> {
        let device = self.devices.iter().position(|device| device.link == Some(link)).map(Frame::Device);
        device.or_else(|| self.targets.iter().position(|target| target.link == link).map(Frame::Target))
    }

    /// The bones at readings `positions` (rad or m, one per joint): for each of the [branches](Self::branches) a line through the pivot
    /// of the joint that carries it, the pivots of its own revolute joints, and its end, metres in the frame of the measurements. A
    /// branch on the base begins at its own first pivot. Of an arm it is the [skeleton](Self::skeleton) alone.
    pub fn bones(&self, positions: &[f64]) -> Vec<Vec<Point3<f64>>> {
        let links = Links::of(self, positions);
        let pivot = |joint: usize| self.joints[joint].line().map(|_| Point3::from(links.joint(joint).pivot));
        let place = |frame: Frame| match frame {
            Frame::Target(target) => Point3::from(links.target(target)),
            other => Point3::from(links.pose(other).translation.vector),
        };
        let bone = |branch: Branch| {
            // A joint that slides has no pivot: the nearest that turns stands for it.
            let begins = branch.carrier.and_then(|carrier| self.tree.path(carrier + 1).find_map(pivot));
            let pivots = branch.joints.into_iter().filter_map(pivot);
            begins.into_iter().chain(pivots).chain(branch.end.map(place)).collect()
        };
        self.branches().into_iter().map(bone).collect()
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, UnitVector3, Vector3};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::{
        kinematics::{Joint, Line, Tree},
        model::{
            Device,
            random::{branched, random_state},
        },
    };

    fn turning(point: [f64; 3], axis: Vector3<f64>) -> Joint {
        Joint::Revolute(Line { point: point.into(), direction: UnitVector3::new_normalize(axis) })
    }

    /// A waist, an arm of two joints with the marker, a neck of two with a camera, and a tail of one that carries nothing.
    fn figure() -> State {
        let (y, z) = (Vector3::y(), Vector3::z());
        let joints = vec![
            turning([0.0, 0.0, 1.0], z),
            turning([0.0, -0.2, 1.4], y),
            turning([0.0, 0.0, 1.5], z),
            turning([0.3, -0.2, 1.4], y),
            turning([0.0, 0.0, 1.6], y),
            turning([-0.1, 0.0, 0.9], y),
        ];
        let parents = vec![None, Some(0), Some(0), Some(1), Some(2), None];
        let mut state = State::branching(joints, parents, (4, Point3::new(0.6, -0.2, 1.4))).expect("a tree");
        let pose = Isometry3::translation(0.1, 0.0, 1.65);
        state.devices.push(Device { link: Some(5), pose, intrinsics: None, distortion: None });
        state
    }

    #[test]
    fn the_bones_of_a_figure_worked_by_hand() {
        let state = figure();
        let branch = |carrier, joints: &[usize], end| Branch { carrier, joints: joints.to_vec(), end };
        let expected = [
            branch(None, &[0, 1, 3], Some(Frame::Target(0))),
            branch(Some(0), &[2, 4], Some(Frame::Device(0))),
            branch(None, &[5], None),
        ];
        assert_eq!(state.branches(), expected);
        // The waist turned by a right angle carries all but the tail.
        let mut readings = [0.0; 6];
        readings[0] = std::f64::consts::FRAC_PI_2;
        let expected: [&[[f64; 3]]; 3] = [
            &[[0.0, 0.0, 1.0], [0.2, 0.0, 1.4], [0.2, 0.3, 1.4], [0.2, 0.6, 1.4]],
            &[[0.0, 0.0, 1.0], [0.0, 0.0, 1.5], [0.0, 0.0, 1.6], [0.0, 0.1, 1.65]],
            &[[-0.1, 0.0, 0.9]],
        ];
        let bones = state.bones(&readings);
        assert_eq!(bones.iter().map(Vec::len).collect::<Vec<_>>(), [4, 4, 1]);
        for (found, expected) in bones.iter().flatten().zip(expected.concat()) {
            assert!((found - Point3::from(expected)).norm() < 1e-12, "{bones:?}");
        }
    }

    #[test]
    fn an_arm_has_one_bone_and_that_is_its_skeleton() {
        let mut rng = ChaCha8Rng::seed_from_u64(1301);
        for joints in 0..8 {
            let state = random_state(&mut rng, joints);
            let readings: Vec<f64> = (0..joints).map(|_| rng.random_range(-2.0..2.0)).collect();
            assert_eq!(state.bones(&readings), [state.skeleton(&readings)]);
        }
    }

    /// Bones are on one link each: none grows or shrinks when joints turn, and every joint has its place in one of them.
    #[test]
    fn bones_are_rigid() {
        let mut trees = 0;
        for seed in 1302..1362 {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let count = rng.random_range(2..9);
            let arm = random_state(&mut rng, count);
            let mut state = State { loads: None, ..branched(arm, &mut rng) };
            state.corrections.iter_mut().for_each(|correction| *correction = Default::default());
            // Joints that slide do so on purpose.
            for joint in &mut state.joints {
                *joint = Joint::Revolute(joint.line().copied().unwrap_or(Line {
                    point: crate::model::random::random_point(&mut rng),
                    direction: joint.direction(),
                }));
            }
            trees += usize::from(!state.tree.is_serial());
            let lengths = |readings: &[f64]| -> Vec<f64> {
                let of = |bone: &Vec<Point3<f64>>| bone.windows(2).map(|it| (it[1] - it[0]).norm()).collect::<Vec<_>>();
                state.bones(readings).iter().flat_map(of).collect()
            };
            let rest = lengths(&vec![0.0; count]);
            let readings: Vec<f64> = (0..count).map(|_| rng.random_range(-3.0..3.0)).collect();
            let moved = lengths(&readings);
            assert!(rest.len() == moved.len() && rest.iter().zip(&moved).all(|(a, b)| (a - b).abs() < 1e-9), "{seed}");
            let mut joints: Vec<usize> = state.branches().into_iter().flat_map(|branch| branch.joints).collect();
            joints.sort_unstable();
            assert_eq!(joints, (0..count).collect::<Vec<_>>(), "{seed}");
            let end = state.bones(&readings)[0].last().copied();
            assert_eq!(end, Some(state.marker_at(&readings)), "the first ends at the hand");
        }
        assert!(trees > 30, "{trees}");
    }

    #[test]
    fn a_hand_in_the_middle_of_a_branch_ends_the_first() {
        let joints = [0.0, 1.0, 2.0].map(|x| turning([x, 0.0, 0.0], Vector3::z())).to_vec();
        let tree = Tree::new(vec![None, Some(0), Some(0)]).expect("a tree");
        let mut state = State { tree, ..State::arm(joints, Point3::new(0.5, 0.0, 0.0)) };
        state.targets[0].link = 1;
        let of = |carrier, joints: &[usize], end| Branch { carrier, joints: joints.to_vec(), end };
        let hand = Some(Frame::Target(0));
        assert_eq!(state.branches(), [of(None, &[0], hand), of(Some(0), &[1], None), of(Some(0), &[2], None)]);
        // On the base it is alone.
        state.targets[0].link = 0;
        assert_eq!(state.branches(), [of(None, &[], hand), of(None, &[0, 1], None), of(Some(0), &[2], None)]);
    }
}
