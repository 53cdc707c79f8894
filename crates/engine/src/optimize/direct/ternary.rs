//! The lattice on which every centre lies: odd multiples of ½·3⁻ˡ, kept exact inside `f64`.

/// The deepest trisection level of a side: a side of 3⁻³⁰ ≈ 4.9 × 10⁻¹⁵ is never divided.
///
/// One level is worth a factor of three, so this is where the centres of neighbouring rectangles are still some
/// forty units in the last place apart.
pub const MAX_LEVEL: u8 = 30;

const POWERS: [i64; MAX_LEVEL as usize + 1] = {
    let mut powers = [1; MAX_LEVEL as usize + 1];
    let mut level = 1;
    while level < powers.len() {
        powers[level] = 3 * powers[level - 1];
        level += 1;
    }
    powers
};

/// Ticks along one edge of the unit cube; twice a power of three, so that every centre falls on a tick. There are
/// fewer than 2⁴⁹, few enough for [`ticks`] to undo [`coordinate`] without error.
const EDGE: i64 = 2 * POWERS[MAX_LEVEL as usize];

/// The side 3⁻ˡ of an edge trisected `level` times, correctly rounded.
pub fn side(level: u8) -> f64 {
    1.0 / POWERS[usize::from(level)] as f64
}

/// Half a side, in ticks.
pub fn half_side_ticks(level: u8) -> i64 {
    POWERS[usize::from(MAX_LEVEL - level)]
}

/// The lattice number of a coordinate that [`coordinate`] made. Exact: the two roundings amount to less than a
/// tenth of a tick. (Truncation after adding a half is several times faster than `f64::round`.)
pub fn ticks(coordinate: f64) -> i64 {
    (coordinate * EDGE as f64 + 0.5) as i64
}

/// The coordinate of a lattice number, correctly rounded.
pub fn coordinate(ticks: i64) -> f64 {
    ticks as f64 / EDGE as f64
}

/// The centres of the upper and lower third of a side at `level` around `centre`.
///
/// Going through the lattice keeps a centre correctly rounded however deep it lies; adding and subtracting 3⁻ˡ
/// would let the rounding errors of all its ancestors pile up.
pub fn thirds(centre: f64, level: u8) -> [f64; 2] {
    let (centre, step) = (ticks(centre), 2 * half_side_ticks(level + 1));
    [coordinate(centre + step), coordinate(centre - step)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coordinates_and_ticks_are_inverse_down_to_the_last_tick() {
        let near_the_ends_and_the_middle =
            (0..2_000).flat_map(|k| [k, EDGE / 2 - 1_000 + k, EDGE - k, k * (EDGE / 2_000)]);
        for tick in near_the_ends_and_the_middle {
            assert_eq!(ticks(coordinate(tick)), tick);
        }
    }

    #[test]
    fn repeated_trisection_does_not_drift() {
        let mut centre = 0.5;
        for level in 0..MAX_LEVEL {
            centre = thirds(centre, level)[usize::from(level % 2 == 0)];
        }
        let exact = (0..MAX_LEVEL).fold(POWERS[MAX_LEVEL as usize], |sum, level| {
            let step = 2 * half_side_ticks(level + 1);
            if level % 2 == 0 { sum - step } else { sum + step }
        });
        assert_eq!(centre, coordinate(exact));
    }

    #[test]
    fn centres_are_told_apart_at_the_deepest_level() {
        let [upper, lower] = thirds(1.0 - 0.5 * side(MAX_LEVEL - 1), MAX_LEVEL - 1);
        assert!(upper < 1.0 && lower < upper);
        assert!((upper - lower) / f64::EPSILON > 40.0);
    }
}
