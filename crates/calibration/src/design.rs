//! What rows would tell, by their postures alone.
//!
//! With H the whitened Jacobian of the rows and P₀ the prior, both around the description, P = (P₀⁻¹ + HᵀH)⁻¹ is what they leave, and
//! √(tr(J P Jᵀ)) what is expected of other postures with Jacobian J (criterion I of optimal design). Nothing that was measured
//! enters but the joints' readings, which put the target and the sockets where they are best explained by the description.

use std::sync::Arc;

use nalgebra::DMatrix;

use super::{CalibrationError, Case, Fit};
use body_schema_engine::{estimation::Belief, model::State, sensing::Observation};

impl Case<'_> {
    /// The belief that `rows` would leave of the chain as it is described, by their postures alone.
    pub(super) fn designed(&self, rows: &[usize]) -> Result<Option<Fit>, CalibrationError> {
        let nominal = self.nominal(rows)?;
        Ok(self.stated(nominal.state(), rows).map(|belief| Fit { belief, rows: rows.to_vec(), ..nominal }))
    }

    /// What `rows` leave unknown around a state, with noise and prior as they are stated; `None` where that is no covariance.
    pub(super) fn stated(&self, state: &State, rows: &[usize]) -> Option<Belief> {
        let layout = self.writable();
        let before = match self.chain(&layout) {
            Some(chain) => chain.covariance(&chain.stated()),
            None => DMatrix::from_diagonal(&self.deviations(&layout).map(|sd| sd * sd)),
        };
        let mut information = before.cholesky()?.inverse();
        let mut tell = |positions: &[f64], observation: &Observation| {
            let told = self.rig.equations_of(state, &layout, positions, observation).rows;
            information += &told * told.transpose();
        };
        rows.iter().map(|row| &self.rows[*row]).for_each(|row| tell(&row.positions, &row.observation));
        if let Some(known) = self.known {
            // Whatever the posture.
            tell(&vec![0.0; state.joints.len()], known);
        }
        let covariance = information.cholesky()?.inverse();
        Some(Belief::new(state.clone(), Arc::new(layout), self.rig.clone()).with_covariance(covariance))
    }

    /// By postures alone, of the rows that the file trains on: the expected scatter in sockets that are held out, root mean square,
    /// millimetres. `None` where nothing is held out or nothing can be told.
    pub(super) fn scatter_mm(&self) -> Option<f64> {
        let split = self.splits(None).ok()?.into_iter().next()?;
        let (asked, fit) = (self.in_sockets(&split.held_out), self.designed(&split.training).ok()??);
        let jacobian = asked.jacobian(fit.state(), &fit.belief.layout);
        let squares = (&jacobian * fit.belief.covariance.as_ref()?).dot(&jacobian) / asked.configurations.len() as f64;
        Some(squares.max(0.0).sqrt() * 1e3).filter(|mm| mm.is_finite())
    }

    /// By postures alone, of the rows that the file trains on, or of all: the standard deviation of a span of 1 m of the calibrated robot,
    /// millimetres.
    pub(super) fn size_mm(&self) -> Option<f64> {
        let splits = self.splits(None).ok()?;
        let rows = match splits.as_slice() {
            [split] => split.training.clone(),
            _ => (0..self.rows.len()).collect(),
        };
        self.span_sd_mm(&self.designed(&rows).ok()??)
    }
}
