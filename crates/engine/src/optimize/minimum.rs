//! What a search has found, and the least of candidates whose values may be anything.

/// What a search has found.
#[derive(Debug, Clone, PartialEq)]
pub struct Minimum {
    /// The best point, in the unit cube.
    pub point: Vec<f64>,
    /// Its value.
    pub value: f64,
    /// How many points were evaluated.
    pub evaluations: usize,
}

/// The candidate of the least value, with it; of equals the first. Candidates whose value is not finite do not count:
/// `f64::total_cmp` alone orders a NaN with a negative sign below every number, and would prefer it to all of them.
pub fn least<T>(candidates: impl IntoIterator<Item = (T, f64)>) -> Option<(T, f64)> {
    candidates.into_iter().filter(|(_, value)| value.is_finite()).min_by(|a, b| a.1.total_cmp(&b.1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_least_is_finite_and_the_first_of_equals() {
        let values = [-f64::NAN, 2.0, f64::NEG_INFINITY, 1.0, f64::NAN, 1.0, f64::INFINITY];
        assert_eq!(least(values.into_iter().enumerate()), Some((3, 1.0)));
        assert_eq!(least([(0, f64::NAN), (1, -f64::NAN), (2, f64::NEG_INFINITY)]), None);
        assert_eq!(least::<()>([]), None);
    }
}
