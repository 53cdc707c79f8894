//! Rows to learn from, and rows to judge by.

use std::collections::HashMap;

/// Rows by their index in the table.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Split {
    /// What is learned from.
    pub training: Vec<usize>,
    /// What nothing is learned from.
    pub held_out: Vec<usize>,
}

impl Split {
    /// So many folds of `rows`, or as many as they have postures: the one with number f holds out the f-th of every K postures,
    /// counted from 0 as they appear, with all their rows. `postures` says by row of the table which it is in; where no row
    /// repeats another these are the f-th of every K rows.
    pub fn folds(rows: &[usize], folds: usize, postures: &[usize]) -> Vec<Self> {
        let (numbers, count) = Self::numbered(rows, postures);
        let folds = folds.min(count);
        let fold = |fold: usize| {
            let held_out = |index: &usize| numbers[*index] % folds == fold;
            let (held_out, training): (Vec<usize>, Vec<usize>) = (0..rows.len()).partition(held_out);
            let named = |indices: Vec<usize>| indices.into_iter().map(|index| rows[index]).collect();
            Self { training: named(training), held_out: named(held_out) }
        };
        (0..folds).map(fold).collect()
    }

    /// By row its posture, counted from 0 as they appear among `rows`; and how many there are.
    pub fn numbered(rows: &[usize], postures: &[usize]) -> (Vec<usize>, usize) {
        let mut known: HashMap<usize, usize> = HashMap::new();
        let number = |row: &usize| {
            let next = known.len();
            *known.entry(postures[*row]).or_insert(next)
        };
        (rows.iter().map(number).collect(), known.len())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_row_is_held_out_once() {
        let rows = [4, 5, 6, 7, 9, 11, 12];
        let folds = Split::folds(&rows, 3, &(0..13).collect::<Vec<_>>());
        assert_eq!(folds[0].held_out, [4, 7, 12]);
        assert_eq!(folds[1], Split { training: vec![4, 6, 7, 11, 12], held_out: vec![5, 9] });
        let mut all: Vec<usize> = folds.iter().flat_map(|fold| fold.held_out.clone()).collect();
        all.sort_unstable();
        assert_eq!(all, rows);
    }
}
