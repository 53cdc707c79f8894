//! Colours that keep their meaning everywhere: one per learner, grey for the truth, a scale for the criterion.

pub use super::palette::learner_color;
use super::palette::mix;
pub(super) use super::palette::viridis;

/// The colour of the truth: grey.
pub const TRUTH_COLOR: [u8; 3] = [0x80, 0x80, 0x80];

/// A colour as `#rrggbb`.
pub fn hex([red, green, blue]: [u8; 3]) -> String {
    format!("#{red:02x}{green:02x}{blue:02x}")
}

/// A colour moved towards white by `amount` in 0..=1.
pub(super) fn tint(colour: [u8; 3], amount: f64) -> [u8; 3] {
    mix(colour, [0xFF; 3], amount)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_are_written_in_hexadecimal() {
        assert_eq!(hex(learner_color(7)), "#0072b2");
    }
}
