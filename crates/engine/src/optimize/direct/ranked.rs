//! A score and a number as one integer, which heaps and sorts compare at once.

/// The bit that tells negative numbers from others.
const SIGN: u64 = 1 << 63;

/// An integer in the order of scores, which is that of `f64::total_cmp`, and of numbers where scores are equal.
pub fn ranked(score: f64, number: usize) -> u128 {
    let bits = score.to_bits();
    // Of negative numbers those with the larger bits are the smaller, so all bits are turned; of others the sign alone.
    let rank = if bits & SIGN > 0 { !bits } else { bits | SIGN };
    u128::from(rank) << 64 | number as u128
}

/// The score in such an integer.
pub fn score(ranked: u128) -> f64 {
    let rank = (ranked >> 64) as u64;
    f64::from_bits(if rank & SIGN > 0 { rank ^ SIGN } else { !rank })
}

/// The number in such an integer.
pub fn number(ranked: u128) -> usize {
    ranked as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_order_is_that_of_scores_and_then_of_numbers_and_nothing_is_lost() {
        let scores = [f64::NEG_INFINITY, -1e300, -2.0, -1e-300, 0.0, 5e-324, 1.0, 1.0 + f64::EPSILON, f64::INFINITY];
        for pair in scores.windows(2) {
            assert!(ranked(pair[0], 1) < ranked(pair[1], 0));
        }
        for known in scores {
            let last = ranked(known, usize::MAX);
            assert!(ranked(known, 0) < last);
            assert_eq!((score(last).to_bits(), number(last)), (known.to_bits(), usize::MAX));
        }
    }
}
