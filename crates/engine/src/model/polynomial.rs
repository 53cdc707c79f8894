//! The first root of a polynomial.

/// The number of coefficients.
const COUNT: usize = 8;
/// The number of times that the interval is halved: the root is then as near as rounding allows.
const HALVINGS: u32 = 52;

/// The first t from 0 to `end` at which p(t) = Σ cᵢ tⁱ is not positive; `None` if there is none.
///
/// In Bernstein's form the polynomial lies in the convex hull of its coefficients. So it has no root in an interval where all of these
/// are positive; otherwise the interval is halved, by de Casteljau's algorithm, and the lower half is looked at first.
pub(super) fn first_root(coefficients: &[f64; COUNT], end: f64) -> Option<f64> {
    // bⱼ = Σᵢ≤ⱼ (j over i)/(n over i) cᵢ endⁱ, n = 7.
    let mut scaled = *coefficients;
    let mut power = 1.0;
    for scaled in &mut scaled {
        *scaled *= power;
        power *= end;
    }
    // Of what is no number nothing is positive.
    if scaled.iter().any(|c| !c.is_finite()) {
        return Some(0.0);
    }
    let choose = |n: usize, k: usize| (0..k).fold(1.0, |product, i| product * (n - i) as f64 / (i + 1) as f64);
    let bernstein: [f64; COUNT] =
        std::array::from_fn(|j| (0..=j).map(|i| choose(j, i) / choose(COUNT - 1, i) * scaled[i]).sum());
    first(&bernstein, 0.0, end, HALVINGS)
}

fn first(bernstein: &[f64; COUNT], from: f64, to: f64, halvings: u32) -> Option<f64> {
    if bernstein[0] <= 0.0 {
        return Some(from);
    }
    if bernstein.iter().all(|b| *b > 0.0) {
        return None;
    }
    if halvings == 0 {
        return Some(from);
    }
    let [mut lower, mut upper] = [*bernstein; 2];
    for (level, lower) in lower.iter_mut().enumerate().skip(1) {
        for i in 0..COUNT - level {
            upper[i] = 0.5 * (upper[i] + upper[i + 1]);
        }
        *lower = upper[0];
    }
    let middle = 0.5 * (from + to);
    first(&lower, from, middle, halvings - 1).or_else(|| first(&upper, middle, to, halvings - 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_root_is_found_and_none_where_there_is_none() {
        // (1 − t)(2 − t)(3 + t) and others, worked by hand.
        let found = |c: [f64; COUNT], end| first_root(&c, end);
        let close = |found: Option<f64>, wanted: f64| found.is_some_and(|found| (found - wanted).abs() < 1e-12);
        assert!(close(found([6.0, -7.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0], 100.0), 1.0));
        assert_eq!(found([6.0, -7.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0], 0.9), None);
        assert_eq!(found([1.0, 0.3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], 100.0), None);
        assert_eq!(found([-1.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], 100.0), Some(0.0));
        // Positive but for a narrow dip: (t − 3)² − 1e-6 has its first root at 2.999.
        assert!(close(found([9.0 - 1e-6, -6.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0], 100.0), 2.999));
        // 1 − t⁷.
        assert!(close(found([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0], 10.0), 1.0));
    }
}
