//! Measurements that were marginalised into a quadratic: ½ (δ − δ̂)ᵀ Λ (δ − δ̂) in the chart at one state.

use nalgebra::{DMatrix, DVector};

use crate::model::{Layout, State};

/// Measurements as a quadratic in the chart at `state`.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub(super) struct Marginalised {
    pub state: State,
    /// The quadratics by kind of noise, in nominal σ.
    pub noises: Vec<Quadratic>,
    /// The readings' cost at δ = 0 beyond their weighted squares: that of outliers.
    pub excess: f64,
    /// The number of measurements.
    pub count: usize,
}

/// Σ w HᵀH and related sums of one kind of noise.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub(super) struct Quadratic {
    /// Λ, m × m.
    #[serde(with = "crate::as_numbers")]
    pub information: DMatrix<f64>,
    /// Λ δ̂.
    #[serde(with = "crate::as_numbers")]
    pub vector: DVector<f64>,
    /// ½ Σ w ‖r‖² at δ = 0.
    pub misfit: f64,
    /// Σ w d: the number of its equations, outliers not counted.
    pub equations: f64,
}

impl Quadratic {
    pub fn nothing(m: usize) -> Self {
        Self { information: DMatrix::zeros(m, m), vector: DVector::zeros(m), misfit: 0.0, equations: 0.0 }
    }

    pub fn add(&mut self, other: Self) {
        self.information += other.information;
        self.vector += other.vector;
        self.misfit += other.misfit;
        self.equations += other.equations;
    }

    pub fn misfit_at(&self, delta: &DVector<f64>) -> f64 {
        self.misfit + 0.5 * delta.dot(&(&self.information * delta)) - self.vector.dot(delta)
    }
}

impl Marginalised {
    /// The number of its equations, outliers not counted.
    pub fn equations(&self) -> f64 {
        self.noises.iter().map(|of| of.equations).sum()
    }

    /// The quadratics in the chart at `state`: their information there, their negative gradient and their misfit.
    ///
    /// A change of chart moves δ by `D = ∂ local(marginalised, retract(state, ε))/∂ε` at ε = 0. It is not the inverse of the
    /// transport at δ: a line is pinned, and its pivot in `state` need not be where a retraction from the marginalised state
    /// would leave it, so that turning it also shifts it.
    pub fn carried(&self, state: &State, layout: &Layout) -> Option<(Vec<Quadratic>, f64)> {
        let delta = self.state.local(layout, state)?;
        let change = self.state.change_of_chart(layout, state)?;
        let carry = |of: &Quadratic| {
            if of.equations == 0.0 {
                return Quadratic::nothing(delta.len());
            }
            Quadratic {
                information: change.transpose() * &of.information * &change,
                vector: change.transpose() * (&of.vector - &of.information * &delta),
                misfit: of.misfit_at(&delta),
                equations: of.equations,
            }
        };
        Some((self.noises.iter().map(carry).collect(), self.excess))
    }
}
