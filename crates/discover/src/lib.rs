//! Which column of a table turns which part of a robot, from readings and measured places alone.
//!
//! No description is given: not which columns are joints, nor their order, kinds or axes. [`discover`] finds the structure that explains a table
//! of random postures, [`next`] says which movement would tell most, and [`answer`] says what was found and how sure that is.
//!
//! # The model
//!
//! A robot is a tree of joints. With qᵢ = Σ ratio (θ − θ₀) over the columns that drive joint i, a target of home pose M is at
//!
//! ```text
//! T(θ) = e^{ξ₁q₁} … e^{ξₙqₙ} M        (Murray, Li, Sastry 1994, eq. 3.3)
//! ```
//!
//! the product over the joints from the ground to it. Twists ξ are written at the middle θ₀ of the columns' ranges, in the frame of the
//! measurements.
//!
//! # The search, body by body
//!
//! 1. [`audit`]: columns that stand still, and those that repeat another.
//! 2. Markers whose distances do not change are one body; three of them give its pose.
//! 3. Structures come from four sources: columns that were moved alone, and then all orders of these axes; rotations alone, column by
//!    column in closed form (beam search); the neighbourhood of one posture, grown outwards; and, where no rotation is measured, a grid of
//!    directions. What slides comes out of the places, which are linear in everything but directions.
//! 4. Each is fitted (Levenberg–Marquardt, robust) and weighed by the Bayesian information criterion; neighbours of the best are tried until
//!    none is better: two joints swapped, one elsewhere, away, new, of the other kind, coupled to another column.
//! 5. Chains of several bodies share what they have in common at the ground.
//!
//! Probabilities are shares of the evidence of the structures that were tried. An answer is *sure* only if the robot explains the rows, has
//! three measured numbers or more for each unknown, and predicts rows that are held out about as well as the others.
//!
//! # Units and frames
//!
//! Metres, radians, the frame of the measurements. The crate does no input or output.
//!
//! ```
//! use body_schema_discover::{answer, discover, simulated::{Arm, Measured}};
//!
//! let mut arm = Arm::random(7, 3, true, Measured::Pose(0.005), 1e-3);
//! let mut data = arm.blank.clone();
//! for _ in 0..25 {
//!     let positions = arm.draw();
//!     data.rows.push(arm.measure(&positions));
//! }
//! let found = discover(&data)?;
//! assert!(arm.has_structure_of(&found.fit.robot) && answer(&data, &found).sure);
//! # Ok::<(), body_schema_discover::DiscoverError>(())
//! ```

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod answer;
mod audit;
mod beam;
mod bodies;
mod chain;
mod choose;
mod damped;
mod data;
mod discovery;
mod equivalence;
mod fit;
mod isolated;
mod jacobian;
#[cfg(test)]
mod laws;
mod median;
mod outwards;
mod places;
mod ranking;
mod robot;
pub mod simulated;
mod table;
mod trust;
mod turns;
mod urdf;

pub use answer::{Alternative, Answer, ColumnAnswer, JointAnswer, TargetAnswer, answer, joint_name};
pub use audit::{Kind, audit};
pub use chain::{Effort, is_misfit, movement};
pub use choose::{Asked, Reason, next};
pub use data::{Column, Data, Reading, Row, Target};
pub use discovery::{Body, DiscoverError, Discovery, advance, discover};
pub use equivalence::{are_equivalent, commute};
pub use fit::{Fit, Noise, fit};
pub use ranking::probabilities;
pub use robot::{Drive, Driven, Held, Robot, Shape};
pub use table::{ReadTable, read};
pub use urdf::{BASE, Sources, calibration, urdf};
