//! The criterion as a textbook writes it, minimised by NLopt.

use nlopt::{Algorithm, Nlopt, Target};

use super::{Case, innovation};

/// tr(W (P − P Hᵀ S⁻¹ H P)), the posterior built for every posture.
fn posterior_trace(case: &Case, posture: &[f64]) -> f64 {
    let covariance = case.covariance();
    let (s, numerator) = innovation(&case.belief, covariance, posture);
    let gain = &numerator * s.try_inverse().expect("positive");
    case.weights.trace(&(covariance - gain * numerator.transpose()))
}

/// The least value that NLopt's `GN_DIRECT_L` finds by so many evaluations.
pub fn minimise(case: &Case, evaluations: usize) -> f64 {
    let objective = |posture: &[f64], _: Option<&mut [f64]>, case: &mut &Case| posterior_trace(case, posture);
    let mut search = Nlopt::new(Algorithm::DirectL, case.limits.len(), objective, Target::Minimize, case);
    let (lower, upper): (Vec<f64>, Vec<f64>) = case.limits.iter().copied().unzip();
    search.set_lower_bounds(&lower).expect("bounds");
    search.set_upper_bounds(&upper).expect("bounds");
    search.set_maxeval(evaluations as u32).expect("a budget");
    let mut posture: Vec<f64> = lower.iter().zip(&upper).map(|(lower, upper)| 0.5 * (lower + upper)).collect();
    search.optimize(&mut posture).expect("a minimum").1
}
