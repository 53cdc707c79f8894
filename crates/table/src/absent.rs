//! The ways in which tables say that a cell is empty.

/// The words that programs write for a missing number, in any case.
const WORDS: [&str; 14] =
    ["nan", "-nan", "+nan", "na", "n/a", "#n/a", "#na", "<na>", "none", "null", "nil", "-", "--", "nan(ind)"];

/// Whether a cell is empty, or a word in it says so. Infinity is no such word.
pub fn is_absent(cell: &str) -> bool {
    cell.is_empty() || WORDS.iter().any(|word| cell.eq_ignore_ascii_case(word))
}
