//! The damped steps of Levenberg and Marquardt.

use nalgebra::{Cholesky, DMatrix, DVector};

/// How much the steps of a descent are damped.
pub(crate) struct Damped {
    damping: f64,
    /// What is added to every diagonal entry, in the units of the Hessian.
    floor: f64,
    /// The damping from which on no step lowers anything.
    most: f64,
}

impl Damped {
    pub fn new(floor: f64, most: f64) -> Self {
        Self { damping: 1e-3, floor, most }
    }

    /// What `lowered` makes of the first step −(H + λ diag H + floor)⁻¹ g that it accepts, λ growing from step to step; `None` if it
    /// accepts none.
    pub fn step<T>(
        &mut self,
        hessian: &DMatrix<f64>,
        gradient: &DVector<f64>,
        mut lowered: impl FnMut(&[f64]) -> Option<T>,
    ) -> Option<T> {
        while self.damping < self.most {
            let mut damped = hessian.clone();
            for index in 0..damped.nrows() {
                damped[(index, index)] += self.damping * hessian[(index, index)] + self.floor;
            }
            let step = Cholesky::new(damped).map(|cholesky| cholesky.solve(&-gradient));
            if let Some(found) = step.and_then(|step| lowered(step.as_slice())) {
                self.damping = (self.damping * 0.2).max(1e-9);
                return Some(found);
            }
            self.damping *= 10.0;
        }
        None
    }
}
