//! Joints as twists, and the coordinates of lines, directions and rotations.
//!
//! A chain of joints carries what is fixed to its last link from where it is at θ = 0 to
//!
//! ```text
//! e^{ξ₁θ₁} e^{ξ₂θ₂} … e^{ξₙθₙ}        (Murray, Li, Sastry 1994, eq. 3.3)
//! ```
//!
//! with one twist ξ per joint. All axes are expressed at θ = 0 in one frame.
//!
//! * [`Joint`], [`Line`]: one twist, revolute or prismatic, and its exponential.
//! * [`JointBox`]: the limits of all joints, and the unit cube.
//! * [`chart`]: minimal coordinates of lines and directions (retraction, local coordinates, change of chart).
//! * [`rotation`]: exponential coordinates of rotations.
//!
//! Which parameters a whole robot has, and how they move its links, is [`model`](crate::model).

pub mod chart;
mod joint;
mod joint_box;
pub mod rotation;

pub use joint::{Joint, JointKind, Line};
pub use joint_box::{JointBox, JointBoxError};

#[cfg(test)]
mod laws;
