//! The normal equations of a posterior, and the memory in which they are computed.

use nalgebra::{DMatrix, DVector};

/// The normal equations of the posterior at a state: `information · step = negative_gradient`.
pub(super) struct Normal {
    pub cost: f64,
    /// The information's lower triangle; the upper triangle is meaningless.
    pub information: DMatrix<f64>,
    pub negative_gradient: DVector<f64>,
}

/// A workspace for rows and residuals, reused step after step of a search of one layout.
#[derive(Default)]
pub(super) struct Buffers {
    spare: Option<Normal>,
    pub(super) rows: Vec<f64>,
    pub(super) readings: Vec<f64>,
    pub(super) factors: Vec<f64>,
    pub(super) residuals: Vec<f64>,
    /// J of every measurement, where joints' readings are off: at the state at which the search stood last.
    pub(super) joints: Option<Vec<DMatrix<f64>>>,
}

impl Buffers {
    /// Zeroed sums of squares (m × m) and of products.
    pub(super) fn derivatives(&mut self, m: usize) -> (DMatrix<f64>, DVector<f64>) {
        let Some(Normal { mut information, mut negative_gradient, .. }) = self.spare.take() else {
            return (DMatrix::zeros(m, m), DVector::zeros(m));
        };
        information.as_mut_slice().fill(0.0);
        negative_gradient.as_mut_slice().fill(0.0);
        (information, negative_gradient)
    }

    /// Returns the memory of equations that are no longer needed.
    pub(super) fn put_back(&mut self, normal: Normal) {
        self.spare = Some(normal);
    }
}

pub(super) fn emptied(numbers: &mut Vec<f64>, count: usize) -> &mut [f64] {
    numbers.clear();
    numbers.resize(count, 0.0);
    numbers
}

/// `count` numbers: zero, or values written here before that will be written again.
pub(super) fn kept(numbers: &mut Vec<f64>, count: usize) -> &mut [f64] {
    if numbers.len() == count { numbers } else { emptied(numbers, count) }
}
