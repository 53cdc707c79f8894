//! Diagnostics and noise from postures that were measured more than once.

use std::collections::{BTreeSet, HashMap};

use nalgebra::{Point3, Vector3};

use super::{Diagnostic, DiagnosticKind, Evidence, Line, SAME, diagnostic::length, postures};

/// The distance from its posture's other rows, in robust standard deviations, beyond which a row had not settled.
const FAR: f64 = 6.0;
/// The number of deviations, in coordinates, below which none is judged to be far from the others.
const TELLING: usize = 9;

/// The diagnostics, and σ per coordinate.
pub fn diagnostics(evidence: &Evidence) -> (Vec<Diagnostic>, Option<f64>) {
    let by_row = postures(evidence.configurations);
    let mut postures: Vec<Vec<usize>> = vec![Vec::new(); by_row.iter().max().map_or(0, |last| last + 1)];
    by_row.iter().enumerate().for_each(|(row, posture)| postures[*posture].push(row));
    let mut repeated: Vec<Vec<usize>> = postures.into_iter().filter(|rows| rows.len() > 1).collect();
    let mut diagnostics = Vec::new();
    diagnostics.extend(leakage(&by_row, evidence));
    diagnostics.extend(copies(&mut repeated, evidence));
    repeated.retain(|rows| rows.len() > 1);
    let Some(seen) = evidence.targets.first().filter(|_| !repeated.is_empty()) else { return (diagnostics, None) };
    let (deviations, postures) = deviations(&repeated, &seen.points);
    let degrees = deviations.len().saturating_sub(postures);
    if degrees < 1 {
        return (diagnostics, None);
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
        diagnostics.push(Diagnostic {
            kind: DiagnosticKind::Unsettled,
            column: None,
            lines: far.iter().map(|(row, _)| evidence.line(*row)).collect(),
            what: format!("`{}` is not where it was in the same posture in other rows", seen.name),
            evidence: format!("by up to {}, while repeats scatter by {} per coordinate", length(worst), length(sigma)),
            hint: "was the robot still moving? Measure again when it stands, or leave the rows out".to_owned(),
        });
    }
    diagnostics.push(Diagnostic {
        kind: DiagnosticKind::RepeatedPosture,
        column: None,
        lines: repeated.iter().flatten().map(|row| evidence.line(*row)).collect(),
        what: format!("{} postures were measured more than once", repeated.len()),
        evidence: format!("σ is {} per coordinate as far as they tell", length(sigma)),
        hint: "new postures would have taught more; folds keep repeats together".to_owned(),
    });
    (diagnostics, Some(sigma))
}

/// The diagnostic about held-out rows whose posture is also learned from.
fn leakage(postures: &[usize], evidence: &Evidence) -> Option<Diagnostic> {
    let held_out: BTreeSet<usize> = evidence.held_out.iter().copied().collect();
    let mut trained: HashMap<usize, usize> = HashMap::new();
    for row in (0..postures.len()).filter(|row| !held_out.contains(row)) {
        trained.entry(postures[row]).or_insert(row);
    }
    let leaks = held_out.iter().filter_map(|row| Some((*row, *trained.get(postures.get(*row)?)?)));
    let leaks: Vec<(usize, usize)> = leaks.collect();
    let (row, original) = *leaks.first()?;
    let lines: Vec<Line> = leaks.iter().map(|(row, _)| evidence.line(*row)).collect();
    Some(Diagnostic {
        kind: DiagnosticKind::Leakage,
        column: None,
        what: "held out, though the same posture is learned from".to_owned(),
        evidence: format!(
            "{} repeats {} to {SAME} rad or m; {} of {} rows that are held out do so",
            evidence.line(row),
            evidence.line(original),
            lines.len(),
            held_out.len()
        ),
        lines,
        hint: "they tell how well measuring is repeated, not how good the model is elsewhere: hold out postures that nothing is \
               learned from, or let folds choose"
            .to_owned(),
    })
}

/// The diagnostic about more folds than `rows` rows have postures.
pub fn few_folds(folds: usize, postures: usize, rows: usize) -> Option<Diagnostic> {
    (postures < folds).then(|| Diagnostic {
        kind: DiagnosticKind::FewFolds,
        column: None,
        lines: Vec::new(),
        what: format!("{folds} folds are asked for, and {postures} are made"),
        evidence: format!("{rows} rows are {postures} postures, and rows of one posture stay together"),
        hint: "measure more postures: what is held out says little of so few".to_owned(),
    })
}

/// The diagnostic about rows that are equal to an earlier one in every number; they are taken out of `repeated`.
fn copies(repeated: &mut [Vec<usize>], evidence: &Evidence) -> Option<Diagnostic> {
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
                    lines.push(evidence.line(row));
                    originals.push(evidence.line(*original));
                }
                None => kept.push(row),
            }
        }
        *rows = kept;
    }
    let original = originals.first()?;
    Some(Diagnostic {
        kind: DiagnosticKind::CopiedRow,
        column: None,
        what: format!("{} of an earlier row", if lines.len() > 1 { "copies" } else { "a copy" }),
        evidence: format!("{} says what {original} said, number by number", lines[0]),
        lines,
        hint: "leave copies out: they count as measurements and are none".to_owned(),
    })
}

/// For each row of a posture that saw the target more than once, its distance from the median of its posture; and the number
/// of such postures.
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
    use crate::Seen;

    /// One posture was seen twice, 2 mm apart; in four others that were measured twice nothing was seen.
    #[test]
    fn repeats_tell_the_noise_where_the_target_was_seen() {
        let configurations: Vec<Vec<f64>> = (0..10).map(|row| vec![f64::from(row / 2)]).collect();
        let lines: Vec<usize> = (2..12).collect();
        let at = |x: f64| Some(Point3::new(x, 0.0, 0.0));
        let points = [vec![at(0.0), at(0.002)], vec![None; 8]].concat();
        let targets = vec![Seen { name: "hand".to_owned(), points, ..Seen::default() }];
        let evidence = Evidence { lines: &lines, configurations: &configurations, targets, ..Evidence::default() };
        let (_, sigma) = diagnostics(&evidence);
        // 1 mm to either side: of one coordinate of three, with one degree of freedom each.
        let expected = (2e-6_f64 / 3.0).sqrt();
        assert!((sigma.expect("repeats") - expected).abs() < 1e-9, "{sigma:?}");
    }
}
