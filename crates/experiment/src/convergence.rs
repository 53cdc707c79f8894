//! When a run converged, judged with hindsight and the truth.

/// Movements within the thresholds that must follow before a run counts as converged.
pub const CONFIRMATION: u64 = 20;

/// The thresholds of a scenario.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thresholds {
    /// Largest `orientation_deg`, degrees.
    pub orientation_deg: f64,
    /// Largest `location_m`, metres.
    pub location_m: f64,
}

/// Follows one run and tells `converged_at`: the first movement from which both errors stay within the thresholds to
/// the end of the run; `None` when fewer than 20 further movements confirm it.
#[derive(Clone, Debug)]
pub struct Convergence {
    thresholds: Thresholds,
    last_outside: Option<u64>,
    latest: u64,
    judged: bool,
}

impl Convergence {
    /// A run that has not begun.
    pub fn new(thresholds: Thresholds) -> Self {
        Self { thresholds, last_outside: None, latest: 0, judged: false }
    }

    /// The same rule for a run that begins anew, with a body that has changed.
    pub fn restart(&mut self) {
        *self = Self::new(self.thresholds);
    }

    /// Takes in the errors after so many movements; without the truth (`None`) nothing is judged.
    pub fn observe(&mut self, movements: u64, orientation_deg: Option<f64>, location_m: Option<f64>) {
        self.latest = movements;
        if orientation_deg.is_none() && location_m.is_none() {
            return;
        }
        self.judged = true;
        // A NaN is outside.
        let within = orientation_deg.is_none_or(|error| error <= self.thresholds.orientation_deg)
            && location_m.is_none_or(|error| error <= self.thresholds.location_m);
        if !within {
            self.last_outside = Some(movements);
        }
    }

    /// The first movement of the stretch within the thresholds that lasts until now; `None` outside of them, and where
    /// nothing is judged.
    pub fn within_since(&self) -> Option<u64> {
        let first = self.last_outside.map_or(0, |last| last + 1);
        (self.judged && first <= self.latest).then_some(first)
    }

    /// The same, if 20 further movements confirm it.
    pub fn converged_at(&self) -> Option<u64> {
        self.within_since().filter(|first| self.latest - first >= CONFIRMATION)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(errors_deg: impl IntoIterator<Item = f64>) -> Option<u64> {
        let mut convergence = Convergence::new(Thresholds { orientation_deg: 5.0, location_m: 0.02 });
        for (movements, error) in errors_deg.into_iter().enumerate() {
            convergence.observe(movements as u64, Some(error), Some(0.01));
        }
        convergence.converged_at()
    }

    #[test]
    fn counts_from_the_last_excursion() {
        let bad_until = |n: usize, total: usize| (0..=total).map(move |k| if k < n { 9.0 } else { 1.0 });
        assert_eq!(run(bad_until(0, 20)), Some(0));
        assert_eq!(run(bad_until(0, 19)), None);
        assert_eq!(run(bad_until(30, 50)), Some(30));
        assert_eq!(run(bad_until(31, 50)), None);
        assert_eq!(run((0..=100).map(|k| if k == 60 { 5.1 } else { 5.0 })), Some(61));
        assert_eq!(run((0..=100).map(|_| f64::NAN)), None);
    }

    #[test]
    fn a_stretch_within_the_thresholds_is_told_before_it_is_confirmed() {
        let mut convergence = Convergence::new(Thresholds { orientation_deg: 5.0, location_m: 0.02 });
        assert_eq!(convergence.within_since(), None);
        for (movements, (error, since)) in [(9.0, None), (1.0, Some(1)), (6.0, None), (4.0, Some(3))].iter().enumerate()
        {
            convergence.observe(movements as u64, Some(*error), None);
            assert_eq!(convergence.within_since(), *since, "after {movements}");
        }
        convergence.restart();
        convergence.observe(1, Some(4.0), None);
        assert_eq!(convergence.within_since(), Some(0));
    }

    #[test]
    fn without_truth_nothing_converges() {
        let mut convergence = Convergence::new(Thresholds { orientation_deg: 5.0, location_m: 0.02 });
        (0..100).for_each(|movements| convergence.observe(movements, None, None));
        assert_eq!(convergence.converged_at(), None);
    }
}
