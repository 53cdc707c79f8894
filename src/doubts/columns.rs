//! What a column shows by itself.

use super::{Doubt, DoubtKind, Evidence, Subject};
use crate::kinematics::JointKind;

/// What is forgiven to limits, rad or m: rounding, and where a robot comes to rest.
const SLACK: f64 = 1e-3;

pub fn doubts(subject: &Subject, evidence: &Evidence) -> Vec<Doubt> {
    let mut doubts = Vec::new();
    for (joint, column) in subject.columns.iter().enumerate() {
        doubts.extend(constant(joint, column, evidence));
        doubts.extend(outside(joint, column, subject, evidence));
    }
    doubts.extend(repeated(evidence));
    doubts.extend(too_few(subject, evidence));
    doubts
}

fn constant(joint: usize, column: &str, evidence: &Evidence) -> Option<Doubt> {
    let first = evidence.configurations.first()?[joint];
    if evidence.configurations.len() < 2 || evidence.configurations.iter().any(|row| (row[joint] - first).abs() > 1e-9)
    {
        return None;
    }
    Some(Doubt {
        kind: DoubtKind::Constant,
        column: Some(column.to_owned()),
        lines: Vec::new(),
        what: "this joint never moves".to_owned(),
        evidence: format!("{first} in all {} rows", evidence.configurations.len()),
        mend: "its axis cannot be told from such data: add rows in which it moves, or hold it".to_owned(),
    })
}

fn outside(joint: usize, column: &str, subject: &Subject, evidence: &Evidence) -> Option<Doubt> {
    let (lower, upper) = subject.limits[joint]?;
    let beyond = |row: &[f64]| (lower - row[joint]).max(row[joint] - upper);
    let rows = evidence.lines.iter().zip(evidence.configurations);
    let lines: Vec<usize> = rows.filter(|(_, row)| beyond(row) > SLACK).map(|(line, _)| *line).collect();
    let worst = evidence.configurations.iter().map(|row| beyond(row)).fold(0.0, f64::max);
    let unit = match subject.joints[joint].kind() {
        JointKind::Revolute => "rad",
        JointKind::Prismatic => "m",
    };
    (!lines.is_empty()).then(|| Doubt {
        kind: DoubtKind::Limits,
        column: Some(column.to_owned()),
        lines,
        what: "outside the joint's limits".to_owned(),
        evidence: format!("by up to {worst:.4} {unit}; the limits are {lower:.4} and {upper:.4} {unit}"),
        mend: "correct the rows, their unit or the limits".to_owned(),
    })
}

/// Neighbouring columns that repeat neighbours are told together.
fn repeated(evidence: &Evidence) -> Option<Doubt> {
    if evidence.repeated.is_empty() {
        return None;
    }
    let list =
        |of: &dyn Fn(&(String, String)) -> String| evidence.repeated.iter().map(of).collect::<Vec<_>>().join(", ");
    let (repeating, original) = (list(&|pair| pair.0.clone()), list(&|pair| pair.1.clone()));
    Some(Doubt {
        kind: DoubtKind::RepeatedColumn,
        column: Some(repeating),
        lines: Vec::new(),
        what: format!("a copy of `{original}`"),
        evidence: "the same in every row".to_owned(),
        mend: "leave it out: it brings nothing new, and counts what it copies twice".to_owned(),
    })
}

fn too_few(subject: &Subject, evidence: &Evidence) -> Option<Doubt> {
    let rows = evidence.configurations.len();
    let equations = match &evidence.sockets {
        // The first row in a socket says where that is.
        Some(sockets) => {
            let places: std::collections::BTreeSet<&usize> = sockets.iter().collect();
            3 * rows.saturating_sub(places.len())
        }
        None => 3 * evidence.targets.iter().map(|seen| seen.points.iter().flatten().count()).sum::<usize>(),
    };
    (equations < subject.unknowns).then(|| Doubt {
        kind: DoubtKind::TooFewRows,
        column: None,
        lines: Vec::new(),
        what: format!("{rows} rows are too few"),
        evidence: format!("{equations} equations for {} unknowns", subject.unknowns),
        mend: format!(
            "measure some {} rows more, or learn less: what rows do not tell stays as described",
            (subject.unknowns - equations).div_ceil(3)
        ),
    })
}
