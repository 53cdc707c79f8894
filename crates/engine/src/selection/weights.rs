//! What the criterion takes a metre, a radian and a pixel for.

use nalgebra::{DMatrix, DVector};

use crate::model::{GRAVITY, Layout, Quantity};

/// How the criterion compares metres with radians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CriterionUnits {
    /// One radian counts as this many metres: w = 1 for angles and ratios, 1/L² for lengths. The paper's implicit L is
    /// 1 m. Pixels count in units of their prior standard deviation.
    CharacteristicLength(f64),
    /// Every parameter in units of its prior standard deviation σ₀: w = 1/σ₀².
    Prior,
}

/// The diagonal of W, one weight per tangent coordinate.
#[derive(Clone, Debug, PartialEq)]
pub struct Weights(DVector<f64>);

impl Weights {
    /// The weights of `layout` in the given units; `prior_sd` holds the prior standard deviation of every coordinate.
    pub fn new(units: CriterionUnits, layout: &Layout, prior_sd: &DVector<f64>) -> Self {
        let weight = |(index, quantity): (usize, &Quantity)| match (units, quantity) {
            (CriterionUnits::Prior, _) | (_, Quantity::Pixels) => prior_sd[index].powi(-2),
            (CriterionUnits::CharacteristicLength(_), Quantity::Angle | Quantity::Ratio) => 1.0,
            (CriterionUnits::CharacteristicLength(length), Quantity::Length) => length.powi(-2),
            // As an angle, with 1 kg held out level by that length.
            (CriterionUnits::CharacteristicLength(length), Quantity::Compliance) => (GRAVITY * length).powi(2),
        };
        let quantities = layout.quantities();
        Self(DVector::from_iterator(quantities.len(), quantities.iter().enumerate().map(weight)))
    }

    /// The weight of one tangent coordinate.
    pub(crate) fn of(&self, coordinate: usize) -> f64 {
        self.0[coordinate]
    }

    /// All of them, in the order of the tangent coordinates.
    pub(super) fn all(&self) -> &[f64] {
        self.0.as_slice()
    }

    /// The square roots of all.
    pub(super) fn roots(&self) -> DVector<f64> {
        self.0.map(f64::sqrt)
    }

    /// tr(W P).
    ///
    /// # Panics
    ///
    /// In a build with debug assertions, if the covariance is of another number of coordinates than the weights.
    pub fn trace(&self, covariance: &DMatrix<f64>) -> f64 {
        debug_assert_eq!(self.0.len(), covariance.nrows(), "weights of another layout");
        self.0.iter().zip(covariance.diagonal().iter()).map(|(w, p)| w * p).sum()
    }

    /// tr(W X Xᵀ), for a matrix of m rows.
    pub(super) fn squares(&self, matrix: &DMatrix<f64>) -> f64 {
        matrix.column_iter().map(|column| self.0.iter().zip(column.iter()).map(|(w, x)| w * x * x).sum::<f64>()).sum()
    }

    /// W M, for a matrix of m rows.
    pub fn scale(&self, matrix: &DMatrix<f64>) -> DMatrix<f64> {
        let mut scaled = matrix.clone();
        scaled.column_iter_mut().for_each(|mut column| column.component_mul_assign(&self.0));
        scaled
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::model::random::random_arm;

    #[test]
    fn weights_follow_the_units() {
        let state = random_arm(&mut ChaCha8Rng::seed_from_u64(9), 5);
        let layout = Layout::of_arm(&state, &[], true);
        let sd = DVector::from_element(layout.dimension(), 0.5);
        assert!(Weights::new(CriterionUnits::Prior, &layout, &sd).0.iter().all(|w| *w == 4.0));
        let weights = Weights::new(CriterionUnits::CharacteristicLength(0.1), &layout, &sd);
        let marker = layout.marker().expect("learned");
        assert!((weights.0[marker.start] - 100.0).abs() < 1e-9);
        assert_eq!(weights.0[layout.direction(0).expect("learned").start], 1.0);
        let p = DMatrix::from_fn(layout.dimension(), layout.dimension(), |i, j| 1.0 / (1 + i + j) as f64);
        assert!((weights.scale(&p).trace() - weights.trace(&p)).abs() < 1e-12);
    }
}
