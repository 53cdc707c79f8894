//! A rigid motion as a matrix and a shift, and the twists by which a joint and its axis move what is behind them.
//!
//! A twist is written as the velocity of the point at the origin and the angular velocity: a point at x moves by
//! `linear + angular × x`.

use nalgebra::{Isometry3, Matrix3, Matrix3x2, Rotation3, Translation3, UnitQuaternion, Vector3};

use super::{Joint, Line};

/// A rigid motion as a matrix and a shift: `x ↦ R x + t`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// R.
    pub rotation: Matrix3<f64>,
    /// t, metres.
    pub translation: Vector3<f64>,
}

/// A velocity of a rigid body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Twist {
    /// Velocity of the point at the origin, metres per unit of what moves.
    pub linear: Vector3<f64>,
    /// Angular velocity, radians per unit.
    pub angular: Vector3<f64>,
}

impl Twist {
    /// The velocity of the point at x (metres).
    #[inline]
    pub fn at(&self, x: &Vector3<f64>) -> Vector3<f64> {
        self.linear + self.angular.cross(x)
    }
}

impl From<&Isometry3<f64>> for Motion {
    fn from(pose: &Isometry3<f64>) -> Self {
        Self { rotation: *pose.rotation.to_rotation_matrix().matrix(), translation: pose.translation.vector }
    }
}

impl Motion {
    /// R x + t.
    pub fn point(&self, x: &Vector3<f64>) -> Vector3<f64> {
        self.rotation * x + self.translation
    }

    /// This motion as a pose.
    pub fn pose(&self) -> Isometry3<f64> {
        let rotation = Rotation3::from_matrix_unchecked(self.rotation);
        Isometry3::from_parts(Translation3::from(self.translation), UnitQuaternion::from_rotation_matrix(&rotation))
    }

    /// The motion of the link behind a joint at position `theta` (rad or m), where `self` is the motion of the link
    /// before it.
    #[inline]
    pub fn behind(&self, joint: &Joint, theta: f64) -> Self {
        match joint {
            Joint::Revolute(Line { point, direction }) => {
                let rotation = self.rotation * Rotation3::from_axis_angle(direction, theta).matrix();
                Self { rotation, translation: self.point(&point.coords) - rotation * point.coords }
            }
            Joint::Prismatic(direction) => {
                let along = self.rotation * direction.into_inner();
                Self { rotation: self.rotation, translation: self.translation + along * theta }
            }
        }
    }

    /// `Ad ξ`: how the link behind a joint moves per unit of the joint's position, where `self` is the motion of the link
    /// before it.
    #[inline]
    pub fn joint_twist(&self, joint: &Joint) -> Twist {
        let along = self.rotation * joint.direction().into_inner();
        match joint {
            Joint::Revolute(line) => Twist { linear: self.point(&line.point.coords).cross(&along), angular: along },
            Joint::Prismatic(_) => Twist { linear: along, angular: Vector3::zeros() },
        }
    }

    /// The twists of the link `behind` a joint, one for each tangent coordinate of the joint's axis. `self` is the motion of the link
    /// before the joint, and `basis` that of the axis' chart. For an axis (v, w), with D = (R − R⁺)\[b₁ b₂\] = \[d₁ d₂\] and the pivot
    /// at q,
    ///
    /// ```text
    /// point        (d₁, 0), (d₂, 0)
    /// direction    (q × d₂, d₂), (−q × d₁, −d₁)       revolute
    ///              (θ R b₁, 0), (θ R b₂, 0)           prismatic
    /// ```
    #[inline]
    pub fn axis_twists(
        &self,
        joint: &Joint,
        theta: f64,
        basis: &Matrix3x2<f64>,
        behind: &Self,
        mut each: impl FnMut(usize, Twist),
    ) {
        let (nothing, columns) = (Vector3::zeros(), |of: &Matrix3x2<f64>| [0, 1].map(|k| of.column(k).into_owned()));
        match joint {
            Joint::Revolute(line) => {
                let pivot = self.point(&line.point.coords);
                let [d1, d2] = columns(&((self.rotation - behind.rotation) * basis));
                each(0, Twist { linear: d1, angular: nothing });
                each(1, Twist { linear: d2, angular: nothing });
                each(2, Twist { linear: pivot.cross(&d2), angular: d2 });
                each(3, Twist { linear: d1.cross(&pivot), angular: -d1 });
            }
            Joint::Prismatic(_) => {
                let shifted = columns(&(self.rotation * basis * theta));
                shifted.into_iter().enumerate().for_each(|(k, linear)| each(k, Twist { linear, angular: nothing }));
            }
        }
    }
}
