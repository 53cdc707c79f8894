//! Rows to learn from, and rows to judge by.

/// Rows by their index in the table.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Split {
    /// What is learned from.
    pub training: Vec<usize>,
    /// What nothing is learned from.
    pub held_out: Vec<usize>,
}

impl Split {
    /// So many folds of `rows`: the one with number f holds out the f-th of every K, counted from 0.
    pub fn folds(rows: &[usize], folds: usize) -> Vec<Self> {
        let fold = |fold: usize| {
            let held_out = |index: &usize| index % folds == fold;
            let (held_out, training): (Vec<usize>, Vec<usize>) = (0..rows.len()).partition(held_out);
            let named = |indices: Vec<usize>| indices.into_iter().map(|index| rows[index]).collect();
            Self { training: named(training), held_out: named(held_out) }
        };
        (0..folds).map(fold).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_row_is_held_out_once() {
        let rows = [4, 5, 6, 7, 9, 11, 12];
        let folds = Split::folds(&rows, 3);
        assert_eq!(folds[0].held_out, [4, 7, 12]);
        assert_eq!(folds[1], Split { training: vec![4, 6, 7, 11, 12], held_out: vec![5, 9] });
        let mut all: Vec<usize> = folds.iter().flat_map(|fold| fold.held_out.clone()).collect();
        all.sort_unstable();
        assert_eq!(all, rows);
    }
}
