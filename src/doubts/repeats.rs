//! Postures that were measured more than once.

use std::collections::HashMap;

use nalgebra::{Point3, Vector3};

use super::{Doubt, DoubtKind, Evidence, doubt::length};

/// Postures that differ by less are one, rad or m: what encoders repeat to.
const SAME: f64 = 1e-4;
/// A row so many robust standard deviations from its posture's others had not settled.
const FAR: f64 = 6.0;
/// Deviations, in coordinates, below which none is far from the others.
const TELLING: usize = 9;

/// The doubts, and σ per coordinate.
pub fn doubts(evidence: &Evidence) -> (Vec<Doubt>, Option<f64>) {
    let mut postures: HashMap<Vec<i64>, Vec<usize>> = HashMap::new();
    for (row, configuration) in evidence.configurations.iter().enumerate() {
        let key = configuration.iter().map(|position| (position / SAME).round() as i64).collect();
        postures.entry(key).or_default().push(row);
    }
    let mut repeated: Vec<Vec<usize>> = postures.into_values().filter(|rows| rows.len() > 1).collect();
    repeated.sort_unstable();
    let mut doubts = Vec::new();
    doubts.extend(copies(&mut repeated, evidence));
    repeated.retain(|rows| rows.len() > 1);
    let Some(seen) = evidence.targets.first().filter(|_| !repeated.is_empty()) else { return (doubts, None) };
    let (deviations, postures) = deviations(&repeated, &seen.points);
    let degrees = deviations.len().saturating_sub(postures);
    if degrees < 1 {
        return (doubts, None);
    }
    let mut sizes: Vec<f64> =
        deviations.iter().flat_map(|(_, by)| by.iter().map(|x| x.abs()).collect::<Vec<_>>()).collect();
    sizes.sort_by(f64::total_cmp);
    // The median of absolute deviations, as a standard deviation.
    let robust = 1.4826 * sizes[sizes.len() / 2];
    let is_far = |by: &Vector3<f64>| sizes.len() >= TELLING && by.norm() > FAR * robust.max(1e-9);
    let (far, near): (Vec<_>, Vec<_>) = deviations.iter().partition(|(_, by)| is_far(by));
    let sum: f64 = near.iter().map(|(_, by)| by.norm_squared()).sum();
    let sigma = (sum / (3.0 * degrees.saturating_sub(far.len()).max(1) as f64)).sqrt();
    if !far.is_empty() {
        let worst = far.iter().map(|(_, by)| by.norm()).fold(0.0, f64::max);
        doubts.push(Doubt {
            kind: DoubtKind::Unsettled,
            column: None,
            lines: far.iter().map(|(row, _)| evidence.lines[*row]).collect(),
            what: format!("`{}` is not where it was in the same posture in other rows", seen.name),
            evidence: format!("by up to {}, while repeats scatter by {} per coordinate", length(worst), length(sigma)),
            mend: "was the robot still moving? Measure again when it stands, or leave the rows out".to_owned(),
        });
    }
    doubts.push(Doubt {
        kind: DoubtKind::RepeatedPosture,
        column: None,
        lines: repeated.iter().flatten().map(|row| evidence.lines[*row]).collect(),
        what: format!("{} postures were measured more than once", repeated.len()),
        evidence: format!("σ is {} per coordinate as far as they tell", length(sigma)),
        mend: "new postures would have taught more; let folds keep repeats together".to_owned(),
    });
    (doubts, Some(sigma))
}

/// Rows that are equal to an earlier one in every number; they are taken out of `repeated`.
fn copies(repeated: &mut [Vec<usize>], evidence: &Evidence) -> Option<Doubt> {
    let mut lines = Vec::new();
    let mut originals = Vec::new();
    let is_copy = |one: usize, other: usize| {
        evidence.configurations[one] == evidence.configurations[other]
            && !evidence.targets.is_empty()
            && evidence.targets.iter().all(|seen| seen.points[one] == seen.points[other])
    };
    for rows in repeated {
        // Copies stand next to their original once sorted by what was measured.
        let key = |row: &usize| evidence.targets.first().and_then(|seen| seen.points[*row]).map(|p| p.coords.data.0);
        rows.sort_by(|a, b| key(a).partial_cmp(&key(b)).unwrap_or(std::cmp::Ordering::Equal).then(a.cmp(b)));
        let mut kept: Vec<usize> = Vec::new();
        for &row in rows.iter() {
            match kept.last().filter(|last| is_copy(**last, row)) {
                Some(original) => {
                    lines.push(evidence.lines[row]);
                    originals.push(evidence.lines[*original]);
                }
                None => kept.push(row),
            }
        }
        *rows = kept;
    }
    let original = *originals.first()?;
    Some(Doubt {
        kind: DoubtKind::CopiedRow,
        column: None,
        what: format!("{} of an earlier row", if lines.len() > 1 { "copies" } else { "a copy" }),
        evidence: format!("line {} says what line {original} said, number by number", lines[0]),
        lines,
        mend: "leave copies out: they count as measurements and are none".to_owned(),
    })
}

/// By row of a posture that saw the target more than once: how far from the median of its posture; and how many such postures
/// there are.
fn deviations(repeated: &[Vec<usize>], points: &[Option<Point3<f64>>]) -> (Vec<(usize, Vector3<f64>)>, usize) {
    let (mut deviations, mut postures) = (Vec::new(), 0);
    for rows in repeated {
        let seen: Vec<(usize, Point3<f64>)> = rows.iter().filter_map(|row| Some((*row, points[*row]?))).collect();
        if seen.len() < 2 {
            continue;
        }
        postures += 1;
        let median = Vector3::from_fn(|k, _| {
            let mut values: Vec<f64> = seen.iter().map(|(_, point)| point[k]).collect();
            values.sort_by(f64::total_cmp);
            (values[(values.len() - 1) / 2] + values[values.len() / 2]) / 2.0
        });
        deviations.extend(seen.iter().map(|(row, point)| (*row, point.coords - median)));
    }
    (deviations, postures)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::doubts::Seen;

    /// One posture was seen twice, 2 mm apart; in four others that were measured twice nothing was seen.
    #[test]
    fn repeats_tell_the_noise_where_the_target_was_seen() {
        let configurations: Vec<Vec<f64>> = (0..10).map(|row| vec![f64::from(row / 2)]).collect();
        let lines: Vec<usize> = (2..12).collect();
        let at = |x: f64| Some(Point3::new(x, 0.0, 0.0));
        let points = [vec![at(0.0), at(0.002)], vec![None; 8]].concat();
        let targets = vec![Seen { name: "hand".to_owned(), points, ..Seen::default() }];
        let evidence = Evidence { lines: &lines, configurations: &configurations, targets, ..Evidence::default() };
        let (_, sigma) = doubts(&evidence);
        // 1 mm to either side: of one coordinate of three, with one degree of freedom each.
        let expected = (2e-6_f64 / 3.0).sqrt();
        assert!((sigma.expect("repeats") - expected).abs() < 1e-9, "{sigma:?}");
    }
}
