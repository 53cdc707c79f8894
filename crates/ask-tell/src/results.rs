//! What a session comes to: what `calibrate` makes of its observations.

use super::{Session, table::FILE};
use body_schema_calibration::{Calibration, CalibrationError, Case, File, Options, Progress, Silent, calibrate};
use body_schema_scenario::{Scenario, ScenarioError};

/// Why there are no results.
#[derive(Debug, thiserror::Error)]
pub enum ResultsError {
    /// Nothing was seen.
    #[error("nothing was observed yet; tell observations first")]
    Nothing,
    /// The observations are no table to calibrate by.
    #[error(transparent)]
    Table(#[from] ScenarioError),
    /// There is no calibration by them.
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
}

/// What `calibrate` makes of a session's observations, all of them at once: the same as of the table and the file that the
/// session writes, since they are what it reads.
///
/// It need not be what the agent believes, to the last digit: that took in one observation after the other.
pub struct Results {
    scenario: Scenario,
}

impl Session {
    /// The results of what was observed so far.
    ///
    /// # Errors
    ///
    /// [`ResultsError`] where nothing was observed yet.
    pub fn results(&self) -> Result<Results, ResultsError> {
        let csv = self.observations_csv();
        if csv.lines().count() < 2 {
            return Err(ResultsError::Nothing);
        }
        Ok(Results { scenario: self.recorded(&csv)? })
    }

    /// What `calibrate` makes of a table of observations, and of the file that goes with it.
    pub(super) fn recorded(&self, csv: &str) -> Result<Scenario, ScenarioError> {
        let open = |file: &str| if file == FILE { Ok(csv.to_owned()) } else { self.setup().open(file) };
        Scenario::parse("calibration.toml", &self.calibration_toml(), &open)
    }

    /// Everything that `calibrate` finds, its report and its files.
    ///
    /// # Errors
    ///
    /// [`ResultsError`] where nothing was observed yet, or nothing explains it.
    pub fn calibrate(&self, progress: &dyn Progress) -> Result<(Calibration, Vec<File>), ResultsError> {
        let results = self.results()?;
        let case = results.case()?;
        let calibration = calibrate(&case, &Options::default(), progress)?;
        let files = calibration.files(&case)?;
        Ok((calibration, files))
    }
}

impl Results {
    /// The case that is calibrated.
    ///
    /// # Errors
    ///
    /// [`ResultsError`] where there is none.
    pub fn case(&self) -> Result<Case<'_>, ResultsError> {
        Ok(Case::new(&self.scenario)?)
    }

    /// The robot's description with what was learned, `calibrated.urdf`, and the same origins as `kinematics.yaml`: without
    /// whatever judges them, in a fraction of the time.
    ///
    /// # Errors
    ///
    /// [`ResultsError`] where nothing explains the observations, or a URDF cannot hold what does.
    pub fn description(&self) -> Result<Vec<File>, ResultsError> {
        Ok(Calibration::description(&self.case()?, &Silent)?)
    }
}
