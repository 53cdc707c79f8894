//! A recording in a file.

use std::{
    fs::{self, File},
    io::{self, BufWriter, Write},
    path::{Path, PathBuf},
};

use re_log_encoding::{CrateVersion, EncodeError, Encoder, EncodingOptions};

use super::{RecordingError, rerun::LogMsg};
use body_schema_files::AtomicFile;

/// An .rrd file that is being written. Its footer, the index, is written at the end; dropping the file tries to write
/// it.
pub(super) struct RrdFile {
    path: PathBuf,
    encoder: Encoder<BufWriter<File>>,
    /// The pending name of a file that gets it once it is whole; `None` for a file that grows in its place.
    whole: Option<AtomicFile>,
    /// Whether a write has failed; nothing is written after that.
    broken: bool,
}

impl RrdFile {
    /// Begins a file that replaces what is at `path` when it is finished.
    pub(super) fn create(path: &Path) -> Result<Self, RecordingError> {
        let create = |source| RecordingError::Create { path: path.to_owned(), source };
        let (file, whole) = AtomicFile::create(path).map_err(create)?;
        Self::begin(path, file, Some(whole))
    }

    /// Creates the file, or empties it: it grows in its place, so that it outlives the process.
    pub(super) fn create_growing(path: &Path) -> Result<Self, RecordingError> {
        let create = |source| RecordingError::Create { path: path.to_owned(), source };
        let file = File::create(path).map_err(create)?;
        Self::begin(path, file, None).inspect_err(|_| discard(path))
    }

    fn begin(path: &Path, file: File, whole: Option<AtomicFile>) -> Result<Self, RecordingError> {
        let encoder = encoder(BufWriter::new(file)).map_err(|source| failure(path, whole.is_some(), source))?;
        Ok(Self { path: path.to_owned(), encoder, whole, broken: false })
    }

    /// Removes the file, unless it is a device.
    pub(super) fn discard(mut self) {
        self.encoder.do_not_emit_footer();
        if self.whole.is_none() {
            discard(&self.path);
        }
    }

    /// Appends messages and hands them to the operating system, so that they survive the death of the process.
    pub(super) fn append(&mut self, messages: &[LogMsg]) -> Result<(), RecordingError> {
        self.attempt(|encoder| messages.iter().try_for_each(|message| encoder.append(message).map(drop)))
    }

    /// Writes the footer, and gives the file its name.
    pub(super) fn finish(&mut self) -> Result<(), RecordingError> {
        self.attempt(Encoder::finish)?;
        self.whole.take().map_or(Ok(()), AtomicFile::commit).map_err(|source| self.unwritten(source))
    }

    /// Writes the footer, and gives the file its name unless a file of that name exists.
    pub(super) fn finish_new(&mut self) -> Result<(), RecordingError> {
        self.attempt(Encoder::finish)?;
        self.whole.take().map_or(Ok(()), AtomicFile::commit_new).map_err(|source| self.unwritten(source))
    }

    fn unwritten(&self, source: io::Error) -> RecordingError {
        RecordingError::Unwritten { path: self.path.clone(), source }
    }

    /// Puts a finished recording in this file's place, whatever was written before.
    pub(super) fn replace(&self, recording: &[u8]) -> Result<(), RecordingError> {
        let failed = |source| RecordingError::Write { path: self.path.clone(), source };
        // A device holds nothing that could be replaced.
        if !fs::metadata(&self.path).map_err(failed)?.is_file() {
            return Err(failed(io::Error::other("it is no file")));
        }
        let part = self.path.with_extension("rrd.part");
        let written = File::create(&part).and_then(|mut file| file.write_all(recording).and_then(|()| file.sync_all()));
        written.and_then(|()| fs::rename(&part, &self.path)).map_err(|source| {
            // Half a file is of no use, and takes space.
            drop(fs::remove_file(&part));
            failed(source)
        })
    }

    fn attempt(
        &mut self,
        write: impl FnOnce(&mut Encoder<BufWriter<File>>) -> Result<(), EncodeError>,
    ) -> Result<(), RecordingError> {
        if self.broken {
            let source = io::Error::other("an earlier write failed");
            return Err(RecordingError::Write { path: self.path.clone(), source });
        }
        write(&mut self.encoder).and_then(|()| self.encoder.flush_blocking()).map_err(|source| {
            // A message may stand there by half: what came after it could not be read, a footer least of all.
            self.broken = true;
            self.encoder.do_not_emit_footer();
            failure(&self.path, self.whole.is_some(), source)
        })
    }
}

/// What writes a recording.
pub(super) fn encoder<W: Write>(output: W) -> Result<Encoder<W>, EncodeError> {
    Encoder::new_eager(CrateVersion::LOCAL, EncodingOptions::PROTOBUF_COMPRESSED, output)
}

fn discard(path: &Path) {
    if fs::metadata(path).is_ok_and(|file| file.is_file()) {
        // Whoever asked for it is told of a worse failure already.
        drop(fs::remove_file(path));
    }
}

pub(super) fn failure(path: &Path, is_atomic: bool, source: EncodeError) -> RecordingError {
    let path = path.to_owned();
    match source {
        EncodeError::Write(source) if is_atomic => RecordingError::Unwritten { path, source },
        EncodeError::Write(source) => RecordingError::Write { path, source },
        other => other.into(),
    }
}
