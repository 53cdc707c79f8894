//! Errors of a calibration.

use body_schema_engine::{estimation::EstimationError, model::PriorError, selection::SelectionError};
use body_schema_robot::Unwritable;

/// Why a table cannot be calibrated by.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CalibrationError {
    /// The scenario has no table.
    #[error(
        "scenario `{scenario}` simulates its world: there is no table to calibrate by; add [measurements] in place of [sensor] and [initial_error]"
    )]
    Simulated {
        /// Its name.
        scenario: String,
    },
    /// Rows cannot be held out in this many folds.
    #[error("{rows} rows cannot be held out in {folds} folds; write a number of folds from 2 to the number of rows")]
    Folds {
        /// The number that was asked for.
        folds: usize,
        /// The number of rows.
        rows: usize,
    },
    /// All rows are one posture, so that none can be held out.
    #[error(
        "all {rows} rows are one posture, and its rows stay together: nothing can be held out; measure more postures"
    )]
    OnePosture {
        /// The number of rows.
        rows: usize,
    },
    /// This many rows cannot be chosen.
    #[error("{asked} rows cannot be chosen from {rows} training rows; write a number from 1 to that")]
    Active {
        /// The number that was asked for.
        asked: usize,
        /// The number of training rows.
        rows: usize,
    },
    /// No rows are held out to judge by.
    #[error(
        "chosen rows are judged by rows that are held out, and none are; hold some out by --folds K, or in the file"
    )]
    NothingHeldOut,
    /// There is no row to learn from.
    #[error("the table has no row to learn from; add rows, or hold fewer out")]
    NoRows,
    /// The prior is not a positive definite covariance.
    #[error("the prior cannot be used: {0}; correct [prior]")]
    Prior(#[from] PriorError),
    /// The search for what explains the rows failed.
    #[error("no fit explains the rows: {0}; look at the doubts about the table first")]
    Estimation(#[from] EstimationError),
    /// No row could be chosen.
    #[error("no row could be chosen: {0}")]
    Selection(#[from] SelectionError),
    /// The caller no longer waits.
    #[error("the caller no longer waits, so the calibration was given up; ask again")]
    GivenUp,
    /// What was learned does not fit into a URDF.
    #[error("what was learned cannot be written as a URDF: {0}")]
    Unwritable(#[from] Unwritable),
}

impl CalibrationError {
    /// Whether the error lies in the request rather than in carrying it out.
    pub fn is_bad_input(&self) -> bool {
        !matches!(self, Self::Estimation(_) | Self::Selection(_) | Self::GivenUp)
    }
}
