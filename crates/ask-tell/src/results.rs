//! The results of a session: what `calibrate` makes of its observations.

use super::{Session, table::FILE};
use body_schema_calibration::{Calibration, CalibrationError, Case, File, Options, Progress, Silent, calibrate};
use body_schema_scenario::{Scenario, ScenarioError};

/// Why there are no results.
#[derive(Debug, thiserror::Error)]
pub enum ResultsError {
    /// Nothing was reported.
    #[error("nothing was observed yet; report observations first")]
    Nothing,
    /// Observations were reported, and none of them counts.
    #[error(
        "no observation counts: {excluded} of {all} are excluded, and no reading came with the others; include some again, or report \
         more"
    )]
    NoneCounts {
        /// How many were reported.
        all: usize,
        /// How many of them are excluded.
        excluded: usize,
    },
    /// The observations are no table that `calibrate` can read.
    #[error(transparent)]
    Table(#[from] ScenarioError),
    /// The calibration failed.
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
}

/// The calibration of a session's observations, all of them at once. It equals that of the table and the file that the
/// session writes, since they are its input.
///
/// It may differ from the agent's belief in the last digits, because the agent absorbed one observation after the other.
pub struct Results {
    scenario: Scenario,
}

impl Results {
    /// What was measured, as `calibrate` reads it.
    pub fn into_scenario(self) -> Scenario {
        self.scenario
    }
}

impl Session {
    /// The results of what was observed so far.
    ///
    /// # Errors
    ///
    /// [`ResultsError::Nothing`] if nothing was observed yet, [`ResultsError::NoneCounts`] if all observations are excluded or without
    /// a reading, [`ResultsError::Table`] if the observations make no table.
    pub fn results(&self) -> Result<Results, ResultsError> {
        let csv = self.observations_csv();
        if csv.lines().count() < 2 {
            return Err(match self.observations() {
                [] => ResultsError::Nothing,
                told => {
                    let excluded = told.iter().filter(|told| told.excluded).count();
                    ResultsError::NoneCounts { all: told.len(), excluded }
                }
            });
        }
        Ok(Results { scenario: self.recorded(&csv)? })
    }

    /// The scenario that `calibrate` makes of a table of observations, and of the file that goes with it.
    pub(super) fn recorded(&self, csv: &str) -> Result<Scenario, ScenarioError> {
        let open = |file: &str| if file == FILE { Ok(csv.to_owned()) } else { self.setup().open(file) };
        Scenario::parse("calibration.toml", &self.calibration_toml(), &open)
    }

    /// Calibrates, and returns everything that `calibrate` finds, its report and its files.
    ///
    /// # Errors
    ///
    /// The errors of [`results`](Self::results), and [`ResultsError::Calibration`] if no fit explains the observations, a
    /// URDF cannot hold the fit, or `progress` says that nobody waits any longer.
    pub fn calibrate(
        &self,
        options: &Options,
        progress: &dyn Progress,
    ) -> Result<(Calibration, Vec<File>), ResultsError> {
        self.results()?.calibrate(options, progress)
    }
}

impl Results {
    /// Everything that `calibrate` finds, its report and its files.
    ///
    /// # Errors
    ///
    /// [`ResultsError::Calibration`] if no fit explains the observations, a URDF cannot hold the fit, or `progress` says that nobody
    /// waits any longer.
    pub fn calibrate(
        &self,
        options: &Options,
        progress: &dyn Progress,
    ) -> Result<(Calibration, Vec<File>), ResultsError> {
        let calibration = self.judged(options, progress)?;
        let files = calibration.files(&self.case()?)?;
        Ok((calibration, files))
    }

    /// The calibration with its report alone, which also tells what is wrong where no URDF can hold what was found.
    ///
    /// # Errors
    ///
    /// [`ResultsError::Calibration`] if no fit explains the observations, or `progress` says that nobody waits any longer.
    pub fn judged(&self, options: &Options, progress: &dyn Progress) -> Result<Calibration, ResultsError> {
        Ok(calibrate(&self.case()?, options, progress)?)
    }

    /// The case that is calibrated.
    ///
    /// # Errors
    ///
    /// [`ResultsError::Calibration`] if the scenario has no table.
    pub fn case(&self) -> Result<Case<'_>, ResultsError> {
        Ok(Case::new(&self.scenario)?)
    }

    /// The robot's description with what was learned, `calibrated.urdf`, and the same origins as `kinematics.yaml`, without
    /// judging them and so in a fraction of the time.
    ///
    /// # Errors
    ///
    /// [`ResultsError::Calibration`] if no fit explains the observations, or a URDF cannot hold the fit.
    pub fn description(&self) -> Result<Vec<File>, ResultsError> {
        Ok(Calibration::description(&self.case()?, &Silent)?)
    }
}
