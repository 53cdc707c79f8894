//! The observability report, as JSON.

use serde::{Deserialize, Serialize};

use super::Indices;

/// What can be determined of a robot before anything is measured.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Observability {
    /// The scenario's name.
    pub scenario: String,
    /// One line about it.
    pub title: String,
    /// The version of this program.
    pub version: String,
    /// The parameters to be learned, and those that can be determined.
    pub parameters: ObservedParameters,
    /// Directions that can be determined, but of which the best postures tell little.
    pub weak: Vec<Weak>,
    /// N, the number of postures that were looked at.
    pub postures: usize,
    /// The criterion by which the best postures were chosen.
    pub criterion: String,
    /// O1 … O5 after N postures.
    pub indices: IndexTable,
    /// The standard deviation of every parameter before, and after N postures.
    pub deviations: Vec<Deviation>,
    /// The error of predictions over the workspace that is to be expected, by number of postures.
    pub errors: Vec<ErrorPoint>,
    /// How many postures the wanted accuracy takes.
    pub accuracy: Accuracy,
    /// The best postures, in the order in which they teach most.
    pub best: Vec<Posture>,
}

/// The parameters to be learned, and those that can be determined.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ObservedParameters {
    /// How many.
    pub learned: usize,
    /// The number of directions among them that some movement determines.
    pub rank: usize,
    /// The directions that no movement determines, in words.
    pub undetermined: Vec<String>,
}

/// A direction of which measurements tell little.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Weak {
    /// The deviation that is left after the best N postures, as a share of the prior's.
    pub left: f64,
    /// The direction, in words.
    pub said: String,
}

/// Indices of the best and of random postures.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct IndexTable {
    /// The indices of the best postures.
    pub best: Indices,
    /// The medians of the indices over random postures.
    pub random_median: Indices,
}

/// The standard deviation of a parameter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Deviation {
    /// The parameter's name.
    pub parameter: String,
    /// mm, deg or px; 1 for a ratio.
    pub unit: String,
    /// Before any measurement.
    pub prior: f64,
    /// After the best N postures.
    pub best: f64,
    /// After N random ones, the median.
    pub random_median: f64,
}

/// The expected error of predictions after so many postures.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ErrorPoint {
    /// The number of postures.
    pub postures: usize,
    /// The error after the best postures, millimetres.
    pub best_mm: f64,
    /// The median error after random postures, millimetres.
    pub random_median_mm: f64,
    /// The lower quartile of the error after random postures, millimetres.
    pub random_q25_mm: f64,
    /// The upper quartile of the error after random postures, millimetres.
    pub random_q75_mm: f64,
}

/// How many postures a wanted accuracy takes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Accuracy {
    /// The wanted accuracy, millimetres.
    pub wanted_mm: f64,
    /// The error that no number of postures makes smaller, millimetres.
    pub floor_mm: f64,
    /// The number of best postures that reach it; null if no number does.
    pub best_postures: Option<u64>,
    /// The number of random postures that reach it; null if no number does.
    pub random_postures: Option<u64>,
    /// A sentence that says how many postures are needed.
    pub said: String,
}

/// A posture to measure.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Posture {
    /// The joint positions, degrees; millimetres for sliding joints.
    pub joints: Vec<f64>,
    /// The socket that holds the target at this posture.
    pub socket: Option<String>,
}
