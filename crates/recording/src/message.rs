//! Messages of a recording or a blueprint, made without Rerun's stream.
//!
//! A `RecordingStream` starts threads, which one with a memory sink leaves behind, reports errors to a log, and writes
//! nothing when the environment says `RERUN=off`. Recordings here must be written whenever they are asked for, so they
//! are made of the messages themselves.

use super::{
    RecordingError,
    ids::{self, RowIds},
    rerun::{Chunk, LogMsg, SetStoreInfo, StoreId, StoreInfo, StoreSource},
};

/// The first message of a store, which describes it.
pub(super) fn store_info(store: &StoreId) -> LogMsg {
    let info = StoreInfo::new(store.clone(), StoreSource::Other("body-schema".to_owned()));
    SetStoreInfo { row_id: *RowIds::of_store(store), info }.into()
}

/// The message that adds a chunk to a store.
pub(super) fn data(store: &StoreId, chunk: &Chunk) -> Result<LogMsg, RecordingError> {
    Ok(LogMsg::ArrowMsg(store.clone(), chunk.clone_with_id(ids::chunk(store, chunk)).to_arrow_msg()?))
}
