//! Rows that were measured while the robot moved.
//!
//! Where joints and measurements are paired by clocks that differ, the hand may have begun to move to the next posture when it was seen,
//! or may still have been on its way from the one before. The residual of such a row points to the target's place in the other posture;
//! the residual of a row that went wrong in another way points anywhere: the cosine c of the angle between both is uniform then. With
//! half of the rows that are off on their way, whose cosines have the density `(k + 1)/2 · ((1 + c)/2)ᵏ`, the logarithm of the odds is
//!
//! ```text
//! Σ ln( ½ (k + 1) ((1 + c)/2)ᵏ + ½ )
//! ```

use nalgebra::Point3;

use super::{Diagnostic, DiagnosticKind, Line, diagnostic::length};
use body_schema_engine::{
    elementary::{acos, ln, powf},
    most::middle,
};

/// A row is off where more is left of it than so many times what is left of the middle one.
const OFF: f64 = 2.5;
/// The width of the cone, degrees, within which half of the rows on their way lie: noise, and the robot's own errors,
/// turn residuals.
const NARROW: f64 = 20.0;
/// The logarithm of the odds from which on it is reported; chance reaches it in one table of 100 at most, since the odds of a false
/// hypothesis are 1 in the mean.
const TOLD: f64 = 4.6;
/// A row is on its way within this angle, degrees, and at most this share of it.
const WITHIN: f64 = 40.0;
const SHARE: f64 = 0.5;

/// The diagnostic that the robot stood still, from the target's expected and measured place in each row; a residual less than `sigma` is not
/// off.
pub fn diagnostic(lines: &[Line], places: &[Point3<f64>], seen: &[Point3<f64>], sigma: f64) -> Option<Diagnostic> {
    let left: Vec<_> = seen.iter().zip(places).map(|(seen, place)| seen - place).collect();
    let middle = middle(left.iter().map(nalgebra::Vector3::norm).collect()).filter(|middle| *middle > 0.0)?;
    let off: Vec<usize> = (0..left.len()).filter(|row| left[*row].norm() > OFF * middle.max(sigma)).collect();
    let towards = |by: isize| {
        let way =
            |row: usize| Some(places.get(row.checked_add_signed(by)?)? - places[row]).filter(|way| way.norm() > 0.0);
        let cosines: Vec<(usize, f64)> =
            off.iter().filter_map(|row| Some((*row, left[*row].normalize().dot(&way(*row)?.normalize())))).collect();
        let gain = |c: f64| ln(0.5 * (NARROW + 1.0) * powf(0.5 * (1.0 + c), NARROW) + 0.5);
        let odds: f64 = cosines.iter().map(|(_, c)| gain(*c)).sum();
        let on_way = |(row, c): &(usize, f64)| {
            let share = way(*row).is_some_and(|way| left[*row].norm() < SHARE * way.norm());
            share && acos(*c).to_degrees() < WITHIN
        };
        (odds, by, cosines.iter().filter(|it| on_way(it)).map(|it| it.0).collect::<Vec<usize>>())
    };
    let found = [towards(1), towards(-1)].into_iter().max_by(|a, b| a.0.total_cmp(&b.0));
    let (_, by, rows) = found.filter(|(odds, _, rows)| *odds > TOLD && rows.len() > 1)?;
    let furthest = rows.iter().map(|row| left[*row].norm()).fold(0.0, f64::max);
    let other = if by > 0 { "to that of the line below" } else { "from that of the line above" };
    Some(Diagnostic {
        kind: DiagnosticKind::Lag,
        column: None,
        lines: rows.iter().map(|row| lines[*row].clone()).collect(),
        what: format!("measured while the robot moved, on its way {other}"),
        evidence: format!(
            "they miss by up to {}, the middle row by {}, and what is left of them points along that way",
            length(furthest),
            length(middle)
        ),
        hint: "pair joints and measurements by their times anew, where the robot stands still: their clocks differ"
            .to_owned(),
    })
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    fn normal(rng: &mut ChaCha8Rng, sigma: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| sigma * rng.sample::<f64, _>(rand_distr::StandardNormal))
    }

    /// Thirty postures within half a metre, with noise of 1 mm; `spoil` says what a row is off by beside it.
    fn told(seed: u64, spoil: impl Fn(&mut ChaCha8Rng, &[Point3<f64>], usize) -> Vector3<f64>) -> Option<Diagnostic> {
        let rng = &mut ChaCha8Rng::seed_from_u64(seed);
        let places: Vec<Point3<f64>> = (0..30).map(|_| (normal(rng, 0.25)).into()).collect();
        let seen: Vec<Point3<f64>> =
            (0..30).map(|row| places[row] + normal(rng, 1e-3) + spoil(rng, &places, row)).collect();
        let lines: Vec<Line> = (2..32).map(|number| Line { file: None, number }).collect();
        diagnostic(&lines, &places, &seen, 1e-3)
    }

    #[test]
    fn rows_on_their_way_are_told_and_others_are_not() {
        let moved = [4, 11, 20];
        let [mut forth, mut back, mut none, mut wrong] = [0; 4];
        for seed in 1001..1201 {
            let to = |other: isize| {
                told(seed, |rng, places, row| {
                    let way = places[row.saturating_add_signed(other).min(29)] - places[row];
                    if moved.contains(&row) {
                        way * (rng.random_range(8e-3..2e-2) / way.norm())
                    } else {
                        Vector3::zeros()
                    }
                })
            };
            let is_right = |diagnostic: Option<Diagnostic>, words: &str| {
                diagnostic.is_some_and(|it| {
                    it.what.ends_with(words)
                        && [6, 13, 22].iter().all(|number| it.lines.iter().any(|line| line.number == *number))
                })
            };
            forth += usize::from(is_right(to(1), "to that of the line below"));
            back += usize::from(is_right(to(-1), "from that of the line above"));
            none += usize::from(told(seed, |_, _, _| Vector3::zeros()).is_some());
            wrong += usize::from(
                told(seed, |rng, _, row| if row % 5 == 0 { normal(rng, 8e-3) } else { Vector3::zeros() }).is_some(),
            );
        }
        assert!(forth >= 180 && back >= 180 && none <= 2 && wrong <= 2, "{forth} {back} {none} {wrong}");
    }
}
