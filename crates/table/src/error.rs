//! Errors in a table: what is wrong, where, and what to do.

/// An error in a table: what is wrong, and what to do. It continues a sentence that begins with the file's name.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{what}; {hint}")]
pub struct TableError {
    /// What was found, with line and column.
    pub what: String,
    /// What to do about it.
    pub hint: String,
}

pub(super) const AS_TEXT: &str = "export the table as CSV, text in UTF-8";

impl TableError {
    /// An error from what is wrong and what to do. The place is added by the reader of the table.
    pub fn new(what: impl Into<String>, hint: impl Into<String>) -> Self {
        Self { what: what.into(), hint: hint.into() }
    }

    /// The error for a line that the CSV reader cannot read, in our own words.
    pub(super) fn unreadable(error: &csv::Error, line: usize) -> Self {
        match error.kind() {
            csv::ErrorKind::Utf8 { err, .. } => {
                let what = format!("is not text in UTF-8: line {line}, value {} is not", err.field() + 1);
                Self::new(what, AS_TEXT)
            }
            csv::ErrorKind::Io(error) => Self::new(error.to_string(), AS_TEXT),
            _ => Self::new(error.to_string(), AS_TEXT),
        }
    }
}
