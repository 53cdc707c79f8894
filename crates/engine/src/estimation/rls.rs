//! Recursive least squares: an extended Kalman filter whose state does not move.
//!
//! The paper's equations, in minimal tangent coordinates (x becomes the chart's origin, + becomes a retraction):
//!
//! ```text
//! S = H P Hᵀ + I,   K = P Hᵀ S⁻¹                    (4)
//! x ← x ⊞ K (y − h(x, θ))                           (2)
//! P ← J [(I − K H) P (I − K H)ᵀ + K Kᵀ] Jᵀ          (3), J carries P to the chart at the new x
//! P ← P + σn² I                                     (5), on the steps that the schedule names
//! ```
//!
//! with H and y − h whitened, so that the paper's R is I.
//!
//! A filter linearises once. Where the belief is wide, h bends over it by more than the noise, and in the same way for all
//! points of one picture: the filter takes the bend for information, soon believes itself, and stays wrong. *Underweighting*
//! by β (Lear's; Zanetti, DeMars and Bishop 2010) takes a share of the predicted spread for noise that all equations have in common,
//!
//! ```text
//! R = I + β H P Hᵀ,   S = (1 + β) H P Hᵀ + I        in place of (4), and K R Kᵀ in place of K Kᵀ in (3)
//! ```
//!
//! so that no observation shrinks the spread of what it measures below a share β/(1 + β), and of what is well known (H P Hᵀ ≪ I) nothing
//! changes. β = 0 is the paper's filter.

use nalgebra::{DMatrix, DVector};

use super::{
    Belief, ChangeDetector, EstimationError, Estimator, Update,
    belief::{Revision, innovation_covariance, is_finite},
};
use crate::{model::Layout, sensing::Observation};

/// The stabilising noise of (5) and when it is added.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StabilisingNoise {
    /// σn², added to every tangent coordinate: m² for points, rad² for directions.
    pub variance: f64,
    /// The first movement after which it is added, counted from 1.
    pub first_step: u64,
    /// The number of movements between additions.
    pub every: u64,
}

impl StabilisingNoise {
    pub(super) fn is_due(&self, step: u64) -> bool {
        step >= self.first_step && (step - self.first_step).is_multiple_of(self.every.max(1))
    }
}

/// Recursive least squares after Martinez-Cantin, Lopes and Montesano 2010.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use body_schema_engine::{
///     estimation::{Belief, Estimator, Rls},
///     kinematics::{Joint, Line},
///     model::{Layout, State},
///     sensing::{Observation, MeasurementModel},
/// };
/// use nalgebra::{DMatrix, Point3, Vector3};
///
/// // Two parallel axes and a marker half a metre from the first, in the frame in which the marker is measured.
/// let axis = |x| Joint::Revolute(Line { point: Point3::new(x, 0.0, 0.0), direction: Vector3::z_axis() });
/// let marker = Point3::new(0.5, 0.0, 0.0);
/// let truth = State::arm(vec![axis(0.0), axis(0.31)], marker);
/// let guess = State::arm(vec![axis(0.02), axis(0.28)], marker);
///
/// // Both axes are learned, the marker is known; readings have σ = 1 mm, the guess 10 cm and 0.1 rad.
/// let layout = Layout::of_arm(&guess, &[true, true], false);
/// let covariance = DMatrix::from_diagonal_element(layout.dimension(), layout.dimension(), 0.01);
/// let belief = Belief::new(guess, layout.into(), MeasurementModel::tracker(0.001).into());
/// let mut rls = Rls::new(belief, covariance, None);
/// for step in 0..30 {
///     let positions = [0.1 * f64::from(step) - 1.5, 1.5 - 0.07 * f64::from(step)];
///     rls.update(&positions, &Observation::seen(truth.marker_at(&positions)))?;
/// }
/// let elbow = rls.belief().state.joints[1].line().expect("it turns");
/// assert!(elbow.distance_to(&Point3::new(0.31, 0.0, 0.0)) < 1e-3);
///
/// // An observation that does not fit this robot is refused, and changes nothing.
/// assert!(rls.update(&[0.0], &Observation::seen(marker)).is_err());
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct Rls {
    belief: Belief,
    covariance: DMatrix<f64>,
    stabilising: Option<StabilisingNoise>,
    underweighting: f64,
    step: u64,
    changes: ChangeDetector,
}

impl Rls {
    /// Starts from `belief`, with `covariance` as prior P₀.
    pub fn new(belief: Belief, covariance: DMatrix<f64>, stabilising: Option<StabilisingNoise>) -> Self {
        let belief = Belief { covariance: Some(covariance.clone()), ..belief };
        Self { belief, covariance, stabilising, underweighting: 0.0, step: 0, changes: ChangeDetector::relative() }
    }

    /// This filter with β = `share` ≥ 0: the share of the predicted spread that every update takes for noise.
    pub fn underweighting(self, share: f64) -> Self {
        Self { underweighting: share, ..self }
    }

    /// The update (2)–(4) by an observation, with the covariance before (5), and the normalised innovation squared;
    /// `None` if nothing was seen.
    fn corrected(&self, positions: &[f64], observation: &Observation) -> Result<Option<Revision>, EstimationError> {
        let (state, layout, p) = (&self.belief.state, &self.belief.layout, &self.covariance);
        let equations = self.belief.measurement_model.equations_of(state, layout, positions, observation);
        let innovation = &equations.residual;
        if innovation.is_empty() {
            return Ok(None);
        }
        let (mut s, numerator) = innovation_covariance(p, &equations.rows);
        let bend =
            (self.underweighting > 0.0).then(|| (&s - DMatrix::identity(s.nrows(), s.ncols())) * self.underweighting);
        if let Some(bend) = &bend {
            s += bend;
        }
        let s = s.cholesky().ok_or(EstimationError::Diverged("the innovation covariance is not positive"))?;
        let k = s.solve(&numerator.transpose()).transpose();
        let delta: DVector<f64> = &k * innovation;
        // Both factors of (3) are the identity but for as many rows as there are equations.
        let mut covariance = p.clone();
        covariance.gemm(-1.0, &k, &numerator.transpose(), 1.0);
        let mut outer = &k - &covariance * &equations.rows;
        if let Some(bend) = &bend {
            outer += &k * bend;
        }
        covariance.gemm(1.0, &outer, &k.transpose(), 1.0);
        carry(&mut covariance, &state.transport(layout, &delta), layout);
        let nis = innovation.dot(&s.solve(innovation));
        if !(is_finite(&delta, &covariance) && nis.is_finite()) {
            return Err(EstimationError::Diverged("an update was not a finite number"));
        }
        let state = state.retract(layout, &delta);
        Ok(Some(Revision { state, covariance, nis: (nis, innovation.len()) }))
    }
}

impl Estimator for Rls {
    fn boxed(&self) -> Box<dyn Estimator> {
        Box::new(self.clone())
    }

    fn belief(&self) -> &Belief {
        &self.belief
    }

    fn correct(&mut self, positions: &[f64], observation: &Observation) -> Result<Update, EstimationError> {
        let mut update = Update::default();
        if let Some(Revision { state, covariance, nis }) = self.corrected(positions, observation)? {
            self.belief.state = state;
            self.covariance = covariance;
            update = Update { nis: Some(nis), change_noticed: self.changes.observe(nis.0, nis.1) };
        }
        self.step += 1;
        if let Some(noise) = self.stabilising.filter(|noise| noise.is_due(self.step)) {
            for k in 0..self.covariance.nrows() {
                self.covariance[(k, k)] += noise.variance;
            }
        }
        symmetrise(&mut self.covariance);
        self.belief.covariance = Some(self.covariance.clone());
        Ok(update)
    }
}

/// P ← J P Jᵀ, J block diagonal.
fn carry(covariance: &mut DMatrix<f64>, transport: &DMatrix<f64>, layout: &Layout) {
    let m = covariance.nrows();
    for (_, range) in layout.blocks() {
        let (start, length) = (range.start, range.len());
        let block = transport.view((start, start), (length, length));
        let rows = block * covariance.rows(start, length);
        covariance.rows_mut(start, length).copy_from(&rows);
        let columns = covariance.columns(start, length) * block.transpose();
        covariance.view_mut((0, start), (m, length)).copy_from(&columns);
    }
}

/// Removes the rounding error that would let P drift from symmetry over thousands of updates.
fn symmetrise(matrix: &mut DMatrix<f64>) {
    for column in 0..matrix.ncols() {
        for row in 0..column {
            let mean = 0.5 * (matrix[(row, column)] + matrix[(column, row)]);
            matrix[(row, column)] = mean;
            matrix[(column, row)] = mean;
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::{Point3, Vector3};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::{
        model::{jacobian, random::random_arm},
        sensing::MeasurementModel,
    };

    const SIGMA: f64 = 1e-2;

    fn random_filter(seed: u64, stabilising: Option<StabilisingNoise>) -> (Rls, ChaCha8Rng) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let state = random_arm(&mut rng, 6);
        let layout = Arc::new(Layout::of_arm(&state, &[], true));
        let covariance = DMatrix::identity(layout.dimension(), layout.dimension()) * 0.2;
        let belief = Belief::new(state, layout, Arc::new(MeasurementModel::tracker(SIGMA)));
        (Rls::new(belief, covariance, stabilising), rng)
    }

    fn random_update(filter: &mut Rls, rng: &mut ChaCha8Rng) {
        let theta: Vec<f64> = (0..6).map(|_| rng.random_range(-1.5..1.5)).collect();
        // Half of the markers near the prediction, half anywhere: innovations small and absurd.
        let near = filter.belief().state.marker_at(&theta);
        let spread = if rng.random_range(0..2) == 0 { 0.01 } else { 1.0 };
        let measured = near + Vector3::from_fn(|_, _| rng.random_range(-spread..spread));
        let observation =
            if rng.random_range(0..10) == 0 { Observation::missed(1) } else { Observation::seen(measured) };
        filter.update(&theta, &observation).expect("a finite update");
    }

    #[test]
    fn covariance_stays_symmetric_and_positive_over_ten_thousand_updates() {
        let noise = StabilisingNoise { variance: 1e-6, first_step: 1, every: 3 };
        for (seed, stabilising, share) in [(1, None, 0.0), (2, Some(noise), 0.0), (3, None, 1.0)] {
            let (filter, mut rng) = random_filter(seed, stabilising);
            let mut filter = filter.underweighting(share);
            for step in 0..10_000 {
                random_update(&mut filter, &mut rng);
                if step % 100 == 99 {
                    let p = filter.belief().covariance.as_ref().expect("a covariance");
                    assert_eq!(p, &p.transpose(), "step {step}");
                    let least = p.clone().symmetric_eigenvalues().min();
                    assert!(least > 0.0, "step {step}: least eigenvalue {least}");
                }
            }
        }
    }

    #[test]
    fn agrees_with_the_information_form_on_a_small_step() {
        // One update with a measurement at the prediction moves nothing, and P⁻¹ grows by HᵀR⁻¹H.
        let (mut filter, _) = random_filter(3, None);
        let theta = [0.3, -0.5, 0.9, 0.1, -1.0, 0.4];
        let before = filter.belief().clone();
        let (predicted, h) = jacobian(&before.state, &before.layout, &theta);
        let update = filter.update(&theta, &Observation::seen(predicted)).expect("an update");
        let information = before.covariance.expect("a covariance").try_inverse().expect("positive")
            + h.transpose() * &h / SIGMA.powi(2);
        let expected = information.try_inverse().expect("positive");
        assert!((filter.belief().covariance.as_ref().expect("a covariance") - expected).amax() < 1e-9);
        let moved = before.state.local(&before.layout, &filter.belief().state).expect("in the chart");
        assert!(moved.amax() < 1e-12);
        assert!(update.nis.is_some_and(|(nis, dof)| nis.abs() < 1e-12 && dof == 3));
    }

    #[test]
    fn an_underweighted_update_leaves_its_share_of_the_spread() {
        // From R = I + β H P Hᵀ by the textbook: P⁻¹ grows by Hᵀ R⁻¹ H, and H P Hᵀ keeps at least β/(1 + β) of itself.
        let theta = [0.3, -0.5, 0.9, 0.1, -1.0, 0.4];
        for share in [0.0, 0.2, 1.0, 7.0] {
            let (filter, _) = random_filter(6, None);
            let mut filter = filter.underweighting(share);
            let before = filter.belief().clone();
            let p = before.covariance.clone().expect("a covariance");
            let (predicted, h) = jacobian(&before.state, &before.layout, &theta);
            filter.update(&theta, &Observation::seen(predicted)).expect("an update");
            let after = filter.belief().covariance.clone().expect("a covariance");
            let spread = &h * &p * h.transpose();
            let noise = DMatrix::identity(3, 3) * SIGMA.powi(2) + spread * share;
            let information =
                p.try_inverse().expect("positive") + h.transpose() * noise.try_inverse().expect("positive") * &h;
            assert!((&after - information.try_inverse().expect("positive")).amax() < 1e-9, "β = {share}");
            let kept = (&h * &after * h.transpose()) - spread * (share / (1.0 + share));
            assert!(kept.symmetric_eigenvalues().min() > 0.0, "β = {share}");
        }
    }

    #[test]
    fn underweighting_changes_nothing_of_what_is_known_well() {
        let (plain, mut rng) = random_filter(7, None);
        let covariance = plain.covariance.clone() * 1e-8;
        let belief = plain.belief().clone();
        let mut plain = Rls::new(belief.clone(), covariance.clone(), None);
        let mut careful = Rls::new(belief, covariance, None).underweighting(1.0);
        random_update(&mut plain, &mut rng.clone());
        random_update(&mut careful, &mut rng);
        let moved = plain.belief().state.local(&plain.belief().layout, &careful.belief().state).expect("in the chart");
        assert!(moved.amax() < 1e-6, "{moved}");
        let (one, other) = (&plain.covariance, &careful.covariance);
        assert!((one - other).amax() < 1e-3 * one.amax());
    }

    #[test]
    fn a_miss_changes_no_estimate_and_counts_as_a_step() {
        let noise = StabilisingNoise { variance: 0.5, first_step: 2, every: 2 };
        let (mut filter, _) = random_filter(4, Some(noise));
        let before = filter.belief().clone();
        let trace = |filter: &Rls| filter.belief().covariance.as_ref().map_or(0.0, DMatrix::trace);
        let start = trace(&filter);
        filter.update(&[0.0; 6], &Observation::missed(1)).expect("an update");
        assert_eq!(filter.belief().state, before.state);
        assert_eq!(trace(&filter), start);
        filter.update(&[0.0; 6], &Observation::missed(1)).expect("an update");
        let added = 0.5 * before.layout.dimension() as f64;
        assert!((trace(&filter) - start - added).abs() < 1e-9);
    }

    #[test]
    fn a_measurement_that_is_no_number_is_refused_and_leaves_the_belief() {
        let (mut filter, _) = random_filter(5, None);
        let before = filter.belief().clone();
        let result = filter.update(&[0.1; 6], &Observation::seen(Point3::new(f64::NAN, 0.0, 0.0)));
        assert!(matches!(result, Err(EstimationError::Refused(_))));
        assert_eq!(filter.belief().state, before.state);
        assert_eq!(filter.belief().covariance, before.covariance);
    }
}
