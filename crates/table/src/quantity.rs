//! What a column measures.

use body_schema_engine::kinematics::JointKind;

/// The quantity that a column measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// An angle, held in radians.
    Angle,
    /// A length, held in metres.
    Length,
    /// Pixels.
    Pixels,
    /// A number without a unit.
    Number,
}

impl Quantity {
    /// The quantity that a joint's readings measure.
    pub fn of(kind: JointKind) -> Self {
        match kind {
            JointKind::Revolute => Self::Angle,
            JointKind::Prismatic => Self::Length,
        }
    }

    pub(super) fn called(self) -> &'static str {
        match self {
            Self::Angle => "an angle",
            Self::Length => "a length",
            Self::Pixels => "a point in a picture",
            Self::Number => "a number without a unit",
        }
    }
}
