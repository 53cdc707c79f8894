//! One doubt, said so that it can be looked into.

use std::fmt;

/// What is doubted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DoubtKind {
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
    /// Joints and measurements that do not belong together.
    Lag,
    /// Where the base stands.
    Base,
    /// Nothing explains the table.
    Misfit,
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

/// Something in a table that may be wrong. It reads as a sentence that names row or column, evidence and mend.
#[derive(Clone, Debug, PartialEq)]
pub struct Doubt {
    /// What is doubted.
    pub kind: DoubtKind,
    /// The column, if it is about one.
    pub column: Option<String>,
    /// The lines of the file, if it is about some.
    pub lines: Vec<usize>,
    /// What is suspected.
    pub what: String,
    /// Why.
    pub evidence: String,
    /// How to mend it, if it is wrong.
    pub mend: String,
}

impl fmt::Display for Doubt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(column) = &self.column {
            write!(f, "column `{column}`: ")?;
        }
        if !self.lines.is_empty() {
            write!(f, "{}: ", listed(&self.lines))?;
        }
        write!(f, "{} ({}); {}", self.what, self.evidence, self.mend)
    }
}

/// "line 4" or "lines 4, 5, 9 and 12 more".
fn listed(lines: &[usize]) -> String {
    const SHOWN: usize = 8;
    let shown: Vec<String> = lines.iter().take(SHOWN).map(ToString::to_string).collect();
    let more = lines.len().saturating_sub(SHOWN);
    let end = if more > 0 { format!(" and {more} more") } else { String::new() };
    format!("line{} {}{end}", if lines.len() > 1 { "s" } else { "" }, shown.join(", "))
}

/// A length as a reader likes it.
pub(super) fn length(metres: f64) -> String {
    if metres >= 1.0 { format!("{metres:.1} m") } else { format!("{:.2} mm", metres * 1e3) }
}
