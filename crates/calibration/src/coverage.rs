//! Coverage: the share of held-out readings that lie within their stated intervals.
//!
//! A held-out reading y of d numbers is predicted with covariance S = R + J P Jᵀ, R the noise as it was learned and P the posterior
//! covariance, so that `(y − h)ᵀ S⁻¹ (y − h)` is below the 95 % point of χ² with d degrees of freedom in 95 of 100 readings if the model
//! is right. The model error is no normal noise: it is large in some postures and small in others. So where folds among the training rows
//! find less than 95 % of their readings there, the stated interval is widened as much as they need, by a factor of lengths w: `(y − h)ᵀ
//! S⁻¹ (y − h) ≤ w² χ²` (conformal prediction; Vovk, *Cross-conformal predictors*, 2015). Readings of one posture share their errors: the
//! interval of the share is that of means over postures.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::{Case, Fit};
use body_schema_engine::sensing::{Observation, Occasion};

/// The share of readings within the 95 % intervals.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Coverage {
    /// The number of held-out readings.
    pub readings: usize,
    /// The share of them within the stated 95 % intervals.
    pub share: f64,
    /// The lower end of its 95 % interval, clustered by posture.
    pub low: f64,
    /// The upper end.
    pub high: f64,
    /// The factor of lengths by which the stated intervals are wider than noise and uncertainty alone make them, from folds among
    /// the training rows; the mean over the splits.
    #[serde(default = "unwidened")]
    pub widened: f64,
}

pub(super) fn unwidened() -> f64 {
    1.0
}

/// The stated probability.
const STATED: f64 = 0.95;
/// The quantiles of a normal number for this probability, two-sided and one-sided.
const BOTH_SIDES: f64 = 1.96;
const ONE_SIDE: f64 = 1.645;

impl Coverage {
    /// The coverage from readings by row, where intervals were `widened`; `None` for fewer than ten rows, which tell
    /// nothing.
    pub(super) fn of(covered: &[(usize, bool)], widened: f64) -> Option<Self> {
        let mut rows: BTreeMap<usize, (f64, f64)> = BTreeMap::new();
        for (row, is_within) in covered {
            let of = rows.entry(*row).or_default();
            *of = (of.0 + f64::from(u8::from(*is_within)), of.1 + 1.0);
        }
        let (readings, count) = (covered.len() as f64, rows.len() as f64);
        let share = rows.values().map(|of| of.0).sum::<f64>() / readings;
        // What each posture adds to the share beside its part (a ratio estimator).
        let squares: f64 = rows.values().map(|of| (of.0 - share * of.1).powi(2)).sum();
        let sd = (squares * count / (count - 1.0)).sqrt() / readings;
        // Where all or nearly all lie within, as many as could have been without by chance (Agresti and Coull).
        let by_chance = (STATED * (1.0 - STATED) / count).sqrt();
        let reach = BOTH_SIDES * sd.max(by_chance);
        (count >= 10.0).then(|| Self {
            readings: covered.len(),
            share,
            low: (share - reach).max(0.0),
            high: (share + reach).min(1.0),
            widened,
        })
    }

    /// A warning where the share is not the stated one.
    pub fn warning(&self) -> Option<String> {
        let Self { readings, share, low, high, .. } = self;
        let percent = |share: &f64| 100.0 * share;
        let is_told = !(*low..=*high).contains(&STATED);
        let what =
            if *share < STATED { "errors are larger than is stated" } else { "errors are smaller than is stated" };
        is_told.then(|| {
            format!(
                "{:.0} % of {readings} held-out readings lie within the 95 % that are stated for them ({:.0} to {:.0} %): {what}",
                percent(share),
                percent(low),
                percent(high)
            )
        })
    }
}

impl Case<'_> {
    /// For each reading of `rows`, which were not learned from, its row, and its distance from the prediction as a share of the 95 %
    /// interval by noise and uncertainty.
    pub(super) fn reaches(&self, fit: &Fit, rows: &[usize]) -> Vec<(usize, f64)> {
        let belief = &fit.belief;
        let Some(covariance) = &belief.covariance else { return Vec::new() };
        let mut reaches = Vec::new();
        for &index in rows {
            let row = &self.rows[index];
            let sensors = self.measurement_model.sensors().iter().enumerate();
            for (channel, _) in sensors.filter(|(_, sensor)| sensor.subject().occasion == Occasion::Always) {
                let mut alone = Observation { readings: vec![None; row.observation.readings.len()] };
                let Some(reading) = row.observation.readings.get(channel).and_then(Option::as_ref) else { continue };
                alone.readings[channel] = Some(reading.clone());
                let equations =
                    belief.measurement_model.equations_of(&belief.state, &belief.layout, &row.positions, &alone);
                let d = equations.residual.len();
                let mut spread = equations.rows.tr_mul(&(covariance * &equations.rows));
                (0..d).for_each(|k| spread[(k, k)] += 1.0);
                let Some(factor) = spread.cholesky().filter(|_| d > 0) else { continue };
                let square = equations.residual.dot(&factor.solve(&equations.residual));
                reaches.push((index, (square / most(d)).sqrt()));
            }
        }
        reaches
    }
}

/// w, from the reaches of held-out readings: their 95 % point, or 1 if that is less.
pub(super) fn widening(reaches: &[(usize, f64)]) -> f64 {
    let mut reaches: Vec<f64> = reaches.iter().map(|it| it.1).collect();
    let within = (STATED * reaches.len() as f64).ceil() as usize;
    match within.checked_sub(1) {
        Some(last) => reaches.select_nth_unstable_by(last, f64::total_cmp).1.max(1.0),
        None => 1.0,
    }
}

/// The 95 % point of χ² of d degrees of freedom (Wilson and Hilferty).
fn most(d: usize) -> f64 {
    let d = d as f64;
    let variance = 2.0 / (9.0 * d);
    d * (1.0 - variance + ONE_SIDE * variance.sqrt()).powi(3)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Options, Silent, calibrate};
    use body_schema_scenario::builtin;

    /// χ² of 1, 3 and 8 degrees is below 3.84, 7.81 and 15.51 in 95 of 100.
    #[test]
    fn the_point_is_where_tables_have_it() {
        for (d, point) in [(1, 3.84), (3, 7.81), (8, 15.51)] {
            assert!((most(d) - point).abs() < 0.1, "{d}: {}", most(d));
        }
    }

    #[test]
    fn a_share_that_is_not_as_stated_is_told() {
        let of = |within: usize, of: usize| {
            let covered: Vec<(usize, bool)> = (0..of).map(|row| (row, row < within)).collect();
            Coverage::of(&covered, 1.0).expect("enough rows").warning()
        };
        assert_eq!((of(95, 100), of(90, 100), of(30, 30)), (None, None, None));
        assert!(of(80, 100).expect("told").contains("80 % of 100 held-out readings"));
        assert!(of(1000, 1000).expect("told").contains("smaller than is stated"));
        // The same readings of ten postures tell less.
        let clustered: Vec<(usize, bool)> = (0..100).map(|reading| (reading / 10, reading >= 20)).collect();
        assert_eq!(Coverage::of(&clustered, 1.0).expect("ten rows").warning(), None);
        assert_eq!(Coverage::of(&clustered[..50], 1.0), None);
    }

    #[test]
    fn what_is_stated_is_as_wide_as_most_need() {
        let reaches = |of: &dyn Fn(usize) -> f64| (0..100).map(|row| (row, of(row))).collect::<Vec<_>>();
        assert_eq!(widening(&reaches(&|row| 0.01 * row as f64)), 1.0);
        assert_eq!(widening(&reaches(&|row| if row < 10 { 1.5 } else { 0.5 })), 1.5);
        assert_eq!((widening(&reaches(&|row| if row < 5 { 1.5 } else { 0.5 })), widening(&[])), (1.0, 1.0));
    }

    /// All that ships: of readings that nothing was learned from about as many lie within what is stated for them as is stated.
    #[test]
    fn readings_of_real_robots_are_covered() {
        let (mut within, mut readings) = (0.0, 0.0);
        for name in ["tiago-mocap-3", "ur10-camera", "talos-contact", "positioner"] {
            let scenario = builtin(name).expect("built in");
            let case = Case::new(&scenario).expect("measured");
            let report = calibrate(&case, &Options::default(), &Silent).expect("calibrated").report;
            let coverage = report.coverage.expect("held out");
            let warned = report.doubts.iter().any(|doubt| doubt.contains("that are stated for them"));
            assert_eq!(warned, !(coverage.low..=coverage.high).contains(&STATED), "{name}: {coverage:?}");
            within += coverage.share * coverage.readings as f64;
            readings += coverage.readings as f64;
        }
        let share = within / readings;
        assert!((0.90..=0.98).contains(&share), "{share} of {readings}");
    }
}
