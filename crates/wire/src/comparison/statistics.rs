//! Medians and quantiles over runs.

use super::{Quantiles, Summary};

impl Summary {
    /// The summary of runs by when they converged.
    pub fn of(converged_at: impl Iterator<Item = Option<u64>>) -> Self {
        let mut late: Vec<f64> = converged_at.map(|at| at.map_or(f64::INFINITY, |at| at as f64)).collect();
        late.sort_by(f64::total_cmp);
        let finite = |value: Option<f64>| value.filter(|value| value.is_finite());
        Self {
            runs: late.len(),
            converged: late.iter().filter(|at| at.is_finite()).count(),
            median_converged_at: finite(median(&late)),
            p90_converged_at: finite(nearest_rank(&late, 0.9)),
            max_converged_at: finite(late.last().copied()),
        }
    }
}

impl Quantiles {
    /// Of the runs whose value is finite; `None` if there is none.
    pub(super) fn of(values: impl IntoIterator<Item = f64>) -> Option<Self> {
        let values = sorted(values);
        Some(Self {
            mean: values.iter().sum::<f64>() / values.len() as f64,
            median: median(&values)?,
            q25: nearest_rank(&values, 0.25)?,
            q75: nearest_rank(&values, 0.75)?,
        })
    }
}

/// The finite ones among values, in ascending order. An estimate that diverged may have errors that are no numbers;
/// with their sign they would sort below or above all others.
pub(super) fn sorted(values: impl IntoIterator<Item = f64>) -> Vec<f64> {
    let mut finite: Vec<f64> = values.into_iter().filter(|value| value.is_finite()).collect();
    finite.sort_by(f64::total_cmp);
    finite
}

/// The median of sorted values.
pub(super) fn median(sorted: &[f64]) -> Option<f64> {
    let count = sorted.len();
    match count {
        0 => None,
        _ if count % 2 == 1 => Some(sorted[count / 2]),
        _ => Some(0.5 * (sorted[count / 2 - 1] + sorted[count / 2])),
    }
}

/// The smallest of sorted values that a fraction `q` of them does not exceed.
pub(super) fn nearest_rank(sorted: &[f64], q: f64) -> Option<f64> {
    let rank = (q * sorted.len() as f64).ceil().max(1.0) as usize;
    sorted.get(rank - 1).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_that_did_not_converge_is_infinitely_late() {
        let summary = Summary::of([Some(10), None, Some(30), Some(20)].into_iter());
        assert_eq!((summary.runs, summary.converged), (4, 3));
        assert_eq!(summary.median_converged_at, Some(25.0));
        assert_eq!(summary.p90_converged_at, None);
        assert_eq!(summary.max_converged_at, None);
        assert_eq!(Summary::of([Some(1), None].into_iter()).median_converged_at, None);
        assert_eq!(Summary::of([].into_iter()).median_converged_at, None);
    }

    #[test]
    fn quantiles_are_nearest_rank() {
        let values: Vec<f64> = (1..=20).map(f64::from).collect();
        assert_eq!(nearest_rank(&values, 0.9), Some(18.0));
        assert_eq!(nearest_rank(&values, 0.25), Some(5.0));
        assert_eq!(median(&values), Some(10.5));
        assert_eq!(Quantiles::of(vec![]), None);
    }

    #[test]
    fn errors_that_are_no_numbers_are_left_out() {
        let wanted = Quantiles::of(vec![1.0, 2.0, 3.0]);
        for wrong in [f64::NAN, -f64::NAN, f64::INFINITY] {
            assert_eq!(Quantiles::of(vec![3.0, wrong, 1.0, 2.0]), wanted);
            assert_eq!(Quantiles::of(vec![wrong]), None);
        }
    }
}
