//! The joint box: the configurations that a robot can take.

use rand::{Rng, RngExt};

use crate::numeric_range::is_usable;

/// The limits of every joint, and the map between them and the unit cube [0, 1]ⁿ:
///
/// ```text
/// xᵢ = (θᵢ − lowerᵢ) / (upperᵢ − lowerᵢ),     θᵢ = lowerᵢ + xᵢ (upperᵢ − lowerᵢ)
/// ```
///
/// θᵢ and its limits are in radians for a revolute joint and in metres for a prismatic one; xᵢ has no unit. A joint
/// whose limits are equal does not move: its xᵢ is 0, and every xᵢ means its only position.
///
/// ```
/// use body_schema_engine::kinematics::JointBox;
///
/// let limits = JointBox::new(vec![(-1.0, 3.0), (0.2, 0.4)])?;
/// assert_eq!(limits.to_unit(&[0.0, 0.2]), [0.25, 0.0]);
/// assert_eq!(limits.from_unit(&[0.5, 1.0]), [1.0, 0.4]);
/// assert!(!limits.contains(&[0.0, 0.5]));
/// # Ok::<(), body_schema_engine::kinematics::JointBoxError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct JointBox {
    joints: Vec<(f64, f64)>,
}

/// Why limits make no joint box.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "joint {joint} (counted from 0) has the limits {lower} and {upper} (rad or m): give numbers within ±1e12, the lower first"
)]
pub struct JointBoxError {
    /// The first joint at fault, counted from 0.
    pub joint: usize,
    /// Its lower limit as given.
    pub lower: f64,
    /// Its upper limit as given.
    pub upper: f64,
}

impl JointBox {
    /// How far beyond its limits [`is_within`](Self::is_within) may let a joint be, as a share of its range: half a
    /// thousandth, for positions that were rounded for people.
    pub const ROUNDING: f64 = 5e-4;

    /// The box of `(lower, upper)` per joint, rad or m.
    ///
    /// # Errors
    ///
    /// [`JointBoxError`] if limits are not finite, beyond [`GREATEST`](crate::numeric_range::GREATEST), or in the wrong order.
    pub fn new(joints: Vec<(f64, f64)>) -> Result<Self, JointBoxError> {
        let is_range = |(lower, upper): (f64, f64)| lower <= upper && is_usable(lower) && is_usable(upper);
        match joints.iter().position(|&limits| !is_range(limits)) {
            Some(joint) => Err(JointBoxError { joint, lower: joints[joint].0, upper: joints[joint].1 }),
            None => Ok(Self { joints }),
        }
    }

    /// Number of joints, n.
    pub fn dimension(&self) -> usize {
        self.joints.len()
    }

    /// `(lower, upper)` per joint, rad or m.
    pub fn joints(&self) -> &[(f64, f64)] {
        &self.joints
    }

    /// The lower limit of a joint, rad or m.
    ///
    /// # Panics
    ///
    /// If there is no such joint.
    pub fn lower(&self, joint: usize) -> f64 {
        self.joints[joint].0
    }

    /// The upper limit of a joint, rad or m.
    ///
    /// # Panics
    ///
    /// If there is no such joint.
    pub fn upper(&self, joint: usize) -> f64 {
        self.joints[joint].1
    }

    /// The point of the unit cube that stands for `configuration`, one position per joint; outside the cube if the
    /// configuration is outside its limits.
    pub fn to_unit(&self, configuration: &[f64]) -> Vec<f64> {
        debug_assert_eq!(configuration.len(), self.dimension(), "one position per joint");
        let share = |(position, &(lower, upper)): (&f64, &(f64, f64))| {
            if lower < upper { (position - lower) / (upper - lower) } else { 0.0 }
        };
        configuration.iter().zip(&self.joints).map(share).collect()
    }

    /// The configuration that `point` stands for, one coordinate per joint. It is within the limits whatever rounding
    /// does; a coordinate below 0 or above 1 means the limit.
    pub fn from_unit(&self, point: &[f64]) -> Vec<f64> {
        debug_assert_eq!(point.len(), self.dimension(), "one coordinate per joint");
        point.iter().enumerate().map(|(joint, x)| self.along_from_unit(joint, *x)).collect()
    }

    /// The position of one joint at a coordinate of the unit cube.
    pub(crate) fn along_from_unit(&self, joint: usize, x: f64) -> f64 {
        let (lower, upper) = self.joints[joint];
        (lower + x * (upper - lower)).clamp(lower, upper)
    }

    /// Whether `configuration` has one position per joint, each within the limits (the limits themselves count). A
    /// number that is not finite is outside.
    pub fn contains(&self, configuration: &[f64]) -> bool {
        configuration.len() == self.dimension()
            && configuration.iter().enumerate().all(|(joint, &position)| self.is_within(joint, position, 0.0))
    }

    /// Whether one joint's position (rad or m) is within its limits, or beyond them by at most the share `slack` of its
    /// range, as [`ROUNDING`](Self::ROUNDING). A number that is not finite is outside.
    ///
    /// # Panics
    ///
    /// If there is no such joint.
    pub fn is_within(&self, joint: usize, position: f64, slack: f64) -> bool {
        let (lower, upper) = self.joints[joint];
        let slack = slack * (upper - lower);
        (lower - slack..=upper + slack).contains(&position)
    }

    /// A configuration drawn uniformly.
    pub fn draw<R: Rng + ?Sized>(&self, rng: &mut R) -> Vec<f64> {
        // A joint that does not move takes nothing from the stream of random numbers.
        let position =
            |&(lower, upper): &(f64, f64)| if lower < upper { rng.random_range(lower..=upper) } else { lower };
        self.joints.iter().map(position).collect()
    }
}

#[cfg(test)]
mod tests {
    use proptest::{collection::vec, prelude::*};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;

    fn joint_box(joints: &[(f64, f64)]) -> JointBox {
        JointBox::new(joints.to_vec()).expect("limits in order")
    }

    #[test]
    fn limits_must_be_finite_and_in_order() {
        for (lower, upper) in [(1.0, 0.5), (f64::NAN, 1.0), (0.0, f64::NAN), (0.0, f64::INFINITY), (f64::MIN, f64::MAX)]
        {
            let error = JointBox::new(vec![(0.0, 1.0), (lower, upper)]).expect_err("no range");
            assert_eq!(error.joint, 1);
            let said = error.to_string();
            assert!(said.contains(&format!("{lower} and {upper}")) && said.contains("joint 1"), "{said}");
        }
        assert_eq!(joint_box(&[]).dimension(), 0);
    }

    #[test]
    fn a_joint_that_does_not_move_divides_by_nothing() {
        let limits = joint_box(&[(0.7, 0.7), (-1.0, 1.0)]);
        assert_eq!(limits.to_unit(&[0.7, 0.0]), [0.0, 0.5]);
        assert_eq!(limits.from_unit(&[0.9, 0.5]), [0.7, 0.0]);
        assert!(limits.contains(&[0.7, 0.0]) && !limits.contains(&[0.71, 0.0]));
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let drawn = limits.draw(&mut rng);
        let alone = joint_box(&[(-1.0, 1.0)]).draw(&mut ChaCha8Rng::seed_from_u64(1));
        assert_eq!(drawn, [0.7, alone[0]], "the other joint's draw is its own");
    }

    #[test]
    fn what_is_not_a_configuration_is_outside() {
        let limits = joint_box(&[(-1.0, 1.0), (0.0, 2.0)]);
        assert!(limits.contains(&[-1.0, 2.0]), "the limits count");
        for wrong in [&[0.0][..], &[0.0; 3], &[f64::NAN, 1.0], &[0.0, f64::INFINITY], &[0.0, 2.000_001]] {
            assert!(!limits.contains(wrong), "{wrong:?}");
        }
        let slack = JointBox::ROUNDING;
        assert!(limits.is_within(1, 2.000_9, slack) && limits.is_within(1, -0.000_9, slack));
        assert!(!limits.is_within(1, 2.001_1, slack) && !limits.is_within(1, f64::NAN, slack));
        assert_eq!((limits.lower(1), limits.upper(1), limits.joints()[0]), (0.0, 2.0, (-1.0, 1.0)));
    }

    /// Joint boxes of up to eight joints, some of which do not move, with a point of the unit cube.
    fn cases() -> impl Strategy<Value = (JointBox, Vec<f64>)> {
        let width = prop_oneof![4 => 1e-3..10.0, 1 => Just(0.0)];
        vec((-10.0..10.0, width, 0.0..=1.0), 1..=8).prop_map(|joints| {
            let limits = joints.iter().map(|&(lower, width, _)| (lower, lower + width)).collect();
            (JointBox::new(limits).expect("limits in order"), joints.iter().map(|&(.., x)| x).collect())
        })
    }

    proptest! {
        #[test]
        fn the_maps_invert_each_other((limits, point) in cases()) {
            let configuration = limits.from_unit(&point);
            prop_assert!(limits.contains(&configuration));
            let back = limits.to_unit(&configuration);
            for ((x, found), (lower, upper)) in point.iter().zip(&back).zip(limits.joints()) {
                let wanted = if lower < upper { *x } else { 0.0 };
                // Positions up to 20 are rounded to 4e-15, over a range of at least 1e-3.
                prop_assert!((wanted - found).abs() < 1e-11, "{wanted} {found}");
                prop_assert!((0.0..=1.0).contains(found));
            }
        }

        #[test]
        fn corners_and_what_is_beyond_them_stay_in_the_box((limits, point) in cases()) {
            for corner in [-0.5, 0.0, 1.0, 1.5] {
                let configuration = limits.from_unit(&vec![corner; point.len()]);
                prop_assert!(limits.contains(&configuration));
                let side = |&(lower, upper): &(f64, f64)| if corner < 0.5 { lower } else { upper };
                for (position, limit) in configuration.iter().zip(limits.joints().iter().map(side)) {
                    prop_assert!((position - limit).abs() < 1e-14);
                }
            }
        }

        #[test]
        fn draws_are_contained((limits, _) in cases(), seed: u64) {
            prop_assert!(limits.contains(&limits.draw(&mut ChaCha8Rng::seed_from_u64(seed))));
        }
    }

    #[test]
    fn draws_are_uniform() {
        let limits = joint_box(&[(2.0, 6.0)]);
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut tenths = [0_u32; 10];
        for _ in 0..10_000 {
            tenths[((limits.draw(&mut rng)[0] - 2.0) / 0.4) as usize % 10] += 1;
        }
        // 1000 each, with a standard deviation of 30.
        assert!(tenths.iter().all(|count| count.abs_diff(1000) < 150), "{tenths:?}");
    }
}
