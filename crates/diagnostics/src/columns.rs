//! Diagnostics that a column raises by itself.

use super::{Diagnostic, DiagnosticKind, Evidence, Line, Subject};
use body_schema_engine::kinematics::{Joint, JointKind};

/// The slack of limits, rad or m, for rounding and for where a robot comes to rest.
const SLACK: f64 = 1e-3;

/// The plausible error of an axis, rad, and how much of it at the target no sensor measures, metres.
const AXIS: f64 = 0.01;
const SEEN: f64 = 2e-5;
/// The least distance of a target from an axis, metres: it can be moved away from the axis.
const ARM: f64 = 0.5;

pub fn diagnostics(subject: &Subject, evidence: &Evidence) -> Vec<Diagnostic> {
    let mut diagnostics = Vec::new();
    for (joint, column) in subject.columns.iter().enumerate().filter(|(_, column)| !column.is_empty()) {
        diagnostics.extend(constant(joint, column, subject, evidence));
        diagnostics.extend(outside(joint, column, subject, evidence));
    }
    diagnostics.extend(repeated(evidence));
    diagnostics.extend(too_few(subject, evidence));
    diagnostics
}

/// The diagnostic about a joint that moves too little for its axis to be determined.
fn constant(joint: usize, column: &str, subject: &Subject, evidence: &Evidence) -> Option<Diagnostic> {
    let count = evidence.configurations.len();
    if count < 2 || !subject.learned.get(joint).copied().unwrap_or(true) {
        return None;
    }
    let values = evidence.configurations.iter().map(|row| row[joint]);
    let (least, most) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), x| (least.min(x), most.max(x)));
    let range = most - least;
    let (unit, arm) = match &subject.joints[joint] {
        Joint::Revolute(axis) => ("rad", (subject.target - axis.point).norm().max(ARM)),
        Joint::Prismatic(_) => ("m", 1.0),
    };
    let is_still = range <= 1e-9;
    if !is_still && range * arm * AXIS >= SEEN {
        return None;
    }
    Some(Diagnostic {
        kind: DiagnosticKind::Constant,
        column: Some(column.to_owned()),
        lines: Vec::new(),
        what: if is_still { "this joint never moves" } else { "this joint hardly moves" }.to_owned(),
        evidence: if is_still {
            format!("{least} in all {count} rows")
        } else {
            format!(
                "between {least:.6} and {most:.6} {unit}, a range of {range:.2e}, in all {count} rows: an axis that is off by \
                 {AXIS} rad moves the target by {:.4} mm",
                range * arm * AXIS * 1e3
            )
        },
        hint: "its axis cannot be told from such data: add rows in which it moves, or hold it".to_owned(),
    })
}

fn outside(joint: usize, column: &str, subject: &Subject, evidence: &Evidence) -> Option<Diagnostic> {
    let (lower, upper) = subject.limits[joint]?;
    let beyond = |row: &[f64]| (lower - row[joint]).max(row[joint] - upper);
    let rows = (0..).zip(evidence.configurations).filter(|(_, row)| beyond(row) > SLACK);
    let lines: Vec<Line> = rows.map(|(row, _)| evidence.line(row)).collect();
    let worst = evidence.configurations.iter().map(|row| beyond(row)).fold(0.0, f64::max);
    let unit = match subject.joints[joint].kind() {
        JointKind::Revolute => "rad",
        JointKind::Prismatic => "m",
    };
    (!lines.is_empty()).then(|| Diagnostic {
        kind: DiagnosticKind::Limits,
        column: Some(column.to_owned()),
        lines,
        what: "outside the joint's limits".to_owned(),
        evidence: format!("by up to {worst:.4} {unit}; the limits are {lower:.4} and {upper:.4} {unit}"),
        hint: "correct the rows, their unit or the limits".to_owned(),
    })
}

/// The diagnostic about repeated columns; neighbours that repeat neighbours are reported together.
fn repeated(evidence: &Evidence) -> Option<Diagnostic> {
    if evidence.repeated.is_empty() {
        return None;
    }
    let list =
        |of: &dyn Fn(&(String, String)) -> String| evidence.repeated.iter().map(of).collect::<Vec<_>>().join(", ");
    let (repeating, original) = (list(&|pair| pair.0.clone()), list(&|pair| pair.1.clone()));
    Some(Diagnostic {
        kind: DiagnosticKind::RepeatedColumn,
        column: Some(repeating),
        lines: Vec::new(),
        what: format!("a copy of `{original}`"),
        evidence: "the same in every row".to_owned(),
        hint: "leave it out: it brings nothing new, and counts what it copies twice".to_owned(),
    })
}

fn too_few(subject: &Subject, evidence: &Evidence) -> Option<Diagnostic> {
    let rows = evidence.configurations.len();
    let equations = evidence.equations.unwrap_or_else(|| match &evidence.sockets {
        // The first row in a socket says where that is.
        Some(sockets) => {
            let places: std::collections::BTreeSet<&usize> = sockets.iter().collect();
            3 * rows.saturating_sub(places.len())
        }
        None => 3 * evidence.targets.iter().map(|seen| seen.points.iter().flatten().count()).sum::<usize>(),
    });
    // What one more row brings, as rows bring so far.
    let each = if equations > 0 { equations as f64 / rows.max(1) as f64 } else { 3.0 };
    (equations < subject.unknowns).then(|| Diagnostic {
        kind: DiagnosticKind::TooFewRows,
        column: None,
        lines: Vec::new(),
        what: format!("{rows} rows are too few"),
        evidence: format!("{equations} equations for {} unknowns", subject.unknowns),
        hint: format!(
            "measure some {} rows more, or learn less: what rows do not tell stays as described",
            ((subject.unknowns - equations) as f64 / each).ceil()
        ),
    })
}
