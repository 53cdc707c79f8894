//! A recording in a file.

use std::{
    fs::File,
    io::BufWriter,
    path::{Path, PathBuf},
};

use re_log_encoding::{CrateVersion, EncodeError, Encoder, EncodingOptions};
use rerun::log::LogMsg;

use super::RecordingError;

/// An .rrd file that is being written. Its footer, the index, is written at the end; dropping it tries to.
pub(super) struct RrdFile {
    path: PathBuf,
    encoder: Encoder<BufWriter<File>>,
}

impl RrdFile {
    /// Creates the file, or empties it.
    pub(super) fn create(path: &Path) -> Result<Self, RecordingError> {
        let create = |source| RecordingError::Create { path: path.to_owned(), source };
        let file = BufWriter::new(File::create(path).map_err(create)?);
        let encoder = Encoder::new_eager(CrateVersion::LOCAL, EncodingOptions::PROTOBUF_COMPRESSED, file)
            .map_err(|source| failure(path, source))?;
        Ok(Self { path: path.to_owned(), encoder })
    }

    /// Appends messages and hands them to the operating system, so that they survive the death of the process.
    pub(super) fn append(&mut self, messages: &[LogMsg]) -> Result<(), RecordingError> {
        let mut append = || {
            messages.iter().try_for_each(|message| self.encoder.append(message).map(drop))?;
            self.encoder.flush_blocking()
        };
        append().map_err(|source| failure(&self.path, source))
    }

    /// Writes the footer.
    pub(super) fn finish(&mut self) -> Result<(), RecordingError> {
        let mut finish = || {
            self.encoder.finish()?;
            self.encoder.flush_blocking()
        };
        finish().map_err(|source| failure(&self.path, source))
    }
}

fn failure(path: &Path, source: EncodeError) -> RecordingError {
    match source {
        EncodeError::Write(source) => RecordingError::Write { path: path.to_owned(), source },
        other => other.into(),
    }
}
