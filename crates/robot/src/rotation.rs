//! Rotations as roll, pitch and yaw: `R = Rz(yaw) Ry(pitch) Rx(roll)`.

use std::f64::consts::{PI, TAU};

use nalgebra::{Rotation3, UnitQuaternion};

use body_schema_engine::elementary::{atan2, hypot};

/// Below this cosine of the pitch, roll and yaw turn about the same axis as far as digits tell.
const LOCKED: f64 = 1e-13;

/// The roll, pitch and yaw of a rotation (radians) that are nearest to `near` among all that give it.
///
/// They give the rotation back to 1e-12 rad however near to gimbal lock: roll takes back whatever error yaw has.
pub fn rpy(rotation: &UnitQuaternion<f64>, near: [f64; 3]) -> [f64; 3] {
    let matrix = rotation.to_rotation_matrix();
    let yaw =
        if hypot(matrix[(0, 0)], matrix[(1, 0)]) < LOCKED { near[2] } else { atan2(matrix[(1, 0)], matrix[(0, 0)]) };
    // What is left is Ry(pitch) Rx(roll).
    let rest = Rotation3::from_euler_angles(0.0, 0.0, -yaw) * matrix;
    let pitch = atan2(-rest[(2, 0)], rest[(0, 0)]);
    let roll = atan2(-rest[(1, 2)], rest[(1, 1)]);
    let turned = |angle: f64, near: f64| angle + TAU * ((near - angle) / TAU).round();
    let wound = |angles: [f64; 3]| -> [f64; 3] { std::array::from_fn(|k| turned(angles[k], near[k])) };
    let distance = |angles: &[f64; 3]| -> f64 { (0..3).map(|k| (angles[k] - near[k]).abs()).sum() };
    let (one, other) = (wound([roll, pitch, yaw]), wound([roll + PI, PI - pitch, yaw + PI]));
    if distance(&other) < distance(&one) { other } else { one }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use proptest::prelude::*;

    use super::*;

    fn rotation([roll, pitch, yaw]: [f64; 3]) -> UnitQuaternion<f64> {
        UnitQuaternion::from_euler_angles(roll, pitch, yaw)
    }

    proptest! {
        #[test]
        fn a_rotation_is_given_back_however_near_to_gimbal_lock(
            roll in -7.0..7.0, yaw in -7.0..7.0, away in -17.0..0.0, near in proptest::array::uniform3(-7.0..7.0),
            lower: bool, beyond: bool,
        ) {
            let away = if beyond { -(10_f64.powf(away)) } else { 10_f64.powf(away) };
            let pitch = if lower { -FRAC_PI_2 + away } else { FRAC_PI_2 - away };
            let wanted = rotation([roll, pitch, yaw]);
            let found = rpy(&wanted, near);
            prop_assert!(rotation(found).angle_to(&wanted) < 1e-12, "{found:?}");
        }

        #[test]
        fn angles_that_describe_a_rotation_already_are_kept(
            roll in -7.0..7.0, pitch in -7.0..7.0_f64, yaw in -7.0..7.0,
        ) {
            prop_assume!(pitch.cos().abs() > 1e-3);
            let found = rpy(&rotation([roll, pitch, yaw]), [roll, pitch, yaw]);
            for (found, wanted) in found.iter().zip([roll, pitch, yaw]) {
                prop_assert!((found - wanted).abs() < 1e-11, "{found} {wanted}");
            }
        }
    }

    #[test]
    fn at_gimbal_lock_yaw_stays() {
        let found = rpy(&rotation([0.3, FRAC_PI_2, 0.1]), [0.0, FRAC_PI_2, 0.7]);
        assert!((found[2] - 0.7).abs() < 1e-15 && (found[0] - 0.9).abs() < 1e-12, "{found:?}");
    }
}
