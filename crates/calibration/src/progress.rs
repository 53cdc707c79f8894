//! The progress of a calibration.

use super::CalibrationError;

/// A receiver of progress, called from any thread.
pub trait Progress: Sync {
    /// A stage of `steps` steps begins.
    fn stage(&self, what: &str, steps: u64);

    /// One step is done.
    fn tick(&self);

    /// Whether the caller no longer waits; asked after each step.
    fn is_given_up(&self) -> bool {
        false
    }

    /// Marks one step as done, and checks that the caller still waits.
    ///
    /// # Errors
    ///
    /// [`CalibrationError::GivenUp`] if the caller no longer waits.
    fn advance(&self) -> Result<(), CalibrationError> {
        self.tick();
        if self.is_given_up() { Err(CalibrationError::GivenUp) } else { Ok(()) }
    }
}

/// Progress that is reported to nobody.
#[derive(Clone, Copy, Debug, Default)]
pub struct Silent;

impl Progress for Silent {
    fn stage(&self, _what: &str, _steps: u64) {}

    fn tick(&self) {}
}
