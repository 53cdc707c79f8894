//! The palette of recordings and page: the panel's crate takes this file in as it is.

/// The Okabe–Ito palette, which the colour-blind can tell apart, in the order in which learners take it.
const LEARNERS: [[u8; 3]; 7] = [
    [0x00, 0x72, 0xB2], // blue
    [0xD5, 0x5E, 0x00], // vermillion
    [0x00, 0x9E, 0x73], // bluish green
    [0xCC, 0x79, 0xA7], // reddish purple
    [0xE6, 0x9F, 0x00], // orange
    [0x56, 0xB4, 0xE9], // sky blue
    [0xF0, 0xE4, 0x42], // yellow
];

/// Stops of the viridis colour map, evenly spaced, dark to bright.
const VIRIDIS: [[u8; 3]; 10] = [
    [0x44, 0x01, 0x54],
    [0x48, 0x28, 0x78],
    [0x3E, 0x49, 0x89],
    [0x31, 0x68, 0x8E],
    [0x26, 0x82, 0x8E],
    [0x1F, 0x9E, 0x89],
    [0x35, 0xB7, 0x79],
    [0x6E, 0xCE, 0x58],
    [0xB5, 0xDE, 0x2B],
    [0xFD, 0xE7, 0x25],
];

/// The colour (sRGB) of the learner at this place in the description; it repeats after seven.
pub fn learner_color(index: usize) -> [u8; 3] {
    LEARNERS[index % LEARNERS.len()]
}

/// The viridis colour of `value` in 0..=1.
pub fn viridis(value: f64) -> [u8; 3] {
    let last = VIRIDIS.len() - 1;
    let place = value.clamp(0.0, 1.0) * last as f64;
    let lower = (place as usize).min(last - 1);
    mix(VIRIDIS[lower], VIRIDIS[lower + 1], place - lower as f64)
}

/// The colour between two, `amount` in 0..=1 of the way.
pub fn mix(from: [u8; 3], to: [u8; 3], amount: f64) -> [u8; 3] {
    std::array::from_fn(|i| (f64::from(from[i]) + amount * (f64::from(to[i]) - f64::from(from[i]))).round() as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_scale_runs_from_end_to_end() {
        assert_eq!(viridis(0.0), VIRIDIS[0]);
        assert_eq!(viridis(1.0), VIRIDIS[9]);
        assert_eq!(viridis(2.0), VIRIDIS[9]);
        assert_eq!(viridis(1.0 / 9.0), VIRIDIS[1]);
        assert_eq!(learner_color(7), learner_color(0));
    }
}
