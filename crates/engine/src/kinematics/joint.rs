//! One joint: a twist of unit pitch-free motion, and its exponential.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, UnitVector3};
use serde::{Deserialize, Serialize};

/// A directed line in space: the axis of a revolute joint at θ = 0.
///
/// Any point of the axis describes the same line; the one written here is its *pivot*, the origin of the line's
/// chart (see [`chart`](super::chart)). Kinematics do not depend on it, covariances do.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Line {
    /// A point on the axis, metres, measurement frame.
    #[serde(with = "crate::as_numbers")]
    pub point: Point3<f64>,
    /// The direction about which a positive angle turns right-handedly; w and −w are different robots.
    #[serde(with = "crate::as_numbers")]
    pub direction: UnitVector3<f64>,
}

impl Line {
    /// Distance in metres from `point` to the line, `‖(I − wwᵀ)(q − v)‖`.
    pub fn distance_to(&self, point: &Point3<f64>) -> f64 {
        self.direction.cross(&(point - self.point)).norm()
    }

    /// This line written with its pivot moved by `length` metres along the axis.
    pub fn slid(&self, length: f64) -> Self {
        Self { point: self.point + self.direction.into_inner() * length, ..*self }
    }

    /// This line written with its pivot where it is nearest to `point`, metres.
    pub fn slid_towards(&self, point: &Point3<f64>) -> Self {
        self.slid(self.direction.dot(&(point - self.point)))
    }
}

/// Whether a joint turns or slides.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum JointKind {
    /// Turns about a line; position in radians.
    Revolute,
    /// Slides along a direction; position in metres.
    Prismatic,
}

/// A joint of a serial chain, described at θ = 0 in the measurement frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Joint {
    /// Turns about a line: `p ↦ e^{wθ}(p − v) + v`, θ in radians.
    Revolute(Line),
    /// Slides along a direction: `p ↦ p + θw`, θ in metres.
    Prismatic(#[serde(with = "crate::as_numbers")] UnitVector3<f64>),
}

impl Joint {
    /// Revolute or prismatic.
    pub fn kind(&self) -> JointKind {
        match self {
            Self::Revolute(_) => JointKind::Revolute,
            Self::Prismatic(_) => JointKind::Prismatic,
        }
    }

    /// The direction of the axis.
    pub fn direction(&self) -> UnitVector3<f64> {
        match self {
            Self::Revolute(line) => line.direction,
            Self::Prismatic(direction) => *direction,
        }
    }

    /// The line of a revolute joint; a prismatic joint has a direction only.
    pub fn line(&self) -> Option<&Line> {
        match self {
            Self::Revolute(line) => Some(line),
            Self::Prismatic(_) => None,
        }
    }

    /// The smallest motion that takes this axis to another.
    pub fn motion_to(&self, other: &Self) -> Isometry3<f64> {
        let rotation = UnitQuaternion::rotation_between_axis(&self.direction(), &other.direction()).unwrap_or_default();
        let (Some(from), Some(to)) = (self.line(), other.line()) else {
            return Isometry3::from_parts(Translation3::identity(), rotation);
        };
        let nearest = to.slid_towards(&from.point).point;
        Translation3::from(nearest - from.point) * Isometry3::rotation_wrt_point(rotation, from.point)
    }

    /// Number of minimal tangent coordinates: 4 for a line, 2 for a direction.
    pub fn degrees_of_freedom(&self) -> usize {
        match self {
            Self::Revolute(_) => 4,
            Self::Prismatic(_) => 2,
        }
    }

    /// The exponential e^{ξθ}, a rigid motion; `position` in radians (revolute) or metres (prismatic).
    pub fn exp(&self, position: f64) -> Isometry3<f64> {
        match self {
            Self::Revolute(line) => {
                let rotation = UnitQuaternion::from_axis_angle(&line.direction, position);
                Isometry3::rotation_wrt_point(rotation, line.point)
            }
            Self::Prismatic(direction) => {
                Isometry3::from_parts(Translation3::from(direction.into_inner() * position), UnitQuaternion::identity())
            }
        }
    }

    /// This joint written in another frame, into which `transform` carries the frame of `self`.
    pub fn transformed(&self, transform: &Isometry3<f64>) -> Self {
        let turn = |w: &UnitVector3<f64>| UnitVector3::new_normalize(transform * w.into_inner());
        match self {
            Self::Revolute(line) => {
                Self::Revolute(Line { point: transform * line.point, direction: turn(&line.direction) })
            }
            Self::Prismatic(direction) => Self::Prismatic(turn(direction)),
        }
    }
}
