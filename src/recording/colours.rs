//! Colours that keep their meaning everywhere: one per learner, grey for the truth, a scale for the criterion.

/// What the page draws with too: the panel's crate puts a module `colours` of its own around the same file, and wants
/// nothing in it that it does not use.
#[path = "palette.rs"]
mod palette;

use palette::mix;
pub(super) use palette::viridis;
pub use palette::{learner_color, learner_slots};

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
        assert_eq!(hex(learner_color(0)), "#0072b2");
    }
}
