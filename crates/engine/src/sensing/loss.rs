//! Losses: the cost of a reading that is far from its prediction.
//!
//! With s = ‖L⁻¹ (y ⊖ h)‖², the squared whitened residual of a reading of d equations, and z = √s:
//!
//! | loss | cost ρ(s) | weight w = 2 dρ/ds |
//! |---|---|---|
//! | none | s/2 | 1 |
//! | Huber | s/2 up to z = k, then k z − k²/2 | min(1, k/z) |
//! | mixture | −ln((1 − ε) e^{−s/2} + ε ((1 − φ) κ^{−d} e^{−s/2κ²} + φ (100 κ)^{−d})) + constant | q + p/κ² |
//!
//! The mixture takes a share ε of readings to be outliers. Most of them have κ times the deviations of the others, with probability p; a
//! share φ = 10 % may be anywhere: their density is flat, so that a reading says nothing however far off it is. Where κ is not stated it is
//! 50, and 50^(3/d) for four to six equations, 7 for a pose: an outlier is spread over the volume that three equations have. With 50 in
//! each of six, readings of up to seven deviations would count fully. Readings of more equations are of bodies of many points, where the
//! volume decides too much: what a model leaves of all of them would be outliers. 1 − q is the probability
//! that a reading is an outlier of either kind, and the constant makes ρ(0) = 0. Huber's k is where 95 % of normal readings lie within. A
//! loss enters a least squares problem as the weight of the reading's equations (iteratively reweighted least squares), and the answer as
//! ρ.
//!
//! A loss goes around what a [`Sensor`](super::Sensor) hands out. It sees the whitened residual alone, so that any loss goes with any
//! channel and any noise.

use crate::elementary::{exp, ln, ln_1p};

/// φ, the share of outliers that may be anywhere.
const ANYWHERE: f64 = 0.1;
/// The deviation of those outliers, in deviations of normal readings.
const FAR: f64 = 100.0;

/// The cost of a reading as a function of its whitened residual.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Loss {
    /// Least squares: all readings have the same noise.
    #[default]
    None,
    /// Huber's: beyond what 95 % of normal readings keep within, the cost grows linearly.
    Huber,
    /// Normal readings mixed with outliers.
    Mixture {
        /// ε, the prior share of outliers; above 0, below 1.
        fraction: f64,
        /// κ, the deviation of most outliers as a multiple of a normal reading's; above 1. `None` for the usual one.
        spread: Option<f64>,
    },
}

impl Loss {
    /// ε of the usual mixture: one reading in twenty is an outlier.
    pub const USUAL_FRACTION: f64 = 0.05;
    /// The usual mixture.
    pub const MIXTURE: Self = Self::Mixture { fraction: Self::USUAL_FRACTION, spread: None };

    /// ρ(s) of a reading of d equations.
    pub fn cost(&self, s: f64, d: usize) -> f64 {
        match *self {
            Self::None => 0.5 * s,
            Self::Huber => {
                let k = huber(d);
                if s <= k * k { 0.5 * s } else { k * s.sqrt() - 0.5 * k * k }
            }
            Self::Mixture { .. } => {
                let [near, far] = self.outlying(s, d).unwrap_or([f64::NEG_INFINITY; 2]);
                let [near_best, far_best] = self.outlying(0.0, d).unwrap_or([f64::NEG_INFINITY; 2]);
                // All terms relative to that of a normal reading at s = 0.
                log_sum(0.0, log_sum(near_best, far_best)) - log_sum(-0.5 * s, log_sum(near, far))
            }
        }
    }

    /// w, the weight of a reading's equations.
    pub fn weight(&self, s: f64, d: usize) -> f64 {
        match *self {
            Self::None => 1.0,
            Self::Huber => (huber(d) / s.sqrt()).min(1.0),
            Self::Mixture { spread, .. } => {
                let [near, far] = self.outlying(s, d).unwrap_or([f64::NEG_INFINITY; 2]);
                let all = log_sum(-0.5 * s, log_sum(near, far));
                let spread = spread.unwrap_or_else(|| usual_spread(d));
                exp(-0.5 * s - all) + exp(near - all) / (spread * spread)
            }
        }
    }

    /// 1 − q, the probability that a reading is an outlier; `None` for a loss without outliers.
    pub fn outlier(&self, s: f64, d: usize) -> Option<f64> {
        let [near, far] = self.outlying(s, d)?;
        let odds = log_sum(near, far) + 0.5 * s;
        Some(1.0 / (1.0 + exp(-odds)))
    }

    /// The logarithms of ε (1 − φ) κ^{−d} e^{−s/2κ²} and of ε φ (100 κ)^{−d}, relative to 1 − ε.
    fn outlying(&self, s: f64, d: usize) -> Option<[f64; 2]> {
        let Self::Mixture { fraction, spread } = *self else { return None };
        let spread = spread.unwrap_or_else(|| usual_spread(d));
        let near = log_odds(fraction, spread, d) + ln_1p(-ANYWHERE) - 0.5 * s / (spread * spread);
        Some([near, log_odds(fraction, FAR * spread, d) + ln(ANYWHERE)])
    }

    /// Whether the loss lets a single reading be wrong without moving the estimate.
    pub fn is_robust(&self) -> bool {
        *self != Self::None
    }
}

/// A loss widened by τ: `τ² ρ(s/τ²)`. Near 0 it is least squares like the loss itself, but it gives a reading up only τ
/// times as far out, so that a fit which is still on its way does not take half of the readings for outliers. Searches
/// go from wide to 1 (graduated non-convexity, Blake and Zisserman 1987).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Graduated {
    /// ρ.
    pub loss: Loss,
    /// τ; 1 is the loss itself.
    pub width: f64,
}

impl From<Loss> for Graduated {
    fn from(loss: Loss) -> Self {
        Self { loss, width: 1.0 }
    }
}

impl Graduated {
    /// τ² ρ(s/τ²).
    pub fn cost(&self, s: f64, d: usize) -> f64 {
        let square = self.width * self.width;
        square * self.loss.cost(s / square, d)
    }

    /// The probability that a reading is normal; for a loss without outliers, its weight.
    pub fn normal(&self, s: f64, d: usize) -> f64 {
        let square = self.width * self.width;
        self.loss.outlier(s / square, d).map_or_else(|| self.weight(s, d), |outlier| 1.0 - outlier)
    }

    /// The weight of a reading's equations.
    pub fn weight(&self, s: f64, d: usize) -> f64 {
        self.loss.weight(s / (self.width * self.width), d)
    }
}

/// Huber's k for d equations, standard deviations: 95 % of normal readings lie within it. √ of the χ² quantile (Wilson and
/// Hilferty).
fn huber(d: usize) -> f64 {
    let variance = 2.0 / (9.0 * d.max(1) as f64);
    (d.max(1) as f64 * (1.0 - variance + 1.645 * variance.sqrt()).powi(3)).sqrt()
}

/// κ of the usual mixture for d equations.
fn usual_spread(d: usize) -> f64 {
    const OF_THREE: f64 = 50.0;
    if (4..=6).contains(&d) { exp(3.0 * ln(OF_THREE) / d as f64) } else { OF_THREE }
}

/// ln(ε κ^{−d} / (1 − ε)).
fn log_odds(fraction: f64, spread: f64, d: usize) -> f64 {
    ln(fraction) - ln_1p(-fraction) - d as f64 * ln(spread)
}

/// ln(eᵃ + eᵇ), of which one is finite.
pub(crate) fn log_sum(a: f64, b: f64) -> f64 {
    a.max(b) + ln_1p(exp(-(a - b).abs()))
}

#[cfg(test)]
mod tests {
    use super::*;

    const LOSSES: [Loss; 3] = [Loss::None, Loss::Huber, Loss::MIXTURE];

    /// w = 2 dρ/ds, ρ grows from 0, and no loss is above least squares.
    #[test]
    fn weights_are_the_slopes_of_costs() {
        for loss in LOSSES {
            for d in [1, 2, 3, 6, 8] {
                assert!(loss.cost(0.0, d).abs() < 1e-12, "{loss:?}");
                for s in [0.01, 0.5, 2.0, 9.0, 20.0, 26.0, 35.0, 80.0, 1e4, 1e7] {
                    let step = 1e-5 * s;
                    let slope = (loss.cost(s + step, d) - loss.cost(s - step, d)) / (2.0 * step);
                    let weight = loss.weight(s, d);
                    assert!((2.0 * slope - weight).abs() < 1e-4 * (1.0 + weight), "{loss:?} {d} {s}: {slope} {weight}");
                    assert!(loss.cost(s, d) <= 0.5 * s + 1e-9 && (0.0..=1.0).contains(&weight));
                }
            }
        }
    }

    /// At six standard deviations and three equations it is likelier than not, at four it is not; far out it is certain.
    #[test]
    fn an_outlier_is_told_from_a_normal_reading() {
        let probability = |z: f64| Loss::MIXTURE.outlier(z * z, 3).expect("a mixture");
        assert!(probability(3.0) < 0.01 && probability(4.0) < 0.5 && probability(6.0) > 0.9);
        assert!(probability(1e6) == 1.0 && probability(1e200) == 1.0);
        assert_eq!(Loss::Huber.outlier(9.0, 3), None);
        // By Bayes' rule, worked out by hand for one equation, ε = 1/2, κ = 2, s = 4.
        let (normal, outlier) = ((-2.0_f64).exp(), 0.9 * 0.5 * (-0.5_f64).exp() + 0.1 / 200.0);
        let found = Loss::Mixture { fraction: 0.5, spread: Some(2.0) }.outlier(4.0, 1).expect("a mixture");
        assert!((found - outlier / (normal + outlier)).abs() < 1e-12);
    }

    /// A pose is an outlier where a position as unlikely is one.
    #[test]
    fn outliers_of_six_numbers_are_told_as_early_as_those_of_three() {
        let probability = |z: f64, d| Loss::MIXTURE.outlier(z * z, d).expect("a mixture");
        assert!(probability(4.5, 6) < 0.5 && probability(6.0, 6) > 0.9);
        let stated = Loss::Mixture { fraction: Loss::USUAL_FRACTION, spread: Some(50.0) };
        assert!(stated.outlier(36.0, 6).expect("a mixture") < 0.01, "what is stated holds in every number");
        assert_eq!(stated.outlier(36.0, 3), Loss::MIXTURE.outlier(36.0, 3));
    }

    /// However far off a reading is, it costs no more and pulls at nothing.
    #[test]
    fn what_is_anywhere_says_nothing() {
        for d in [1, 3, 6] {
            let most = Loss::MIXTURE.cost(1e300, d);
            assert!((Loss::MIXTURE.cost(1e12, d) - most).abs() < 1e-9 && most < 12.0 * (d + 1) as f64, "{most}");
            for s in [1e8, 1e12, 1e300, f64::MAX] {
                assert!(Loss::MIXTURE.weight(s, d) * s < 1e-3, "{d}: {s}");
            }
        }
    }

    /// 95 % of readings: tables of χ².
    #[test]
    fn huber_begins_where_normal_readings_end() {
        for (d, x) in [(1, 3.841), (2, 5.991), (3, 7.815), (6, 12.592)] {
            assert!((huber(d).powi(2) / x - 1.0_f64).abs() < 0.03, "{d}: {}", huber(d).powi(2));
        }
        assert!((Loss::Huber.weight(4.0 * huber(3).powi(2), 3) - 0.5).abs() < 1e-12);
    }
}
