//! Standard normal numbers with the same bits on every machine.

use std::{
    f64::consts::{FRAC_1_SQRT_2, PI},
    sync::LazyLock,
};

use rand::{
    Rng, RngExt,
    distr::{Distribution, Open01},
};

use crate::elementary::{exp, ln};

/// The normal distribution N(0, 1).
///
/// Drawn by the ziggurat of Doornik (2005, "An improved ziggurat method to generate normal random samples"), as `rand_distr` does,
/// but by [elementary functions](crate::elementary) that give the same bits everywhere.
#[derive(Clone, Copy, Debug)]
pub struct StandardNormal;

/// Rectangles of equal area under the density.
const BOXES: usize = 256;
/// Where the tail begins.
const TAIL: f64 = 3.654_152_885_361_009;

/// The area of each rectangle, and of the lowest with the tail.
fn area() -> f64 {
    TAIL * density(TAIL) + (0.5 * PI).sqrt() * libm::erfc(TAIL * FRAC_1_SQRT_2)
}

/// The right edges of the rectangles, the lowest first, and the density there; the last edge is 0.
static EDGES: LazyLock<([f64; BOXES + 1], [f64; BOXES + 1])> = LazyLock::new(|| {
    let (area, mut x) = (area(), [0.0; BOXES + 1]);
    (x[0], x[1]) = (area / density(TAIL), TAIL);
    for index in 2..BOXES {
        x[index] = (-2.0 * ln(area / x[index - 1] + density(x[index - 1]))).sqrt();
    }
    (x, x.map(density))
});

/// exp(−x²/2).
fn density(x: f64) -> f64 {
    exp(-0.5 * x * x)
}

impl Distribution<f64> for StandardNormal {
    fn sample<R: Rng + ?Sized>(&self, rng: &mut R) -> f64 {
        let (x, f) = &*EDGES;
        loop {
            let bits = rng.next_u64();
            let index = (bits % BOXES as u64) as usize;
            // From −1 to 1, of 52 other bits.
            let u = (bits >> 12) as f64 * (2.0 / (1_u64 << 52) as f64) - 1.0;
            let found = u * x[index];
            if found.abs() < x[index + 1] {
                return found;
            }
            if index == 0 {
                return tail(rng).copysign(u);
            }
            if f[index + 1] + (f[index] - f[index + 1]) * rng.random::<f64>() < density(found) {
                return found;
            }
        }
    }
}

/// A number beyond the last edge (Marsaglia 1964).
fn tail<R: Rng + ?Sized>(rng: &mut R) -> f64 {
    loop {
        let beyond = ln(rng.sample::<f64, _>(Open01)) / TAIL;
        let y = ln(rng.sample::<f64, _>(Open01));
        if -2.0 * y >= beyond * beyond {
            return TAIL - beyond;
        }
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// All rectangles have the same area, and the highest ends at the top of the density.
    #[test]
    fn rectangles_have_equal_areas() {
        let (x, f) = &*EDGES;
        for index in 1..BOXES {
            let found = x[index] * (f[index + 1] - f[index]);
            assert!((found - area()).abs() < 1e-12, "{index}: {found}");
        }
    }

    /// Its moments and its tails are those of N(0, 1), within five standard deviations of what so many draws tell.
    #[test]
    fn moments_and_tails_are_those_of_the_normal_distribution() {
        const DRAWS: usize = 400_000;
        let mut rng = ChaCha8Rng::seed_from_u64(1001);
        let draws: Vec<f64> = (0..DRAWS).map(|_| rng.sample(StandardNormal)).collect();
        let n = DRAWS as f64;
        for (power, expected, variance) in [(1, 0.0, 1.0), (2, 1.0, 2.0), (3, 0.0, 15.0), (4, 3.0, 96.0)] {
            let mean = draws.iter().map(|x| x.powi(power)).sum::<f64>() / n;
            assert!((mean - expected).abs() < 5.0 * (variance / n).sqrt(), "{power}: {mean}");
        }
        for beyond in [-3.7, -2.5, -1.0, -0.3, 0.0, 0.3, 1.0, 2.5, 3.7] {
            let share = draws.iter().filter(|x| **x < beyond).count() as f64 / n;
            let expected = 0.5 * libm::erfc(-beyond / 2_f64.sqrt());
            assert!((share - expected).abs() < 5.0 * (expected * (1.0 - expected) / n).sqrt(), "{beyond}: {share}");
        }
    }

    /// They are those of `rand_distr`, but for what its tables are rounded by.
    #[test]
    fn draws_are_those_of_rand_distr() {
        let [mut ours, mut theirs] = [ChaCha8Rng::seed_from_u64(1002), ChaCha8Rng::seed_from_u64(1002)];
        for _ in 0..100_000 {
            let (a, b): (f64, f64) = (ours.sample(StandardNormal), theirs.sample(rand_distr::StandardNormal));
            assert!((a - b).abs() < 1e-9, "{a} {b}");
        }
    }
}
