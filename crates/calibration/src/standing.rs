//! The calibration that stands: what later sightings are held against.

use super::{
    CalibrationError, Case, Fit, Split,
    calibrate::without,
    coverage::widening,
    extras::{FEWEST, FOLDS},
};

impl Case<'_> {
    /// The fit of what a URDF can hold to `rows`, and the factor w ≥ 1 of lengths by which rows that a fold of them holds out scatter
    /// more widely than the noise and the covariance say (see [`Coverage`](super::Coverage)): 1 with too few postures to tell.
    ///
    /// # Errors
    ///
    /// [`CalibrationError::NoRows`] without rows, [`CalibrationError::Prior`] or [`CalibrationError::Estimation`] if a fit fails.
    pub fn standing(&self, rows: &[usize]) -> Result<(Fit, f64), CalibrationError> {
        if rows.is_empty() {
            return Err(CalibrationError::NoRows);
        }
        let layout = self.writable();
        let nominal = self.nominal(rows)?;
        let fit = self.fit(&layout, rows, Some(nominal.state()))?;
        let judged = without(rows, &self.strays(&fit));
        if Split::numbered(&judged, &self.postures).1 < FEWEST {
            return Ok((fit, 1.0));
        }
        let (_, reaches) = self.inner(&layout, &Split::folds(&judged, FOLDS, &self.postures), fit.state())?;
        Ok((fit, widening(&reaches)))
    }
}
