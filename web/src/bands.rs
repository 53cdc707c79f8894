//! Running other seeds of the shown comparison, for the bands behind its curves.

use body_schema_wire::StepReport;

use crate::{
    history::Row,
    host::Command,
    panel::Panel,
    seeds::{Band, SEEDS, SeedRuns},
    settings::MAX_SEED,
};

impl Panel {
    /// The band of a learner, if other seeds of the shown comparison were run.
    pub fn band(&self, learner: usize, value: impl Fn(&Row) -> Option<f64>) -> Option<Band> {
        self.other_seeds()?.band(learner, value)
    }

    /// Runs other seeds of the shown comparison.
    pub fn run_seeds(&mut self) {
        let Some(description) = self.description().cloned() else { return };
        let first = description.seed;
        let steps = self
            .run_to()
            .min(self.session.as_ref().and_then(|one| one.remaining.map(|left| left + one.step)).unwrap_or(u64::MAX));
        self.ask(Command::Seeds {
            scenario: description.scenario.clone(),
            set: description.set.clone(),
            learners: description.learners.iter().map(|learner| learner.name.clone()).collect(),
            seeds: (1..=SEEDS).map(|offset| first.wrapping_add(offset) % MAX_SEED).collect(),
            steps,
        });
        self.seeds = Some(SeedRuns::new(description, steps));
    }

    /// Whether there are bands behind the curves, or are going to be.
    pub(crate) fn has_bands(&self) -> bool {
        self.other_seeds().is_some_and(|seeds| seeds.running || seeds.done() > 0)
    }

    /// Runs other seeds where the address asks for them.
    pub(crate) fn restore_bands(&mut self) {
        let can = self.human().is_none() && !self.is_external();
        if std::mem::take(&mut self.wants_bands) && can && !self.has_bands() {
            self.run_seeds();
        }
    }

    /// Adds a part of another seed's run.
    pub(crate) fn take_seed(&mut self, seed: u64, reports: &[StepReport], done: bool) {
        if self.seeds.as_mut().is_some_and(|seeds| seeds.take(seed, reports, done)) {
            self.ask(Command::EnoughSeed { seed });
        }
    }

    /// The runs of other seeds, if they belong to the shown comparison.
    pub fn other_seeds(&self) -> Option<&SeedRuns> {
        let description = self.description()?;
        self.seeds.as_ref().filter(|seeds| seeds.is_of(description))
    }

    /// Stops running other seeds; their results so far stay.
    pub fn cancel_seeds(&mut self) {
        self.seeds.iter_mut().for_each(SeedRuns::cancel);
        self.ask(Command::CancelSeeds);
    }
}
