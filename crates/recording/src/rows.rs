//! Rows that wait to be written, one sheet per entity.
//!
//! Rerun's own stream batches in a thread and writes in another, where errors go to a log. Here rows are gathered and
//! handed over when the recorder asks for them: many steps make one chunk per entity, and every error is returned to a
//! caller.

use std::{
    collections::{HashMap, hash_map::Entry},
    sync::Arc,
};

use super::{
    COMPLETE, MOTION, MOTION_PER_STEP, RecordingError, TIMELINE,
    ids::RowIds,
    rerun::{
        AsComponents, Chunk, ChunkError, ComponentIdentifier, DynamicArchetype, EntityPath, StoreId, Timeline,
        arrow::array::UInt64Array,
    },
    sheet::{Sheet, Timelines, When, sequence},
    values::{Cell, Values, cells},
};

/// Rows by entity.
///
/// They have up to two readers: the live log takes [`news`](Self::news), a file takes [`steps`](Self::steps). Rows wait
/// until both have them.
pub(super) struct Rows {
    // Rows of different timelines cannot share a chunk.
    sheets: Vec<Sheet>,
    index: HashMap<(EntityPath, When), usize>,
    /// The look of each entity since its last row with one.
    looks: HashMap<(EntityPath, ComponentIdentifier), Values>,
    /// The part of a look that depends on the data; see [`drawn`](Self::drawn).
    kinds: HashMap<EntityPath, u64>,
    step: Timeline,
    motion: Timeline,
    ids: RowIds,
}

/// Components of an entity's look. They hold until they are logged again, and each costs some 300 bytes in every
/// message, so rows repeat them only when they change.
const LOOKS: [&str; 8] =
    ["colors", "draw_order", "fill_mode", "labels", "lengths", "line_radii", "radii", "show_labels"];

impl Rows {
    /// None yet of this store.
    pub(super) fn of(store: &StoreId) -> Self {
        let [step, motion] = [TIMELINE, MOTION].map(Timeline::new_sequence);
        let (sheets, index, looks, kinds) = Default::default();
        Self { sheets, index, looks, kinds, step, motion, ids: RowIds::of(store) }
    }

    /// What holds at all times.
    pub(super) fn always(&mut self, entity: &EntityPath, what: &[&dyn AsComponents]) {
        self.always_plain(entity, cells(what.iter().copied()));
    }

    /// Adds what holds at all times, component by component.
    pub(super) fn always_plain(&mut self, entity: &EntityPath, cells: Vec<Cell>) {
        let id = self.ids.next();
        self.sheet(entity, When::Always).push((id, 0), cells);
    }

    /// Adds what holds from a step on, until the entity's next row.
    pub(super) fn at(&mut self, step: u64, entity: &EntityPath, what: &[&dyn AsComponents]) {
        self.plain(step, entity, cells(what.iter().copied()));
    }

    /// Adds what holds from a step on, component by component.
    pub(super) fn plain(&mut self, step: u64, entity: &EntityPath, mut cells: Vec<Cell>) {
        self.drop_looks(entity, &mut cells);
        let id = self.ids.next();
        self.sheet(entity, When::Step).push((id, motion(step, 0)), cells);
    }

    /// Adds what is drawn again and again: its look is asked for when the entity has no row yet, or when its last row was of
    /// another kind.
    pub(super) fn drawn<L: AsComponents>(
        &mut self,
        step: u64,
        entity: &EntityPath,
        mut what: Vec<Cell>,
        (kind, look): (u64, impl FnOnce() -> L),
    ) {
        if self.kinds.get(entity) != Some(&kind) {
            self.kinds.insert(entity.clone(), kind);
            what.extend(cells([&look() as &dyn AsComponents]));
        }
        self.plain(step, entity, what);
    }

    /// Adds a number of a series at a step.
    pub(super) fn number(&mut self, step: u64, series: &EntityPath, number: f64) {
        let id = self.ids.next();
        self.sheet(series, When::Step).push_number((id, motion(step, 0)), number);
    }

    /// Adds what holds from `ticks` after a step until the entity's next row. Readers that see only steps do not see
    /// it.
    pub(super) fn after(&mut self, step: u64, ticks: u64, entity: &EntityPath, what: &[&dyn AsComponents]) {
        self.after_plain(step, ticks, entity, cells(what.iter().copied()));
    }

    /// Adds what holds from `ticks` after a step, component by component.
    pub(super) fn after_plain(&mut self, step: u64, ticks: u64, entity: &EntityPath, cells: Vec<Cell>) {
        let id = self.ids.next();
        self.sheet(entity, When::Between).push((id, motion(step, ticks)), cells);
    }

    fn sheet(&mut self, entity: &EntityPath, when: When) -> &mut Sheet {
        let index = *self.index.entry((entity.clone(), when)).or_insert_with(|| {
            self.sheets.push(Sheet::new(entity.clone(), when));
            self.sheets.len() - 1
        });
        &mut self.sheets[index]
    }

    fn drop_looks(&mut self, entity: &EntityPath, cells: &mut Vec<Cell>) {
        cells.retain(|(descriptor, values)| {
            let component = descriptor.component;
            let is_look = component.as_str().split_once(':').is_some_and(|(_, field)| LOOKS.contains(&field));
            if !is_look {
                return true;
            }
            let last = self.looks.entry((entity.clone(), component));
            match last {
                Entry::Occupied(last) if last.get() == values => false,
                last => {
                    last.insert_entry(values.clone());
                    true
                }
            }
        });
    }

    /// The rows of `wanted` sheets that live readers do not have yet; one chunk per entity and kind of time. They are
    /// `kept` for [`steps`](Self::steps), or forgotten.
    pub(super) fn news(&mut self, wanted: impl Fn(&Sheet) -> bool, kept: bool) -> Result<Vec<Chunk>, RecordingError> {
        let named = Timelines { step: self.step, motion: Some(self.motion) };
        let wanted = self.sheets.iter_mut().filter(|sheet| wanted(sheet));
        wanted.filter_map(|sheet| sheet.news(&named, kept).transpose()).collect()
    }

    /// The rows of `wanted` sheets for a file since the last call; one chunk per entity. They are forgotten.
    pub(super) fn steps(&mut self, wanted: impl Fn(&Sheet) -> bool) -> Result<Vec<Chunk>, RecordingError> {
        let named = Timelines { step: self.step, motion: None };
        let wanted = self.sheets.iter_mut().filter(|sheet| wanted(sheet));
        wanted.filter_map(|sheet| sheet.all(&named).transpose()).collect()
    }

    /// Says that all rows of a step that views show stand before this one.
    pub(super) fn complete(&self, step: u64) -> Result<Chunk, ChunkError> {
        let time = [(Timeline::new_sequence(COMPLETE), sequence(step))];
        let mark = DynamicArchetype::new_without_archetype()
            .with_component_from_data("step", Arc::new(UInt64Array::from_iter_values([step])));
        Chunk::builder(COMPLETE)
            .with_serialized_batches(self.ids.of_complete(step), time, mark.as_serialized_batches())
            .build()
    }

    /// Whether so many bytes of one entity wait.
    pub(super) fn has_large(&self, bytes: usize) -> bool {
        self.sheets.iter().any(|sheet| sheet.bytes() >= bytes)
    }
}

/// The part of a chunk for a file; `None` if the chunk is between steps.
pub(super) fn by_steps(chunk: &Chunk) -> Option<Chunk> {
    let step = TIMELINE.into();
    let is_wanted = chunk.is_static() || chunk.timelines().contains_key(&step);
    is_wanted.then(|| chunk.timeline_sliced(step))
}

fn motion(step: u64, ticks: u64) -> u64 {
    step.saturating_mul(MOTION_PER_STEP).saturating_add(ticks)
}

#[cfg(test)]
mod tests {
    use crate::rerun::{Points3D, arrow::array::Array};

    use super::*;

    fn place(x: f32) -> Points3D {
        Points3D::update_fields().with_positions([[x, 0.0, 0.0]])
    }

    /// Entity, number of rows and timelines of every chunk.
    fn told(chunks: &[Chunk]) -> Vec<(String, usize, Vec<String>)> {
        let of = |chunk: &Chunk| {
            let mut timelines: Vec<String> = chunk.timelines().keys().map(ToString::to_string).collect();
            timelines.sort();
            (chunk.entity_path().to_string(), chunk.num_rows(), timelines)
        };
        chunks.iter().map(of).collect()
    }

    fn row(entity: &str, rows: usize, timelines: &[&str]) -> (String, usize, Vec<String>) {
        (entity.to_owned(), rows, timelines.iter().map(ToString::to_string).collect())
    }

    #[test]
    fn both_readers_get_every_row_once() {
        let [hand, error] = ["hand", "error"].map(EntityPath::from);
        let mut rows = Rows::of(&StoreId::recording("test", "test"));
        let step = |rows: &mut Rows, step: u64| {
            rows.at(step, &hand, &[&place(step as f32)]);
            rows.after(step, 1, &hand, &[&place(0.5)]);
            rows.number(step, &error, 0.1 * step as f64);
        };
        step(&mut rows, 0);
        let is_shown = |sheet: &Sheet| sheet.entity() != &error;
        let both = ["motion", "step"];
        let of_hand = [row("/hand", 1, &both), row("/hand", 1, &["motion"])];
        assert_eq!(told(&rows.news(is_shown, true).unwrap()), of_hand);
        step(&mut rows, 1);
        let [now, between] = of_hand;
        assert_eq!(told(&rows.news(|_| true, true).unwrap()), [now, between, row("/error", 2, &both)]);
        assert_eq!(told(&rows.steps(|_| true).unwrap()), [row("/hand", 2, &["step"]), row("/error", 2, &["step"])]);
        assert!(rows.news(|_| true, true).unwrap().is_empty() && rows.steps(|_| true).unwrap().is_empty());
        // Without a file nothing waits for it.
        step(&mut rows, 2);
        assert_eq!(rows.news(|_| true, false).unwrap().len(), 3);
        assert!(rows.steps(|_| true).unwrap().is_empty());
    }

    #[test]
    fn looks_are_said_when_they_change() {
        let hand = EntityPath::from("hand");
        let mut rows = Rows::of(&StoreId::recording("test", "test"));
        let look = |label: &'static str| move || Points3D::update_fields().with_labels([label]);
        for (step, kind, label) in [(0, 0, "a"), (1, 0, "not asked for"), (2, 1, "b")] {
            let place = Values::Triples(vec![[step as f32, 0.0, 0.0]]);
            let what =
                [(Points3D::descriptor_positions(), place), (Points3D::descriptor_radii(), Values::Singles(vec![0.1]))];
            rows.drawn(step, &hand, what.to_vec(), (kind, look(label)));
        }
        let chunks = rows.steps(|_| true).unwrap();
        let [chunk] = chunks.as_slice() else { panic!("one chunk, not {}", chunks.len()) };
        let said = |component: &'static str| {
            let list = chunk.components().get_array(component.into()).unwrap();
            (0..3).map(|row| Array::is_valid(list, row)).collect::<Vec<_>>()
        };
        assert_eq!(said("Points3D:positions"), [true; 3]);
        assert_eq!(said("Points3D:labels"), [true, false, true]);
        assert_eq!(said("Points3D:radii"), [true, false, false]);
    }
}
