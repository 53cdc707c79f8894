//! The number of postures that a wanted accuracy takes.

/// The number of postures after which the expected error is as small as wanted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Needed {
    /// This number, among those that were looked at.
    Within(u64),
    /// About this number: e² − f² is taken to fall with the number of postures beyond those looked at, where f is the
    /// error that none makes smaller.
    About(u64),
    /// No number of postures is enough.
    Never,
}

impl Needed {
    /// Computes the number from the errors after 1, 2, … postures and the error that is left after infinitely many, all
    /// in one unit.
    pub fn of(errors: &[f64], floor: f64, wanted: f64) -> Self {
        if let Some(index) = errors.iter().position(|error| *error <= wanted) {
            return Self::Within(index as u64 + 1);
        }
        let Some(last) = errors.last().filter(|_| wanted > floor) else { return Self::Never };
        let count = errors.len() as f64;
        let needed = count * (last * last - floor * floor) / (wanted * wanted - floor * floor);
        // No reading is so many.
        if needed < 1e9 { Self::About((needed.ceil() as u64).max(errors.len() as u64 + 1)) } else { Self::Never }
    }

    /// The number, if there is one.
    pub fn postures(self) -> Option<u64> {
        match self {
            Self::Within(postures) | Self::About(postures) => Some(postures),
            Self::Never => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_fall_with_the_root_of_the_number_above_what_stays() {
        let errors = [5.0, 4.0, 3.0, 2.0];
        assert_eq!(Needed::of(&errors, 0.0, 3.0), Needed::Within(3));
        assert_eq!(Needed::of(&errors, 0.0, 1.0), Needed::About(16));
        assert_eq!(Needed::of(&errors, 1.0, 1.5), Needed::About(10), "4 × 3 / 1.25");
        assert_eq!(Needed::of(&errors, 1.0, 1.0), Needed::Never);
        assert_eq!(Needed::of(&[], 0.0, 1.0).postures(), None);
    }
}
