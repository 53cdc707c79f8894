//! The numeric range of a robot's numbers. Input beyond it is refused where it can still be named: its squares and fourth powers would
//! leave the range of floating point, and results would be silently wrong.

/// The greatest: metres, radians, degrees, pixels, seconds, kilograms and their noise are all far below.
pub const GREATEST: f64 = 1e12;
/// The least that is not zero, where a number has to be above it: a noise of a billionth of a metre, squared.
pub const LEAST: f64 = 1e-18;

/// Whether x is a number of which a robot can be made: |x| ≤ [`GREATEST`]. NaN is not.
pub fn is_usable(x: f64) -> bool {
    x.abs() <= GREATEST
}

/// The reason why a text is no [usable](is_usable) number.
pub fn what_is_wrong(text: &str) -> &'static str {
    match text.parse::<f64>() {
        Ok(x) if x.is_finite() => "is beyond ±1e12",
        _ => "is not a finite number",
    }
}

/// Whether x can be what has to be above 0: between [`LEAST`] and [`GREATEST`].
pub fn is_positive(x: f64) -> bool {
    (LEAST..=GREATEST).contains(&x)
}

/// Whether x can be what has to be 0 or more.
pub fn is_not_negative(x: f64) -> bool {
    x == 0.0 || is_positive(x)
}

/// Whether every one is [usable](is_usable).
pub fn are_usable<'a>(numbers: impl IntoIterator<Item = &'a f64>) -> bool {
    numbers.into_iter().all(|x| is_usable(*x))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_cannot_be_squared_twice_is_not_usable() {
        for x in [f64::NAN, f64::INFINITY, -f64::INFINITY, 1e308, -1e300, 2e12] {
            assert!(!is_usable(x) && !is_positive(x) && !is_not_negative(x), "{x}");
        }
        for x in [1e-160, 5e-324, 1e-19] {
            assert!(is_usable(x) && !is_positive(x) && !is_not_negative(x), "{x}");
        }
        assert!(is_not_negative(0.0) && is_not_negative(-0.0) && !is_positive(0.0) && !is_not_negative(-1.0));
        assert!([1e-18, 1e-9, 1.0, 1e12].into_iter().all(is_positive));
    }
}
