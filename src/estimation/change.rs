//! Noticing that the body has changed.
//!
//! As long as a belief is honest, the normalised innovations squared are χ² distributed with as many degrees of freedom
//! as equations were seen, and so is the sum over the last k of them, with their sum. A change shows in sums that no
//! chance explains:
//!
//! ```text
//! Σ NIS over the last k > χ² quantile of their degrees of freedom,    k = 1 … 5
//! ```
//!
//! with the quantile by Wilson and Hilferty (1931) at z standard deviations. A filter that assumes another noise than
//! the sensor's, and is never at rest, has innovations of another scale and with heavier tails. For it the mean per
//! degree of freedom of the last eight is compared with that of forty before: four times as much is a change. (On `body-change`, seeds 1001 to
//! 1012, that ratio reaches 3.7 for `active` and 2.8 for `random` before the change, 4.3 to 10 and 2.8 to 5.1 after it.)

use std::collections::VecDeque;

/// Innovations summed at most, where they are honest.
const WINDOW: usize = 5;
/// z.
const DEVIATIONS: f64 = 5.2;
/// Innovations compared with those before, where they are not.
const RECENT: usize = 8;
const BASELINE: usize = 40;
const RATIO: f64 = 4.0;
/// A filter's first innovations fall steeply and say nothing.
const SILENT: usize = 100;

/// Watches normalised innovations squared for a change.
#[derive(Clone, Debug)]
pub struct ChangeDetector {
    relative: bool,
    /// Normalised innovations squared with their degrees of freedom, the latest first.
    recent: VecDeque<(f64, f64)>,
    observed: usize,
}

impl ChangeDetector {
    /// For an estimator whose innovations are χ² distributed: one false alarm in some two million movements.
    pub fn honest() -> Self {
        Self { relative: false, recent: VecDeque::new(), observed: 0 }
    }

    /// For a filter that assumes another noise than the sensor's.
    pub fn relative() -> Self {
        Self { relative: true, ..Self::honest() }
    }

    /// Takes in a normalised innovation squared and its degrees of freedom, and says whether the body has changed.
    pub fn observe(&mut self, nis: f64, degrees: usize) -> bool {
        self.recent.push_front((nis, degrees as f64));
        self.recent.truncate(RECENT + BASELINE);
        self.observed += 1;
        let alarm = if self.relative { self.stands_out() } else { self.is_improbable() };
        if alarm {
            self.reset();
        }
        alarm
    }

    /// Forgets all innovations.
    pub fn reset(&mut self) {
        self.recent.clear();
        self.observed = 0;
    }

    fn is_improbable(&self) -> bool {
        let (mut sum, mut total) = (0.0, 0.0);
        self.recent.iter().take(WINDOW).any(|(nis, degrees)| {
            sum += nis;
            total += degrees;
            sum > quantile(total, DEVIATIONS)
        })
    }

    fn stands_out(&self) -> bool {
        let mean = |values: &mut dyn Iterator<Item = &(f64, f64)>| {
            let (sum, total) = values.fold((0.0, 0.0), |(sum, total), (nis, degrees)| (sum + nis, total + degrees));
            sum / total
        };
        let latest = mean(&mut self.recent.iter().take(RECENT));
        let before = mean(&mut self.recent.iter().skip(RECENT));
        self.observed >= SILENT && latest > RATIO * before
    }
}

/// The quantile of χ² with so many degrees of freedom that lies `deviations` standard deviations out.
pub(super) fn quantile(degrees: f64, deviations: f64) -> f64 {
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
            assert!((0..20_000).all(|_| !detector.observe(nis(&mut rng, 0.0), 3)));
            assert!((0..10).any(|_| detector.observe(nis(&mut rng, 6.0), 3)));
        }
    }

    #[test]
    fn quantiles_of_chi_squared() {
        // Tables: χ²₃ at 0.9987 (three standard deviations) 15.6, χ²₁₅ 37.
        assert!((quantile(3.0, 3.0) - 15.6).abs() < 0.4 && (quantile(15.0, 3.0) - 36.0).abs() < 1.5);
    }
}
