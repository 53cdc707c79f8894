//! Laws of the kinematics, over random chains.

use nalgebra::{DVector, Isometry3, Point3, UnitVector3, Vector3};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{Chain, Joint, Line, TangentLayout, jacobian::jacobian};

pub(crate) fn random_direction(rng: &mut ChaCha8Rng) -> UnitVector3<f64> {
    loop {
        let v = Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0));
        if (0.1..1.0).contains(&v.norm()) {
            return UnitVector3::new_normalize(v);
        }
    }
}

fn random_point(rng: &mut ChaCha8Rng) -> Point3<f64> {
    Point3::from(Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0)))
}

/// A chain of `joints` joints, about one in four prismatic.
pub(crate) fn random_chain(rng: &mut ChaCha8Rng, joints: usize) -> Chain {
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
    Chain { joints, marker: random_point(rng) }
}

/// A random chain with some joints known, perhaps a learned marker, and joint positions.
fn random_case(seed: u64, joints: usize) -> (Chain, TangentLayout, Vec<f64>, ChaCha8Rng) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let chain = random_chain(&mut rng, joints);
    let learned: Vec<bool> = (0..joints).map(|_| rng.random_range(0..5) > 0).collect();
    let layout = TangentLayout::new(&chain.joints, &learned, rng.random_range(0..2) == 0);
    let theta = (0..joints).map(|_| rng.random_range(-3.0..3.0)).collect();
    (chain, layout, theta, rng)
}

fn random_delta(rng: &mut ChaCha8Rng, dimension: usize, size: f64) -> DVector<f64> {
    DVector::from_fn(dimension, |_, _| rng.random_range(-size..size))
}

fn close(a: &Isometry3<f64>, b: &Isometry3<f64>) -> bool {
    (a.to_homogeneous() - b.to_homogeneous()).amax() < 1e-12
}

proptest! {
    #[test]
    fn jacobian_equals_central_differences(seed: u64, joints in 1_usize..=20) {
        let (chain, layout, theta, _) = random_case(seed, joints);
        let (marker, h) = jacobian(&chain, &layout, &theta);
        prop_assert!((marker - chain.marker_at(&theta)).norm() < 1e-10);
        let step = 1e-6;
        for k in 0..layout.dimension() {
            let moved = |sign: f64| {
                let mut delta = DVector::zeros(layout.dimension());
                delta[k] = sign * step;
                chain.retract(&layout, &delta).marker_at(&theta)
            };
            let difference = (moved(1.0) - moved(-1.0)) / (2.0 * step);
            // Rounding of positions of a few tens of metres, over the step.
            prop_assert!((difference - h.column(k)).norm() < 1e-7 * (1.0 + h.column(k).norm()), "column {k}");
        }
    }

    #[test]
    fn exponential_is_a_one_parameter_group(seed: u64, a in -3.0..3.0, b in -3.0..3.0) {
        let (chain, ..) = random_case(seed, 4);
        for joint in &chain.joints {
            prop_assert!(close(&joint.exp(0.0), &Isometry3::identity()));
            prop_assert!(close(&(joint.exp(a) * joint.exp(b)), &joint.exp(a + b)));
            prop_assert!(close(&joint.exp(a).inverse(), &joint.exp(-a)));
            prop_assert!((joint.carry(a, &chain.marker) - joint.exp(a) * chain.marker).norm() < 1e-12);
        }
    }

    #[test]
    fn sliding_a_point_along_its_axis_changes_nothing(seed: u64, joints in 1_usize..=20, length in -2.0..2.0) {
        let (chain, _, theta, _) = random_case(seed, joints);
        let mut slid = chain.clone();
        for joint in &mut slid.joints {
            if let Joint::Revolute(line) = joint {
                *line = line.slid(length);
            }
        }
        prop_assert!((slid.marker_at(&theta) - chain.marker_at(&theta)).norm() < 1e-11);
    }

    #[test]
    fn retract_and_local_invert_each_other(seed: u64, joints in 1_usize..=20) {
        let (chain, layout, theta, mut rng) = random_case(seed, joints);
        let delta = random_delta(&mut rng, layout.dimension(), 0.9);
        let other = chain.retract(&layout, &delta);
        let local = chain.local(&layout, &other).expect("within 90 deg");
        prop_assert!((&local - &delta).amax() < 1e-10);
        // A line written with another pivot is the same line, and comes back as the same kinematics.
        let mut slid = other.clone();
        for joint in &mut slid.joints {
            if let Joint::Revolute(line) = joint {
                *line = line.slid(0.7);
            }
        }
        let local_slid = chain.local(&layout, &slid).expect("within 90 deg");
        let back = chain.retract(&layout, &local_slid);
        prop_assert!((back.marker_at(&theta) - other.marker_at(&theta)).norm() < 1e-9);
    }

    #[test]
    fn transport_equals_differences_of_the_change_of_chart(seed: u64, joints in 1_usize..=8) {
        let (chain, layout, _, mut rng) = random_case(seed, joints);
        let delta = random_delta(&mut rng, layout.dimension(), 0.6);
        let new = chain.retract(&layout, &delta);
        let transport = chain.transport(&layout, &delta);
        let step = 1e-6;
        for k in 0..layout.dimension() {
            let moved = |sign: f64| {
                let mut near = delta.clone();
                near[k] += sign * step;
                new.local(&layout, &chain.retract(&layout, &near)).expect("near the new chart's origin")
            };
            let difference = (moved(1.0) - moved(-1.0)) / (2.0 * step);
            prop_assert!((difference - transport.column(k)).amax() < 1e-7, "column {k}");
        }
    }

    #[test]
    fn bases_are_orthonormal_and_right_handed(seed: u64) {
        let w = random_direction(&mut ChaCha8Rng::seed_from_u64(seed));
        for w in [w, -w, Vector3::z_axis(), -Vector3::z_axis()] {
            let basis = super::chart::basis(&w);
            let (b1, b2) = (basis.column(0), basis.column(1));
            prop_assert!((basis.transpose() * basis - nalgebra::Matrix2::identity()).amax() < 1e-12);
            prop_assert!((b1.cross(&b2) - w.into_inner()).norm() < 1e-12);
        }
    }
}

#[test]
fn antipodes_and_perpendicular_lines_are_outside_the_chart() {
    let line = Line { point: Point3::origin(), direction: Vector3::z_axis() };
    let other = Line { direction: -Vector3::z_axis(), ..line };
    let across = Line { direction: Vector3::x_axis(), ..line };
    assert!(super::chart::local_line(&line, &other).is_none());
    assert!(super::chart::local_line(&line, &across).is_none());
    assert!(super::chart::local_direction(&line.direction, &other.direction).is_none());
}

#[test]
fn distance_to_a_line() {
    let line = Line { point: Point3::new(1.0, 0.0, 5.0), direction: Vector3::z_axis() };
    assert!((line.distance_to(&Point3::new(4.0, 4.0, -2.0)) - 5.0).abs() < 1e-12);
}
