//! Splits into training rows and held-out rows.

use std::collections::HashMap;

/// A split of the rows, by their index in the table.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Split {
    /// The rows that are learned from.
    pub training: Vec<usize>,
    /// The rows that are held out.
    pub held_out: Vec<usize>,
}

impl Split {
    /// The folds of `rows`, `folds` of them, or as many as the rows have postures. Fold f holds out every K-th posture from f
    /// on, counted from 0 as they appear, with all its rows. `postures` gives the posture of each row of the table; where no
    /// row repeats another, fold f holds out every K-th row.
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

    /// The posture of each row, counted from 0 as they appear among `rows`; and the number of postures.
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
