//! Ids of rows, chunks and arrangements that follow from what they name: a recording has the same bytes wherever it is made.
//!
//! Rerun's own are of the time and of chance. Here a row's id is its store's hash and its number, so that later rows have larger
//! ones, and a chunk's is the hash of its store, its entity, its timelines and its rows.

use super::rerun::{Chunk, ChunkId, RowId, StoreId};

/// The ids of a store's rows, in order.
pub(super) struct RowIds {
    store: u64,
    rows: u64,
}

impl RowIds {
    pub(super) fn of(store: &StoreId) -> Self {
        Self { store: hash(&[store.application_id().as_str(), store.recording_id().as_str()], &[]), rows: 0 }
    }

    /// The id of the store's own message, before all rows.
    pub(super) fn of_store(store: &StoreId) -> RowId {
        Self::of(store).next()
    }

    /// The id of the row that says that a step is complete. When that is written depends on the time, so that these count by
    /// themselves.
    pub(super) fn of_complete(&self, step: u64) -> RowId {
        Self { store: hash(&["complete"], &[self.store]), rows: step }.next()
    }

    pub(super) fn next(&mut self) -> RowId {
        self.rows += 1;
        // Viewers take the first half for a time in nanoseconds, and that for a signed number.
        RowId::from_u128(u128::from(self.store >> 1) << 64 | u128::from(self.rows))
    }
}

/// The id of a chunk of a store.
pub(super) fn chunk(store: &StoreId, chunk: &Chunk) -> ChunkId {
    let entity = chunk.entity_path().to_string();
    let mut names = vec![store.recording_id().as_str(), entity.as_str()];
    let mut timelines: Vec<&str> = chunk.timelines().keys().map(|timeline| timeline.as_str()).collect();
    timelines.sort_unstable();
    names.extend(timelines);
    let mut rows = chunk.row_ids();
    let first = rows.next().map_or(0, |row| row.as_u128());
    let last = rows.last().map_or(first, |row| row.as_u128());
    let numbers = [first >> 64, first, last, chunk.num_rows() as u128].map(|number| number as u64);
    ChunkId::from_u128(u128::from(hash(&names, &numbers) >> 1) << 64 | u128::from(numbers[1]))
}

/// The 64-bit hash of Fowler, Noll and Vo (FNV-1a), of names and numbers: the same on every machine and in every version.
fn hash(names: &[&str], numbers: &[u64]) -> u64 {
    // No name has the byte that ends one.
    let names = names.iter().flat_map(|name| name.bytes().chain([0xFF]));
    let bytes = names.chain(numbers.iter().flat_map(|number| number.to_le_bytes()));
    bytes.fold(0xCBF2_9CE4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01B3))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rerun::ApplicationId;

    #[test]
    fn the_hash_is_the_published_one() {
        // From the authors' list of test vectors, of the byte that ends a name behind nothing, and of "a" by itself.
        assert_eq!(hash(&[], &[]), 0xCBF2_9CE4_8422_2325);
        assert_eq!(
            "a".bytes().fold(hash(&[], &[]), |h, b| (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01B3)),
            0xAF63_DC4C_8601_EC8C
        );
    }

    #[test]
    fn later_rows_have_larger_ids_and_stores_have_their_own() {
        let store = |name: &str| StoreId::recording(ApplicationId::new_or_unknown("a"), name);
        let (mut one, mut other) = (RowIds::of(&store("one")), RowIds::of(&store("other")));
        assert!(one.next() < one.next());
        assert_ne!(RowIds::of_store(&store("one")), other.next());
        assert_eq!(RowIds::of_store(&store("one")), RowIds::of(&store("one")).next());
    }
}
