//! Checkpoints of sessions with robots elsewhere, kept so that opening one need not replay all of it.

use uuid::Uuid;

use super::{Kept, Shared};
use crate::server::{
    metrics::Metrics,
    store::{EVERY, Saved, Store, build, packed, unpacked},
};
use body_schema_ask_tell as ask_tell;
use body_schema_ask_tell::{Checkpoint, Event, ReplayError, Setup};
use body_schema_wire::Description;

/// The steps since the latest checkpoint, none of which is in the store yet.
#[derive(Default)]
pub(super) struct Since {
    reports: Vec<Kept>,
}

impl Since {
    /// Adds a step, after `told` observations were received, and returns a checkpoint where one is due. `learned` gives what was
    /// learned up to it.
    pub(super) fn step(
        &mut self,
        report: &Kept,
        told: u64,
        learned: impl FnOnce() -> Option<Checkpoint>,
    ) -> Option<Saved> {
        build()?;
        self.reports.push(report.clone());
        if report.step == 0 || !report.step.is_multiple_of(EVERY) {
            return None;
        }
        let reports = std::mem::take(&mut self.reports);
        let state = learned()?.to_bytes();
        Some(Saved { step: report.step, told, state, reports: packed(reports.iter().map(|kept| kept.json.get())) })
    }

    /// Adds a step and keeps the checkpoint in the store, if possible.
    pub(super) fn keep(
        &mut self,
        (store, id): (&Store, Uuid),
        report: &Kept,
        told: u64,
        learned: impl FnOnce() -> Option<Checkpoint>,
    ) {
        let saved = self.step(report, told, learned);
        keep_all((store, id), saved.as_slice());
    }
}

/// Keeps checkpoints in the store, if possible.
pub(super) fn keep_all((store, id): (&Store, Uuid), saved: &[Saved]) {
    let Some(build) = build() else { return };
    for saved in saved {
        if let Err(error) = store.save(id, build, saved) {
            // Nothing is lost by it but the time to replay.
            tracing::debug!(session = %id, %error, "a checkpoint cannot be kept");
            return;
        }
    }
}

/// The point from which a stored session goes on.
pub(super) struct GoesOn {
    pub(super) checkpoint: Checkpoint,
    /// The reports of the steps until there, JSON by lines.
    reports: Vec<String>,
}

impl GoesOn {
    /// The latest checkpoint that serves these events; `None` if all of them must be replayed.
    pub(super) fn of(store: &Store, id: Uuid, events: &[Event]) -> Option<Self> {
        let saved = store.saved(id, build()?).ok()?;
        let (index, checkpoint) = latest(&saved, events)?;
        let reports = saved[..=index].iter().map(|saved| unpacked(&saved.reports).ok());
        let reports: Vec<String> = reports.collect::<Option<_>>()?;
        let steps: usize = reports.iter().map(|text| text.lines().count()).sum();
        (steps as u64 == checkpoint.step() + 1).then_some(Self { checkpoint, reports })
    }

    /// The reports of the steps until there; `None` if some are missing.
    pub(super) fn reports(&self, description: &Description) -> Option<Vec<Kept>> {
        let lines = self.reports.iter().flat_map(|text| text.lines());
        let kept: Vec<Kept> = lines.map(|line| Kept::read(line, description)).collect::<Option<_>>()?;
        let are_in_order = (0..).zip(&kept).all(|(step, kept)| kept.step == step);
        (are_in_order && kept.len() as u64 == self.checkpoint.step() + 1).then_some(kept)
    }
}

/// The latest checkpoint before an observation that serves these events.
pub(super) fn before(store: &Store, id: Uuid, observation: u64, events: &[Event]) -> Option<Checkpoint> {
    let mut saved = store.saved(id, build()?).ok()?;
    saved.retain(|saved| saved.told < observation);
    latest(&saved, events).map(|(_, checkpoint)| checkpoint)
}

fn latest(saved: &[Saved], events: &[Event]) -> Option<(usize, Checkpoint)> {
    saved.iter().enumerate().rev().filter(|(_, saved)| !saved.state.is_empty()).find_map(|(index, saved)| {
        let checkpoint = Checkpoint::from_bytes(&saved.state)?;
        (checkpoint.step() == saved.step && checkpoint.serves(events)).then_some((index, checkpoint))
    })
}

/// The checkpoints that a replay passes.
#[derive(Default)]
pub(super) struct ComeBy {
    /// The description of the experiment, once a step has come by.
    description: Option<Description>,
    since: Since,
    pub(super) saved: Vec<Saved>,
}

impl ComeBy {
    /// Adds a step, and returns its report; `None` if that cannot be written.
    pub(super) fn hear(&mut self, step: &ask_tell::Replayed<'_>, metrics: &Metrics) -> Option<Kept> {
        if step.step() > 0 {
            metrics.replayed.inc();
        }
        let description = self.description.get_or_insert_with(|| step.description());
        let kept = Kept::of(&step.report(), description).ok()?;
        self.saved.extend(self.since.step(&kept, step.told, || step.checkpoint()));
        Some(kept)
    }
}

/// A session that was replayed.
pub(super) struct Replayed {
    pub(super) session: ask_tell::Session,
    /// The whole history.
    pub(super) reports: Vec<Kept>,
    pub(super) since: Since,
    /// The checkpoints that it has passed.
    pub(super) saved: Vec<Saved>,
}

impl Replayed {
    pub(super) fn of(
        setup: Setup,
        events: Vec<Event>,
        from: Option<GoesOn>,
        shared: &Shared,
    ) -> Result<Self, ReplayError> {
        let (mut come_by, mut later) = (ComeBy::default(), Vec::new());
        let session =
            ask_tell::Session::replay_from(setup, events, from.as_ref().map(|from| &from.checkpoint), &mut |step| {
                let kept = come_by.hear(&step, &shared.metrics);
                let can_go_on = kept.is_some() && !shared.stop.is_cancelled();
                later.extend(kept);
                can_go_on
            })?;
        let ComeBy { since, saved, .. } = come_by;
        let mut reports = Vec::new();
        if let Some(from) = from {
            let lacking = || ReplayError::NotASession("the reports of its steps are not all of them".to_owned());
            reports = from.reports(&session.description()).ok_or_else(lacking)?;
        }
        reports.extend(later);
        Ok(Self { session, reports, since, saved })
    }
}
