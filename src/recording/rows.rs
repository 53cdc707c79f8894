//! Rows that wait to be written, one batch per entity.
//!
//! Rerun's own stream batches in a thread and writes in another, where errors go to a log. Here rows are gathered and
//! handed over when the recorder says so: many steps make one chunk per entity, and every error has a caller.

use std::{collections::BTreeMap, sync::Arc};

use rerun::{
    AsComponents, ComponentIdentifier, DynamicArchetype, SerializedComponentBatch, Timeline,
    external::{
        arrow::array::{ArrayRef, UInt64Array},
        re_log_types::EntityPath,
    },
    log::{Chunk, ChunkError, RowId},
    time::TimePoint,
};

use super::{COMPLETE, MOTION, MOTION_PER_STEP, TIMELINE};

/// Rows by entity, in the order of their logging.
#[derive(Default)]
pub(super) struct Rows {
    // Rows of different timelines cannot share a chunk.
    rows: BTreeMap<(EntityPath, When), Vec<Row>>,
    /// How entities look since their last row that said so.
    looks: BTreeMap<(EntityPath, ComponentIdentifier), ArrayRef>,
}

/// Components that say how something looks. They hold until they are logged again, and each costs some 300 bytes in
/// every message: rows repeat them only when they change.
const LOOKS: [&str; 8] =
    ["colors", "draw_order", "fill_mode", "labels", "lengths", "line_radii", "radii", "show_labels"];

/// On which timelines rows stand.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum When {
    /// On none: they hold at all times.
    Always,
    /// At a step.
    Step,
    /// Between two steps.
    Between,
}

struct Row {
    id: RowId,
    time: TimePoint,
    components: Vec<SerializedComponentBatch>,
}

impl Rows {
    /// What holds at all times.
    pub(super) fn always(&mut self, entity: &EntityPath, what: &[&dyn AsComponents]) {
        self.push(entity, When::Always, TimePoint::default(), batches(what));
    }

    /// What holds from a step on, until the entity's next row.
    pub(super) fn at(&mut self, step: u64, entity: &EntityPath, what: &[&dyn AsComponents]) {
        let time = TimePoint::from([(Timeline::new_sequence(TIMELINE), sequence(step)), motion(step, 0)]);
        let mut components = batches(what);
        components.retain(|batch| {
            let component = batch.descriptor.component;
            let is_look = component.as_str().split_once(':').is_some_and(|(_, field)| LOOKS.contains(&field));
            !is_look || self.looks.insert((entity.clone(), component), batch.array.clone()) != Some(batch.array.clone())
        });
        self.push(entity, When::Step, time, components);
    }

    /// What holds so many ticks after a step, until the entity's next row. Whoever sees steps alone does not see it.
    pub(super) fn after(&mut self, step: u64, ticks: u64, entity: &EntityPath, what: &[&dyn AsComponents]) {
        self.push(entity, When::Between, TimePoint::from([motion(step, ticks)]), batches(what));
    }

    fn push(&mut self, entity: &EntityPath, when: When, time: TimePoint, components: Vec<SerializedComponentBatch>) {
        self.rows.entry((entity.clone(), when)).or_default().push(Row { id: RowId::new(), time, components });
    }

    /// Takes out what `wanted` says, one chunk per entity and kind of time.
    pub(super) fn drain(&mut self, wanted: impl Fn(&EntityPath) -> bool) -> Result<Vec<Chunk>, ChunkError> {
        self.rows
            .extract_if(.., |(entity, _), _| wanted(entity))
            .map(|((entity, _), rows)| {
                rows.into_iter()
                    .fold(Chunk::builder(entity), |chunk, row| {
                        chunk.with_serialized_batches(row.id, row.time, row.components)
                    })
                    .build()
            })
            .collect()
    }
}

/// What a recording in a file has of a chunk; `None` if it is between steps.
pub(super) fn by_steps(chunk: &Chunk) -> Option<Chunk> {
    let step = TIMELINE.into();
    let is_wanted = chunk.is_static() || chunk.timelines().contains_key(&step);
    is_wanted.then(|| chunk.timeline_sliced(step))
}

/// Says that all rows of a step that views show stand before this one.
pub(super) fn complete(step: u64) -> Result<Chunk, ChunkError> {
    let time = [(Timeline::new_sequence(COMPLETE), sequence(step))];
    let mark = DynamicArchetype::new_without_archetype()
        .with_component_from_data("step", Arc::new(UInt64Array::from_iter_values([step])));
    Chunk::builder(COMPLETE).with_serialized_batches(RowId::new(), time, mark.as_serialized_batches()).build()
}

fn motion(step: u64, ticks: u64) -> (Timeline, i64) {
    (Timeline::new_sequence(MOTION), sequence(step.saturating_mul(MOTION_PER_STEP).saturating_add(ticks)))
}

fn sequence(number: u64) -> i64 {
    i64::try_from(number).unwrap_or(i64::MAX)
}

fn batches(what: &[&dyn AsComponents]) -> Vec<SerializedComponentBatch> {
    what.iter().flat_map(|archetype| archetype.as_serialized_batches()).collect()
}
