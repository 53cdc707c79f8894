use body_schema_calibration::CalibrationError;
use body_schema_scenario::ScenarioError;
use body_schema_watch::WatchError;

/// Why later sightings cannot be held against a robot.
#[derive(Debug, thiserror::Error)]
pub enum SightingsError {
    /// Rows, or what was asked, are not as they must be; says how to mend it.
    #[error("{0}")]
    Refused(String),
    /// The calibration file is none for these rows.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// The robot cannot be calibrated.
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
    /// The calibrated robot cannot be watched.
    #[error(transparent)]
    Watch(#[from] WatchError),
}
