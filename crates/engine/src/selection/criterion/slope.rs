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
//! with hⱼ, and likewise with hₖ. What multiplies G is summed first. [`Posture`] carries these back to the joints.

use nalgebra::{DMatrix, DMatrixView, DVector};

use super::Criterion;
use crate::{
    elementary::exp,
    model::Posture,
    selection::{
        Optimality,
        bhattacharyya::{bhattacharyya, share},
    },
    sensing::MeasurementModel,
    simd::times_few,
};

/// What one posture shows under one hypothesis.
pub(in crate::selection) struct Shown<'a> {
    posture: Posture<'a>,
    /// Gᵀ, m × d.
    gains: DMatrix<f64>,
    /// H P Hᵀ.
    spread: DMatrix<f64>,
}

/// The same, and how a value changes with that.
pub(in crate::selection) struct Slope<'a> {
    shown: Shown<'a>,
    /// What seeing the movement gains.
    gain: f64,
    by_readings: DVector<f64>,
    /// How the value changes with Hᵀ (m × d), but for Gᵀ times the next.
    by_rows: DMatrix<f64>,
    /// d × d.
    by_gains: DMatrix<f64>,
}

impl Criterion<'_> {
    /// What a posture shows; `None` where something else than points is measured, or something may stay unseen.
    pub(in crate::selection) fn shown(&self, posture: &[f64]) -> Option<Shown<'_>> {
        let posture = self.points.as_ref().filter(|_| self.sees_all())?.at(posture);
        let gains = self.times(posture.readings().len(), posture.rows(), self.covariance);
        let spread = DMatrixView::from_slice(posture.rows(), gains.nrows(), gains.ncols()).tr_mul(&gains);
        Some(Shown { posture, gains, spread })
    }

    /// A symmetric matrix times d columns.
    fn times(&self, d: usize, columns: &[f64], by: &DMatrix<f64>) -> DMatrix<f64> {
        DMatrix::from_vec(by.nrows(), d, times_few(self.level, columns, by.as_slice(), by.nrows()))
    }

    /// Whether [`slope`](Self::slope) tells derivatives: everything is seen, points are measured, and they are known.
    pub(in crate::selection) fn has_slope(&self) -> bool {
        self.points.is_some() && self.sees_all() && self.optimality != Optimality::E
    }

    /// Of −`weight` times what seeing the movement to a posture gains; `None` without [derivatives](Self::has_slope), or where the
    /// gain is no number.
    pub(in crate::selection) fn slope(&self, weight: f64, posture: &[f64]) -> Option<Slope<'_>> {
        if !self.has_slope() {
            return None;
        }
        let shown = self.shown(posture)?;
        let Shown { gains, spread, .. } = &shown;
        let (m, d) = gains.shape();
        let cholesky = (spread + DMatrix::identity(d, d)).cholesky()?;
        let inverse = cholesky.inverse();
        let weighed = match (self.optimality, &self.metric) {
            (Optimality::D, _) => None,
            (_, Some(metric)) => Some(self.times(d, gains.as_slice(), metric)),
            (_, None) => Some(self.weights.scale(gains)),
        };
        let (gain, by_rows, by_gains) = match weighed {
            Some(mut weighed) => {
                let leverage = &inverse * weighed.tr_mul(gains);
                let product = self.times(d, weighed.as_slice(), self.covariance);
                // In the same place: larger ones cost more to find than to fill.
                weighed.gemm(1.0, &product, &inverse, 0.0);
                weighed *= -2.0 * weight;
                (leverage.trace(), weighed, leverage * inverse * (2.0 * weight))
            }
            None => (cholesky.ln_determinant() * 0.5, DMatrix::zeros(m, d), inverse * -weight),
        };
        gain.is_finite().then(|| Slope { shown, gain, by_readings: DVector::zeros(d), by_rows, by_gains })
    }
}

impl Shown<'_> {
    /// Hᵀ, whitened, m × d.
    pub fn rows(&self) -> DMatrix<f64> {
        DMatrix::from_column_slice(self.gains.nrows(), self.gains.ncols(), self.posture.rows())
    }

    /// How far this and what another hypothesis predicts of the same posture are apart, B.
    pub fn distance(&self, other: &Self, measurement_model: &MeasurementModel) -> f64 {
        self.distance_with(other, measurement_model, |distance, _| distance).unwrap_or(0.0)
    }

    /// What is made of B, and of u.
    fn distance_with<T>(
        &self,
        other: &Self,
        measurement_model: &MeasurementModel,
        found: impl FnOnce(f64, &[f64]) -> T,
    ) -> Option<T> {
        let mean = |row: usize, column: usize| 0.5 * (self.spread[(row, column)] + other.spread[(row, column)]);
        bhattacharyya(measurement_model, [self.posture.readings(), other.posture.readings()], |_| 1.0, mean, found)
    }
}

impl Slope<'_> {
    /// What seeing the movement gains.
    pub fn gain(&self) -> f64 {
        self.gain
    }

    /// How far these hypotheses are told apart, 1 − e^{−B}; adds −`weight` times that to what both stand for.
    pub fn tell_apart(&mut self, other: &mut Self, measurement_model: &MeasurementModel, weight: f64) -> f64 {
        let found =
            self.shown.distance_with(&other.shown, measurement_model, |b, u| (b, DVector::from_column_slice(u)));
        let Some((distance, u)) = found else { return 0.0 };
        let weight = weight * exp(-distance);
        for (of, sign) in [(self, 1.0), (other, -1.0)] {
            of.by_readings.axpy(-0.25 * sign * weight, &u, 1.0);
            of.by_gains.ger(0.125 * weight, &u, &u, 1.0);
        }
        share(distance)
    }

    /// Adds the derivative by every joint's reading.
    pub fn add_to(&mut self, gradient: &mut [f64]) {
        let Self { shown, by_readings, by_rows, by_gains, .. } = self;
        let mut more = DVector::zeros(by_rows.nrows());
        for (mut column, by) in by_rows.column_iter_mut().zip(by_gains.column_iter()) {
            more.gemv(1.0, &shown.gains, &by, 0.0);
            column += &more;
        }
        shown.posture.add_slope((by_readings.as_slice(), by_rows.as_slice()), gradient);
    }
}
