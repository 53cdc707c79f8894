//! Errors of recordings.

use std::{io, path::PathBuf};

use re_log_encoding::{CodecError, EncodeError};

use super::rerun::{ChunkError, arrow::error::ArrowError};

/// Why a run could not be recorded. The experiment itself is not affected.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// The file could not be created.
    #[error("cannot create the recording {}: {source}; name a file in a folder that exists and may be written to", path.display())]
    Create {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The file could not be written to; the disk is full, say.
    #[error(
        "cannot write to the recording {}: {source}; what was written before can be opened, without its index; \
         free some space or record to another disk",
        path.display()
    )]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The file could not be written as a whole; what was there before is as it was.
    #[error(
        "cannot write the recording {}: {source}; what was there before is as it was; free some space or record to another disk",
        path.display()
    )]
    Unwritten {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The file could not be read.
    #[error("cannot read the recording {}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The file is no recording, or nothing of it can be read.
    #[error("nothing of {} can be read as a recording: {why}", path.display())]
    NoRecording {
        /// The file.
        path: PathBuf,
        /// Why.
        why: String,
    },
    /// Rerun could not arrange or encode the data.
    #[error("cannot encode the recording: {0}; please report this as a bug, with the scenario and the seed")]
    Encode(String),
    /// A table could not be written.
    #[error("cannot write the csv table: {0}; is there space, and is the file still there?")]
    Csv(#[from] csv::Error),
}

impl From<ChunkError> for RecordingError {
    fn from(source: ChunkError) -> Self {
        Self::Encode(source.to_string())
    }
}

impl From<ArrowError> for RecordingError {
    fn from(source: ArrowError) -> Self {
        Self::Encode(source.to_string())
    }
}

impl From<CodecError> for RecordingError {
    fn from(source: CodecError) -> Self {
        Self::Encode(source.to_string())
    }
}

impl From<EncodeError> for RecordingError {
    fn from(source: EncodeError) -> Self {
        Self::Encode(source.to_string())
    }
}
