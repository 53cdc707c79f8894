//! Many seeds of the same comparison, run in the background: is what is seen luck?

use std::collections::BTreeMap;

use crate::{
    history::Row,
    host::Command,
    panel::Panel,
    wire::{Description, Report},
};

/// How many further seeds are run.
pub const SEEDS: u64 = 10;
/// How far each is run at most.
const STEPS: u64 = 300;
/// How few seeds make no band.
const FEWEST: usize = 3;

/// The runs of other seeds.
#[derive(Clone, Debug, Default)]
pub struct SeedRuns {
    /// Whether they are being run.
    pub running: bool,
    description: Description,
    total: u64,
    steps: u64,
    done: u64,
    runs: BTreeMap<u64, crate::history::History>,
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
    /// How much is done, 0 to 1.
    pub fn progress(&self) -> f32 {
        let made: u64 = self.runs.values().map(|run| run.latest()).sum();
        made as f32 / (self.total * self.steps).max(1) as f32
    }

    /// How many seeds are done.
    pub fn done(&self) -> u64 {
        self.done
    }

    /// How many seeds were asked for.
    pub fn total(&self) -> u64 {
        self.total
    }

    pub(crate) fn take(&mut self, seed: u64, reports: &[Report], done: bool) {
        if !self.running {
            return;
        }
        let run = self.runs.entry(seed).or_insert_with(|| crate::history::History::new(&self.description));
        for report in reports {
            run.take(report);
        }
        self.done += u64::from(done);
        self.running = self.done < self.total;
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
    fn is_of(&self, description: &Description) -> bool {
        self.description.scenario == description.scenario && self.description.learners == description.learners
    }
}

impl Panel {
    /// The band of a learner, if other seeds of what is shown were run.
    pub fn band(&self, learner: usize, value: impl Fn(&Row) -> Option<f64>) -> Option<Band> {
        self.seeds.is_of(self.description()?).then(|| self.seeds.band(learner, value))?
    }

    /// Runs other seeds of what is shown.
    pub fn run_seeds(&mut self) {
        let Some(description) = self.description().cloned() else { return };
        let first = description.seed;
        let steps = self
            .run_to()
            .min(STEPS)
            .min(self.session.as_ref().and_then(|one| one.remaining.map(|left| left + one.step)).unwrap_or(STEPS));
        let seeds: Vec<u64> =
            (1..=SEEDS).map(|offset| first.wrapping_add(offset) % crate::settings::MAX_SEED).collect();
        self.ask(Command::Seeds {
            scenario: description.scenario.clone(),
            learners: description.learners.iter().map(|learner| learner.name.clone()).collect(),
            seeds,
            steps,
        });
        self.seeds = SeedRuns { running: true, description, total: SEEDS, steps, ..SeedRuns::default() };
    }

    /// Stops running other seeds; what they have done stays.
    pub fn cancel_seeds(&mut self) {
        self.seeds.cancel();
        self.ask(Command::CancelSeeds);
    }
}
