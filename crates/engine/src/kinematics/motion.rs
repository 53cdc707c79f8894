//! A rigid motion as a matrix and a shift, and a velocity of a rigid body.
//!
//! A twist is written as the velocity of the point at the origin and the angular velocity: a point at x moves by
//! `linear + angular × x`.

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};

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
}
