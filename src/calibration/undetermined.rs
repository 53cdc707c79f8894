//! What the rows cannot determine, in words.
//!
//! With Λ the information of the rows alone, scaled to a unit diagonal, directions whose eigenvalue is less than 10⁻¹² of the
//! greatest are told by no row: the estimate stays there where the description has it. Beside these stand parameters that the
//! rows tell so little of that their deviation has hardly fallen from the prior's.

use nalgebra::DMatrix;

use super::{Case, Fit, Parameters};
use crate::model::{Block, listed, null_space};

/// The share of a parameter that undetermined directions must hold for it to be named.
const NAMED: f64 = 0.05;
/// A deviation above this share of the prior's has hardly fallen.
const HARDLY: f64 = 0.9;

impl Case<'_> {
    /// How much of what was learned the rows determine.
    pub(super) fn determined(&self, fit: &Fit) -> Parameters {
        let layout = &*fit.belief.layout;
        let free = self.undetermined(fit);
        let untold = self.names.untold(layout, &free, "these rows");
        let undetermined = untold.into_iter().chain(self.hardly(fit, &free)).collect();
        Parameters { learned: layout.dimension(), rank: layout.dimension() - free.ncols(), undetermined }
    }

    /// An orthonormal basis of what no row tells (m × k).
    fn undetermined(&self, fit: &Fit) -> DMatrix<f64> {
        null_space(&self.information(fit))
    }

    /// What the rows of a fit tell of its parameters, without the prior (m × m).
    pub(super) fn information(&self, fit: &Fit) -> DMatrix<f64> {
        let belief = &fit.belief;
        let m = belief.layout.dimension();
        let mut information = DMatrix::zeros(m, m);
        for row in fit.rows.iter().map(|row| &self.rows[*row]) {
            let rows = belief.rig.equations_of(&belief.state, &belief.layout, &row.positions, &row.observation).rows;
            information += &rows * rows.transpose();
        }
        information
    }

    /// Blocks of which every coordinate is known hardly better than before.
    fn hardly(&self, fit: &Fit, free: &DMatrix<f64>) -> Option<String> {
        let layout = &*fit.belief.layout;
        let covariance = fit.belief.covariance.as_ref()?;
        // As the rows have them: what shrinks with the scale of the prior alone is not told by rows.
        let prior = match (self.chain(layout), &fit.scales) {
            (Some(chain), Some(scales)) => chain.covariance(scales).diagonal().map(|x| x.max(0.0).sqrt()),
            _ => self.deviations(layout),
        };
        let share = |coordinate: usize| covariance[(coordinate, coordinate)].sqrt() / prior[coordinate];
        let is_told = |coordinate: usize| free.ncols() > 0 && free.row(coordinate).norm_squared() > NAMED;
        let hardly = |(block, range): (Block, std::ops::Range<usize>)| {
            let untold = range.clone().all(|coordinate| share(coordinate) > HARDLY) && !range.clone().all(is_told);
            untold.then(|| self.names.block(block))
        };
        let names: Vec<String> = layout.blocks().filter_map(hardly).collect();
        (!names.is_empty()).then(|| {
            format!(
                "these rows say next to nothing of {}: what is known has hardly grown beyond the prior; add rows in which the \
                 joints behind it move farther",
                listed(names)
            )
        })
    }
}
