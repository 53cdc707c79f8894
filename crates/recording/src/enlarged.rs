//! A learned robot with its differences from its description enlarged, so that people see them.

use std::f64::consts::FRAC_PI_2;

use nalgebra::UnitQuaternion;

use body_schema_engine::{kinematics::Joint, model::Correction};
use body_schema_wire::{CorrectionReport, ModelReport};

/// The robot at `described + times · (learned − described)`, standing where the learned base is: axes are compared where each is
/// nearest to the described point, and turn by at most a right angle. A model with a number that is not finite stays as it is.
pub(super) fn enlarged(learned: &ModelReport, described: &ModelReport, times: f64) -> ModelReport {
    let mut drawn = learned.clone();
    let bases = learned.base_frame().zip(described.base_frame());
    let (Some((here, there)), Some(arms)) = (bases, learned.state().zip(described.state())) else { return drawn };
    let carry = here * there.inverse();
    let (learned, described) = arms;
    let corrections = learned.corrections.iter().zip(&described.corrections);
    let joints = learned.joints.iter().zip(&described.joints).zip(corrections);
    for (report, ((joint, other), (correction, from))) in drawn.joints.iter_mut().zip(joints) {
        let other = other.transformed(&carry);
        let turn = UnitQuaternion::rotation_between_axis(&other.direction(), &joint.direction()).unwrap_or_default();
        let turn = turn.axis_angle().map_or(UnitQuaternion::identity(), |(axis, angle)| {
            UnitQuaternion::from_axis_angle(&axis, (times * angle).min(FRAC_PI_2.max(angle)))
        });
        report.axis = (turn * other.direction().into_inner()).into();
        if let (Joint::Revolute(line), Joint::Revolute(from)) = (joint, &other) {
            let nearest = line.slid_towards(&from.point).point;
            report.point_m = Some((from.point + times * (nearest - from.point)).coords.into());
        }
        if correction != from {
            report.correction = Some(corrected(correction, from, times));
        }
    }
    // A hand that nobody described goes with its link as it was learned.
    let carrier = learned.hand_link().checked_sub(1);
    let last =
        carrier.and_then(|carrier| Some((carrier, learned.joints.get(carrier)?, described.joints.get(carrier)?)));
    if let Some(((carrier, joint, other), state)) = last.zip(drawn.state())
        && let Some(shown) = state.joints.get(carrier)
    {
        let other = other.transformed(&carry);
        let motion = other.motion_to(shown) * other.motion_to(joint).inverse();
        drawn.marker_m = (motion * learned.marker()).coords.into();
    }
    drawn
}

fn corrected(learned: &Correction, described: &Correction, times: f64) -> CorrectionReport {
    let between = |learned: f64, described: f64| described + times * (learned - described);
    CorrectionReport {
        offset: between(learned.offset, described.offset),
        ratio: between(learned.ratio, described.ratio),
        sine: between(learned.sine, described.sine),
        cosine: between(learned.cosine, described.cosine),
        compliance: std::array::from_fn(|k| between(learned.compliance[k], described.compliance[k])),
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Point3, UnitVector3, Vector3};

    use super::*;
    use body_schema_engine::{kinematics::Line, model::State};

    /// A joint that turns about an axis in the plane x = 0, and a hand.
    fn arm(tilt: f64, point: [f64; 3], hand: [f64; 3], base: Isometry3<f64>) -> State {
        let direction = UnitVector3::new_normalize(Vector3::new(0.0, tilt.sin(), tilt.cos()));
        let line = Line { point: point.into(), direction };
        State { base, ..State::arm(vec![Joint::Revolute(line)], hand.into()) }
    }

    #[test]
    fn differences_are_so_many_times_as_large() {
        let base = Isometry3::new(Vector3::new(1.0, 2.0, 3.0), Vector3::new(0.1, 0.2, 0.3));
        let described = ModelReport::of_state(&arm(0.0, [0.0; 3], [1.0, 0.0, 0.0], Isometry3::identity()));
        // The hand is held as the learned last link holds it.
        let tilted = |tilt: f64, shift: f64| [shift + 1.0, -tilt.sin() * 0.5, tilt.cos() * 0.5];
        let mut learned = arm(0.01, [0.002, 0.0, 0.0], tilted(-0.01, 0.002), base);
        learned.corrections[0].offset = 0.01;
        let drawn = enlarged(&ModelReport::of_state(&learned), &described, 10.0).state().unwrap();
        let wanted = arm(0.1, [0.02, 0.0, 0.0], tilted(-0.1, 0.02), base).measured().into_owned();
        let near = |a: Point3<f64>, b: Point3<f64>| assert!((a - b).norm() < 1e-12, "{a} instead of {b}");
        let (found, expected) = (drawn.joints[0].line().unwrap(), wanted.joints[0].line().unwrap());
        near(found.point, expected.point);
        near(drawn.marker(), wanted.marker());
        assert!(found.direction.angle(&expected.direction) < 1e-7);
        assert!((drawn.corrections[0].offset - 0.1).abs() < 1e-12);
    }

    #[test]
    fn once_is_what_was_learned_and_axes_turn_by_a_right_angle_at_most() {
        let described = ModelReport::of_state(&arm(0.0, [0.0; 3], [1.0, 0.0, 0.0], Isometry3::identity()));
        let learned = ModelReport::of_state(&arm(0.1, [0.1, 0.0, 0.0], [1.0, 0.1, 0.0], Isometry3::identity()));
        let drawn = enlarged(&learned, &described, 1.0);
        assert!((0..3).all(|k| (drawn.joints[0].axis[k] - learned.joints[0].axis[k]).abs() < 1e-12));
        let [x, y, z] = enlarged(&learned, &described, 50.0).joints[0].axis;
        assert!(x.abs() < 1e-12 && (y - 1.0).abs() < 1e-12 && z.abs() < 1e-12, "{:?}", [x, y, z]);
    }

    /// On a robot that branches a hand goes with the joint that carries it, not with the last in the list.
    #[test]
    fn a_hand_stays_where_another_branch_is_enlarged() {
        let tree = |tilt: f64| {
            let joints = [
                arm(0.0, [0.0; 3], [0.0; 3], Isometry3::identity()),
                arm(tilt, [0.0; 3], [0.0; 3], Isometry3::identity()),
            ];
            let joints = joints.map(|state| state.joints[0]).to_vec();
            State::branching(joints, vec![None, None], (1, Point3::new(1.0, 0.0, 0.0))).unwrap()
        };
        let [described, learned] = [0.0, 0.02].map(|tilt| ModelReport::of_state(&tree(tilt)));
        let drawn = enlarged(&learned, &described, 10.0);
        assert_eq!(drawn.marker_m, [1.0, 0.0, 0.0]);
        assert!((drawn.joints[1].axis[1] - 0.2_f64.sin()).abs() < 1e-9, "{:?}", drawn.joints[1].axis);
    }
}
