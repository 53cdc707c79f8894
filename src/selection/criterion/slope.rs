//! How the criterion changes with the posture, for all joints in one pass.
//!
//! With A = S⁻¹, G = H P and M the metric of the criterion (W, for criterion A), what a movement gains changes with its rows by
//!
//! ```text
//! ∂ tr(A G M Gᵀ)/∂H = 2 (A G M P − A (G M Gᵀ) A G),     ∂ ½ ln det S/∂H = A G
//! ```
//!
//! and the distance of two hypotheses, B = ⅛ δᵀ S̄⁻¹ δ with δ = hⱼ − hₖ and u = S̄⁻¹ δ, by
//!
//! ```text
//! ∂B/∂hⱼ = ¼ u,     ∂B/∂Hⱼ = −⅛ u uᵀ Gⱼ
//! ```
//!
//! with hⱼ, and likewise with hₖ. [`Posture`] carries these back to the joints.

use nalgebra::{DMatrix, DMatrixView, DVector};

use super::Criterion;
use crate::{lanes::times_few, model::Posture, selection::Optimality, sensing::Rig};

/// One posture under one hypothesis: what is predicted, and how a value changes with that.
pub(in crate::selection) struct Slope<'a> {
    posture: Posture<'a>,
    /// What seeing the movement gains.
    gain: f64,
    /// Gᵀ, m × d.
    gains: DMatrix<f64>,
    /// H P Hᵀ.
    spread: DMatrix<f64>,
    by_readings: DVector<f64>,
    /// m × d.
    by_rows: DMatrix<f64>,
}

impl Criterion<'_> {
    /// Whether [`slope`](Self::slope) tells derivatives: everything is seen, points are measured, and they are known.
    pub(in crate::selection) fn has_slope(&self) -> bool {
        self.points.is_some() && self.sees_all() && self.optimality != Optimality::E
    }

    /// Of −`weight` times what seeing the movement to a posture gains; `None` without [derivatives](Self::has_slope), or where the
    /// gain is no number.
    pub(in crate::selection) fn slope(&self, weight: f64, posture: &[f64]) -> Option<Slope<'_>> {
        let posture = self.points.as_ref().filter(|_| self.has_slope())?.at(posture);
        let (m, d) = (self.covariance.nrows(), posture.readings().len());
        let times =
            |rows: &[f64], by: &DMatrix<f64>| DMatrix::from_vec(m, d, times_few(self.level, rows, by.as_slice(), m));
        let gains = times(posture.rows(), self.covariance);
        let spread = DMatrixView::from_slice(posture.rows(), m, d).tr_mul(&gains);
        let cholesky = (&spread + DMatrix::identity(d, d)).cholesky()?;
        let inverse = cholesky.inverse();
        let weighed = match (self.optimality, &self.metric) {
            (Optimality::D, _) => None,
            (_, Some(metric)) => Some(times(gains.as_slice(), metric)),
            (_, None) => Some(self.weights.scale(&gains)),
        };
        let (gain, by_rows) = match weighed {
            Some(weighed) => {
                let leverage = &inverse * weighed.tr_mul(&gains);
                let by_rows = times(weighed.as_slice(), self.covariance) - &gains * &leverage;
                (leverage.trace(), by_rows * inverse * (-2.0 * weight))
            }
            None => (cholesky.ln_determinant() * 0.5, &gains * inverse * -weight),
        };
        gain.is_finite().then(|| Slope { posture, gain, gains, spread, by_readings: DVector::zeros(d), by_rows })
    }
}

impl Slope<'_> {
    /// What seeing the movement gains.
    pub fn gain(&self) -> f64 {
        self.gain
    }

    /// How far these hypotheses are told apart, 1 − e^{−B}; adds −`weight` times that to what both stand for.
    pub fn tell_apart(&mut self, other: &mut Self, rig: &Rig, weight: f64) -> f64 {
        let d = self.by_readings.len();
        let mut apart = DVector::zeros(d);
        rig.difference(self.posture.readings(), other.posture.readings(), apart.as_mut_slice());
        let mean = (&self.spread + &other.spread) * 0.5 + DMatrix::identity(d, d);
        let Some(cholesky) = mean.cholesky() else { return 0.0 };
        let u = cholesky.solve(&apart);
        let distance = 0.125 * apart.dot(&u);
        let weight = weight * (-distance).exp();
        for (of, sign) in [(self, 1.0), (other, -1.0)] {
            of.by_readings.axpy(-0.25 * sign * weight, &u, 1.0);
            let leaning = &of.gains * &u;
            of.by_rows.ger(0.125 * weight, &leaning, &u, 1.0);
        }
        -(-distance).exp_m1()
    }

    /// Adds the derivative by every joint's reading.
    pub fn add_to(&self, gradient: &mut [f64]) {
        self.posture.add_slope((self.by_readings.as_slice(), self.by_rows.as_slice()), gradient);
    }
}
