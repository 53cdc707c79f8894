//! What is found of a robot before anything is measured.

use nalgebra::DMatrix;

use super::{Indices, Needed};
use crate::{model::Block, selection::Movement};

/// What can be determined of a robot before anything is measured. Lengths are in metres, angles in radians; m is the number of
/// coordinates of the [`Layout`](crate::model::Layout).
#[derive(Clone, Debug, PartialEq)]
pub struct Observability {
    /// The number of directions among the m that some movement determines.
    pub rank: usize,
    /// An orthonormal basis of the directions that no movement determines, m × (m − rank), in tangent coordinates.
    pub undetermined: DMatrix<f64>,
    /// Directions that can be determined, but of which the best movements tell little.
    pub weak: Vec<Weak>,
    /// O1 … O5 after N movements.
    pub indices: IndexTable,
    /// The standard deviation of every coordinate before, and after N movements, in the order of the layout.
    pub deviations: Vec<Deviation>,
    /// The error of predictions over the workspace that is to be expected, by number of movements.
    pub errors: Vec<ErrorPoint>,
    /// How many movements the wanted accuracy takes.
    pub accuracy: Accuracy,
    /// The N best movements, in the order in which they teach most.
    pub best: Vec<Movement>,
}

/// A direction of which measurements tell little.
#[derive(Clone, Debug, PartialEq)]
pub struct Weak {
    /// The deviation that is left after the best N movements, as a share of the prior's.
    pub left: f64,
    /// The blocks that it lies in, the one with the greatest share of it first.
    pub blocks: Vec<Block>,
}

/// Indices of the best and of random movements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IndexTable {
    /// The indices of the best movements.
    pub best: Indices,
    /// The medians of the indices over random movements.
    pub random_median: Indices,
}

/// The standard deviation of a coordinate, in the unit of its [`Quantity`](crate::model::Quantity).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Deviation {
    /// Before any measurement.
    pub prior: f64,
    /// After the best N movements.
    pub best: f64,
    /// After N random ones, the median.
    pub random_median: f64,
}

/// The expected error of predictions after so many movements, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErrorPoint {
    /// After the best movements.
    pub best_m: f64,
    /// The median after random movements.
    pub random_median_m: f64,
    /// The lower quartile after random movements.
    pub random_q25_m: f64,
    /// The upper quartile after random movements.
    pub random_q75_m: f64,
}

/// How many movements a wanted accuracy takes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Accuracy {
    /// The wanted accuracy, metres.
    pub wanted_m: f64,
    /// The error that no number of movements makes smaller, metres.
    pub floor_m: f64,
    /// The number of best movements that reach it.
    pub best: Needed,
    /// The number of random movements that reach it.
    pub random: Needed,
}
