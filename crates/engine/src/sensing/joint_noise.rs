//! The noise of the joints' readings, such as a servo's play or an encoder's noise.
//!
//! The robot stands at q + e where its joints say q, with `e ~ N(0, Σ)`, Σ = diag(σ_j²), drawn anew at every posture. To first
//! order all readings of that posture are moved together,
//!
//! ```text
//! r = y ⊖ h(x, q) = H δ + J e + v,     J = ∂h/∂q,     v ~ N(0, I)        (whitened by the sensors' noise)
//! cov(J e + v) = I + J Σ Jᵀ = L Lᵀ
//! ```
//!
//! and H and r are whitened by L⁻¹. It is done one equation after the other, which is Cholesky's factor row by row and the Kalman
//! filter of e at once: an equation (h, j, r) that follows others is, with e ~ N(ê − B δ, V) given those,
//!
//! ```text
//! c = 1 + jᵀ V j,   h ← (h − Bᵀ j)/√c,   r ← (r − jᵀ ê)/√c,
//! k = V j/√c,   ê ← ê + k r,   B ← B + k hᵀ,   V ← V − k kᵀ
//! ```
//!
//! That costs n (n + m) for each of d equations, and no matrix is ever d × d. A reading of low weight, such as an outlier, also
//! counts less for e, and so spoils no other reading. J is taken at q, not at q + ê: what that leaves out is of the order of e²
//! times a length, 0.05 mm for 1 deg and 0.3 m.

use std::sync::Arc;

use nalgebra::{DMatrix, DMatrixView};

use crate::{
    elementary::ln,
    kinematics::{Joint, JointKind},
    model::{Block, Layout, State},
};

const USUAL_RAD: f64 = std::f64::consts::PI / 180.0;
const USUAL_M: f64 = 0.002;

/// The deviations of the joints' readings: independent, normal, drawn anew at every posture.
#[derive(Clone, Debug, PartialEq)]
pub struct JointNoise {
    /// σ_j, rad or m.
    sigmas: Vec<f64>,
    /// The layout of every joint's offset.
    layout: Arc<Layout>,
}

impl JointNoise {
    /// The noise of the joints of `state`, with one standard deviation each (rad or m); `None` where all are 0, so that
    /// joints are exact, or where they are not deviations of this robot's joints.
    pub fn new(state: &State, sigmas: Vec<f64>) -> Option<Self> {
        let are_deviations = sigmas.iter().all(|sigma| sigma.is_finite() && *sigma >= 0.0);
        if sigmas.len() != state.joints.len() || !are_deviations || sigmas.iter().all(|sigma| *sigma == 0.0) {
            return None;
        }
        let layout = Arc::new(Layout::new(state, (0..sigmas.len()).map(Block::Offset)));
        Some(Self { sigmas, layout })
    }

    /// The usual noise, assumed where none is stated and as the start of learning it: 1 deg, 2 mm. That is more than most
    /// joints have: with noise that is at first too wide no reading is taken for an outlier.
    pub fn usual(state: &State) -> Option<Self> {
        let usual = |joint: &Joint| match joint.kind() {
            JointKind::Revolute => USUAL_RAD,
            JointKind::Prismatic => USUAL_M,
        };
        Self::new(state, state.joints.iter().map(usual).collect())
    }

    /// σ_j, rad or m, one per joint.
    pub fn sigmas(&self) -> &[f64] {
        &self.sigmas
    }

    /// This noise multiplied by `factor`.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        Self { sigmas: self.sigmas.iter().map(|sigma| sigma * factor).collect(), layout: self.layout.clone() }
    }

    /// The layout of every joint's offset, in which J is computed.
    pub(crate) fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Turns derivatives by offsets (columns of n numbers) into derivatives by readings.
    pub(super) fn by_readings(&self, state: &State, positions: &[f64], rows: &mut [f64]) {
        let slopes = state.corrections.iter().zip(positions).map(|(correction, reading)| correction.slope(*reading));
        let slopes: Vec<f64> = slopes.collect();
        if slopes.iter().any(|slope| *slope != 1.0) {
            for row in rows.chunks_exact_mut(slopes.len().max(1)) {
                row.iter_mut().zip(&slopes).for_each(|(x, slope)| *x *= slope);
            }
        }
    }

    /// Whitens rows (d columns of m numbers; none if they are not wanted) and residuals (d numbers, or none) of one posture by
    /// L⁻¹; `by_joints` is J, d columns of n numbers.
    pub(crate) fn whiten(&self, by_joints: &[f64], rows: &mut [f64], residual: &mut [f64]) {
        let d = by_joints.len() / self.sigmas.len().max(1);
        JointErrors::new(&self.sigmas, rows.len() / d.max(1)).whiten(by_joints, rows, residual);
    }

    /// L of `I + J Σ Jᵀ`, lower triangular (d × d).
    pub(crate) fn factor(&self, by_joints: &[f64]) -> DMatrix<f64> {
        let n = self.sigmas.len();
        let d = by_joints.len() / n.max(1);
        let mut rows = DMatrixView::from_slice(by_joints, n, d).into_owned();
        for (mut row, sigma) in rows.row_iter_mut().zip(&self.sigmas) {
            row *= *sigma;
        }
        let covariance = rows.tr_mul(&rows) + DMatrix::identity(d, d);
        // It is the identity and a square: positive, but for numbers that are none.
        covariance.cholesky().map_or_else(|| DMatrix::from_element(d, d, f64::NAN), |root| root.unpack())
    }
}

/// The estimate of the errors of one posture's joints: e ~ N(ê − B δ, V), for m coordinates δ.
#[derive(Clone, Debug)]
pub(crate) struct JointErrors {
    m: usize,
    /// ê.
    mean: Vec<f64>,
    /// B: m numbers for each joint.
    slopes: Vec<f64>,
    /// V, n × n, symmetric.
    covariance: Vec<f64>,
    /// V j.
    gain: Vec<f64>,
}

impl JointErrors {
    /// The estimate before any reading.
    pub fn new(sigmas: &[f64], m: usize) -> Self {
        let n = sigmas.len();
        let mut covariance = vec![0.0; n * n];
        sigmas.iter().enumerate().for_each(|(joint, sigma)| covariance[joint * (n + 1)] = sigma * sigma);
        Self { m, mean: vec![0.0; n], slopes: vec![0.0; n * m], covariance, gain: vec![0.0; n] }
    }

    /// Whitens the equations of a reading given those before it, as [`JointNoise::whiten`], learns of the errors by it, and
    /// returns ln det of its covariance.
    pub fn whiten(&mut self, by_joints: &[f64], rows: &mut [f64], residual: &mut [f64]) -> f64 {
        let (n, m) = (self.mean.len(), self.m);
        let mut log_determinant = 0.0;
        for (index, j) in by_joints.chunks_exact(n.max(1)).enumerate() {
            let c = 1.0 + self.spread(j);
            let weight = c.sqrt().recip();
            let row: &mut [f64] = if m > 0 { &mut rows[index * m..(index + 1) * m] } else { &mut [] };
            self.innovate(j, row);
            row.iter_mut().for_each(|x| *x *= weight);
            let mut found = 0.0;
            if let Some(residual) = residual.get_mut(index) {
                *residual = (*residual - dot(j, &self.mean)) * weight;
                found = *residual;
            }
            self.learn(weight, row, found);
            log_determinant += ln(c);
        }
        log_determinant
    }

    /// Learns of the errors by the equations of a reading that count `weight` times, without whitening them.
    pub fn weigh(&mut self, weight: f64, by_joints: &[f64], rows: &[f64], residual: &[f64]) {
        // What counts for next to nothing says nothing.
        if weight < 1e-12 {
            return;
        }
        let (n, m) = (self.mean.len(), self.m);
        for (index, j) in by_joints.chunks_exact(n.max(1)).enumerate() {
            let root = (weight.recip() + self.spread(j)).sqrt().recip();
            let mut row = rows[index * m..(index + 1) * m].to_vec();
            self.innovate(j, &mut row);
            row.iter_mut().for_each(|x| *x *= root);
            let found = (residual[index] - dot(j, &self.mean)) * root;
            self.learn(root, &row, found);
        }
    }

    /// jᵀ V j; V j stays in `gain`.
    fn spread(&mut self, j: &[f64]) -> f64 {
        let columns = self.covariance.chunks_exact(j.len().max(1));
        self.gain.iter_mut().zip(columns).for_each(|(gain, column)| *gain = dot(column, j));
        // Below 0 by rounding alone.
        dot(&self.gain, j).max(0.0)
    }

    /// h − Bᵀ j.
    fn innovate(&self, j: &[f64], row: &mut [f64]) {
        if row.is_empty() {
            return;
        }
        for (j, slopes) in j.iter().zip(self.slopes.chunks_exact(self.m)).filter(|(j, _)| **j != 0.0) {
            row.iter_mut().zip(slopes).for_each(|(x, slope)| *x -= j * slope);
        }
    }

    /// Updates the estimate by an equation whose variance is c = 1/`root`², given V j.
    fn learn(&mut self, root: f64, row: &[f64], residual: f64) {
        let n = self.gain.len();
        self.gain.iter_mut().for_each(|gain| *gain *= root);
        for (joint, gain) in self.gain.iter().enumerate().filter(|(_, gain)| **gain != 0.0) {
            self.mean[joint] += gain * residual;
            let slopes = &mut self.slopes[joint * self.m..(joint + 1) * self.m];
            slopes.iter_mut().zip(row).for_each(|(slope, x)| *slope += gain * x);
            let column = &mut self.covariance[joint * n..(joint + 1) * n];
            column.iter_mut().zip(&self.gain).for_each(|(v, other)| *v -= gain * other);
        }
    }

    /// ê, rad or m.
    pub fn mean(&self) -> &[f64] {
        &self.mean
    }

    /// B of a joint (m numbers).
    pub fn slopes(&self, joint: usize) -> &[f64] {
        &self.slopes[joint * self.m..(joint + 1) * self.m]
    }

    /// An entry of V.
    pub fn covariance(&self, row: usize, column: usize) -> f64 {
        self.covariance[row * self.mean.len() + column]
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use nalgebra::DVector;
    use proptest::prelude::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    use super::*;
    use crate::{
        model::{Links, random::random_stiff_state},
        sensing::{MeasurementModel, Observation, examples},
    };

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]

        /// Of every channel at once: J is that of central differences, and what is whitened by it is what the matrix
        /// I + J Σ Jᵀ says, whichever readings are missing.
        #[test]
        fn readings_are_whitened_by_the_whole_matrix(seed: u64, joints in 1_usize..=7) {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let (state, blocks) = random_stiff_state(&mut rng, joints);
            let layout = Layout::new(&state, blocks);
            let sigmas: Vec<f64> =
                (0..joints).map(|joint| if joint == 1 { 0.0 } else { rng.random_range(1e-4..0.05) }).collect();
            let noise = JointNoise::new(&state, sigmas.clone()).expect("off");
            let apart = MeasurementModel::new(examples(&mut rng, &state));
            let measurement_model = apart.clone().with_joint_noise(Some(Arc::new(noise.clone())));
            let theta: Vec<f64> = (0..joints).map(|_| rng.random_range(-2.0..2.0)).collect();
            let readings = apart.sensors().iter().map(|sensor| {
                let mut reading = vec![0.0; sensor.equations()];
                let is_read = sensor.channel().predict(Links::new(&state).at(&theta), &mut reading) && rng.random_range(0..4) > 0;
                let v: Vec<f64> = (0..reading.len()).map(|_| rng.sample(StandardNormal)).collect();
                sensor.disturb(&mut reading, &v);
                is_read.then_some(reading)
            });
            let observation = Observation { readings: readings.collect() };
            // Derivatives where nothing is left.
            let exact = observation.readings.iter().zip(apart.sensors()).map(|(reading, sensor)| {
                let mut reading = reading.clone()?;
                sensor.channel().predict(Links::new(&state).at(&theta), &mut reading);
                Some(reading)
            });
            let exact = Observation { readings: exact.collect() };
            let (found, wanted) = (
                measurement_model.equations_of(&state, &layout, &theta, &observation),
                apart.equations_of(&state, &layout, &theta, &observation),
            );
            let d = wanted.residual.len();
            let rows = apart.joint_rows_of(&noise, &state, &theta, &observation);
            let j = DMatrix::from_column_slice(joints, d, &rows);
            for joint in 0..joints {
                let moved = |step: f64| {
                    let mut theta = theta.clone();
                    theta[joint] += step;
                    apart.residual(&state, &theta, &exact)
                };
                let slope = (moved(-1e-6) - moved(1e-6)) / 2e-6;
                let scale = 1.0 + j.amax();
                prop_assert!((slope - j.row(joint).transpose()).amax() < 1e-5 * scale, "joint {joint}");
            }
            let sigma = DMatrix::from_diagonal(&DVector::from_vec(sigmas).map(|sigma| sigma * sigma));
            let c = j.tr_mul(&(sigma * &j)) + DMatrix::identity(d, d);
            let inverse = c.clone().cholesky().expect("positive").inverse();
            // What rounding leaves grows with what is divided by.
            let slack = 1e-12 * c.amax().max(1e4);
            let information = &wanted.rows * &inverse * wanted.rows.transpose();
            let scale = 1.0 + (&wanted.rows * wanted.rows.transpose()).amax();
            prop_assert!((&found.rows * found.rows.transpose() - information).amax() < slack * scale);
            let pull = &wanted.rows * &inverse * &wanted.residual;
            prop_assert!((&found.rows * &found.residual - pull).amax() < slack * scale);
            let squared = wanted.residual.dot(&(&inverse * &wanted.residual));
            prop_assert!((found.residual.norm_squared() - squared).abs() < slack * (1.0 + wanted.residual.norm_squared()));
            prop_assert!((measurement_model.residual(&state, &theta, &observation) - &found.residual).amax() < 1e-6);
            let mut sum = 0.0;
            measurement_model.residuals(Links::new(&state).at(&theta), &observation, |_, it| sum += it.iter().map(|x| x * x).sum::<f64>());
            prop_assert!((sum - found.residual.norm_squared()).abs() < 1e-6 * (1.0 + sum));
            let factor = noise.factor(&rows);
            // Nothing is read now and then: the matrix is empty then.
            prop_assert!(d == 0 || (&factor * factor.transpose() - &c).amax() < 1e-9 * c.amax());
            let mut errors = JointErrors::new(noise.sigmas(), 0);
            let log = errors.whiten(&rows, &mut [], &mut []);
            prop_assert!(d == 0 || (log - 2.0 * factor.diagonal().map(f64::ln).sum()).abs() < 1e-6 * (1.0 + log.abs()));
        }
    }
}
