//! The rows of one entity, column by column.
//!
//! Rerun's own builder of chunks takes rows. Here rows are kept by columns from the start, so that a row costs no more
//! than its arrays, and a number of a series no array at all.

use std::{mem::discriminant, ops::Range, sync::Arc};

use super::{
    MOTION_PER_STEP, RecordingError,
    rerun::{
        Chunk, ChunkId, ComponentDescriptor, EntityPath, RowId, Scalars, TimeColumn, Timeline,
        arrow::{
            array::{ArrayRef, Float64Array, ListArray},
            buffer::{NullBuffer, OffsetBuffer},
            datatypes::Field,
            error::ArrowError,
        },
    },
    values::{Cell, Values},
};

/// The timelines on which rows stand.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum When {
    /// No timeline: they hold at all times.
    Always,
    /// The timeline of steps.
    Step,
    /// The timeline of motion alone, between two steps.
    Between,
}

/// Rows of one entity on the same timelines, in the order of their logging.
pub(super) struct Sheet {
    entity: EntityPath,
    when: When,
    ids: Vec<RowId>,
    /// The place of each row on the timeline of motion.
    ticks: Vec<u64>,
    columns: Vec<Column>,
    /// The numbers of a series, which has no other components: one in each row.
    numbers: Vec<f64>,
    /// The number of rows that were handed out and are still needed.
    handed_out: usize,
    bytes: usize,
}

/// The cells of one component; rows without it have no cell.
struct Column {
    descriptor: ComponentDescriptor,
    /// The row of each cell, and its number of values.
    cells: Vec<(usize, usize)>,
    values: Values,
}

impl Sheet {
    pub(super) fn new(entity: EntityPath, when: When) -> Self {
        let (ids, ticks, columns, numbers) = Default::default();
        Self { entity, when, ids, ticks, columns, numbers, handed_out: 0, bytes: 0 }
    }

    pub(super) fn entity(&self) -> &EntityPath {
        &self.entity
    }

    pub(super) fn push(&mut self, (id, ticks): (RowId, u64), components: impl IntoIterator<Item = Cell>) {
        let row = self.begin_row(id, ticks);
        for (descriptor, values) in components {
            self.bytes += values.bytes();
            let (length, kind) = (values.len(), discriminant(&values));
            let is_it = |column: &&mut Column| column.descriptor == descriptor && discriminant(&column.values) == kind;
            match self.columns.iter_mut().find(is_it) {
                Some(column) => {
                    column.cells.push((row, length));
                    column.values.extend(values);
                }
                None => self.columns.push(Column { descriptor, cells: vec![(row, length)], values }),
            }
        }
    }

    /// The number of bytes in components that wait.
    pub(super) fn bytes(&self) -> usize {
        self.bytes
    }

    pub(super) fn push_number(&mut self, (id, ticks): (RowId, u64), number: f64) {
        self.begin_row(id, ticks);
        self.numbers.push(number);
    }

    fn begin_row(&mut self, id: RowId, ticks: u64) -> usize {
        self.ids.push(id);
        self.ticks.push(ticks);
        self.ids.len() - 1
    }

    /// The rows that were not handed out yet, on the timelines `named`. They are forgotten, unless `kept` for another reader.
    pub(super) fn news(&mut self, named: &Timelines, kept: bool) -> Result<Option<Chunk>, RecordingError> {
        let rows = self.handed_out..self.ids.len();
        let chunk = self.chunk(rows, named);
        self.handed_out = self.ids.len();
        if !kept {
            self.forget();
        }
        chunk
    }

    /// All rows, on the timelines `named`. They are forgotten.
    pub(super) fn all(&mut self, named: &Timelines) -> Result<Option<Chunk>, RecordingError> {
        let chunk = self.chunk(0..self.ids.len(), named);
        self.forget();
        chunk
    }

    fn forget(&mut self) {
        let Self { ids, ticks, columns, numbers, handed_out, bytes, .. } = self;
        ids.clear();
        ticks.clear();
        numbers.clear();
        columns.iter_mut().for_each(|column| (column.cells.clear(), column.values.clear()).0);
        (*handed_out, *bytes) = (0, 0);
    }

    /// A chunk of these rows; `None` if there are no rows, or none on these timelines.
    fn chunk(&self, rows: Range<usize>, named: &Timelines) -> Result<Option<Chunk>, RecordingError> {
        let timelines = named.of(self.when, &self.ticks[rows.clone()]);
        if rows.is_empty() || (timelines.is_empty() && self.when != When::Always) {
            return Ok(None);
        }
        let mut components = Vec::with_capacity(self.columns.len().max(1));
        for column in &self.columns {
            components.extend(column.list(&rows)?.map(|list| (column.descriptor.clone(), list)));
        }
        if let Some(numbers) = self.numbers.get(rows.clone()).filter(|numbers| !numbers.is_empty()) {
            let lengths = OffsetBuffer::from_lengths(std::iter::repeat_n(1, numbers.len()));
            let list = list(lengths, Arc::new(Float64Array::from(numbers.to_vec())), None);
            components.push((Scalars::descriptor_scalars(), list?));
        }
        let timelines = timelines.into_iter().map(|column| (*column.timeline().name(), column)).collect();
        let (ids, components) = (&self.ids[rows], components.into_iter().collect());
        Ok(Some(Chunk::from_native_row_ids(ChunkId::new(), self.entity.clone(), None, ids, timelines, components)?))
    }
}

impl Column {
    /// The cells of these rows, one list per row; `None` if there are none.
    fn list(&self, rows: &Range<usize>) -> Result<Option<ListArray>, RecordingError> {
        let first = self.cells.partition_point(|(row, _)| *row < rows.start);
        let cells = &self.cells[first..];
        if cells.is_empty() {
            return Ok(None);
        }
        let skipped = self.cells[..first].iter().map(|(_, length)| length).sum();
        let values = self.values.array(first, skipped)?;
        let mut lengths = vec![0; rows.len()];
        let mut is_there = vec![false; rows.len()];
        for (row, length) in cells {
            (lengths[row - rows.start], is_there[row - rows.start]) = (*length, true);
        }
        let nulls = (cells.len() < rows.len()).then(|| NullBuffer::from(is_there));
        Ok(Some(list(OffsetBuffer::from_lengths(lengths), values, nulls)?))
    }
}

fn list(lengths: OffsetBuffer<i32>, values: ArrayRef, nulls: Option<NullBuffer>) -> Result<ListArray, ArrowError> {
    ListArray::try_new(Field::new_list_field(values.data_type().clone(), true).into(), lengths, values, nulls)
}

/// The timelines on which chunks stand.
pub(super) struct Timelines {
    pub(super) step: Timeline,
    /// The timeline of motion, for live readers.
    pub(super) motion: Option<Timeline>,
}

impl Timelines {
    fn of(&self, when: When, ticks: &[u64]) -> Vec<TimeColumn> {
        let column = |timeline, per_tick: u64| {
            let times: Vec<i64> = ticks.iter().map(|ticks| sequence(ticks / per_tick)).collect();
            TimeColumn::new(None, timeline, times.into())
        };
        let step = (when == When::Step).then(|| column(self.step, MOTION_PER_STEP));
        let motion = self.motion.filter(|_| when != When::Always).map(|motion| column(motion, 1));
        step.into_iter().chain(motion).collect()
    }
}

/// A number as a place on a timeline.
pub(super) fn sequence(number: u64) -> i64 {
    i64::try_from(number).unwrap_or(i64::MAX)
}
