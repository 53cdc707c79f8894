//! Which column of a table turns which part of a robot, from readings and measured places alone.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod answer;
mod audit;
mod bodies;
mod chain;
mod choose;
mod data;
mod discovery;
mod equivalence;
mod fit;
mod isolated;
#[cfg(test)]
mod laws;
mod places;
mod robot;
pub mod simulated;
mod table;
mod turns;
mod urdf;

pub use answer::{Alternative, Answer, ColumnAnswer, JointAnswer, TargetAnswer, answer, joint_name};
pub use audit::{Kind, audit};
pub use chain::{Effort, is_misfit, movement, probabilities};
pub use choose::{Asked, Reason, next};
pub use data::{Column, Data, Reading, Row, Target};
pub use discovery::{Body, DiscoverError, Discovery, advance, discover};
pub use equivalence::{are_equivalent, commute};
pub use fit::{Fit, Noise, fit};
pub use robot::{Drive, Driven, Held, Robot, Shape};
pub use table::{ReadTable, read};
pub use urdf::{BASE, Sources, calibration, urdf};
