//! Estimators of a robot's state, and what they believe.
//!
//! * [`Belief`]: the estimated state and its covariance in minimal tangent coordinates.
//! * [`Estimator`]: takes a movement and its observation, revises the belief.
//! * [`Rls`]: recursive least squares, (2)–(5) of the paper: an extended Kalman filter with a constant state.
//! * [`UnscentedRls`]: the same by the unscented transform, without linearisation.
//! * [`SixNumbers`]: the same in the paper's over-parameterised coordinates, for comparison.
//! * [`Gradient`]: the stochastic gradient, the paper's baseline.
//! * [`Smoother`]: maximum a posteriori over all measurements, with several hypotheses.
//! * [`ChangeDetector`]: notices from the innovations that the body has changed.
//!
//! All of them read observations through a whitened [`Rig`](crate::sensing::Rig): R = I.

mod begun;
mod belief;
mod change;
mod gradient;
mod rls;
mod six_numbers;
mod smoother;
mod unscented;

pub use begun::{Begin, Begun};
pub use belief::{Alternative, Belief};
pub use change::ChangeDetector;
pub use gradient::Gradient;
pub use rls::{Rls, StabilisingNoise};
pub use six_numbers::SixNumbers;
pub use smoother::{HypothesisSettings, Smoother};
pub use unscented::UnscentedRls;

use crate::sensing::{Observation, Refused};

/// Revises a belief after each movement.
pub trait Estimator: Send + Sync {
    /// A copy, to try an observation on.
    fn boxed(&self) -> Box<dyn Estimator>;

    /// What is believed now.
    fn belief(&self) -> &Belief;

    /// Takes in what was observed after moving to `positions` (rad or m, one per joint), which
    /// the belief [accepts](Belief::accepts). An estimator that diverges keeps the belief that it had.
    fn correct(&mut self, positions: &[f64], observation: &Observation) -> Result<Update, EstimationError>;

    /// What it makes of every reading so far; empty for an estimator that weighs none.
    fn readings(&self) -> Vec<ReadingReport> {
        Vec::new()
    }

    /// What it makes of the readings of the latest movement, the `movement`-th; without a look at those before.
    fn latest_readings(&self, movement: u64) -> Vec<ReadingReport> {
        self.readings().into_iter().filter(|reading| reading.movement == movement).collect()
    }

    /// The scales of noise that it learns, by kind of noise; empty for an estimator that is told them all.
    fn noise(&self) -> Vec<NoiseReport> {
        Vec::new()
    }

    /// What the readings so far say that the model and its noise do not allow; `None` while all is well, and for an estimator that
    /// does not look.
    fn misfit(&self) -> Option<Misfit> {
        None
    }

    /// How far joints' readings are off, where it learns that: one standard deviation each, rad or m.
    fn reading_sigmas(&self) -> Vec<f64> {
        Vec::new()
    }

    /// All that it has learned, for [`restored`](Self::restored) of the same build; `None` for one that learns it again as fast.
    fn stored(&self) -> Option<Vec<u8>> {
        None
    }

    /// One like this, which has learned nothing yet, where it has learned what is [stored](Self::stored): from there on the two
    /// are the same to the last bit. `None` where that was stored of another.
    fn restored(&self, _stored: &[u8]) -> Option<Box<dyn Estimator>> {
        None
    }

    /// As [`correct`](Self::correct), for observations that nobody has looked at: what does not fit is refused, and
    /// nothing is changed by it.
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

/// What an estimator makes of one reading, by its belief.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct ReadingReport {
    /// The movement, counted from 1; 0 for what was known before the first.
    pub movement: u64,
    /// The channel, counted from 0.
    pub channel: usize,
    /// Its equations.
    pub equations: usize,
    /// How far it is from what the belief predicts, in standard deviations of its noise.
    pub residual_sigmas: f64,
    /// The weight of its equations; 1 for least squares.
    pub weight: f64,
    /// The probability that it is an outlier; null for a loss that knows of none.
    pub outlier_probability: Option<f64>,
}

/// That readings are not explained as they should be.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Misfit {
    /// The first movement that speaks of it, counted from 1.
    pub since: u64,
    /// What explains it best.
    pub cause: MisfitCause,
}

/// What explains a misfit best.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum MisfitCause {
    /// The body may have changed: what was measured since does not fit what was measured before.
    ChangedBody,
    /// More readings are outliers than are to be expected.
    Outliers,
    /// Nothing that is known of: the model does not hold.
    Unexplained,
}

/// The learned scale of one kind of noise.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct NoiseReport {
    /// The channel, counted from 0.
    pub channel: usize,
    /// The first of its equations that this noise is of.
    pub first: usize,
    /// Its standard deviation in nominal ones.
    pub scale: f64,
}

/// How well readings with one kind of noise are fitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoiseFit {
    /// The channel, counted from 0.
    pub channel: usize,
    /// The first of its equations that this noise is of.
    pub first: usize,
    /// Σ w ‖r‖² in nominal standard deviations: χ², outliers not counted.
    pub squared: f64,
    /// Σ w d: how many equations.
    pub equations: f64,
    /// How many of them the parameters account for.
    pub absorbed: f64,
    /// The standard deviation that is assumed, in nominal ones.
    pub scale: f64,
}

/// What an update found before it changed the belief.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Update {
    /// Normalised innovation squared, `eᵀ S⁻¹ e` with `S = H P Hᵀ + I` of whitened equations, and its degrees of freedom,
    /// the equations seen; `None` for a miss and for an estimator without a covariance.
    pub nis: Option<(f64, usize)>,
    /// Whether the estimator noticed at this movement that the body has changed.
    pub change_noticed: bool,
}

/// Why an estimator could not take in an observation. Its belief stays as it was.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum EstimationError {
    /// The observation is none of this robot's; the estimator goes on.
    #[error("the measurement was refused: {0}")]
    Refused(#[from] Refused),
    /// The update left the range of numbers; the estimator cannot go on.
    #[error("the estimate diverged: {0}")]
    Diverged(&'static str),
}
