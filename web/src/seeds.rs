//! Other seeds of the same comparison, run in the background, which show how much of the result is luck.

use std::collections::{BTreeMap, BTreeSet};

use body_schema_wire::{Description, StepReport};

use crate::{
    history::{History, Row},
    outcome::Outcome,
};

/// The number of further seeds.
pub const SEEDS: u64 = 10;
/// The least number of seeds for a band.
const FEWEST: usize = 3;

/// The runs of other seeds.
#[derive(Clone, Debug)]
pub struct SeedRuns {
    /// Whether they are being run.
    pub running: bool,
    description: Description,
    steps: u64,
    done: BTreeSet<u64>,
    runs: BTreeMap<u64, History>,
}

/// The band of the middle 80 % of seeds at each step: 10th, 50th and 90th percentile.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Band {
    /// Steps.
    pub steps: Vec<f64>,
    /// 10th percentile.
    pub low: Vec<f64>,
    /// Median.
    pub middle: Vec<f64>,
    /// 90th percentile.
    pub high: Vec<f64>,
}

impl SeedRuns {
    /// Runs of this many steps that have just been asked for.
    pub(crate) fn new(description: Description, steps: u64) -> Self {
        Self { running: true, description, steps, done: BTreeSet::new(), runs: BTreeMap::new() }
    }

    /// The share that is done, 0 to 1.
    pub fn progress(&self) -> f32 {
        let under_way = self.runs.iter().filter(|(seed, _)| !self.done.contains(seed));
        let made: u64 = under_way.map(|(_, run)| run.latest()).sum();
        (self.done() as f32 + made as f32 / self.steps.max(1) as f32) / SEEDS as f32
    }

    /// The number of seeds that are done.
    pub fn done(&self) -> u64 {
        self.done.len() as u64
    }

    /// The most steps of each run.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// Movements until accurate, a learner's, over the seeds that are done, counted from the change of the body if it
    /// changes; `None` for a seed on which they were not enough.
    pub fn finishes(&self, learner: usize) -> Vec<Option<u64>> {
        let finish = |run: &History| Some(run.converged_at(run.latest(), learner)? - run.begin(run.latest()));
        self.finished().map(finish).collect()
    }

    /// How all learners ended on each seed that is done.
    pub fn outcomes(&self) -> Vec<Vec<Outcome>> {
        let learners = self.description.learners.len();
        self.finished().map(|run| run.outcomes(learners)).collect()
    }

    fn finished(&self) -> impl Iterator<Item = &History> {
        self.runs.iter().filter(|(seed, _)| self.done.contains(seed)).map(|(_, run)| run)
    }

    /// Takes a part of a run in; whether it is the one that tells that this seed needs no more.
    pub(crate) fn take(&mut self, seed: u64, reports: &[StepReport], done: bool) -> bool {
        // What was under way when enough was known changes nothing.
        if !self.running || self.done.contains(&seed) {
            return false;
        }
        let run = self.runs.entry(seed).or_insert_with(|| History::new(&self.description));
        for report in reports {
            run.take(report);
        }
        let told = self.runs.get(&seed).is_some_and(History::is_told);
        if done || told {
            self.done.insert(seed);
        }
        self.running = self.done() < SEEDS;
        told && !done
    }

    pub(crate) fn cancel(&mut self) {
        self.running = false;
    }

    /// The band of a learner, over the steps that at least three seeds have reached.
    pub fn band(&self, learner: usize, value: impl Fn(&Row) -> Option<f64>) -> Option<Band> {
        let mut band = Band::default();
        let first = self.runs.values().map(|run| run.first()).min()?;
        let furthest = self.runs.values().map(|run| run.latest()).max()?;
        for step in first..=furthest {
            let rows = self.runs.values().filter_map(|run| run.row(step, learner));
            let mut values: Vec<f64> = rows.filter_map(&value).filter(|value| value.is_finite()).collect();
            if values.len() < FEWEST {
                break;
            }
            values.sort_by(f64::total_cmp);
            let at = |share: f64| values[(share * (values.len() - 1) as f64).round() as usize];
            band.steps.push(step as f64);
            band.low.push(at(0.1));
            band.middle.push(at(0.5));
            band.high.push(at(0.9));
        }
        (band.steps.len() > 1).then_some(band)
    }

    /// Whether these runs are of what is shown.
    pub(crate) fn is_of(&self, description: &Description) -> bool {
        let of = |one: &Description| (one.scenario.clone(), one.set.clone(), one.learners.clone());
        of(&self.description) == of(description)
    }
}

/// The middle of several numbers of movements, those that were not enough being the largest; `None` if it is one of
/// these.
pub fn median(finishes: &[Option<u64>]) -> Option<f64> {
    let mut sorted: Vec<f64> = finishes.iter().map(|one| one.map_or(f64::INFINITY, |one| one as f64)).collect();
    sorted.sort_by(f64::total_cmp);
    let middle = sorted.len().checked_sub(1)?;
    let value = (sorted[middle / 2] + sorted[middle.div_ceil(2)]) / 2.0;
    value.is_finite().then_some(value)
}

#[cfg(test)]
mod tests {
    use super::median;

    #[test]
    fn a_median_counts_runs_that_did_not_finish() {
        assert_eq!(median(&[]), None);
        assert_eq!(median(&[Some(3), None, Some(1)]), Some(3.0));
        assert_eq!(median(&[Some(3), Some(4)]), Some(3.5));
        assert_eq!(median(&[Some(3), None]), None);
        assert_eq!(median(&[None, Some(3), None]), None);
    }
}
