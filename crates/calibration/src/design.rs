//! The information of rows, from their postures alone.
//!
//! With H the whitened Jacobian of the rows and P₀ the prior, both around the description, P = (P₀⁻¹ + HᵀH)⁻¹ is what they leave, and
//! √(tr(J P Jᵀ)) what is expected of other postures with Jacobian J (criterion I of optimal design). Nothing that was measured
//! enters but the joints' readings, which put the target and the sockets where they are best explained by the description.

use std::sync::Arc;

use nalgebra::DMatrix;

use super::{CalibrationError, Case, Fit};
use body_schema_engine::{estimation::Belief, model::State, sensing::Observation};

impl Case<'_> {
    /// The belief about the described chain that `rows` would leave, from their postures alone.
    pub(super) fn designed(&self, rows: &[usize]) -> Result<Option<Fit>, CalibrationError> {
        let nominal = self.nominal(rows)?;
        Ok(self.stated(nominal.state(), rows).map(|belief| Fit { belief, rows: rows.to_vec(), ..nominal }))
    }

    /// The belief around a state that `rows` leave, with noise and prior as stated; `None` if that has no covariance.
    pub(super) fn stated(&self, state: &State, rows: &[usize]) -> Option<Belief> {
        let layout = self.writable();
        let before = match self.chain(&layout) {
            Some(chain) => chain.covariance(&chain.stated()),
            None => DMatrix::from_diagonal(&self.deviations(&layout).map(|sd| sd * sd)),
        };
        let mut information = before.cholesky()?.inverse();
        let mut tell = |positions: &[f64], observation: &Observation| {
            let told = self.measurement_model.equations_of(state, &layout, positions, observation).rows;
            information += &told * told.transpose();
        };
        rows.iter().map(|row| &self.rows[*row]).for_each(|row| tell(&row.positions, &row.observation));
        if let Some(known) = self.known {
            // Whatever the posture.
            tell(&vec![0.0; state.joints.len()], known);
        }
        let covariance = information.cholesky()?.inverse();
        Some(Belief::new(state.clone(), Arc::new(layout), self.measurement_model.clone()).with_covariance(covariance))
    }

    /// The expected scatter in held-out sockets, root mean square, millimetres, from the postures of the training rows alone.
    /// `None` where nothing is held out or the scatter cannot be computed.
    pub(super) fn scatter_mm(&self) -> Option<f64> {
        let split = self.splits(None).ok()?.into_iter().next()?;
        let (asked, fit) = (self.in_sockets(&split.held_out), self.designed(&split.training).ok()??);
        let jacobian = asked.jacobian(fit.state(), &fit.belief.layout);
        let squares = (&jacobian * fit.belief.covariance.as_ref()?).dot(&jacobian) / asked.configurations.len() as f64;
        Some(squares.max(0.0).sqrt() * 1e3).filter(|mm| mm.is_finite())
    }

    /// The standard deviation of a span of 1 m of the calibrated robot, millimetres, from the postures alone of the training rows, or of
    /// all.
    pub(super) fn size_mm(&self) -> Option<f64> {
        let splits = self.splits(None).ok()?;
        let rows = match splits.as_slice() {
            [split] => split.training.clone(),
            _ => (0..self.rows.len()).collect(),
        };
        self.span_sd_mm(&self.designed(&rows).ok()??)
    }
}
