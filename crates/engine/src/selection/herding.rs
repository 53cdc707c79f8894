//! Movements like those that count: kernel herding.
//!
//! Where a model cannot explain everything, the parameters come out as suits the postures that were measured, and these had better
//! be distributed like those over which predictions count. Of some candidates the one is taken that brings the two distributions
//! nearest (Chen, Welling and Smola, "Super-samples from kernel herding", UAI 2010),
//!
//! ```text
//! max over θ of   1/|T| Σ_{t∈T} k(θ, t) − 1/(n + 1) Σᵢ k(θ, θᵢ),    k(θ, θ') = exp(−½ Σⱼ (θⱼ − θ'ⱼ)² / (J σⱼ²))
//! ```
//!
//! with T what counts, θ₁ … θₙ the movements made, J joints and σⱼ the standard deviation of joint j over T: errors of models are alike
//! in similar postures, and k says how similar they are.

use crate::elementary::exp;

/// The index of the candidate that makes `made` most like `wanted`; `None` without candidates.
pub fn herd<C: AsRef<[f64]>, W: AsRef<[f64]>, M: AsRef<[f64]>>(
    candidates: &[C],
    wanted: &[W],
    made: &[M],
) -> Option<usize> {
    let joints = candidates.first()?.as_ref().len();
    let count = wanted.len().max(1) as f64;
    let precision: Vec<f64> = (0..joints)
        .map(|joint| {
            let mean = wanted.iter().map(|of| of.as_ref()[joint]).sum::<f64>() / count;
            let variance = wanted.iter().map(|of| (of.as_ref()[joint] - mean).powi(2)).sum::<f64>() / count;
            // A joint that does not move makes no posture another.
            if variance > 0.0 { 1.0 / (variance * joints as f64) } else { 0.0 }
        })
        .collect();
    let likeness = |a: &[f64], b: &[f64]| {
        let squares = a.iter().zip(b).zip(&precision).map(|((a, b), precision)| (a - b) * (a - b) * precision);
        exp(-0.5 * squares.sum::<f64>())
    };
    let score = |candidate: &[f64]| {
        let attraction: f64 = wanted.iter().map(|of| likeness(candidate, of.as_ref())).sum();
        let repulsion: f64 = made.iter().map(|of| likeness(candidate, of.as_ref())).sum();
        attraction / count - repulsion / (made.len() + 1) as f64
    };
    let scores = candidates.iter().map(|candidate| score(candidate.as_ref())).enumerate();
    scores.max_by(|(_, a), (_, b)| a.total_cmp(b)).map(|(index, _)| index)
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::herd;

    /// After movements to the edges the moments of a square are reached sooner than by uniform draws.
    #[test]
    fn moments_are_matched_sooner_than_by_chance() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let mut draw = || vec![rng.random_range(-1.0..1.0), rng.random_range(-3.0..3.0)];
        let edges: Vec<Vec<f64>> = [(1.0, 3.0), (-1.0, 3.0), (1.0, 2.8), (0.9, -3.0), (1.0, 3.0), (1.0, -2.9)]
            .map(|(x, y)| vec![x, y])
            .to_vec();
        let (mut herded, mut random) = (edges.clone(), edges);
        for _ in 0..24 {
            let drawn: Vec<Vec<f64>> = (0..64).map(|_| draw()).collect();
            random.push(drawn[0].clone());
            let index = herd(&drawn, &drawn, &herded).expect("candidates");
            herded.push(drawn[index].clone());
        }
        let off = |made: &[Vec<f64>]| {
            let mean = |f: &dyn Fn(&[f64]) -> f64| made.iter().map(|of| f(of)).sum::<f64>() / made.len() as f64;
            (mean(&|of| of[0] * of[0]) - 1.0 / 3.0).abs() + (mean(&|of| of[1] * of[1] / 9.0) - 1.0 / 3.0).abs()
        };
        assert!(off(&herded) < 0.5 * off(&random), "{} {}", off(&herded), off(&random));
    }

    #[test]
    fn a_joint_that_stands_still_and_nothing_to_choose_from() {
        let rows = [vec![0.0, 1.0], vec![1.0, 1.0], vec![2.0, 1.0]];
        assert_eq!(herd(&rows, &rows, &[rows[1].clone()]).map(|index| index == 1), Some(false));
        assert_eq!(herd::<Vec<f64>, Vec<f64>, Vec<f64>>(&[], &rows, &[]), None);
    }
}
