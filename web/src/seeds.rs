//! Many seeds of the same comparison, run in the background: is what is seen luck?

use std::collections::BTreeMap;

use body_schema::experiment::{Description, StepReport};

use crate::history::{History, Row};

/// How many further seeds are run.
pub const SEEDS: u64 = 10;
/// How few seeds make no band.
const FEWEST: usize = 3;

/// The runs of other seeds.
#[derive(Clone, Debug)]
pub struct SeedRuns {
    /// Whether they are being run.
    pub running: bool,
    description: Description,
    steps: u64,
    done: u64,
    runs: BTreeMap<u64, History>,
}

/// What the middle 80 % of seeds did at a step: 10th, 50th and 90th percentile.
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
    /// Runs of so many steps that have just been asked for.
    pub(crate) fn new(description: Description, steps: u64) -> Self {
        Self { running: true, description, steps, done: 0, runs: BTreeMap::new() }
    }

    /// How much is done, 0 to 1.
    pub fn progress(&self) -> f32 {
        let made: u64 = self.runs.values().map(|run| run.latest()).sum();
        made as f32 / (SEEDS * self.steps).max(1) as f32
    }

    /// How many seeds are done.
    pub fn done(&self) -> u64 {
        self.done
    }

    pub(crate) fn take(&mut self, seed: u64, reports: &[StepReport], done: bool) {
        if !self.running {
            return;
        }
        let run = self.runs.entry(seed).or_insert_with(|| History::new(&self.description));
        for report in reports {
            run.take(report);
        }
        self.done += u64::from(done);
        self.running = self.done < SEEDS;
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
        self.description.scenario == description.scenario && self.description.learners == description.learners
    }
}
