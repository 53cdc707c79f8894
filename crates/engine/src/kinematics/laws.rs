//! Laws of joints and bases, over random ones.

use nalgebra::{Isometry3, Matrix2, Point3, Vector3};
use proptest::prelude::*;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::{Line, chart, rotation};
use crate::model::random::{random_arm, random_direction};

fn close(a: &Isometry3<f64>, b: &Isometry3<f64>) -> bool {
    (a.to_homogeneous() - b.to_homogeneous()).amax() < 1e-12
}

proptest! {
    #[test]
    fn exponential_is_a_one_parameter_group(seed: u64, a in -3.0..3.0, b in -3.0..3.0) {
        let arm = random_arm(&mut ChaCha8Rng::seed_from_u64(seed), 4);
        for joint in &arm.joints {
            prop_assert!(close(&joint.exp(0.0), &Isometry3::identity()));
            prop_assert!(close(&(joint.exp(a) * joint.exp(b)), &joint.exp(a + b)));
            prop_assert!(close(&joint.exp(a).inverse(), &joint.exp(-a)));
        }
    }

    #[test]
    fn bases_are_orthonormal_and_right_handed(seed: u64) {
        let w = random_direction(&mut ChaCha8Rng::seed_from_u64(seed));
        for w in [w, -w, Vector3::z_axis(), -Vector3::z_axis()] {
            let basis = chart::basis(&w);
            let (b1, b2) = (basis.column(0), basis.column(1));
            prop_assert!((basis.transpose() * basis - Matrix2::identity()).amax() < 1e-12);
            prop_assert!((b1.cross(&b2) - w.into_inner()).norm() < 1e-12);
        }
    }

    /// J is the derivative of the exponential, for small rotations too.
    #[test]
    fn left_jacobian_equals_differences(seed: u64, size in prop::sample::select(vec![1e-9, 1e-5, 1e-3, 0.5, 3.0])) {
        let omega = random_direction(&mut ChaCha8Rng::seed_from_u64(seed)).into_inner() * size;
        let jacobian = rotation::left_jacobian(&omega);
        let identity = nalgebra::UnitQuaternion::identity();
        let here = rotation::exp(&identity, &omega);
        for k in 0..3 {
            let moved = |sign: f64| {
                let there = rotation::exp(&identity, &(omega + Vector3::ith(k, sign * 1e-6)));
                rotation::log(&here, &there)
            };
            let difference = (moved(1.0) - moved(-1.0)) / 2e-6;
            prop_assert!((difference - jacobian.column(k)).norm() < 1e-7);
        }
    }
}

#[test]
fn distance_to_a_line() {
    let line = Line { point: Point3::new(1.0, 0.0, 5.0), direction: Vector3::z_axis() };
    assert!((line.distance_to(&Point3::new(4.0, 4.0, -2.0)) - 5.0).abs() < 1e-12);
}
