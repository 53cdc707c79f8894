//! Bayesian optimisation over the unit cube: a Gaussian process and expected improvement.
//!
//! The objective is modelled as a Gaussian process with a constant mean and an isotropic Matérn 5/2 kernel,
//!
//! ```text
//! k(r) = s² (1 + √5 r/ℓ + 5r²/3ℓ²) e^{−√5 r/ℓ}
//! ```
//!
//! s² and the mean are those of the values seen; ℓ is, of a few, the one of the highest marginal likelihood. The next
//! point maximises the expected improvement over the best value f*, with z = (f* − μ)/σ (Mockus 1978; Jones, Schonlau,
//! Welch 1998):
//!
//! ```text
//! EI = σ (z Φ(z) + φ(z))
//! ```
//!
//! over random candidates, half of them anywhere, half of them near the best point. One point is asked for at a time,
//! after a first batch that fills the cube; each costs O(n²) after n points, which is what the method is known for.

use nalgebra::{DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{Minimum, least};

use crate::{
    elementary::{exp, ln},
    normal::StandardNormal,
};

/// Candidates among which the next point is chosen.
const CANDIDATES: usize = 200;
/// Length scales tried, in sides of the cube.
const LENGTHS: [f64; 5] = [0.15, 0.3, 0.6, 1.2, 2.4];
/// Standard deviation of the candidates near the best point.
const NEAR: f64 = 0.05;
/// Variance added to the diagonal for the sake of the factorisation, relative to s².
const JITTER: f64 = 1e-8;

/// Minimises `f` over the unit cube with so many evaluations; `None` if no value was finite. The outcome is a
/// function of the arguments alone: `seed` drives the candidates.
pub fn bayesian(dimension: usize, evaluations: usize, seed: u64, mut f: impl FnMut(&[f64]) -> f64) -> Option<Minimum> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let (mut points, mut values): (Vec<DVector<f64>>, Vec<f64>) = (Vec::new(), Vec::new());
    let mut length = LENGTHS[1];
    for evaluation in 0..evaluations {
        let first = evaluation < (2 * dimension + 1).min(evaluations);
        if !first && evaluation % 10 == 1 {
            length = likeliest_length(&points, &values).unwrap_or(length);
        }
        let point = match (first, Process::fit(&points, &values, length)) {
            (false, Some(process)) => process.most_promising(&mut rng),
            _ => uniform(dimension, &mut rng),
        };
        let value = f(point.as_slice());
        if value.is_finite() {
            points.push(point);
            values.push(value);
        }
    }
    let (best, value) = least(points.iter().zip(values))?;
    Some(Minimum { point: best.as_slice().to_vec(), value, evaluations })
}

/// A Gaussian process conditioned on the values seen.
struct Process<'a> {
    points: &'a [DVector<f64>],
    length: f64,
    mean: f64,
    variance: f64,
    inverse_root: DMatrix<f64>,
    weights: DVector<f64>,
    best: usize,
    best_value: f64,
    log_likelihood: f64,
}

impl<'a> Process<'a> {
    fn fit(points: &'a [DVector<f64>], values: &[f64], length: f64) -> Option<Self> {
        let count = values.len();
        let (best, best_value) = least(values.iter().copied().enumerate())?;
        let mean = values.iter().sum::<f64>() / count as f64;
        let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / count as f64;
        // Values all alike have no length, and those too large to be squared no variance.
        if !(variance > 0.0 && variance.is_finite()) {
            return None;
        }
        let kernel = DMatrix::from_fn(count, count, |i, j| {
            matern(distance(&points[i], &points[j]), length) + if i == j { JITTER } else { 0.0 }
        });
        let cholesky = kernel.cholesky()?;
        let standard = DVector::from_iterator(count, values.iter().map(|value| (value - mean) / variance.sqrt()));
        let weights = cholesky.solve(&standard);
        let log_determinant: f64 = cholesky.l_dirty().diagonal().iter().map(|l| ln(*l)).sum();
        let log_likelihood = -0.5 * standard.dot(&weights) - log_determinant;
        let inverse_root = cholesky.l().solve_lower_triangular(&DMatrix::identity(count, count))?;
        Some(Self { points, length, mean, variance, inverse_root, weights, best, best_value, log_likelihood })
    }

    fn expected_improvement(&self, x: &DVector<f64>) -> f64 {
        let k = DVector::from_iterator(
            self.points.len(),
            self.points.iter().map(|point| matern(distance(x, point), self.length)),
        );
        let mean = self.mean + self.variance.sqrt() * k.dot(&self.weights);
        let explained = (&self.inverse_root * k).norm_squared();
        let deviation = (self.variance * (1.0 - explained)).max(0.0).sqrt();
        if deviation == 0.0 {
            return (self.best_value - mean).max(0.0);
        }
        let z = (self.best_value - mean) / deviation;
        deviation * (z * normal_distribution(z) + normal_density(z))
    }

    fn most_promising(&self, rng: &mut ChaCha8Rng) -> DVector<f64> {
        let centre = &self.points[self.best];
        let candidate = |index: usize, rng: &mut ChaCha8Rng| {
            if index.is_multiple_of(2) {
                return uniform(centre.len(), rng);
            }
            centre.map(|c| (c + NEAR * rng.sample::<f64, _>(StandardNormal)).clamp(0.0, 1.0))
        };
        let mut most = (f64::NEG_INFINITY, centre.clone());
        for index in 0..CANDIDATES {
            let x = candidate(index, rng);
            let improvement = self.expected_improvement(&x);
            if improvement > most.0 {
                most = (improvement, x);
            }
        }
        most.1
    }
}

fn distance(a: &DVector<f64>, b: &DVector<f64>) -> f64 {
    a.iter().zip(b.iter()).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}

fn likeliest_length(points: &[DVector<f64>], values: &[f64]) -> Option<f64> {
    let cost = |length| Process::fit(points, values, length).map(|process| -process.log_likelihood);
    least(LENGTHS.into_iter().filter_map(|length| Some((length, cost(length)?)))).map(|(length, _)| length)
}

fn uniform(dimension: usize, rng: &mut ChaCha8Rng) -> DVector<f64> {
    DVector::from_fn(dimension, |_, _| rng.random())
}

/// The Matérn 5/2 correlation at a distance.
fn matern(distance: f64, length: f64) -> f64 {
    let r = 5_f64.sqrt() * distance / length;
    (1.0 + r + r * r / 3.0) * exp(-r)
}

fn normal_density(z: f64) -> f64 {
    exp(-0.5 * z * z) / (2.0 * std::f64::consts::PI).sqrt()
}

fn normal_distribution(z: f64) -> f64 {
    0.5 * libm::erfc(-z / std::f64::consts::SQRT_2)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn branin(x: &[f64]) -> f64 {
        let (a, b) = (15.0 * x[0] - 5.0, 15.0 * x[1]);
        let pi = std::f64::consts::PI;
        (b - 5.1 / (4.0 * pi * pi) * a * a + 5.0 / pi * a - 6.0).powi(2)
            + 10.0 * (1.0 - 1.0 / (8.0 * pi)) * a.cos()
            + 10.0
    }

    #[test]
    fn finds_the_minimum_of_branin_in_few_evaluations() {
        for seed in 0..5 {
            let found = bayesian(2, 60, seed, branin).expect("finite values");
            assert!(found.value < 0.3979 + 0.05, "seed {seed}: {found:?}");
            assert_eq!(found.evaluations, 60);
        }
    }

    #[test]
    fn expected_improvement_is_that_of_the_normal_distribution() {
        for (z, expected) in [(0.0, 0.5), (1.0, 0.841_344_7), (-1.96, 0.024_997_9), (3.0, 0.998_650_1)] {
            assert!((normal_distribution(z) - expected).abs() < 1e-6);
        }
    }

    /// Their variance is infinite, which makes the likelihood of every length NaN, and NaN sorts above all numbers.
    #[test]
    fn values_too_large_to_be_squared_are_not_modelled() {
        let points: Vec<DVector<f64>> = [0.1, 0.4, 0.8].map(|x| DVector::from_element(1, x)).to_vec();
        for values in [[1e200, -1e200, 3e200], [1e308, 1.5e308, 1.7e308]] {
            assert_eq!(likeliest_length(&points, &values), None);
            assert!(Process::fit(&points, &values, 0.3).is_none());
        }
        let found = bayesian(2, 60, 1, |x| 1e200 * branin(x)).expect("finite values");
        assert!(found.value.is_finite() && found.evaluations == 60);
    }

    #[test]
    fn copes_with_constants_and_with_nothing_finite() {
        assert!(bayesian(3, 20, 1, |_| 1.0).is_some_and(|found| found.value == 1.0));
        assert!(bayesian(3, 20, 1, |_| f64::NAN).is_none());
        let half = |x: &[f64]| if x[0] < 0.5 { f64::INFINITY } else { x[0] };
        assert!(bayesian(2, 40, 1, half).is_some_and(|found| found.value < 0.6));
    }
}
