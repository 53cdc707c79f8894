//! What is told of a robot before anything is measured, as JSON.

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
    /// What is to be learned, and what can be.
    pub parameters: ObservedParameters,
    /// Directions that can be told, and of which the best postures tell little.
    pub weak: Vec<Weak>,
    /// N, the postures that were looked at.
    pub postures: usize,
    /// By what the best ones were chosen.
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

/// What is to be learned, and what can be.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ObservedParameters {
    /// How many.
    pub learned: usize,
    /// Directions among them that some movements determine.
    pub rank: usize,
    /// What none does, in words.
    pub undetermined: Vec<String>,
}

/// A direction of which little is told.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Weak {
    /// What is left of its deviation after the best N postures, as a share of the prior's.
    pub left: f64,
    /// What it is, in words.
    pub said: String,
}

/// Indices of the best and of random postures.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct IndexTable {
    /// Of the best.
    pub best: Indices,
    /// Medians over random ones.
    pub random_median: Indices,
}

/// The standard deviation of a parameter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Deviation {
    /// What it is.
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
    /// How many.
    pub postures: usize,
    /// After the best, millimetres.
    pub best_mm: f64,
    /// After random ones, the median, millimetres.
    pub random_median_mm: f64,
    /// Their lower quartile.
    pub random_q25_mm: f64,
    /// Their upper quartile.
    pub random_q75_mm: f64,
}

/// How many postures a wanted accuracy takes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Accuracy {
    /// What is wanted, millimetres.
    pub wanted_mm: f64,
    /// What no number of postures makes smaller, millimetres.
    pub floor_mm: f64,
    /// Best postures that reach it; null where no number does.
    pub best_postures: Option<u64>,
    /// Random ones.
    pub random_postures: Option<u64>,
    /// The same in words.
    pub said: String,
}

/// A posture to measure.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Posture {
    /// By joint, degrees; of sliding joints millimetres.
    pub joints: Vec<f64>,
    /// The socket that holds the target then.
    pub socket: Option<String>,
}
