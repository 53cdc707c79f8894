//! Corrections that the prior, as stated, hardly allows.
//!
//! With δ how far all learned axes are from the description and P₀ = L Lᵀ their prior, base first, e = L⁻¹ δ holds by joint how far
//! its axis is from where the axes before it would have it, in deviations: an error that is carried along counts where it begins. Of a
//! described chain ‖e_j‖² ~ χ² with as many degrees of freedom as the axis has coordinates. It is told as the deviations of a single
//! number that are as improbable (Wilson and Hilferty).

use nalgebra::{Cholesky, DMatrix};

use super::{Case, Fit};
use body_schema_engine::{
    elementary::cbrt,
    model::{Block, Layout},
};

/// The deviations from which on a correction is reported.
const TOLD: f64 = 3.0;

impl Case<'_> {
    /// A sentence on every joint whose axis was corrected by more than three deviations of the prior as stated.
    pub(super) fn beyond_prior(&self, fit: &Fit) -> Vec<String> {
        self.found_beyond(fit).unwrap_or_default()
    }

    fn found_beyond(&self, fit: &Fit) -> Option<Vec<String>> {
        let layout = &*fit.belief.layout;
        let chain = self.chain(layout)?;
        let learned = |block: &Block| matches!(block, Block::Axis(_)) && layout.block(*block).is_some();
        let axes = Layout::new(self.guess(), (0..self.guess().joints.len()).map(Block::Axis).filter(learned));
        let places: Vec<usize> = axes.blocks().filter_map(|(block, _)| layout.block(block)).flatten().collect();
        let stated = chain.covariance(&chain.stated());
        let stated = DMatrix::from_fn(places.len(), places.len(), |i, j| stated[(places[i], places[j])]);
        let delta = self.guess().local(&axes, &fit.state().slid_towards(self.guess()))?;
        let e = Cholesky::new(stated)?.l().solve_lower_triangular(&delta)?;
        let of = |(block, range): (Block, std::ops::Range<usize>)| {
            let (Block::Axis(joint), count) = (block, range.len()) else { return None };
            let deviations = deviations(e.rows(range.start, count).norm_squared(), count);
            (deviations > TOLD).then(|| {
                format!(
                    "`{}` is corrected by {deviations:.1} standard deviations of what [prior] states: look over its <origin>, its zero and \
                     that of the joint before it, or state a wider prior",
                    self.names.joints[joint]
                )
            })
        };
        Some(axes.blocks().filter_map(of).collect())
    }
}

/// The deviation of one normal number that is as improbable, two-sided, as a χ² of so many degrees of freedom above this
/// value.
fn deviations(chi2: f64, degrees: usize) -> f64 {
    let d = degrees as f64;
    let variance = 2.0 / (9.0 * d);
    let above = (cbrt(chi2 / d) - (1.0 - variance)) / variance.sqrt();
    // One-sided to two-sided: near three deviations a probability of one half less is worth 0.22.
    above + 0.22
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 99.73 % of χ² of one, two and four degrees are below 9.0, 11.83 and 16.25.
    #[test]
    fn three_deviations_are_where_tables_have_them() {
        for (chi2, degrees) in [(9.0, 1), (11.83, 2), (16.25, 4)] {
            assert!((deviations(chi2, degrees) - 3.0).abs() < 0.08, "{}", deviations(chi2, degrees));
        }
    }
}
