//! A diagnostic: one doubt about a table, with what to check.

use std::{fmt, sync::Arc};

/// What is doubted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DiagnosticKind {
    /// A unit: millimetres for metres, degrees for radians, or the other way round.
    Unit,
    /// The sign of a joint's readings.
    Sign,
    /// The zero of a joint's readings.
    Zero,
    /// The order of columns.
    Order,
    /// The handedness of a target's coordinates.
    Mirror,
    /// The size of everything that was seen.
    Size,
    /// How poses are written: inverted, or their rotations in another convention.
    Pose,
    /// Joints and measurements that were taken at different times.
    Lag,
    /// The pose of the base.
    Base,
    /// A table that nothing explains.
    Misfit,
    /// A target whose place never changes.
    Still,
    /// A joint that does not move.
    Constant,
    /// Rows outside a joint's limits.
    Limits,
    /// A column that repeats another.
    RepeatedColumn,
    /// A row that is a copy of another.
    CopiedRow,
    /// Postures that were measured more than once.
    RepeatedPosture,
    /// A row that was taken before the robot stood still.
    Unsettled,
    /// Fewer equations than unknowns.
    TooFewRows,
    /// Rows that are held out and repeat the posture of rows that are learned from.
    Leakage,
    /// More folds than postures.
    FewFolds,
}

/// A diagnostic: something in a table that may be wrong. It reads as a sentence that names row or column, the evidence,
/// and what to do.
#[derive(Clone, Debug, PartialEq)]
pub struct Diagnostic {
    /// What is doubted.
    pub kind: DiagnosticKind,
    /// The column that it is about, if any.
    pub column: Option<String>,
    /// The lines that it is about, if any.
    pub lines: Vec<Line>,
    /// What is suspected.
    pub what: String,
    /// The evidence.
    pub evidence: String,
    /// What to do, if it is wrong.
    pub hint: String,
}

impl fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(column) = &self.column {
            write!(f, "column `{column}`: ")?;
        }
        if !self.lines.is_empty() {
            write!(f, "{}: ", listed(&self.lines))?;
        }
        write!(f, "{} ({}); {}", self.what, self.evidence, self.hint)
    }
}

/// A line of a table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Line {
    /// The file, where rows come from more than one.
    pub file: Option<Arc<str>>,
    /// Its number in that file, counted from 1.
    pub number: usize,
}

impl fmt::Display for Line {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "line {}", self.number)?;
        self.file.iter().try_for_each(|file| write!(f, " of {file}"))
    }
}

/// "line 4" or "lines 4, 5, 9 and 12 more"; where there is more than one file "a.csv: lines 4, 5; b.csv: line 9".
pub fn listed(lines: &[Line]) -> String {
    const SHOWN: usize = 8;
    let mut files: Vec<(&Option<Arc<str>>, Vec<usize>)> = Vec::new();
    for Line { file, number } in lines {
        match files.iter_mut().find(|(known, _)| *known == file) {
            Some((_, numbers)) => numbers.push(*number),
            None => files.push((file, vec![*number])),
        }
    }
    let told = files.into_iter().map(|(file, numbers)| {
        let file = file.as_ref().map(|file| format!("{file}: ")).unwrap_or_default();
        let shown: Vec<String> = numbers.iter().take(SHOWN).map(ToString::to_string).collect();
        let more = numbers.len().saturating_sub(SHOWN);
        let end = if more > 0 { format!(" and {more} more") } else { String::new() };
        format!("{file}line{} {}{end}", if numbers.len() > 1 { "s" } else { "" }, shown.join(", "))
    });
    told.collect::<Vec<_>>().join("; ")
}

/// A length in a unit that reads well.
pub(super) fn length(metres: f64) -> String {
    if metres >= 1.0 { format!("{metres:.1} m") } else { format!("{:.2} mm", metres * 1e3) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_of_several_files_are_told_apart() {
        let line = |file: Option<&str>, number| Line { file: file.map(Arc::from), number };
        assert_eq!(listed(&[line(None, 4)]), "line 4");
        assert_eq!(
            listed(&(1..11).map(|number| line(None, number)).collect::<Vec<_>>()),
            "lines 1, 2, 3, 4, 5, 6, 7, 8 and 2 more"
        );
        let both = [line(Some("a.csv"), 16), line(Some("b.csv"), 5), line(Some("a.csv"), 17)];
        assert_eq!(listed(&both), "a.csv: lines 16, 17; b.csv: line 5");
        assert_eq!(both[1].to_string(), "line 5 of b.csv");
    }
}
