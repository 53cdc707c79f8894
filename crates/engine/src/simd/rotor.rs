//! Sine and cosine.

use fearless_simd::{ExtractToken, Simd, SimdBase, SimdMask};

use super::{Lanes, splat};
use crate::elementary;

/// Sine and cosine of angles, radians, within two units in the last place of 1.
///
/// The angle is reduced to `r = x − n π/2`, `|r| ≤ π/4`, with π/2 in three parts of 33 bits (Cody and Waite), and the two
/// functions of r are Remez polynomials (those of FreeBSD's msun). Then
///
/// ```text
/// sin x = sin r cos(n π/2) + cos r sin(n π/2),     cos x = cos r cos(n π/2) − sin r sin(n π/2)
/// ```
#[inline(always)]
pub fn sin_cos<S: Simd>(x: Lanes<S>) -> (Lanes<S>, Lanes<S>) {
    let simd = x.token();
    let found = reduced::<S>(x);
    if x.abs().simd_lt(splat(simd, FAR)).all_true() {
        return found;
    }
    // Too far for the reduction, or no number: those alone, whatever stands beside them.
    let (sine, cosine) = found;
    (one_by_one::<S>(x, sine, elementary::sin), one_by_one::<S>(x, cosine, elementary::cos))
}

/// Sine and cosine of angles up to [`FAR`], radians.
#[inline(always)]
fn reduced<S: Simd>(x: Lanes<S>) -> (Lanes<S>, Lanes<S>) {
    let simd = x.token();
    let n = nearest::<S>(x * std::f64::consts::FRAC_2_PI);
    let mut r = x;
    for part in HALF_PI {
        r = n * splat(simd, -part) + r;
    }
    let z = r * r;
    let sine = (r * z) * polynomial::<S>(z, &SINE) + r;
    let cosine = (z * z) * polynomial::<S>(z, &COSINE) + (z * splat(simd, -0.5) + splat(simd, 1.0));
    // n modulo 4 is one of −2 … 2, of which the cosine of a quarter turn each is 1 − |q|.
    let q = nearest::<S>(n * 0.25) * splat(simd, -4.0) + n;
    let (of_cosine, of_sine) = (splat(simd, 1.0) - q.abs(), q * (splat(simd, 2.0) - q.abs()));
    (sine * of_cosine + cosine * of_sine, cosine * of_cosine - sine * of_sine)
}

/// The polynomial with these coefficients, the highest power first.
#[inline(always)]
fn polynomial<S: Simd>(z: Lanes<S>, coefficients: &[f64; 6]) -> Lanes<S> {
    let simd = z.token();
    let mut sum = splat(simd, coefficients[0]);
    for coefficient in &coefficients[1..] {
        sum = sum * z + splat(simd, *coefficient);
    }
    sum
}

#[cold]
#[inline(never)]
fn one_by_one<S: Simd>(x: Lanes<S>, near: Lanes<S>, f: impl Fn(f64) -> f64) -> Lanes<S> {
    Lanes::<S>::from_fn(x.token(), |lane| if x[lane].abs() < FAR { near[lane] } else { f(x[lane]) })
}

/// The nearest whole number, for numbers below 2⁵¹: adding 1.5·2⁵² leaves no room for a fraction.
#[inline(always)]
fn nearest<S: Simd>(x: Lanes<S>) -> Lanes<S> {
    const ROOM: f64 = 1.5 * (1_u64 << 52) as f64;
    (x + ROOM) - ROOM
}

/// Up to here n has 20 bits at most, and its products with the parts of π/2 are exact.
const FAR: f64 = 1e6;
const HALF_PI: [f64; 3] = [1.570_796_326_734_125_6, 6.077_100_506_303_966e-11, 2.022_266_248_795_950_7e-21];
const SINE: [f64; 6] = [
    1.589_690_995_211_55e-10,
    -2.505_076_025_340_686_3e-8,
    2.755_731_370_707_006_8e-6,
    -1.984_126_982_985_795e-4,
    8.333_333_333_322_49e-3,
    -1.666_666_666_666_663_2e-1,
];
const COSINE: [f64; 6] = [
    -1.135_964_755_778_819_5e-11,
    2.087_572_321_298_175e-9,
    -2.755_731_435_139_066_3e-7,
    2.480_158_728_947_673e-5,
    -1.388_888_888_887_411e-3,
    4.166_666_666_666_66e-2,
];

#[cfg(test)]
mod tests {
    use fearless_simd::{Level, dispatch};

    use super::*;
    use crate::simd::levels;

    /// Sine and cosine of two angles.
    fn on(level: Level, angles: [f64; 2]) -> ([f64; 2], [f64; 2]) {
        #[inline(always)]
        fn of<S: Simd>(simd: S, angles: [f64; 2]) -> ([f64; 2], [f64; 2]) {
            let (sine, cosine) = sin_cos::<S>(Lanes::<S>::from_fn(simd, |lane| angles[lane % 2]));
            ([sine[0], sine[1]], [cosine[0], cosine[1]])
        }
        dispatch!(level, simd => of(simd, angles))
    }

    /// Over many turns, at all quarters of a turn and beyond the reach of the reduction.
    #[test]
    fn sines_are_those_of_the_standard_library() {
        let turns = (-4_000..4_000).map(|k| f64::from(k) * 0.017_3);
        let quarters = (-40..40).map(|k| f64::from(k) * std::f64::consts::FRAC_PI_4);
        let far = [3e5, -999_999.9, 1e6, -1e9, 1e300].into_iter();
        let angles: Vec<f64> = turns.chain(quarters).chain(far).collect();
        for level in levels() {
            for x in &angles {
                let (sine, cosine) = on(level, [*x, -*x]);
                for (lane, x) in [(0, *x), (1, -*x)] {
                    assert!((sine[lane] - x.sin()).abs() < 4.5e-16, "{level:?} sin {x}");
                    assert!((cosine[lane] - x.cos()).abs() < 4.5e-16, "{level:?} cos {x}");
                }
            }
            let (sine, cosine) = on(level, [f64::NAN, f64::INFINITY]);
            assert!(sine[0].is_nan() && cosine[1].is_nan());
            assert_eq!(on(level, [0.0, 0.0]), ([0.0; 2], [1.0; 2]));
        }
    }
}
