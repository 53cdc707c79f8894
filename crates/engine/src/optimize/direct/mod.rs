//! DIRECT and DIRECT-l; the parent module documents the algorithms.

mod batch;
mod classes;
mod history;
mod hull;
mod lineage;
mod minimize;
mod partition;
mod plane;
mod search;
mod settings;
mod ternary;

pub use batch::{Batch, CoordinatePerturbations};
pub use history::{History, Moment, Shape};
pub use hull::HullPoint;
pub use minimize::minimize;
pub use partition::{Division, Rectangle};
pub use plane::{Plane, Projection, contains};
pub use search::Direct;
pub use settings::{DirectError, Settings, Variant};
pub use ternary::MAX_LEVEL;
