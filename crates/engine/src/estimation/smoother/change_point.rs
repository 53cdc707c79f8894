//! The change point: the measurement since which readings come from a changed body.
//!
//! Before a change the body is x, after it `x ⊕ B η`, `η ~ N(0, Q)` (see [`Jump`]). At the most probable state of all readings under
//! one body, with whitened rows Hᵢ, residuals rᵢ and information Λ, those from the k-th on say of η
//!
//! ```text
//! g = Σ_{i≥k} Bᵀ Hᵢᵀ rᵢ,    S = Bᵀ (M − M Λ⁻¹ M) B + Q⁻¹,    M = Σ_{i≥k} Hᵢᵀ Hᵢ
//! ```
//!
//! so that a change lowers χ² by t = gᵀ S⁻¹ g, and its evidence is that of Laplace (a generalised likelihood ratio as of Willsky and
//! Jones 1976, with Occam's factor in place of a threshold by degrees of freedom):
//!
//! ```text
//! ln odds = ln ev(χ² − t) − ln ev(χ²) − ½ ln det(S Q) + ln P(change)
//! ```
//!
//! ev is the evidence of the residuals with the scale of their noise integrated out (see [`NoiseEvidence`]): noise that is larger
//! than was said explains large residuals as well, and is no change. Odds are summed over all k and jumps. One reading proves
//! nothing: what may be an outlier must be supported by others.
//!
//! Where readings may be outliers, those of a changed body are taken for some at first, and say nothing in the sums above. There the
//! two posteriors are searched instead (see [`changed_body`](super::changed_body)).

use nalgebra::{Cholesky, DMatrix, DVector};

use super::{
    Smoother,
    jump::{Jump, log_determinant},
    mode::Mode,
    noise::NoiseEvidence,
    normal::{Buffers, Normal},
    posterior::Posterior,
};
use crate::{
    elementary::{exp, ln, ln_1p},
    sensing::log_sum,
};

/// The chance that a body changes at a movement.
pub(super) const RATE: f64 = 5e-3;
/// The number of latest movements at each of which a change is looked for; before these, ever fewer are tried.
const EACH: usize = 16;

/// A change of the body.
#[derive(Clone, Debug)]
pub(super) struct Change {
    /// The index of the first measurement, of those kept, after the change.
    pub since: usize,
    /// How the body changed.
    pub jump: Jump,
    /// The logarithm of its odds against one body for all measurements.
    pub log_odds: f64,
}

/// All readings, linearised at one state.
pub(super) struct Evidence {
    /// Hᵀ, whitened and weighed, of every measurement (m × d).
    pub rows: Vec<DMatrix<f64>>,
    /// Residuals, whitened and weighed.
    pub residuals: Vec<DVector<f64>>,
    /// Λ (m × m).
    pub information: DMatrix<f64>,
    /// The evidence that tells larger noise from a change.
    pub noise: NoiseEvidence,
}

/// The places at which a change may have happened, the latest first: at least two movements are seen after it.
fn places(count: usize, has_past: bool) -> Vec<usize> {
    let first = usize::from(!has_past);
    let mut places = Vec::new();
    let mut at = count;
    let mut step = 1;
    while at >= first + step {
        at -= step;
        if count - at >= 2 {
            places.push(at);
        }
        if count - at >= EACH {
            step = 1 + (count - at) / EACH;
        }
    }
    places
}

impl Evidence {
    /// The likeliest change; `None` if there is no place for one.
    pub fn likeliest(&self, jumps: &[Jump], has_past: bool) -> Option<Change> {
        let m = self.information.nrows();
        let covariance = Cholesky::new(self.information.clone())?.inverse();
        let count = self.rows.len();
        let places = places(count, has_past);
        let mut best: Option<Change> = None;
        let mut all = f64::NEG_INFINITY;
        let (mut sum, mut pull) = (DMatrix::<f64>::zeros(m, m), DVector::<f64>::zeros(m));
        let mut next = count;
        for place in places {
            while next > place {
                next -= 1;
                let (rows, residual) = (&self.rows[next], &self.residuals[next]);
                sum.gemm(1.0, rows, &rows.transpose(), 1.0);
                pull.gemv(1.0, rows, residual, 1.0);
            }
            let carried = &covariance * &sum;
            for jump in jumps {
                let Some(log_odds) = self.log_odds(jump, &sum, &carried, &pull) else { continue };
                // What nothing was read of may have changed, for all that is known, and is no news.
                let excess = log_odds - jump.log_share - ln(RATE);
                if excess > 0.0 {
                    all = log_sum(all, log_odds + ln_1p(-exp(-excess)));
                }
                if jump.has_room && best.as_ref().is_none_or(|best| log_odds > best.log_odds) {
                    best = Some(Change { since: place, jump: jump.clone(), log_odds });
                }
            }
        }
        best.map(|best| Change { log_odds: all, ..best })
    }

    fn log_odds(&self, jump: &Jump, sum: &DMatrix<f64>, carried: &DMatrix<f64>, pull: &DVector<f64>) -> Option<f64> {
        let b = &jump.directions;
        let seen = sum * b;
        let mut s = b.tr_mul(&seen) - seen.tr_mul(&(carried * b));
        s = (&s + s.transpose()) * 0.5 + &jump.information;
        let factor = Cholesky::new(s)?;
        let g = b.tr_mul(pull);
        let lowered = g.dot(&factor.solve(&g));
        let occam = 0.5 * (log_determinant(&factor) + jump.log_determinant);
        let log_odds = self.noise.gain(lowered) - occam + jump.log_share + ln(RATE);
        log_odds.is_finite().then_some(log_odds)
    }
}

impl Smoother {
    /// The evidence of all readings that a posterior keeps, at a mode of it.
    pub(super) fn evidence(&self, posterior: &Posterior, mode: &Mode) -> Option<Evidence> {
        let layout = &self.belief.layout;
        // With the scales of noise as they are now, for which the mode need not have been searched again.
        let Normal { mut information, negative_gradient, .. } =
            posterior.normal_by(posterior.loss.into(), &mode.state, layout, &mut Buffers::default())?;
        information.fill_upper_triangle_with_lower_triangle();
        let shift = Cholesky::new(information.clone())?.solve(&negative_gradient);
        let (mut rows, mut residuals) = (Vec::new(), Vec::new());
        for seen in &posterior.measurements {
            let (of, residual) = posterior.weighed(&mode.state, layout, seen);
            residuals.push(residual - of.tr_mul(&shift));
            rows.push(of);
        }
        Some(Evidence { rows, residuals, information, noise: self.noise_evidence(posterior, mode) })
    }
}
