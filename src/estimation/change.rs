//! Noticing that the body has changed.
//!
//! As long as a belief is honest, the normalised innovations squared are χ² distributed with three degrees of freedom
//! each, and so the sum over the last k of them with 3k. A change shows in sums that no chance explains:
//!
//! ```text
//! Σ NIS over the last k > χ²₃ₖ quantile,    k = 1 … 5
//! ```
//!
//! with the quantile by Wilson and Hilferty (1931) at z standard deviations. A filter that assumes another noise than
//! the sensor's has innovations of another scale; for it they are divided by their own running mean first.

use std::collections::VecDeque;

/// Innovations summed at most.
const WINDOW: usize = 5;
/// Innovations before the window that tell the scale.
const BASELINE: usize = 40;

/// Watches normalised innovations squared for a change.
#[derive(Clone, Debug)]
pub struct ChangeDetector {
    /// z, how unlikely a sum must be.
    deviations: f64,
    /// Whether the scale of the innovations is their own running mean, or honest.
    relative: bool,
    recent: VecDeque<f64>,
}

impl ChangeDetector {
    /// For an estimator whose innovations are χ² distributed: one false alarm in some ten million movements.
    pub fn honest() -> Self {
        Self { deviations: 5.2, relative: false, recent: VecDeque::new() }
    }

    /// For a filter that assumes another noise than the sensor's. It is silent until it knows the scale, and wants a
    /// stronger sign, as such innovations are not χ² distributed either.
    pub fn relative() -> Self {
        Self { deviations: 10.0, relative: true, recent: VecDeque::new() }
    }

    /// Takes in a normalised innovation squared (three degrees of freedom) and says whether the body has changed.
    pub fn observe(&mut self, nis: f64) -> bool {
        self.recent.push_front(nis);
        let needed = if self.relative { WINDOW + BASELINE } else { 1 };
        self.recent.truncate(WINDOW + BASELINE);
        if self.recent.len() < needed {
            return false;
        }
        let scale =
            if self.relative { self.recent.iter().skip(WINDOW).sum::<f64>() / (3 * BASELINE) as f64 } else { 1.0 };
        let mut sum = 0.0;
        let alarm = self.recent.iter().take(WINDOW).enumerate().any(|(index, nis)| {
            sum += nis;
            sum > scale * quantile(3.0 * (index + 1) as f64, self.deviations)
        });
        if alarm {
            self.recent.clear();
        }
        alarm
    }

    /// Forgets all innovations.
    pub fn reset(&mut self) {
        self.recent.clear();
    }
}

/// The quantile of χ² with so many degrees of freedom that lies `deviations` standard deviations out.
fn quantile(degrees: f64, deviations: f64) -> f64 {
    let variance = 2.0 / (9.0 * degrees);
    degrees * (1.0 - variance + deviations * variance.sqrt()).powi(3)
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    use super::*;

    fn nis(rng: &mut ChaCha8Rng, bias: f64) -> f64 {
        (0..3).map(|_| (rng.sample::<f64, _>(StandardNormal) + bias).powi(2)).sum()
    }

    #[test]
    fn chance_alone_raises_no_alarm_and_a_bias_does() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        for mut detector in [ChangeDetector::honest(), ChangeDetector::relative()] {
            assert!((0..20_000).all(|_| !detector.observe(nis(&mut rng, 0.0))));
            assert!((0..5).any(|_| detector.observe(nis(&mut rng, 6.0))));
        }
    }

    #[test]
    fn quantiles_of_chi_squared() {
        // Tables: χ²₃ at 0.9987 (three standard deviations) 15.6, χ²₁₅ 37.
        assert!((quantile(3.0, 3.0) - 15.6).abs() < 0.4 && (quantile(15.0, 3.0) - 36.0).abs() < 1.5);
    }
}
