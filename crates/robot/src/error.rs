//! What can be wrong with a description, said so that it can be mended.

/// What is wrong in a URDF, where, and how to mend it.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}, column {column}: {what}; {mend}")]
pub struct UrdfError {
    /// Counted from 1.
    pub line: usize,
    /// In characters, counted from 1.
    pub column: usize,
    /// What was found.
    pub what: String,
    /// How to mend it.
    pub mend: String,
}

impl UrdfError {
    /// An error at a byte of `text`.
    pub(super) fn at(text: &str, byte: usize, what: impl Into<String>, mend: impl Into<String>) -> Self {
        let before = text.get(..byte).unwrap_or(text);
        let line_start = before.rfind('\n').map_or(0, |end| end + 1);
        Self {
            line: before.matches('\n').count() + 1,
            column: before[line_start..].chars().count() + 1,
            what: what.into(),
            mend: mend.into(),
        }
    }
}

/// Why a state cannot be written as the description of a chain.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Unwritable {
    /// Not the chain's joints.
    #[error("the chain has {wanted} moving joints and the state {found}, or not of the same kinds")]
    Joints {
        /// Joints of the state.
        found: usize,
        /// Moving joints of the chain.
        wanted: usize,
    },
    /// A reading that is corrected by more than an offset.
    #[error("a URDF has no place for the ratio or the eccentricity of joint `{joint}`: fit it without")]
    Correction {
        /// The joint.
        joint: String,
    },
    /// An axis that points the other way.
    #[error("the axis of joint `{joint}` has turned by {turned_deg:.0} deg: is its sign reversed?")]
    Turned {
        /// The joint.
        joint: String,
        /// By how much, degrees.
        turned_deg: f64,
    },
}
