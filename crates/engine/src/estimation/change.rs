//! The detector of changes of the body.
//!
//! As long as a belief is honest, the normalised innovations squared are χ² distributed with as many degrees of freedom as equations were
//! seen, and so is the sum over the last k of them, with their sum. A change shows in sums that no chance explains:
//!
//! ```text
//! Σ NIS over the last k > χ² quantile of their degrees of freedom,    k = 1 … 5
//! ```
//!
//! with the quantile by Wilson and Hilferty (1931) at z standard deviations. So far out their approximation errs on the quiet side: with
//! three equations a movement chance exceeds it with a probability of 2.2·10⁻⁸ (k = 1) to 6.1·10⁻⁸ (k = 5), and never by more than the 10⁻⁷
//! that it stands for.
//!
//! A filter that assumes another noise than the sensor's, and is never at rest, has innovations of another scale and with heavier tails.
//! For it the mean per degree of freedom of the last eight is compared with that of forty before: four times as much is a change. (On
//! `body-change`, seeds 1001 to 1012, that ratio reaches 3.7 for `active` and 2.8 for `random` before the change, 4.3 to 10 and 2.8 to 5.1
//! after it.)

use std::collections::VecDeque;

/// The most innovations that are summed, for honest beliefs.
const WINDOW: usize = 5;
/// z.
const DEVIATIONS: f64 = 5.2;
/// The number of latest innovations that are compared with those before, for other beliefs.
const RECENT: usize = 8;
const BASELINE: usize = 40;
const RATIO: f64 = 4.0;
/// The number of a filter's first innovations that are ignored: they fall steeply.
const SILENT: usize = 100;

/// A detector that watches normalised innovations squared for a change.
#[derive(Clone, Debug)]
pub struct ChangeDetector {
    relative: bool,
    /// z.
    deviations: f64,
    /// Normalised innovations squared with their degrees of freedom, the latest first.
    recent: VecDeque<(f64, f64)>,
    observed: usize,
}

impl ChangeDetector {
    /// A detector for an estimator whose innovations are χ² distributed: at most one false alarm in two million
    /// movements; with three equations a movement one in 4.4 million.
    pub fn honest() -> Self {
        Self { relative: false, deviations: DEVIATIONS, recent: VecDeque::new(), observed: 0 }
    }

    /// A detector for a filter that assumes a noise other than the sensor's.
    pub fn relative() -> Self {
        Self { relative: true, ..Self::honest() }
    }

    /// Adds a normalised innovation squared and its degrees of freedom, and returns whether the body has changed.
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
            sum > quantile(total, self.deviations)
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

/// The quantile of χ² with `degrees` of freedom that lies `deviations` standard deviations out.
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

    /// The probability that χ² exceeds `x`, by the recurrence in its degrees of freedom (Abramowitz and Stegun 26.4.8).
    fn tail(degrees: usize, x: f64) -> f64 {
        let (first, start) = if degrees % 2 == 1 { (libm::erfc((x / 2.0).sqrt()), 1) } else { ((-x / 2.0).exp(), 2) };
        let term = |d: usize| (x / 2.0).powf(d as f64 / 2.0) * (-x / 2.0).exp() / libm::tgamma(d as f64 / 2.0 + 1.0);
        first + (start..degrees).step_by(2).map(term).sum::<f64>()
    }

    /// The probability that chance exceeds the threshold of each window.
    fn tails(deviations: f64) -> [f64; WINDOW] {
        std::array::from_fn(|index| {
            let degrees = 3 * (index + 1);
            tail(degrees, quantile(degrees as f64, deviations))
        })
    }

    fn is_near(found: f64, wanted: f64) -> bool {
        (found / wanted - 1.0).abs() < 5e-3
    }

    #[test]
    fn thresholds_are_as_far_out_as_is_said() {
        // Tables of χ²: the upper 5 % and 0.1 %.
        for (degrees, x, wanted) in [(3, 7.815, 0.05), (15, 24.996, 0.05), (6, 12.592, 0.05), (12, 32.909, 0.001)] {
            assert!(is_near(tail(degrees, x), wanted), "{degrees}: {}", tail(degrees, x));
        }
        // Where the approximation is good, 0.0228 is the share of a normal variable beyond two standard deviations.
        assert!(tails(2.0).iter().all(|tail| (tail / 0.02275 - 1.0).abs() < 0.01), "{:?}", tails(2.0));
        let tails = tails(DEVIATIONS);
        assert!(is_near(tails[0], 2.218e-8) && is_near(tails[WINDOW - 1], 6.125e-8), "{tails:?}");
        // No more often than all windows together, were they never to agree.
        assert!(is_near(1.0 / tails.iter().sum::<f64>(), 4.415e6), "{tails:?}");
    }

    /// At thresholds so low that chance exceeds them every few hundred movements. The share is from three million draws of
    /// another program, good to one percent.
    #[test]
    fn chance_raises_as_many_alarms_as_low_thresholds_allow() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let mut detector = ChangeDetector { deviations: 3.0, ..ChangeDetector::honest() };
        let draws = 400_000;
        let alarms = (0..draws).filter(|_| detector.observe(nis(&mut rng, 0.0), 3)).count() as f64;
        let wanted = 0.002_247 * f64::from(draws);
        assert!((alarms - wanted).abs() < 4.0 * wanted.sqrt(), "{alarms}, not {wanted}");
        assert!((tails(3.0)[0]..tails(3.0).iter().sum()).contains(&(alarms / f64::from(draws))));
    }
}
