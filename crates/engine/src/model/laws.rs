//! Laws of states and their coordinates, over random robots.

use nalgebra::{DMatrix, DVector, Isometry3, Matrix6xX, Point3, Vector3};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::random::{all_blocks, branched, random_arm, random_direction, random_point, random_state};
use super::{Block, Element, Frame, KinematicData, Layout, Prior, State, anywhere, jacobian};
use crate::kinematics::{Joint, Line, chart};

/// A random robot with everything, every second one with branches, of which about four blocks in five are learned, and readings.
pub(super) fn random_case(seed: u64, joints: usize) -> (State, Layout, Vec<f64>, ChaCha8Rng) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let state = random_state(&mut rng, joints);
    let state = if rng.random_bool(0.5) { branched(state, &mut rng) } else { state };
    let learned: Vec<Block> = all_blocks(&state).into_iter().filter(|_| rng.random_range(0..5) > 0).collect();
    let layout = Layout::new(&state, learned);
    let readings = (0..joints).map(|_| rng.random_range(-3.0..3.0)).collect();
    (state, layout, readings, rng)
}

pub(super) fn random_delta(rng: &mut ChaCha8Rng, dimension: usize, size: f64) -> DVector<f64> {
    DVector::from_fn(dimension, |_, _| rng.random_range(-size..size))
}

pub(super) fn unit(dimension: usize, k: usize, size: f64) -> DVector<f64> {
    let mut delta = DVector::zeros(dimension);
    delta[k] = size;
    delta
}

/// Every element of a random robot, one of each block.
fn elements(seed: u64) -> Vec<Element> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let state = random_state(&mut rng, 5);
    all_blocks(&state).iter().map(|block| block.of(&state)).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Every frame's twists, and the marker's Jacobian, against central differences of forward kinematics.
    #[test]
    fn twists_equal_central_differences(seed: u64, joints in 1_usize..=20) {
        let (state, layout, readings, _) = random_case(seed, joints);
        let step = 1e-6;
        let frames = [Frame::Link(joints), Frame::Link(joints / 2), Frame::Target(0), Frame::Target(1), Frame::Target(2),
            Frame::Device(0), Frame::Device(1)];
        let pose_at = |state: &State, frame| KinematicData::new(state, &layout).at(&readings).pose(frame);
        let mut data = KinematicData::new(&state, &layout);
        data.at(&readings);
        let (marker, h) = jacobian(&state, &layout, &readings);
        prop_assert!((marker - state.marker_at(&readings)).norm() < 1e-10);
        for frame in frames {
            let twists: Matrix6xX<f64> = data.frame_twists(frame);
            let here = data.pose(frame);
            for k in 0..layout.dimension() {
                let moved = |sign: f64| pose_at(&state.retract(&layout, &unit(layout.dimension(), k, sign * step)), frame);
                let (above, below) = (moved(1.0), moved(-1.0));
                let linear = (above.translation.vector - below.translation.vector) / (2.0 * step);
                let angular = (above.rotation * below.rotation.inverse()).scaled_axis() / (2.0 * step);
                let column = twists.column(k);
                // Rounding of positions of a few tens of metres, over the step.
                let tolerance = 2e-7 * (1.0 + column.norm() + here.translation.vector.norm());
                prop_assert!((linear - column.fixed_rows::<3>(0)).norm() < tolerance, "{frame:?} column {k}");
                prop_assert!((angular - column.fixed_rows::<3>(3)).norm() < tolerance, "{frame:?} column {k}");
                if frame == Frame::Target(0) {
                    prop_assert!((h.column(k) - column.fixed_rows::<3>(0)).norm() < 1e-10 * (1.0 + column.norm()));
                }
            }
        }
    }

    #[test]
    fn links_of_the_pass_are_those_of_forward_kinematics(seed: u64, joints in 1_usize..=20) {
        let (state, layout, readings, _) = random_case(seed, joints);
        let mut data = KinematicData::new(&state, &layout);
        data.at(&readings);
        for (index, link) in state.links(&readings).iter().enumerate() {
            prop_assert!((data.link(index).pose().to_homogeneous() - link.to_homogeneous()).amax() < 1e-10);
        }
        for target in 0..state.targets.len() {
            prop_assert!((data.target(target) - state.target_at(target, &readings).coords).norm() < 1e-10);
        }
    }

    /// The harness of every element: local inverts retract, transport is the derivative of the change of chart, and the
    /// displacement from a guess has the derivative that it says.
    #[test]
    fn elements_keep_the_laws_of_charts(seed: u64, size in 0.01..0.7_f64) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 1);
        for element in elements(seed) {
            let m = element.dimension();
            let delta = random_delta(&mut rng, m, size);
            let there = element.retract(&delta.rows(0, m));
            prop_assert!((element.local(&there).expect("in the chart") - &delta).amax() < 1e-10, "{element:?}");
            prop_assert_eq!(element.retract(&DVector::zeros(m).rows(0, m)).dimension(), m);
            let step = 1e-6;
            let transport = element.transport(&delta.rows(0, m));
            let displacement = element.displacement(&there).expect("everywhere");
            for k in 0..m {
                let other = |sign: f64| element.retract(&(&delta + unit(m, k, sign * step)).rows(0, m));
                let moved = |sign: f64| there.local(&other(sign)).expect("near");
                let difference = (moved(1.0) - moved(-1.0)) / (2.0 * step);
                prop_assert!((difference - transport.column(k)).amax() < 1e-7, "{element:?} {k}");
                let near = |sign: f64| there.retract(&unit(m, k, sign * step).rows(0, m));
                let displaced = |sign: f64| element.displacement(&near(sign)).expect("everywhere").value;
                let difference = (displaced(1.0) - displaced(-1.0)) / (2.0 * step);
                prop_assert!((difference - displacement.derivative.column(k)).amax() < 1e-6, "{element:?} {k}");
            }
            // To first order at the guess, the displacement is the tangent vector.
            let near = element.retract(&(&delta * 1e-6).rows(0, m));
            let first_order = element.displacement(&near).expect("near").value;
            prop_assert!((first_order - &delta * 1e-6).amax() < 1e-10);
        }
    }

    /// Beyond the chart at the guess, where a line has turned by more than 90 deg, the displacement goes on.
    #[test]
    fn displacements_do_not_end_with_the_chart(seed: u64) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let guess = Joint::Revolute(Line { point: random_point(&mut rng), direction: random_direction(&mut rng) });
        let other = Joint::Revolute(Line { point: random_point(&mut rng), direction: random_direction(&mut rng) });
        let found = Element::Axis(guess).displacement(&Element::Axis(other)).expect("lines");
        let (Some(guess), Some(line)) = (guess.line(), other.line()) else { unreachable!() };
        let distance = found.value.fixed_rows::<2>(0).norm();
        let expected = line.direction.cross(&(line.point - guess.point)).norm();
        prop_assert!((distance - expected).abs() < 1e-6);
        prop_assert!((found.value.fixed_rows::<2>(2).norm() - guess.direction.angle(&line.direction)).abs() < 1e-9);
    }

    #[test]
    fn sliding_a_point_along_its_axis_changes_nothing(seed: u64, joints in 1_usize..=20, length in -2.0..2.0) {
        let (state, layout, readings, mut rng) = random_case(seed, joints);
        let slid = |state: &State| {
            let mut slid = state.clone();
            for joint in &mut slid.joints {
                if let Joint::Revolute(line) = joint {
                    *line = line.slid(length);
                }
            }
            slid
        };
        prop_assert!((slid(&state).marker_at(&readings) - state.marker_at(&readings)).norm() < 1e-10);
        // A line written with another pivot is the same line, and comes back as the same kinematics.
        let other = state.retract(&layout, &random_delta(&mut rng, layout.dimension(), 0.3));
        let back = state.retract(&layout, &state.local(&layout, &slid(&other)).expect("within 90 deg"));
        prop_assert!((back.marker_at(&readings) - other.marker_at(&readings)).norm() < 1e-9);
    }

    /// Also between lines that are written with pivots elsewhere than a retraction would leave them.
    #[test]
    fn a_change_of_chart_equals_its_differences(seed: u64, joints in 1_usize..=5, length in -0.5..0.5) {
        let (state, layout, _, mut rng) = random_case(seed, joints);
        let m = layout.dimension();
        let mut there = state.retract(&layout, &random_delta(&mut rng, m, 0.5));
        for joint in &mut there.joints {
            if let Joint::Revolute(line) = joint {
                *line = line.slid(length);
            }
        }
        let change = state.change_of_chart(&layout, &there).expect("in the chart");
        for k in 0..m {
            let moved = |sign: f64| state.local(&layout, &there.retract(&layout, &unit(m, k, sign * 1e-6))).expect("near");
            let difference = (moved(1.0) - moved(-1.0)) / 2e-6;
            prop_assert!((difference - change.column(k)).amax() < 1e-6, "column {k}");
        }
    }

    #[test]
    fn the_base_can_be_folded_into_the_axes(seed: u64, joints in 1_usize..=12) {
        let (state, _, readings, _) = random_case(seed, joints);
        let folded = state.measured();
        prop_assert_eq!(folded.base, Isometry3::identity());
        for target in 0..state.targets.len() {
            let apart = folded.target_at(target, &readings) - state.target_at(target, &readings);
            prop_assert!(apart.norm() < 1e-10);
        }
    }

    /// The negative gradient of the prior's cost is minus its derivative, for any covariance and for blocks that may be anywhere.
    #[test]
    fn descent_is_the_derivative_of_the_priors_cost(seed: u64, vague: bool) {
        let (guess, layout, _, mut rng) = random_case(seed, 3);
        let m = layout.dimension();
        let root = DMatrix::from_fn(m, m, |_, _| rng.random_range(-0.2..0.2));
        let covariance = &root * root.transpose() + DMatrix::identity(m, m) * 0.05;
        let within = |block| (vague && matches!(block, Block::Axis(_) | Block::Base | Block::Socket(_))).then_some(1.5);
        let prior = Prior::new(guess.clone(), &layout, covariance, within).expect("a prior");
        let pins = prior.pins();
        let state = guess.retract(&layout, &random_delta(&mut rng, m, 0.5)).slid_towards(&pins);
        let (mut information, mut negative_gradient) = (DMatrix::zeros(m, m), DVector::zeros(m));
        let cost = prior.cost(&state, Some((&mut information, &mut negative_gradient)));
        prop_assert!((cost - prior.cost(&state, None)).abs() < 1e-9 * (1.0 + cost));
        prop_assert!((&information - information.transpose()).amax() < 1e-9 * information.amax());
        let step = 1e-6;
        for k in 0..m {
            // The pivots stay: sliding them would change the chart, not the cost.
            let moved = |sign: f64| prior.cost(&state.retract(&layout, &unit(m, k, sign * step)), None);
            let difference = -(moved(1.0) - moved(-1.0)) / (2.0 * step);
            prop_assert!((difference - negative_gradient[k]).abs() < 1e-5 * (1.0 + negative_gradient.amax()), "{k}: {difference} {}", negative_gradient[k]);
        }
    }
}

/// Draws of a prior have its covariance, and those of blocks that may be anywhere lie within their bounds.
#[test]
fn draws_are_distributed_as_the_prior_says() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let guess = random_arm(&mut rng, 2);
    let layout = Layout::of_arm(&guess, &[], true);
    let m = layout.dimension();
    let root = DMatrix::from_fn(m, m, |_, _| rng.random_range(-0.02..0.02));
    let covariance = &root * root.transpose() + DMatrix::identity(m, m) * 1e-4;
    let prior = Prior::around(guess.clone(), &layout, covariance.clone()).expect("a prior");
    let count = 4000;
    let mut sum = DMatrix::zeros(m, m);
    for _ in 0..count {
        let delta = guess.local(&layout, &prior.draw(&layout, &mut rng)).expect("near");
        sum += &delta * delta.transpose();
    }
    let found = sum / f64::from(count);
    assert!((&found - &covariance).amax() < 0.12 * covariance.amax());
    let vague = Prior::new(guess, &layout, covariance, |block| matches!(block, Block::Axis(_)).then_some(0.7));
    let vague = vague.expect("a prior");
    let far = (0..200).map(|_| vague.draw(&layout, &mut rng));
    let points: Vec<_> = far.flat_map(|state| state.joints).filter_map(|joint| Some(joint.line()?.point)).collect();
    assert!(points.iter().all(|point| point.coords.amax() <= 0.7));
    assert!(points.iter().any(|point| point.coords.amax() > 0.6));
}

/// The variances that stand for uniform directions and rotations, against draws.
#[test]
fn uniform_draws_have_the_variance_that_the_prior_counts() {
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let mut mean = |element: &Element, of: fn(&Element) -> f64| {
        let count = 20_000;
        (0..count).map(|_| of(&anywhere(element, 1.0, &mut rng))).sum::<f64>() / f64::from(count)
    };
    let direction = mean(&Element::Axis(Joint::Prismatic(Vector3::z_axis())), |element| match element {
        Element::Axis(joint) => joint.direction().angle(&Vector3::z_axis()).powi(2) / 2.0,
        _ => f64::NAN,
    });
    let pi = std::f64::consts::PI;
    assert!((direction - (pi * pi / 4.0 - 1.0)).abs() < 0.03, "{direction}");
    let rotation = mean(&Element::Pose(Isometry3::identity()), |element| match element {
        Element::Pose(pose) => pose.rotation.angle().powi(2) / 3.0,
        _ => f64::NAN,
    });
    assert!((rotation - (pi * pi / 3.0 + 2.0) / 3.0).abs() < 0.03, "{rotation}");
}

#[test]
fn a_prior_that_makes_no_sense_is_refused() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let guess = random_state(&mut rng, 2);
    let layout = Layout::new(&guess, [Block::Ratio(0), Block::Target(0)]);
    let m = layout.dimension();
    let identity = DMatrix::identity(m, m);
    assert!(Prior::around(guess.clone(), &layout, -&identity).is_err());
    assert!(Prior::around(guess.clone(), &layout, DMatrix::identity(2, 2)).is_err());
    assert!(Prior::around(guess.clone(), &layout, DMatrix::from_element(m, m, f64::NAN)).is_err());
    assert!(Prior::new(guess, &layout, identity, |_| Some(1.0)).is_err(), "a ratio has no bounds");
}

/// An unknown base correlates the axes by itself: the marker's covariance is the same whether the base is a block, or
/// its uncertainty is folded into a full covariance of the axes.
#[test]
fn a_base_of_its_own_says_what_correlated_axes_say() {
    let mut rng = ChaCha8Rng::seed_from_u64(6);
    let arm = random_arm(&mut rng, 4);
    let with_base = Layout::new(&arm, (0..4).map(Block::Axis).chain([Block::Base, Block::Target(0)]));
    let axes_alone = Layout::of_arm(&arm, &[], true);
    let (m, k) = (with_base.dimension(), axes_alone.dimension());
    let covariance = DMatrix::from_diagonal(&DVector::from_fn(m, |row, _| if row < 6 { 1e-6 } else { 1e-8 }));
    // How base and axes together move the axes in the frame of the measurements.
    let mut folding = DMatrix::zeros(k, m);
    for column in 0..m {
        let moved = |sign: f64| arm.retract(&with_base, &unit(m, column, sign * 1e-6)).measured().into_owned();
        let local = |sign: f64| arm.local(&axes_alone, &moved(sign)).expect("near");
        folding.set_column(column, &((local(1.0) - local(-1.0)) / 2e-6));
    }
    let correlated = &folding * &covariance * folding.transpose();
    assert!(correlated[(0, 4)].abs() + correlated[(1, 5)].abs() > 1e-9, "axes are correlated");
    for _ in 0..10 {
        let theta: Vec<f64> = (0..4).map(|_| rng.random_range(-2.0..2.0)).collect();
        let (_, of_base) = jacobian(&arm, &with_base, &theta);
        let (_, of_axes) = jacobian(&arm, &axes_alone, &theta);
        let difference = &of_base * &covariance * of_base.transpose() - &of_axes * &correlated * of_axes.transpose();
        assert!(difference.amax() < 1e-9, "{difference}");
    }
}

#[test]
fn antipodes_and_perpendicular_lines_are_outside_the_chart() {
    let line = Line { point: Point3::origin(), direction: Vector3::z_axis() };
    let other = Line { direction: -Vector3::z_axis(), ..line };
    let across = Line { direction: Vector3::x_axis(), ..line };
    assert!(chart::local_line(&line, &other).is_none());
    assert!(chart::local_line(&line, &across).is_none());
    assert!(chart::local_direction(&line.direction, &other.direction).is_none());
}
