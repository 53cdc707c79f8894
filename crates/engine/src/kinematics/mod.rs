//! Joints as twists, and the coordinates of lines, directions and rotations.
//!
//! A chain of joints carries what is fixed to its last link from where it is at θ = 0 to
//!
//! ```text
//! e^{ξ₁θ₁} e^{ξ₂θ₂} … e^{ξₙθₙ}        (Murray, Li, Sastry 1994, eq. 3.3)
//! ```
//!
//! with one twist ξ per joint; where joints branch, those from the base to the link. All axes are expressed at θ = 0 in one frame.
//!
//! * [`Joint`], [`Line`]: one twist, revolute or prismatic, and its exponential.
//! * [`Tree`]: which joint carries which.
//! * [`Correction`]: from what a joint reads to where it is.
//! * [`Motion`], [`Twist`]: where a link is, and how it moves.
//! * `Kernel`: the one pass along the tree, at one posture or many, generic over plain numbers and lanes.
//! * [`JointBox`]: the limits of all joints, and the unit cube.
//! * [`chart`]: minimal coordinates of lines and directions (retraction, local coordinates, change of chart).
//! * [`rotation`]: exponential coordinates of rotations.
//!
//! Which parameters a whole robot has, and how they move its links, is [`model`](crate::model).

pub mod chart;
pub(crate) mod correction;
mod joint;
mod joint_box;
mod kernel;
mod motion;
mod numbers;
mod passed;
pub mod rotation;
mod tree;

pub use correction::Correction;
pub(crate) use correction::Term;
pub use joint::{Joint, JointKind, Line};
pub use joint_box::{JointBox, JointBoxError};
pub(crate) use kernel::{Kernel, Placed, Walk};
pub use motion::{Motion, Twist};
pub use numbers::{Numbers, Plain};
pub(crate) use passed::{Passed, Turned};
pub use tree::{Tree, TreeError};

#[cfg(test)]
mod laws;
