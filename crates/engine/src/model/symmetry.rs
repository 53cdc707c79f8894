//! Changes of a robot that many measurements cannot tell: the directions that are left open, followed as far as one likes.

use nalgebra::{Isometry3, Vector3};

use super::{Block, Layout, Place, State};
use crate::{
    elementary::exp,
    kinematics::{Correction, Joint},
};

/// A family of changes under which what is measured may stay the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Symmetry {
    /// The robot and all that stands beside it moved as one, in the frame of its base: a shift (m) and a turn (rad).
    AsOne,
    /// The base moved one way and all that it carries the other: a shift (m) and a turn (rad).
    WithBase,
    /// The zero of a joint shifted (rad or m), and all that is behind it moved the other way.
    Zero(usize),
    /// All lengths longer by the same factor, its logarithm.
    Size,
}

fn motion(a: &[f64]) -> Isometry3<f64> {
    Isometry3::new(Vector3::from_column_slice(&a[..3]), Vector3::from_column_slice(&a[3..6]))
}

impl Symmetry {
    /// Those that a layout has parameters for.
    pub fn candidates(layout: &Layout) -> impl Iterator<Item = Self> {
        let place = if layout.block(Block::Base).is_some() { Self::WithBase } else { Self::AsOne };
        let zeros = layout.blocks().filter_map(|(block, _)| match block {
            Block::Offset(joint) => Some(Self::Zero(joint)),
            _ => None,
        });
        [place, Self::Size].into_iter().chain(zeros.collect::<Vec<_>>())
    }

    /// The number of its coordinates.
    pub fn dimension(self) -> usize {
        match self {
            Self::AsOne | Self::WithBase => 6,
            Self::Zero(_) | Self::Size => 1,
        }
    }

    /// A state changed by the coordinates `a`; 0 leaves it as it is.
    pub fn applied(self, state: &State, a: &[f64]) -> State {
        match self {
            Self::AsOne => {
                let motion = motion(a);
                let mut moved = state.carried(&motion, |_| true);
                let outside = state.base * motion * state.base.inverse();
                for device in moved.devices.iter_mut().filter(|device| device.link.is_none()) {
                    device.pose = outside * device.pose;
                }
                moved.sockets.iter_mut().for_each(|socket| *socket = outside * *socket);
                moved
            }
            Self::WithBase => {
                let motion = motion(a);
                let mut moved = state.carried(&motion.inverse(), |_| true);
                moved.base *= motion;
                moved
            }
            Self::Zero(joint) => {
                let behind = |link| state.tree.moves(joint, link);
                let mut moved = state.carried(&state.joints[joint].exp(-a[0]), behind);
                moved.corrections[joint].offset += a[0];
                moved
            }
            Self::Size => larger(state, exp(a[0])),
        }
    }
}

/// The state with all lengths longer by a factor.
fn larger(state: &State, factor: f64) -> State {
    let longer = |pose: &mut Isometry3<f64>| pose.translation.vector *= factor;
    let mut moved = state.clone();
    longer(&mut moved.base);
    for (joint, correction) in moved.joints.iter_mut().zip(&mut moved.corrections) {
        match joint {
            Joint::Revolute(line) => line.point *= factor,
            // How far it slides, in all its terms.
            Joint::Prismatic(_) => {
                let Correction { offset, ratio, sine, cosine, .. } = correction;
                [offset, ratio, sine, cosine].into_iter().for_each(|of| *of *= factor);
            }
        }
    }
    for target in &mut moved.targets {
        match &mut target.place {
            Place::Point(point) => *point *= factor,
            Place::Pose(pose) => longer(pose),
        }
    }
    moved.devices.iter_mut().for_each(|device| longer(&mut device.pose));
    moved.sockets.iter_mut().for_each(|socket| *socket *= factor);
    moved
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;
    use proptest::prelude::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::model::{
        Frame,
        random::{branched, random_stiff_state},
    };

    fn case(seed: u64) -> (State, Vec<f64>, Vec<f64>) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let state = random_stiff_state(&mut rng, 5).0;
        let state = branched(state, &mut rng);
        let readings = (0..5).map(|_| rng.random_range(-2.0..2.0)).collect();
        let a = (0..6).map(|_| rng.random_range(-0.8..0.8)).collect();
        (state, readings, a)
    }

    /// All that is predicted in the measurement frame: where targets and cameras are.
    fn places(state: &State, readings: &[f64]) -> Vec<Isometry3<f64>> {
        let frames = (0..state.targets.len()).map(Frame::Target).chain((0..state.devices.len()).map(Frame::Device));
        frames.map(|frame| state.frame_at(frame, readings)).collect()
    }

    fn is_same(a: &Isometry3<f64>, b: &Isometry3<f64>) -> bool {
        (a.translation.vector - b.translation.vector).norm() < 1e-9 && a.rotation.angle_to(&b.rotation) < 1e-7
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn what_a_robot_sees_of_itself_stays_where_it_moves_as_one(seed: u64) {
            let (state, readings, a) = case(seed);
            let moved = Symmetry::AsOne.applied(&state, &a);
            let (before, after) = (places(&state, &readings), places(&moved, &readings));
            let outside = state.base * motion(&a) * state.base.inverse();
            for (index, (one, other)) in before.iter().zip(&after).enumerate() {
                // A point has no orientation of its own.
                let is_point = matches!(state.targets.get(index).map(|target| &target.place), Some(Place::Point(_)));
                let wanted = outside * one;
                prop_assert!((wanted.translation.vector - other.translation.vector).norm() < 1e-9);
                prop_assert!(is_point || is_same(&wanted, other), "{index}");
            }
            for (one, other) in state.sockets.iter().zip(&moved.sockets) {
                prop_assert!((outside * one - other).norm() < 1e-9);
            }
        }

        #[test]
        fn base_and_zeros_change_nothing_of_what_is_seen(seed: u64, joint in 0_usize..5) {
            let (state, readings, a) = case(seed);
            for symmetry in [Symmetry::WithBase, Symmetry::Zero(joint)] {
                let moved = symmetry.applied(&state, &a[..symmetry.dimension()]);
                let carried = |index: usize| {
                    state.devices.get(index.wrapping_sub(state.targets.len())).is_none_or(|it| it.link.is_some())
                };
                for (index, (one, other)) in places(&state, &readings).iter().zip(&places(&moved, &readings)).enumerate() {
                    let apart = (one.translation.vector - other.translation.vector).norm();
                    prop_assert!(!carried(index) || apart < 1e-9, "{symmetry:?} {index}: {apart}");
                }
            }
        }

        #[test]
        fn a_larger_robot_is_larger_everywhere(seed: u64) {
            let (state, readings, a) = case(seed);
            let larger = Symmetry::Size.applied(&state, &a[..1]);
            let factor = exp(a[0]);
            for (one, other) in places(&state, &readings).iter().zip(&places(&larger, &readings)) {
                let wanted = Point3::from(one.translation.vector) * factor;
                prop_assert!((wanted.coords - other.translation.vector).norm() < 1e-9 * (1.0 + factor));
            }
            prop_assert_eq!(Symmetry::Size.applied(&state, &[0.0]), state);
        }
    }
}
