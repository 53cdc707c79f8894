//! Repairing recordings that broke off because a process was killed or a disk was full.

use std::{
    fs::File,
    io::{BufRead, BufReader, Read, Seek, SeekFrom},
    path::Path,
};

use re_log_encoding::StreamFooter;

use super::{RecordingError, decoded::messages, file::RrdFile, rerun::LogMsg, stream::is_end};

/// The number of messages that are held at a time.
const BATCH: usize = 64;

/// The readable part of a recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Condition {
    /// The number of messages before anything that cannot be read.
    pub messages: u64,
    /// Whether it has its footer, and everything can be read.
    pub is_complete: bool,
    /// The reason why reading ended early, if it did.
    pub damage: Option<String>,
}

/// Reads a recording (.rrd) from one end to the other.
///
/// # Errors
///
/// [`RecordingError::Read`] if the file cannot be read, [`RecordingError::NoRecording`] if it is none.
pub fn examine(path: &Path) -> Result<Condition, RecordingError> {
    read(path, |_| Ok(()))
}

/// Writes the readable part of a recording to a new file, with a footer, so that viewers open it. The recording itself is
/// left as it is.
///
/// # Errors
///
/// [`RecordingError::Read`] if the recording cannot be read, [`RecordingError::NoRecording`] if it is none,
/// [`RecordingError::Create`] if there is a file at `out` or it cannot be written.
pub fn restore(path: &Path, out: &Path) -> Result<Condition, RecordingError> {
    // Before anything is created: what is no recording leaves no file.
    examine(path)?;
    if out.symlink_metadata().is_ok() {
        return Err(RecordingError::Create { path: out.to_owned(), source: std::io::ErrorKind::AlreadyExists.into() });
    }
    let mut file = RrdFile::create(out)?;
    let condition = read(path, |messages| file.append(messages))?;
    file.finish_new()?;
    Ok(condition)
}

fn read(path: &Path, take: impl FnMut(&[LogMsg]) -> Result<(), RecordingError>) -> Result<Condition, RecordingError> {
    let unreadable = |source| RecordingError::Read { path: path.to_owned(), source };
    let mut file = File::open(path).map_err(unreadable)?;
    let has_footer = has_footer(&mut file).map_err(unreadable)?;
    let (messages, damage) = with_messages(BufReader::new(file), take)?;
    if messages == 0 {
        let why = damage.unwrap_or_else(|| "it holds no whole message".to_owned());
        return Err(RecordingError::NoRecording { path: path.to_owned(), why });
    }
    Ok(Condition { messages, is_complete: has_footer && damage.is_none(), damage })
}

/// Passes every message up to the first unreadable one to a function, and returns their number and why that one cannot
/// be read.
pub(super) fn with_messages(
    stream: impl BufRead,
    mut take: impl FnMut(&[LogMsg]) -> Result<(), RecordingError>,
) -> Result<(u64, Option<String>), RecordingError> {
    let (mut count, mut batch, mut damage) = (0, Vec::new(), None);
    for message in messages(stream) {
        match message {
            Err(why) => damage = Some(why),
            Ok(message) => {
                count += 1;
                batch.push(message);
                if batch.len() == BATCH {
                    take(&batch)?;
                    batch.clear();
                }
            }
        }
    }
    take(&batch)?;
    Ok((count, damage))
}

fn has_footer(file: &mut File) -> std::io::Result<bool> {
    let size = StreamFooter::ENCODED_SIZE_BYTES;
    let is_long = file.metadata()?.len() >= size as u64;
    let mut end = Vec::with_capacity(size);
    if is_long {
        file.seek(SeekFrom::End(-(size as i64)))?;
        file.read_to_end(&mut end)?;
        file.rewind()?;
    }
    Ok(is_long && is_end(&end))
}
