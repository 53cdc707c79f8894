//! How tables say that there is nothing.

/// What programs write where they have no number, in any case.
const WORDS: [&str; 14] =
    ["nan", "-nan", "+nan", "na", "n/a", "#n/a", "#na", "<na>", "none", "null", "nil", "-", "--", "nan(ind)"];

/// Whether a cell holds nothing: it is empty, or a word says so. Infinity is no such word.
pub fn is_absent(cell: &str) -> bool {
    cell.is_empty() || WORDS.iter().any(|word| cell.eq_ignore_ascii_case(word))
}
