//! Errors of a watch, and why a sighting is skipped.

use body_schema_engine::sensing::{Refused, UnusableNoise};

/// Why there is no watch.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum WatchError {
    /// The belief holds no covariance.
    #[error("the calibration has no covariance, so that nothing can be held against it; calibrate by the smoother")]
    NoCovariance,
    /// A sensor's noise cannot be divided by.
    #[error("nothing can be told from these sensors: {0}")]
    Noise(#[from] UnusableNoise),
    /// A setting is out of its range.
    #[error("{what} is {value}; write {wanted}")]
    Setting {
        /// What it is.
        what: &'static str,
        /// The value given.
        value: f64,
        /// What is wanted.
        wanted: &'static str,
    },
}

/// Why a sighting was skipped.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Skipped {
    /// It does not fit the sensors.
    #[error(transparent)]
    Refused(#[from] Refused),
    /// Nothing that the calibration knows was seen.
    #[error("nothing that was calibrated is seen in it")]
    Nothing,
    /// The covariate is missing.
    #[error("it has no value of the covariate")]
    NoCovariate,
    /// Its numbers cannot be computed with.
    #[error("its readings are too far from their prediction to compute with; check their units")]
    Absurd,
}
