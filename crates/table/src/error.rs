//! What can be wrong with a table, said so that it can be mended.

/// What is wrong with a table, and how to mend it. It continues a sentence that begins with the file's name.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{what}; {mend}")]
pub struct TableError {
    /// What was found, with line and column.
    pub what: String,
    /// How to mend it.
    pub mend: String,
}

pub(super) const AS_TEXT: &str = "export the table as CSV, text in UTF-8";

impl TableError {
    /// An error by what is wrong and what to do; where it is, who reads the table adds.
    pub fn new(what: impl Into<String>, mend: impl Into<String>) -> Self {
        Self { what: what.into(), mend: mend.into() }
    }

    /// What the reader of CSV cannot read on a line, in our own words.
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
