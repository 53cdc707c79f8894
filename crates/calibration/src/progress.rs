//! How far a calibration has come.

use super::CalibrationError;

/// Is told what is being done; from any thread.
pub trait Progress: Sync {
    /// So many steps of something begin.
    fn stage(&self, what: &str, steps: u64);

    /// One of them is done.
    fn tick(&self);

    /// Whether nobody waits for it any longer; this is asked after each step.
    fn is_given_up(&self) -> bool {
        false
    }

    /// One step is done, and the next is wanted.
    ///
    /// # Errors
    ///
    /// [`CalibrationError::GivenUp`] if it is not.
    fn advance(&self) -> Result<(), CalibrationError> {
        self.tick();
        if self.is_given_up() { Err(CalibrationError::GivenUp) } else { Ok(()) }
    }
}

/// Tells nobody.
#[derive(Clone, Copy, Debug, Default)]
pub struct Silent;

impl Progress for Silent {
    fn stage(&self, _what: &str, _steps: u64) {}

    fn tick(&self) {}
}
