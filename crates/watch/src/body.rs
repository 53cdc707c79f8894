//! The calibrated robot, and what one sighting says of it and of its changes.

use std::sync::Arc;

use body_schema_engine::{
    estimation::Belief,
    kinematics::JointKind,
    model::{Layout, Names, State},
    sensing::{MeasurementModel, Observation},
};
use nalgebra::{DMatrix, DVector};

use super::{
    WatchError,
    suspect::{Change, changes, everything},
};

/// A calibrated robot: the estimate x̂ with its covariance P, and the measurement model with the noise that the calibration learned.
#[derive(Clone, Debug)]
pub struct Body {
    /// x̂.
    pub state: State,
    /// What was learned.
    pub learned: Arc<Layout>,
    /// P (m × m), in the chart at x̂.
    pub covariance: DMatrix<f64>,
    /// The sensors, whitened by the learned noise.
    pub measurement_model: Arc<MeasurementModel>,
    /// The names of everything.
    pub names: Names,
    /// w: the factor by which residuals on rows that were not learned from are larger than P and the noise make them. Both are
    /// widened by it.
    widened: f64,
    /// The layout of everything that may change.
    pub(crate) all: Layout,
    /// The places of what is learned among everything.
    places: Vec<usize>,
    pub(crate) changes: Vec<Change>,
}

/// What one sighting says: r = Hδ + G a + ε, ε ~ N(0, I).
#[derive(Clone, Debug)]
pub(crate) struct Linear {
    /// r (d), whitened.
    pub residual: DVector<f64>,
    /// Hᵀ of what is learned (m × d).
    pub body: DMatrix<f64>,
    /// Gᵀ of every change (k × d).
    pub changes: Vec<DMatrix<f64>>,
    /// Rows of the drift with the covariate; none without one.
    pub drift: DMatrix<f64>,
}

/// The prior deviation of the drift over one span of the covariate: of a zero that turns, of one that slides, and of what the whole
/// robot grows by.
const DRIFT_RAD: f64 = 0.0035;
const DRIFT_M: f64 = 5e-4;
const GROWTH_M: f64 = 1e-3;

impl Body {
    /// The robot as a belief has it; residuals are taken to be `widened` times as large as it says, 1 or more.
    ///
    /// # Errors
    ///
    /// [`WatchError::NoCovariance`] if the belief holds no covariance, [`WatchError::Noise`] if a sensor's noise cannot be divided by.
    pub fn new(belief: &Belief, names: Names, widened: f64) -> Result<Self, WatchError> {
        let covariance = belief.covariance.clone().ok_or(WatchError::NoCovariance)?;
        belief.measurement_model.check_noise()?;
        let all = everything(&belief.state, &belief.layout);
        let blocks = belief.layout.blocks().filter_map(|(block, _)| all.block(block));
        let widened = if widened.is_finite() { widened.max(1.0) } else { 1.0 };
        Ok(Self {
            state: belief.state.clone(),
            learned: belief.layout.clone(),
            covariance: covariance * (widened * widened),
            measurement_model: Arc::new(
                belief.measurement_model.scaled(&vec![widened; belief.measurement_model.noises().len()]),
            ),
            names,
            widened,
            changes: changes(&belief.state, &all),
            places: blocks.flatten().collect(),
            all,
        })
    }

    /// w, by which P and the noise were widened.
    pub fn widened(&self) -> f64 {
        self.widened
    }

    /// The number of what may drift with a covariate: every joint's zero, and three directions of growth.
    pub(crate) fn drifting(&self) -> usize {
        self.state.joints.len() + 3
    }

    /// The prior deviations of the drift, over one span of the covariate.
    pub(crate) fn drift_deviations(&self) -> DVector<f64> {
        let joints = self.state.joints.iter().map(|joint| match joint.kind() {
            JointKind::Revolute => DRIFT_RAD,
            JointKind::Prismatic => DRIFT_M,
        });
        DVector::from_iterator(self.drifting(), joints.chain([GROWTH_M; 3]))
    }

    /// The equations of a sighting; `spans` is how far the covariate is from its reference.
    pub(crate) fn linear(&self, positions: &[f64], observation: &Observation, spans: Option<f64>) -> Linear {
        let equations = self.measurement_model.equations_of(&self.state, &self.all, positions, observation);
        self.split(&equations.rows, equations.residual, spans)
    }

    /// The same of a movement with all readings, of which the residuals are not known.
    pub(crate) fn prospect(&self, positions: &[f64]) -> Linear {
        let measurement_model = self.measurement_model.held_in(None);
        let rows = measurement_model.jacobian(&self.state, &self.all, positions);
        let residual = DVector::zeros(rows.ncols());
        self.split(&rows, residual, None)
    }

    fn split(&self, rows: &DMatrix<f64>, residual: DVector<f64>, spans: Option<f64>) -> Linear {
        let changes: Vec<DMatrix<f64>> = self.changes.iter().map(|change| change.moves.tr_mul(rows)).collect();
        let drift = spans.map(|spans| {
            let mut drift = DMatrix::zeros(self.drifting(), residual.len());
            // Zeros come first among changes, joint by joint.
            for (joint, of) in changes.iter().take(self.state.joints.len()).enumerate() {
                drift.row_mut(joint).copy_from(&(of.row(0) * spans));
            }
            if let Some(base) = self.all.block(body_schema_engine::model::Block::Base) {
                let from = self.state.joints.len();
                (0..3).for_each(|k| drift.row_mut(from + k).copy_from(&(rows.row(base.start + k) * spans)));
            }
            drift
        });
        Linear {
            body: rows.select_rows(&self.places),
            drift: drift.unwrap_or_else(|| DMatrix::zeros(0, residual.len())),
            changes,
            residual,
        }
    }
}
