//! The recording so far as a file for downloads: it is written once, to the disk, and no reader holds more of it than a piece.

use std::{
    fs::File,
    io::{self, BufWriter, Read, Seek, SeekFrom, Write},
    path::Path,
    sync::{Arc, Mutex},
};

use axum::body::{Body, Bytes};
use futures_util::stream::unfold;
use tokio::{sync::Mutex as AsyncMutex, task::spawn_blocking};

use super::{Session, lock};
use crate::server::{
    blocking::{Jobs, Wanted},
    problem::{Kind, Problem},
};
use body_schema_recording::{LiveLog, RecordingError};

/// The bytes of it that are read at a time.
const PIECE_BYTES: usize = 256 << 10;

/// The most bytes of a recording that is put together in memory where the disk has no room.
const MOST_IN_MEMORY: usize = 16 << 20;

/// A complete recording.
pub(in crate::server) struct Completed {
    /// The number of parts of the recording that are in it.
    parts: usize,
    whole: Whole,
    pub(in crate::server) bytes: u64,
}

/// The place of the recording.
enum Whole {
    /// A file without a name, which is removed with its last reader.
    File(Mutex<File>),
    Memory(Bytes),
}

/// The recording that was written last.
pub(super) type LastCompleted = AsyncMutex<Option<Arc<Completed>>>;

impl Session {
    /// All of the recording so far; requests that come while it is written wait for the same file.
    pub(in crate::server) async fn completed(&self, jobs: &Jobs) -> Result<Arc<Completed>, Problem> {
        let mut kept = self.completed.lock().await;
        let (live, folder) = (self.live().clone(), self.shared.scratch.clone());
        if let Some(completed) = kept.as_ref().filter(|completed| completed.parts == live.len()) {
            return Ok(completed.clone());
        }
        // Before the next is written: two of them are needed by no new reader.
        *kept = None;
        let parts = live.len();
        let written = jobs.done(move |wanted| match Completed::on_disk(&live, parts, folder.as_deref(), wanted) {
            Err(_) if live.bytes() <= MOST_IN_MEMORY && !wanted.is_given_up() => Completed::in_memory(&live, parts),
            outcome => outcome,
        });
        let completed = Arc::new(written.await?);
        *kept = Some(completed.clone());
        Ok(completed)
    }
}

impl Completed {
    fn on_disk(live: &LiveLog, parts: usize, folder: Option<&Path>, wanted: &Wanted) -> Result<Self, Problem> {
        let file = folder.map_or_else(tempfile::tempfile, tempfile::tempfile_in);
        let mut writer = BufWriter::new(file.map_err(|error| unwritten(&error))?);
        let while_wanted = WhileWanted { writer: &mut writer, wanted };
        live.complete_to(while_wanted, parts).map_err(|error| unwritten_recording(&error))?;
        let file = writer.into_inner().map_err(|error| unwritten(error.error()))?;
        let bytes = file.metadata().map_err(|error| unwritten(&error))?.len();
        Ok(Self { parts, whole: Whole::File(Mutex::new(file)), bytes })
    }

    fn in_memory(live: &LiveLog, parts: usize) -> Result<Self, Problem> {
        let mut whole = Vec::new();
        live.complete_to(&mut whole, parts).map_err(|error| unwritten_recording(&error))?;
        Ok(Self { parts, bytes: whole.len() as u64, whole: Whole::Memory(whole.into()) })
    }

    /// The recording, piece by piece.
    pub(in crate::server) fn body(self: Arc<Self>) -> Body {
        Body::from_stream(unfold((self, 0), |(completed, from)| async move {
            if from >= completed.bytes {
                return None;
            }
            let reading = completed.clone();
            let piece =
                spawn_blocking(move || reading.piece(from)).await.unwrap_or_else(|error| Err(io::Error::other(error)));
            let next = from + piece.as_ref().map_or(completed.bytes, |piece| piece.len() as u64);
            Some((piece, (completed, next)))
        }))
    }

    fn piece(&self, from: u64) -> io::Result<Bytes> {
        let length = PIECE_BYTES.min((self.bytes - from) as usize);
        let file = match &self.whole {
            Whole::File(file) => file,
            Whole::Memory(whole) => return Ok(whole.slice(from as usize..from as usize + length)),
        };
        let mut piece = vec![0; length];
        let mut file = lock(file);
        file.seek(SeekFrom::Start(from))?;
        file.read_exact(&mut piece)?;
        Ok(piece.into())
    }
}

/// A writer that stops when nobody waits for the result any longer.
struct WhileWanted<'a, W> {
    writer: W,
    wanted: &'a Wanted,
}

impl<W: Write> Write for WhileWanted<'_, W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.wanted.is_given_up() {
            return Err(io::Error::other("nobody waits for it any longer"));
        }
        self.writer.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.writer.flush()
    }
}

fn unwritten(error: &io::Error) -> Problem {
    let detail = format!("the recording could not be put together on the disk: {error}; free some space and ask again");
    Problem::new(Kind::Storage, detail)
}

fn unwritten_recording(error: &RecordingError) -> Problem {
    match error {
        RecordingError::Write { source, .. } => unwritten(source),
        error => Problem::new(Kind::Internal, format!("no complete recording: {error}")),
    }
}
