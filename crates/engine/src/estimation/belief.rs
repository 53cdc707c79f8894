//! An estimated state and its covariance.

use std::{borrow::Cow, sync::Arc};

use nalgebra::{DMatrix, DVector, Matrix3, Matrix3xX};

use crate::{
    kinematics::{Joint, chart},
    model::{Block, Layout, Links, State, Workspace, jacobian},
    sensing::{MeasurementModel, Observation, Refused},
};

/// A belief: an estimated state, and the covariance of its learned parameters in the chart at that state.
#[derive(Clone, Debug)]
pub struct Belief {
    /// The estimated state, the origin of the chart.
    pub state: State,
    /// Which parameters are learned, and their order in the covariance.
    pub layout: Arc<Layout>,
    /// The measurement model that the estimator assumes, whitened by the noise that it assumes. That may differ from
    /// the sensors' own.
    pub measurement_model: Arc<MeasurementModel>,
    /// P (m × m), symmetric and positive, in the products of the coordinates' units. `None` for an estimator that keeps
    /// none.
    pub covariance: Option<DMatrix<f64>>,
    /// Other states that explain what was seen, the likeliest first; empty if the estimator keeps one hypothesis.
    pub alternatives: Vec<Alternative>,
    /// The model error: how far predictions of the hand are off beyond what the covariance says, because no parameter explains
    /// it; root mean square, metres.
    pub model_error_m: f64,
}

/// A rival of the estimate: another mode of the posterior.
#[derive(Clone, Debug)]
pub struct Alternative {
    /// Its probability. The estimate's own is 1 minus the sum of all alternatives'.
    pub weight: f64,
    /// The state.
    pub state: State,
    /// The covariance, in the chart at the state.
    pub covariance: DMatrix<f64>,
}

impl Belief {
    /// A belief with one hypothesis and without a covariance.
    pub fn new(state: State, layout: Arc<Layout>, measurement_model: Arc<MeasurementModel>) -> Self {
        Self { state, layout, measurement_model, covariance: None, alternatives: Vec::new(), model_error_m: 0.0 }
    }

    /// This belief with a covariance.
    pub fn with_covariance(self, covariance: DMatrix<f64>) -> Self {
        Self { covariance: Some(covariance), ..self }
    }

    /// The probability of the estimate among its alternatives.
    pub fn weight(&self) -> f64 {
        1.0 - self.alternatives.iter().map(|alternative| alternative.weight).sum::<f64>()
    }

    /// Drops all but the `count` heaviest hypotheses, the estimate included, and shares out the others' weights among
    /// those that stay, in proportion.
    pub fn truncate(&mut self, count: usize) {
        let own = self.weight();
        self.alternatives.truncate(count.saturating_sub(1));
        let total = own + self.alternatives.iter().map(|alternative| alternative.weight).sum::<f64>();
        if total > 0.0 {
            self.alternatives.iter_mut().for_each(|alternative| alternative.weight /= total);
        }
    }

    /// This belief with the channels that read while a target is held in `socket`; unchanged if none is.
    pub fn held_in(&self, socket: Option<usize>) -> Cow<'_, Self> {
        match socket {
            None => Cow::Borrowed(self),
            Some(_) => {
                Cow::Owned(Self { measurement_model: Arc::new(self.measurement_model.held_in(socket)), ..self.clone() })
            }
        }
    }

    /// Checks that an observation after a movement to `positions` (rad or m) can be absorbed.
    ///
    /// # Errors
    ///
    /// [`Refused`] if it does not fit the measurement model (see [`Observation::check`]), if a channel's noise cannot be divided by, or, as
    /// [`Refused::Absurd`], if its distance from the prediction is not finite.
    pub fn accepts(&self, positions: &[f64], observation: &Observation) -> Result<(), Refused> {
        observation.check(&self.measurement_model, self.state.joints.len(), positions)?;
        self.measurement_model.check_noise()?;
        let squared = self.measurement_model.squared_error(Links::new(&self.state).at(positions), observation);
        if squared.is_finite() { Ok(()) } else { Err(Refused::Absurd) }
    }

    /// Normalised innovation squared `eᵀ S⁻¹ e`, `S = H P Hᵀ + I`, of an observation under the estimate, and its degrees
    /// of freedom, the equations seen; `None` without a covariance, without equations, and where it is no number.
    pub fn nis(&self, positions: &[f64], observation: &Observation) -> Option<(f64, usize)> {
        let covariance = self.covariance.as_ref()?;
        let equations = self.measurement_model.equations_of(&self.state, &self.layout, positions, observation);
        let d = equations.residual.len();
        if d == 0 {
            return None;
        }
        let (s, _) = innovation_covariance(covariance, &equations.rows);
        let nis = equations.residual.dot(&s.cholesky()?.solve(&equations.residual));
        nis.is_finite().then_some((nis, d))
    }

    /// The covariance of the predicted marker, `H P Hᵀ` (m²), without the measurement noise.
    pub fn marker_covariance(&self, positions: &[f64]) -> Option<Matrix3<f64>> {
        let covariance = self.covariance.as_ref()?;
        let (_, h) = jacobian(&self.state, &self.layout, positions);
        let spread = &h * covariance * h.transpose();
        Some(spread.fixed_view::<3, 3>(0, 0).into_owned())
    }

    /// The prediction error that the belief itself expects, metres: the mean over a workspace of √(tr(H P Hᵀ) + e²), with e the
    /// model error.
    pub fn expected_error_m(&self, workspace: &Workspace) -> Option<f64> {
        let variances = self.prediction_variances_m2(workspace)?;
        let floor = self.model_error_m * self.model_error_m;
        let sum: f64 = variances.iter().map(|variance| (variance + floor).sqrt()).sum();
        (!variances.is_empty()).then(|| sum / variances.len() as f64)
    }

    /// Whether, over a workspace, the model error makes predictions worse than the uncertainty of the parameters does.
    pub fn model_error_prevails(&self, workspace: &Workspace) -> bool {
        let floor = self.model_error_m * self.model_error_m;
        floor > 0.0
            && self
                .prediction_variances_m2(workspace)
                .is_some_and(|variances| variances.iter().sum::<f64>() < floor * variances.len() as f64)
    }

    /// tr(H P Hᵀ) at every configuration of a workspace, m².
    fn prediction_variances_m2(&self, workspace: &Workspace) -> Option<Vec<f64>> {
        let covariance = self.covariance.as_ref()?;
        let jacobian = workspace.jacobian(&self.state, &self.layout);
        let spread = &jacobian * covariance;
        let of = |index: usize| {
            let place = 3 * index..3 * index + 3;
            place.map(|row| spread.row(row).dot(&jacobian.row(row))).sum::<f64>().max(0.0)
        };
        Some((0..workspace.configurations.len()).map(of).collect())
    }

    /// The covariance (m², frame of the measurements) of the point of a joint's axis that lies `along` metres from the
    /// pivot. To first order that point moves by B (a + along · d), and with the base. Where the base is known it has
    /// rank 2, flat along the axis.
    pub fn point_covariance(&self, joint: usize, along: f64) -> Option<Matrix3<f64>> {
        let (points, directions) = (self.layout.point(joint)?, self.layout.direction(joint)?);
        let Joint::Revolute(line) = self.state.joints.get(joint)? else { return None };
        let basis = self.basis(joint)?;
        let mut h = self.base_columns(&(self.state.base * line.slid(along).point).coords, true);
        for k in 0..2 {
            h.set_column(points.start + k, &basis.column(k));
            h.set_column(directions.start + k, &(basis.column(k) * along));
        }
        self.spread(&h)
    }

    /// The covariance of a joint's axis direction (rad², frame of the measurements): rank 2, flat along the axis.
    pub fn direction_covariance(&self, joint: usize) -> Option<Matrix3<f64>> {
        let directions = self.layout.direction(joint)?;
        let axis = self.state.base.rotation * self.state.joints.get(joint)?.direction().into_inner();
        let basis = self.basis(joint)?;
        let mut h = self.base_columns(&axis, false);
        (0..2).for_each(|k| h.set_column(directions.start + k, &basis.column(k)));
        self.spread(&h)
    }

    /// The covariance of the marker p₀ (m², frame of the measurements), if it is learned.
    pub fn hand_marker_covariance(&self) -> Option<Matrix3<f64>> {
        let start = self.layout.marker()?.start;
        let mut h = self.base_columns(&(self.state.base * self.state.marker()).coords, true);
        let rotation = self.state.base.rotation.to_rotation_matrix();
        (0..3).for_each(|k| h.set_column(start + k, &rotation.matrix().column(k)));
        self.spread(&h)
    }

    /// The basis of a joint's chart, in the frame of the measurements.
    fn basis(&self, joint: usize) -> Option<nalgebra::Matrix3x2<f64>> {
        let rotation = self.state.base.rotation.to_rotation_matrix();
        Some(rotation.matrix() * chart::basis(&self.state.joints.get(joint)?.direction()))
    }

    /// The columns by which an unknown base moves a point (m), or turns a vector.
    fn base_columns(&self, x: &nalgebra::Vector3<f64>, is_point: bool) -> Matrix3xX<f64> {
        let mut h = Matrix3xX::zeros(self.layout.dimension());
        if let Some(range) = self.layout.block(Block::Base) {
            let arm = if is_point { x - self.state.base.translation.vector } else { *x };
            if is_point {
                h.fixed_view_mut::<3, 3>(0, range.start).fill_with_identity();
            }
            h.fixed_view_mut::<3, 3>(0, range.start + 3).copy_from(&-arm.cross_matrix());
        }
        h
    }

    fn spread(&self, h: &Matrix3xX<f64>) -> Option<Matrix3<f64>> {
        let spread = h * self.covariance.as_ref()? * h.transpose();
        Some(spread.fixed_view::<3, 3>(0, 0).into_owned())
    }
}

/// The result of a filter's update by an observation.
pub(super) struct Revision {
    /// The state after it.
    pub state: State,
    /// P, in the chart at that state.
    pub covariance: DMatrix<f64>,
    /// The normalised innovation squared and its degrees of freedom.
    pub nis: (f64, usize),
}

/// S = H P Hᵀ + I of whitened rows Hᵀ (m × d), and P Hᵀ.
pub(super) fn innovation_covariance(covariance: &DMatrix<f64>, rows: &DMatrix<f64>) -> (DMatrix<f64>, DMatrix<f64>) {
    let numerator = covariance * rows;
    let mut s = rows.tr_mul(&numerator);
    s = (&s + s.transpose()) * 0.5;
    (0..s.nrows()).for_each(|k| s[(k, k)] += 1.0);
    (s, numerator)
}

/// Whether all entries are finite.
pub(super) fn is_finite(vector: &DVector<f64>, matrix: &DMatrix<f64>) -> bool {
    vector.iter().chain(matrix.iter()).all(|x| x.is_finite())
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::model::random::{random_arm, random_state};

    fn random_belief(seed: u64) -> (Belief, DMatrix<f64>, ChaCha8Rng) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let state = random_state(&mut rng, 5);
        let blocks = (0..5).map(Block::Axis).chain([Block::Target(0)]);
        let layout = Layout::new(&state, blocks.chain((seed.is_multiple_of(2)).then_some(Block::Base)));
        let m = layout.dimension();
        let root = DMatrix::from_fn(m, m, |_, _| rng.random_range(-0.5..0.5));
        let covariance = &root * root.transpose();
        let belief = Belief::new(state, Arc::new(layout), Arc::new(MeasurementModel::tracker(1.0)));
        (belief.with_covariance(covariance.clone()), covariance, rng)
    }

    /// Covariances of a point away from the pivot, of a direction and of the marker, against differences of what the
    /// retracted state has there, with the base known and unknown.
    #[test]
    fn covariances_follow_the_state() {
        for seed in 0..20 {
            let (belief, covariance, mut rng) = random_belief(seed);
            let along = rng.random_range(-0.8..0.8);
            let m = belief.layout.dimension();
            let against = |of: &dyn Fn(&State) -> nalgebra::Vector3<f64>, found: Matrix3<f64>| {
                let moved = |k: usize, step: f64| {
                    let mut delta = DVector::zeros(m);
                    delta[k] = step;
                    of(&belief.state.retract(&belief.layout, &delta))
                };
                let columns: Vec<_> = (0..m).map(|k| (moved(k, 1e-6) - moved(k, -1e-6)) / 2e-6).collect();
                let derivative = Matrix3xX::from_columns(&columns);
                let expected = &derivative * &covariance * derivative.transpose();
                assert!((expected - found).amax() < 1e-6, "seed {seed}");
            };
            for index in 0..5 {
                let direction = |state: &State| state.base * state.joints[index].direction().into_inner();
                against(&direction, belief.direction_covariance(index).expect("kept"));
                if belief.state.joints[index].line().is_none() {
                    assert!(belief.point_covariance(index, along).is_none());
                    continue;
                }
                let point = |state: &State| {
                    let line = state.joints[index].line().expect("revolute");
                    (state.base * line.slid(along).point).coords
                };
                against(&point, belief.point_covariance(index, along).expect("a revolute joint"));
            }
            let marker = |state: &State| (state.base * state.marker()).coords;
            against(&marker, belief.hand_marker_covariance().expect("learned"));
        }
    }

    /// With sixteen equal hypotheses of which eight are looked at, the estimate counts an eighth.
    #[test]
    fn hypotheses_that_are_cut_off_count_for_nobody() {
        let state = random_arm(&mut ChaCha8Rng::seed_from_u64(1), 2);
        let layout = Arc::new(Layout::of_arm(&state, &[], false));
        let covariance = DMatrix::identity(layout.dimension(), layout.dimension());
        let rival = Alternative { weight: 1.0 / 16.0, state: state.clone(), covariance: covariance.clone() };
        let mut belief =
            Belief::new(state, layout, Arc::new(MeasurementModel::tracker(1.0))).with_covariance(covariance);
        belief.alternatives = vec![rival; 15];
        belief.truncate(8);
        assert_eq!(belief.alternatives.len(), 7);
        assert!((belief.weight() - 0.125).abs() < 1e-12, "{}", belief.weight());
    }
}
