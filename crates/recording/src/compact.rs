//! Compaction: putting the many small chunks of a live session together.

use std::{collections::BTreeMap, io::Cursor};

use super::{
    COMPLETE, RecordingError, decoded, message,
    rerun::{Chunk, EntityPath, LogMsg, StoreId, re_byte_size::SizeBytes},
    rows::by_steps,
};

/// The part of a live recording that is kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Keep {
    /// All of it, with the motion between steps.
    Motion,
    /// The steps, as in a recording in a file.
    Steps,
}

/// The order of chunks. What is between steps cannot be put together with what is at them, and what says that they are
/// complete comes after both.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Order {
    Always,
    Steps,
    Between,
    Complete,
}

/// The messages of a stream, with the chunks of each entity put together; static ones come first.
pub(super) fn put_together(stream: Vec<u8>, keep: Keep) -> Result<Vec<LogMsg>, RecordingError> {
    let mut messages = Vec::new();
    let last = EntityPath::from(COMPLETE);
    let mut chunks: BTreeMap<(Order, EntityPath), (StoreId, Vec<Chunk>)> = BTreeMap::new();
    for message in decoded::messages(Cursor::new(stream)) {
        match message.map_err(RecordingError::Encode)? {
            LogMsg::ArrowMsg(store, message) if store.is_recording() => {
                let chunk = Chunk::from_arrow_msg(&message)?;
                let (chunk, is_between) = match by_steps(&chunk) {
                    Some(steps) if keep == Keep::Steps => (steps, false),
                    None if keep == Keep::Steps => continue,
                    steps => (chunk, steps.is_none()),
                };
                let entity = chunk.entity_path().clone();
                let place = match is_between {
                    _ if chunk.is_static() => Order::Always,
                    false => Order::Steps,
                    true if entity == last => Order::Complete,
                    true => Order::Between,
                };
                let key = (place, entity);
                chunks.entry(key).or_insert_with(|| (store, Vec::new())).1.push(chunk);
            }
            other => messages.push(other),
        }
    }
    for (store, chunks) in chunks.into_values() {
        for chunk in merged(chunks, keep)? {
            messages.push(message::data(&store, &chunk)?);
        }
    }
    Ok(messages)
}

/// The most rows of a chunk that is put together: viewers load by chunk.
const ROWS: usize = 1024;
/// The most bytes of a chunk that is followed live: each reader holds one message at a time.
const FOLLOWED_BYTES: u64 = 1 << 18;

impl Keep {
    /// Whether two neighbouring chunks may become one.
    fn joins(self, left: &Chunk, right: &Chunk) -> bool {
        let bytes = || left.heap_size_bytes() + right.heap_size_bytes();
        left.num_rows() + right.num_rows() <= ROWS
            && (self == Self::Steps || bytes() <= FOLLOWED_BYTES)
            && left.concatenable(right)
    }
}

/// Puts neighbouring chunks of one entity together, by halves: each row is copied only log₂ n times.
fn merged(mut chunks: Vec<Chunk>, keep: Keep) -> Result<Vec<Chunk>, RecordingError> {
    if chunks.len() < 2 {
        return Ok(chunks);
    }
    let mut right = merged(chunks.split_off(chunks.len() / 2), keep)?.into_iter();
    let mut left = merged(chunks, keep)?;
    if let (Some(last), Some(first)) = (left.pop(), right.next()) {
        if keep.joins(&last, &first) {
            left.push(Chunk::concat_and_sort(&last, &first)?);
        } else {
            left.extend([last, first]);
        }
    }
    left.extend(right);
    Ok(left)
}
