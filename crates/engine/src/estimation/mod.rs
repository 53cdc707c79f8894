//! Estimators of a robot's state, and what they believe.
//!
//! * [`Belief`]: the estimated state and its covariance in minimal tangent coordinates.
//! * [`Estimator`]: takes a movement and its observation, revises the belief.
//! * [`Rls`]: recursive least squares, (2)–(5) of the paper: an extended Kalman filter with a constant state.
//! * [`UnscentedRls`]: recursive least squares by the unscented transform, without linearisation.
//! * [`OverparameterisedRls`]: recursive least squares in the paper's over-parameterised coordinates, for comparison.
//! * [`Gradient`]: the stochastic gradient, the paper's baseline.
//! * [`Smoother`]: maximum a posteriori over all measurements, with several hypotheses.
//! * [`ChangeDetector`]: notices from the innovations that the body has changed.
//!
//! All of them read observations through a whitened [`MeasurementModel`](crate::sensing::MeasurementModel): R = I.

mod belief;
mod change;
mod gradient;
mod overparameterised_rls;
#[cfg(test)]
mod partial_laws;
mod rls;
mod smoother;
mod unscented;
mod warm_start;

pub use belief::{Alternative, Belief};
pub use change::ChangeDetector;
pub use gradient::Gradient;
pub use overparameterised_rls::OverparameterisedRls;
pub use rls::{Rls, StabilisingNoise};
pub use smoother::{HypothesisSettings, Smoother};
pub use unscented::UnscentedRls;
pub use warm_start::{Begin, WarmStart};

use crate::sensing::{Observation, Refused};

/// An estimator: it revises a belief after each movement.
pub trait Estimator: Send + Sync {
    /// A copy, on which an observation can be tried.
    fn boxed(&self) -> Box<dyn Estimator>;

    /// The present belief.
    fn belief(&self) -> &Belief;

    /// Absorbs what was observed after moving to `positions` (rad or m, one per joint), which the belief
    /// [accepts](Belief::accepts). An estimator that diverges keeps the belief that it had.
    ///
    /// # Errors
    ///
    /// [`EstimationError::Diverged`] if the update leaves the range of numbers; [`EstimationError::Refused`] if the
    /// estimator cannot read the observation.
    fn correct(&mut self, positions: &[f64], observation: &Observation) -> Result<Update, EstimationError>;

    /// A report on every reading so far; empty for an estimator that does not weigh readings.
    fn readings(&self) -> Vec<ReadingReport> {
        Vec::new()
    }

    /// A report on the readings of the latest movement, the `movement`-th, without a look at those before.
    fn latest_readings(&self, movement: u64) -> Vec<ReadingReport> {
        self.readings().into_iter().filter(|reading| reading.movement == movement).collect()
    }

    /// The learned scales of noise, by kind of noise; empty for an estimator that learns none.
    fn noise(&self) -> Vec<NoiseReport> {
        Vec::new()
    }

    /// The misfit of the readings so far: what they show that the model and its noise do not allow. `None` while there is none,
    /// and for an estimator that does not look.
    fn misfit(&self) -> Option<Misfit> {
        None
    }

    /// The learned standard deviations of the joints' readings, one each, rad or m; empty if they are not learned.
    fn reading_sigmas(&self) -> Vec<f64> {
        Vec::new()
    }

    /// Everything learned so far, as bytes for [`restored`](Self::restored) in the same build; `None` for an estimator that
    /// learns it again as fast.
    fn stored(&self) -> Option<Vec<u8>> {
        None
    }

    /// An estimator like this one, which must have learned nothing yet, with what is [stored](Self::stored): from there on the
    /// two are equal to the last bit. `None` if that was stored by another kind of estimator.
    fn restored(&self, _stored: &[u8]) -> Option<Box<dyn Estimator>> {
        None
    }

    /// Checks an observation, then absorbs it as [`correct`](Self::correct) does: an observation that does not fit is
    /// refused, and changes nothing.
    ///
    /// # Errors
    ///
    /// [`EstimationError::Refused`] if the belief does not [accept](Belief::accepts) the observation; otherwise the errors
    /// of [`correct`](Self::correct).
    fn update(&mut self, positions: &[f64], observation: &Observation) -> Result<Update, EstimationError> {
        self.belief().accepts(positions, observation)?;
        self.correct(positions, observation)
    }
}

impl Clone for Box<dyn Estimator> {
    fn clone(&self) -> Self {
        (**self).boxed()
    }
}

/// What an estimator makes of one reading.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct ReadingReport {
    /// The movement, counted from 1; 0 for what was known before the first.
    pub movement: u64,
    /// The channel, counted from 0.
    pub channel: usize,
    /// The number of its equations.
    pub equations: usize,
    /// Its distance from what the belief predicts, in standard deviations of its noise.
    pub residual_sigmas: f64,
    /// The weight of its equations; 1 for least squares.
    pub weight: f64,
    /// The probability that it is an outlier; null for a loss without outliers.
    pub outlier_probability: Option<f64>,
}

/// A misfit: readings that the model does not explain as it should.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Misfit {
    /// The first movement that shows it, counted from 1.
    pub since: u64,
    /// The cause that explains it best.
    pub cause: MisfitCause,
}

/// The causes of a misfit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum MisfitCause {
    /// The body may have changed: what was measured since does not fit what was measured before.
    ChangedBody,
    /// More readings are outliers than expected.
    Outliers,
    /// No known cause: the model does not hold.
    Unexplained,
}

/// The learned scale of one kind of noise.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct NoiseReport {
    /// The channel, counted from 0.
    pub channel: usize,
    /// The first of the equations that have this noise.
    pub first: usize,
    /// Its standard deviation as a multiple of the nominal one.
    pub scale: f64,
}

/// How well readings with one kind of noise are fitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoiseFit {
    /// The channel, counted from 0.
    pub channel: usize,
    /// The first of the equations that have this noise.
    pub first: usize,
    /// Σ w ‖r‖² in nominal standard deviations: χ², outliers not counted.
    pub squared: f64,
    /// Σ w d: the number of equations.
    pub equations: f64,
    /// The number of them that the parameters absorb.
    pub absorbed: f64,
    /// The standard deviation that is assumed, as a multiple of the nominal one.
    pub scale: f64,
    /// The factor by which covariances are larger than these equations would make them if they were independent: 1, unless several targets
    /// of one link are measured with noise that is learned.
    pub shared: f64,
}

/// What an update found, measured before the belief changed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Update {
    /// Normalised innovation squared, `eᵀ S⁻¹ e` with `S = H P Hᵀ + I` of whitened equations, and its degrees of freedom,
    /// the equations seen; `None` for a miss and for an estimator without a covariance.
    pub nis: Option<(f64, usize)>,
    /// Whether the estimator noticed at this movement that the body has changed.
    pub change_noticed: bool,
}

/// Why an estimator could not absorb an observation. Its belief stays as it was.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum EstimationError {
    /// The observation does not fit this robot; the estimator goes on.
    #[error("the measurement was refused: {0}")]
    Refused(#[from] Refused),
    /// The update left the range of numbers; the estimator cannot go on.
    #[error("the estimate diverged: {0}")]
    Diverged(&'static str),
}
