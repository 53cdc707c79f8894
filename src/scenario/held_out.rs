//! Which rows of a table nobody learns from.

use rand::seq::SliceRandom;

use super::{Scenario, ScenarioError};
use crate::experiment::Stream;

/// Which rows of a table are held out: they say how good a model is on data that it has not seen, and touch nothing else.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HeldOut {
    /// Rows of the table.
    pub rows: usize,
    /// Which of them.
    pub rule: HeldOutRule,
}

/// How the rows that are held out are told.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum HeldOutRule {
    /// None are.
    Nothing,
    /// So many, drawn by seed.
    Count(usize),
    /// Fold f of so many holds out rows f, f + K, …; the seed says which fold.
    Folds(usize),
    /// These, counted from 0, in ascending order.
    Rows(Vec<usize>),
}

impl HeldOut {
    /// The rows to learn from and the rows that are held out, both in ascending order.
    pub fn split(&self, seed: u64) -> (Vec<usize>, Vec<usize>) {
        match &self.rule {
            HeldOutRule::Nothing => self.apart(&[]),
            HeldOutRule::Count(count) => {
                let mut rows: Vec<usize> = (0..self.rows).collect();
                rows.shuffle(&mut Stream::HeldOut.rng(seed));
                rows.truncate(*count);
                self.apart(&rows)
            }
            HeldOutRule::Folds(folds) => {
                let fold = (seed % (*folds).max(1) as u64) as usize;
                self.apart(&(fold..self.rows).step_by((*folds).max(1)).collect::<Vec<_>>())
            }
            HeldOutRule::Rows(rows) => self.apart(rows),
        }
    }

    /// Every split that there is: one per fold, or the only one; that of seed 0, where seeds draw it.
    pub fn folds(&self) -> Vec<(Vec<usize>, Vec<usize>)> {
        match &self.rule {
            HeldOutRule::Folds(folds) => (0..*folds as u64).map(|fold| self.split(fold)).collect(),
            _ => vec![self.split(0)],
        }
    }

    fn apart(&self, held_out: &[usize]) -> (Vec<usize>, Vec<usize>) {
        let mut is_held_out = vec![false; self.rows];
        held_out.iter().for_each(|row| is_held_out[*row] = true);
        (0..self.rows).partition(|row| !is_held_out[*row])
    }
}

impl Scenario {
    /// The same with its table held out in so many folds, whatever its file holds out; sockets that nobody learned from are
    /// learned from in most folds then.
    ///
    /// # Errors
    ///
    /// Where the table has fewer rows than folds, or there is no table.
    pub fn in_folds(&self, folds: usize) -> Result<Self, ScenarioError> {
        let (mut document, file) =
            (self.source.parse::<toml::Table>().unwrap_or_default(), format!("{}.toml", self.name));
        if let Some(measurements) = document.get_mut("measurements").and_then(toml::Value::as_table_mut) {
            measurements.remove("held_out");
        }
        let folds = i64::try_from(folds).unwrap_or(i64::MAX);
        document.insert("held_out".to_owned(), toml::Table::from_iter([("folds".to_owned(), folds.into())]).into());
        Self::parse(&file, &document.to_string(), &|file| self.data_file(file))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_row_is_held_out_by_one_fold() {
        let held_out = HeldOut { rows: 7, rule: HeldOutRule::Folds(3) };
        let folds = held_out.folds();
        assert_eq!(folds[1], (vec![0, 2, 3, 5, 6], vec![1, 4]));
        let mut all: Vec<usize> = folds.into_iter().flat_map(|(_, held_out)| held_out).collect();
        all.sort_unstable();
        assert_eq!(all, (0..7).collect::<Vec<_>>());
        assert_eq!(held_out.split(4), held_out.split(1), "the seed picks the fold");
    }

    #[test]
    fn what_is_drawn_depends_on_the_seed_and_what_is_told_does_not() {
        let drawn = HeldOut { rows: 20, rule: HeldOutRule::Count(5) };
        assert_ne!(drawn.split(1), drawn.split(2));
        assert_eq!((drawn.split(1).0.len(), drawn.split(1).1.len()), (15, 5));
        let told = HeldOut { rows: 4, rule: HeldOutRule::Rows(vec![1, 3]) };
        assert_eq!(told.split(9), (vec![0, 2], vec![1, 3]));
        assert_eq!(told.folds(), [told.split(0)]);
        assert_eq!(HeldOut { rows: 2, rule: HeldOutRule::Nothing }.split(0), (vec![0, 1], vec![]));
    }
}
