//! Serial chains as products of exponentials, and the coordinates in which they are estimated.
//!
//! A chain maps joint positions θ to the position of a marker on the hand,
//!
//! ```text
//! p(θ) = e^{ξ₁θ₁} e^{ξ₂θ₂} … e^{ξₙθₙ} p₀        (Murray, Li, Sastry 1994, eq. 3.3)
//! ```
//!
//! with one twist ξ per joint and the marker p₀ at θ = 0. All axes and points are expressed at θ = 0 in the frame in
//! which markers are measured, so no separate base transform is left to calibrate.
//!
//! * [`Joint`], [`Line`]: one twist, revolute or prismatic, and its exponential.
//! * [`Chain`]: forward kinematics.
//! * [`TangentLayout`]: which parameters are learned and where each stands in the tangent vector.
//! * [`JointBox`]: the limits of the joints, and the unit cube that stands for them.
//! * [`chart`]: minimal coordinates of lines and directions (retraction, local coordinates, change of chart).
//! * [`jacobian`]: the analytic derivative of the marker in those coordinates.
//! * [`registration`]: a chain carried into the frame of measurements by a rigid fit.

mod chain;
pub mod chart;
pub mod jacobian;
mod joint;
mod joint_box;
mod layout;
pub mod registration;

pub use chain::Chain;
pub use joint::{Joint, JointKind, Line};
pub use joint_box::{JointBox, JointBoxError};
pub use layout::{Quantity, TangentLayout};

#[cfg(test)]
pub(crate) mod laws;
