//! The choice of rows that are held out.

use rand::seq::SliceRandom;

use super::{Scenario, ScenarioError};
use body_schema_diagnostics::postures;
use body_schema_experiment::Stream;

/// The rows of a table that are held out. They measure how well a model predicts data that it has not seen, and serve
/// nothing else.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HeldOut {
    /// The number of rows of the table.
    pub rows: usize,
    /// The rule by which rows are held out.
    pub rule: HeldOutRule,
    /// The [posture](fn@body_schema_diagnostics::postures) of each row: rows of one posture are held out together, unless they
    /// are listed.
    pub postures: Vec<usize>,
}

/// The rule by which rows are held out.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum HeldOutRule {
    /// No row is held out.
    Nothing,
    /// This many rows, drawn by seed; fewer, where whole postures do not add up to them.
    Count(usize),
    /// One of this many folds: fold f holds out postures f, f + K, …, which are rows f, f + K, … where no row repeats another;
    /// the seed decides which fold. There are no more folds than postures.
    Folds(usize),
    /// These rows, counted from 0, in ascending order.
    Rows(Vec<usize>),
}

impl HeldOut {
    /// The rule applied to rows with these joint positions.
    pub fn new(rule: HeldOutRule, configurations: &[Vec<f64>]) -> Self {
        Self { rows: configurations.len(), rule, postures: postures(configurations) }
    }

    /// The number of postures.
    pub fn count_postures(&self) -> usize {
        self.postures.iter().max().map_or(0, |last| last + 1)
    }

    /// The least number of training rows over all seeds.
    pub fn fewest_training(&self) -> usize {
        match self.rule {
            HeldOutRule::Count(count) => self.rows.saturating_sub(count),
            _ => self.folds().iter().map(|(training, _)| training.len()).min().unwrap_or(0),
        }
    }

    /// The rows to learn from and the rows that are held out, both in ascending order.
    pub fn split(&self, seed: u64) -> (Vec<usize>, Vec<usize>) {
        match &self.rule {
            HeldOutRule::Nothing => self.apart(&[]),
            HeldOutRule::Count(count) => {
                let mut rows: Vec<usize> = (0..self.rows).collect();
                rows.shuffle(&mut Stream::HeldOut.rng(seed));
                self.apart(&self.whole_postures(&rows, *count))
            }
            HeldOutRule::Folds(folds) => {
                let folds = self.count_folds(*folds);
                let fold = (seed % folds as u64) as usize;
                self.apart(&(0..self.rows).filter(|row| self.postures[*row] % folds == fold).collect::<Vec<_>>())
            }
            HeldOutRule::Rows(rows) => self.apart(rows),
        }
    }

    /// All splits: one per fold, or the only one; the split of seed 0, where seeds draw it.
    pub fn folds(&self) -> Vec<(Vec<usize>, Vec<usize>)> {
        match &self.rule {
            HeldOutRule::Folds(folds) => (0..self.count_folds(*folds) as u64).map(|fold| self.split(fold)).collect(),
            _ => vec![self.split(0)],
        }
    }

    fn count_folds(&self, asked: usize) -> usize {
        asked.min(self.count_postures()).max(1)
    }

    /// The first of `rows` with all of their postures, `count` rows at most.
    fn whole_postures(&self, rows: &[usize], count: usize) -> Vec<usize> {
        let mut by_posture: Vec<Vec<usize>> = vec![Vec::new(); self.count_postures()];
        rows.iter().for_each(|row| by_posture[self.postures[*row]].push(*row));
        let mut taken = Vec::new();
        for row in rows {
            let posture = &mut by_posture[self.postures[*row]];
            if taken.len() + posture.len() <= count {
                taken.append(posture);
            }
        }
        taken
    }

    fn apart(&self, held_out: &[usize]) -> (Vec<usize>, Vec<usize>) {
        let mut is_held_out = vec![false; self.rows];
        held_out.iter().for_each(|row| is_held_out[*row] = true);
        (0..self.rows).partition(|row| !is_held_out[*row])
    }
}

impl Scenario {
    /// This scenario with its table held out in so many folds, in place of the file's rule. Held-out sockets are learned
    /// from in most folds then.
    ///
    /// # Errors
    ///
    /// [`ScenarioError`] if the table has fewer rows than folds, or there is no table.
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

    fn distinct(rows: u32, rule: HeldOutRule) -> HeldOut {
        HeldOut::new(rule, &(0..rows).map(|row| vec![f64::from(row)]).collect::<Vec<_>>())
    }

    /// Five postures of two, three and one rows; encoders repeat to some hundredths of a milliradian.
    #[test]
    fn rows_of_a_posture_stay_together() {
        let which = [0, 1, 0, 2, 1, 3, 1, 4, 2];
        let rows: Vec<Vec<f64>> =
            which.iter().zip(0..).map(|(p, row)| vec![f64::from(*p) + 3e-5 * f64::from(row % 3)]).collect();
        for rule in [HeldOutRule::Folds(2), HeldOutRule::Folds(3), HeldOutRule::Folds(9), HeldOutRule::Count(4)] {
            let held_out = HeldOut::new(rule.clone(), &rows);
            assert_eq!(held_out.count_postures(), 5);
            let mut times = [0; 9];
            for seed in 0..20 {
                let (training, test) = held_out.split(seed);
                assert!(
                    !test.is_empty() && test.len() <= 5 && training.len() >= held_out.fewest_training(),
                    "{rule:?}"
                );
                let of = |rows: &[usize]| rows.iter().map(|row| which[*row]).collect::<Vec<i32>>();
                assert!(of(&test).iter().all(|posture| !of(&training).contains(posture)), "{rule:?}: {test:?}");
            }
            for (_, test) in held_out.folds() {
                test.into_iter().for_each(|row| times[row] += 1);
            }
            assert!(matches!(rule, HeldOutRule::Count(_)) || times == [1; 9], "{rule:?}: {times:?}");
        }
        assert_eq!(HeldOut::new(HeldOutRule::Folds(9), &rows).folds().len(), 5);
    }

    #[test]
    fn every_row_is_held_out_by_one_fold() {
        let held_out = distinct(7, HeldOutRule::Folds(3));
        let folds = held_out.folds();
        assert_eq!(folds[1], (vec![0, 2, 3, 5, 6], vec![1, 4]));
        let mut all: Vec<usize> = folds.into_iter().flat_map(|(_, held_out)| held_out).collect();
        all.sort_unstable();
        assert_eq!(all, (0..7).collect::<Vec<_>>());
        assert_eq!(held_out.split(4), held_out.split(1), "the seed picks the fold");
    }

    #[test]
    fn what_is_drawn_depends_on_the_seed_and_what_is_told_does_not() {
        let drawn = distinct(20, HeldOutRule::Count(5));
        assert_ne!(drawn.split(1), drawn.split(2));
        assert_eq!((drawn.split(1).0.len(), drawn.split(1).1.len()), (15, 5));
        let told = distinct(4, HeldOutRule::Rows(vec![1, 3]));
        assert_eq!(told.split(9), (vec![0, 2], vec![1, 3]));
        assert_eq!(told.folds(), [told.split(0)]);
        assert_eq!(distinct(2, HeldOutRule::Nothing).split(0), (vec![0, 1], vec![]));
    }
}
