//! Errors in a description: what is wrong, where, and what to do.

/// An error in a URDF: what is wrong, where, and what to do.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}, column {column}: {what}; {hint}")]
pub struct UrdfError {
    /// The line, counted from 1.
    pub line: usize,
    /// The column in characters, counted from 1.
    pub column: usize,
    /// What was found.
    pub what: String,
    /// What to do about it.
    pub hint: String,
}

impl UrdfError {
    /// An error at byte `byte` of `text`.
    pub(super) fn at(text: &str, byte: usize, what: impl Into<String>, hint: impl Into<String>) -> Self {
        let before = text.get(..byte).unwrap_or(text);
        let line_start = before.rfind('\n').map_or(0, |end| end + 1);
        Self {
            line: before.matches('\n').count() + 1,
            column: before[line_start..].chars().count() + 1,
            what: what.into(),
            hint: hint.into(),
        }
    }
}

/// Why a state cannot be written as the description of a chain.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Unwritable {
    /// The state's joints are not the chain's.
    #[error(
        "the state does not fit the chain: it has {found} joints, the chain {wanted} that move, and their kinds and which carries which must agree"
    )]
    Joints {
        /// Joints of the state.
        found: usize,
        /// Moving joints of the chain.
        wanted: usize,
    },
    /// A reading has a correction beyond an offset.
    #[error("a URDF has no place for the ratio or the eccentricity of joint `{joint}`: fit it without")]
    Correction {
        /// The joint.
        joint: String,
    },
    /// An axis points the other way.
    #[error("the axis of joint `{joint}` has turned by {turned_deg:.0} deg: is its sign reversed?")]
    Turned {
        /// The joint.
        joint: String,
        /// The angle by which it is turned, degrees.
        turned_deg: f64,
    },
}
