//! Calibration of a robot from a table of measurements.
//!
//! ```text
//! Scenario ─► Case ─► calibrate() ─► Calibration ─► files: calibrated.urdf, kinematics.yaml, readings.yaml, report.json
//!                                         └───────► report::markdown, report::html
//! ```
//!
//! * [`Case`]: the robot as it is described, its sensors, its prior, the rows.
//! * [`Fit`]: what explains some rows by some layout; all rows at once, robustly, with the noise unknown.
//! * [`Split`]: rows to learn from and rows to judge by.
//! * [`Extra`]: what axes cannot explain, kept where folds within the training rows say that it predicts better.
//! * [`ActivePoint`]: few rows that are chosen, beside random ones.
//! * [`begin`]: a first calibration file from a URDF and a table, with what was guessed.
//! * [`Certificate`]: what was found, with what it takes to find it again.
//! * [`Report`]: everything that was found, as JSON; `report` writes it for readers.
//!
//! # What is fitted
//!
//! The main result is the model that a URDF can hold: axes, and reading offsets where they are asked for, with base,
//! targets, cameras and sockets. *Before* is the chain as described, with base, targets, cameras and sockets fitted to the
//! same training rows: the best that is possible without touching the URDF. Beside both stands the extended model.
//!
//! # Where errors are taken
//!
//! An error is the distance between what was measured and what is predicted, reading by reading, on rows that were learned
//! from and on rows that were not. With folds every row is judged by the fold that holds it out, and the calibrated model
//! comes from all rows; otherwise it comes from the training rows alone.
//!
//! This module does no input or output.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod active;
mod asked;
mod beyond;
mod calibrate;
mod case;
mod certificate;
mod coverage;
mod design;
mod error;
mod extra;
mod extras;
mod facing;
mod figures;
mod files;
mod fit;
mod init;
#[cfg(test)]
mod laws;
mod learned;
mod loads;
mod misfit;
mod more_rows;
mod outcome;
mod progress;
mod span;
mod split;
mod standing;
mod undetermined;
mod verdict;

pub use active::{ActivePoint, ORDERS};
pub use calibrate::{Calibration, Options, calibrate};
pub use case::{Case, Row};
pub use certificate::{CERTIFICATE, Cell, Certificate, Data, Difference, Errors, Issue, Reach, hashes};
pub use coverage::Coverage;
pub use error::CalibrationError;
pub use extra::Extra;
pub use extras::Trial;
pub use figures::{Figures, Residual, Sensed, SocketDistance, Unit};
pub use files::File;
pub use fit::Fit;
pub use init::{
    Begun, Guess, InitError, Sources, Taken, begin, begin_coupled, carried, name_of, with_roles, with_units,
};
pub use outcome::*;
pub use progress::{Progress, Silent};
pub use split::Split;
pub use verdict::{Use, Verdict};
