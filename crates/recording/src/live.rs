//! A recording that can be followed while it grows.

use std::{
    io::Write,
    path::Path,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};

use bytes::Bytes;
use re_log_encoding::{CrateVersion, Encodable, EncodingOptions, StreamHeader, ToTransport};
use tokio::sync::watch;

use super::{
    RecordingError, Shape, Theme,
    blueprint::Arranger,
    compact::{Keep, put_together},
    file::{encoder, failure},
    rerun::LogMsg,
};

/// The most bytes of a part that is put together.
const MOST_TOGETHER_BYTES: usize = 1 << 18;
/// The most bytes of parts that are decoded at a time for compaction; decoded they take some ten times as much.
const TAKEN_APART_BYTES: usize = 4 << 20;

/// A growing log of encoded parts, in memory, for any number of readers at any speed. Clones share one log.
///
/// Part 0 is the 12-byte header of an .rrd stream; every further part is one message, except the one that holds all
/// messages of the arrangement of views. The parts in order are a valid stream at every moment, without a footer; a
/// reader that takes single parts puts the header before each. Reader loops hold the index of their next part:
///
/// ```
/// # use body_schema_recording::LiveLog;
/// # async fn follow(log: LiveLog) {
/// let mut length = log.subscribe();
/// let mut next = 0;
/// loop {
///     let parts = log.parts_from(next);
///     next += parts.len();
///     // … send the parts …
///     if parts.is_empty() && (log.is_closed() || length.changed().await.is_err()) {
///         break;
///     }
/// }
/// # }
/// ```
#[derive(Clone)]
pub struct LiveLog {
    shared: Arc<Shared>,
}

struct Shared {
    state: Mutex<State>,
    /// The number of parts; touched at each append and when the log closes.
    length: watch::Sender<usize>,
}

#[derive(Default)]
struct State {
    parts: Vec<Bytes>,
    /// The arrangement of views: its part, and the replacement for a page that has curves of its own.
    scene: Option<(usize, Bytes)>,
    /// The arranger of the views of a page.
    arranger: Option<Arc<Arranger>>,
    bytes: usize,
    /// Whether steps wait that would have been written if anybody had followed the log.
    behind: bool,
    closed: bool,
}

impl LiveLog {
    /// An empty log: the header alone.
    pub fn new() -> Self {
        let header = StreamHeader {
            fourcc: re_log_encoding::RRD_FOURCC,
            version: CrateVersion::LOCAL.to_bytes(),
            options: EncodingOptions::PROTOBUF_COMPRESSED,
        };
        let mut bytes = Vec::new();
        // Writing twelve bytes to memory does not fail; were the header missing, every reader would say so.
        if let Err(error) = header.to_rrd_bytes(&mut bytes) {
            tracing::error!("no header for the live recording: {error}");
        }
        let state = State { bytes: bytes.len(), parts: vec![Bytes::from(bytes)], ..State::default() };
        Self { shared: Arc::new(Shared { state: Mutex::new(state), length: watch::Sender::new(1) }) }
    }

    /// Part 0, the header: it goes before a part that is sent alone.
    pub fn header(&self) -> Bytes {
        self.state().parts[0].clone()
    }

    /// The parts from `index` on; cheap, the bytes are shared.
    pub fn parts_from(&self, index: usize) -> Vec<Bytes> {
        self.batch_from(index, usize::MAX)
    }

    /// The parts from `index` on, at most `most` of them, for readers that may be far behind.
    pub fn batch_from(&self, index: usize, most: usize) -> Vec<Bytes> {
        let state = self.state();
        let end = index.saturating_add(most).min(state.parts.len());
        state.parts.get(index..end).map(<[Bytes]>::to_vec).unwrap_or_default()
    }

    /// The parts from `index` on, with the views arranged for the scene alone, for a page that has curves of its own.
    pub fn scene_parts_from(&self, index: usize) -> Vec<Bytes> {
        self.scene_batch_from(index, usize::MAX)
    }

    /// The parts from `index` on, at most `most` of them, with the views arranged for the scene alone.
    pub fn scene_batch_from(&self, index: usize, most: usize) -> Vec<Bytes> {
        let mut parts = self.batch_from(index, most);
        if let Some((place, scene)) = &self.state().scene
            && let Some(part) = place.checked_sub(index).and_then(|place| parts.get_mut(place))
        {
            *part = scene.clone();
        }
        parts
    }

    /// The number of parts; at least 1, the header.
    #[expect(clippy::len_without_is_empty, reason = "the header is always there")]
    pub fn len(&self) -> usize {
        self.state().parts.len()
    }

    /// The size of all parts together, bytes.
    pub fn bytes(&self) -> usize {
        self.state().bytes
    }

    /// A receiver that is woken when parts are appended and when the log is closed; its value is the number of parts.
    /// Whoever holds it follows the log.
    pub fn subscribe(&self) -> watch::Receiver<usize> {
        // Under the lock: who comes after steps were left waiting sees that they were.
        let _state = self.state();
        self.shared.length.subscribe()
    }

    /// Whether steps may wait because nobody follows the log. The log then counts as [behind](Self::is_behind) until
    /// the recorder has written everything that views show.
    pub fn may_wait(&self) -> bool {
        let mut state = self.state();
        let may_wait = self.shared.length.receiver_count() == 0;
        // What waits is still to be written when somebody has come.
        state.behind |= may_wait;
        may_wait
    }

    /// Marks that no step waits any more: each was appended or could not be.
    pub(super) fn catch_up(&self) {
        if std::mem::take(&mut self.state().behind) {
            self.shared.length.send_modify(|_| ());
        }
    }

    /// Whether steps wait that nobody wanted at once.
    pub fn is_behind(&self) -> bool {
        self.state().behind
    }

    /// Waits until the log is not [behind](Self::is_behind), or is closed. Cancelling loses nothing.
    pub async fn caught_up(&self) {
        if self.is_behind() {
            let mut length = self.subscribe();
            // Whoever holds the log holds the sender.
            while self.is_behind() && !self.is_closed() && length.changed().await.is_ok() {}
        }
    }

    /// Closes the log, so that readers end. Its parts stay readable.
    pub fn close(&self) {
        self.state().closed = true;
        self.shared.length.send_modify(|_| ());
    }

    /// Whether the log is closed.
    pub fn is_closed(&self) -> bool {
        self.state().closed
    }

    /// Encodes messages and appends them, one part each. A closed log ignores them.
    ///
    /// # Errors
    ///
    /// [`RecordingError::Encode`] if a message cannot be encoded; then none is appended.
    pub fn append(&self, messages: &[LogMsg]) -> Result<(), RecordingError> {
        let parts = messages.iter().map(encode).collect::<Result<Vec<_>, _>>()?;
        self.push(parts, None);
        Ok(())
    }

    /// Appends the arrangement of views as one part, with the replacement of the scene alone.
    pub(super) fn append_arrangement(&self, whole: &[LogMsg], arranger: Arranger) -> Result<(), RecordingError> {
        let (whole, scene) =
            (encode_all(whole)?, encode_all(&arranger.scene(Theme::Light, Shape::Wide.aspect(), None)?)?);
        self.state().arranger = Some(Arc::new(arranger));
        self.push(vec![whole], Some(scene));
        Ok(())
    }

    /// An arrangement of views for a page: the scene alone, in light or dark, for a view this many times as wide as high; of all learners,
    /// or of the one at the place `alone` (of none such: of all). It is a stream of its own, which a viewer that has the recording adopts
    /// whatever its last arrangement was. `None` before step 0.
    ///
    /// # Errors
    ///
    /// [`RecordingError::Encode`] if the arrangement cannot be encoded.
    pub fn blueprint(&self, theme: Theme, aspect: f64, alone: Option<usize>) -> Result<Option<Bytes>, RecordingError> {
        let arranger = self.state().arranger.clone();
        let Some(arranger) = arranger else { return Ok(None) };
        let alone = alone.filter(|learner| *learner < arranger.roots.len());
        let messages = encode_all(&arranger.scene(theme, aspect, alone)?)?;
        Ok(Some([self.header(), messages].concat().into()))
    }

    /// Appends parts; `scene` replaces the first for a page with curves of its own. A closed log ignores them.
    fn push(&self, parts: Vec<Bytes>, scene: Option<Bytes>) {
        let mut state = self.state();
        if state.closed {
            return;
        }
        if let Some(scene) = scene {
            state.scene = Some((state.parts.len(), scene));
        }
        state.bytes += parts.iter().map(Bytes::len).sum::<usize>();
        state.parts.extend(parts);
        // Under the lock, so that the lengths are sent in order.
        self.shared.length.send_replace(state.parts.len());
    }

    /// Everything so far as a finished .rrd file with a footer: only the steps, with the many small chunks of a live
    /// session put together.
    ///
    /// This takes about as long as it took to encode the session; run it where it may block.
    ///
    /// # Errors
    ///
    /// [`RecordingError::Encode`] if a part cannot be decoded or encoded again.
    pub fn complete(&self) -> Result<Vec<u8>, RecordingError> {
        let mut bytes = Vec::new();
        self.complete_to(&mut bytes, self.len())?;
        Ok(bytes)
    }

    /// Writes the first `parts` as a finished .rrd file, as [`complete`](Self::complete) does, while they are put together: memory
    /// use hardly grows with the recording's length.
    ///
    /// # Errors
    ///
    /// [`RecordingError`] if a part cannot be decoded or encoded again, or the output refuses it.
    pub fn complete_to(&self, writer: impl Write, parts: usize) -> Result<(), RecordingError> {
        let failed = |source| failure(Path::new("that is put together"), false, source);
        let mut encoder = encoder(writer).map_err(failed)?;
        let parts = self.batch_from(1, parts.saturating_sub(1));
        for few in in_few(&parts) {
            for message in put_together([&[self.header()], few].concat().concat(), Keep::Steps)? {
                encoder.append(&message).map_err(failed)?;
            }
        }
        encoder.finish().map_err(failed)
    }

    /// Puts some of its parts, without the header, together into a few: readers that are far behind read a few large parts
    /// much faster than a thousand small ones. Each consists of whole messages, and has at most about 256 KiB unless a
    /// single row is larger.
    ///
    /// This takes about as long as it took to encode the parts; run it where it may block.
    ///
    /// # Errors
    ///
    /// [`RecordingError`] if the parts cannot be decoded or encoded again.
    pub fn put_together(&self, parts: &[Bytes]) -> Result<Vec<Bytes>, RecordingError> {
        let mut together: Vec<Vec<u8>> = Vec::new();
        for few in in_few(parts) {
            for message in put_together([&[self.header()], few].concat().concat(), Keep::Motion)? {
                let bytes = encode(&message)?;
                match together.last_mut() {
                    Some(part) if part.len() + bytes.len() <= MOST_TOGETHER_BYTES => part.extend_from_slice(&bytes),
                    _ => together.push(bytes.to_vec()),
                }
            }
        }
        Ok(together.into_iter().map(|part| Bytes::from(part.into_boxed_slice())).collect())
    }

    fn state(&self) -> MutexGuard<'_, State> {
        // Nothing panics while it holds the lock.
        self.shared.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Default for LiveLog {
    fn default() -> Self {
        Self::new()
    }
}

/// The parts in groups with so few bytes that each group may be decoded at once.
fn in_few(parts: &[Bytes]) -> impl Iterator<Item = &[Bytes]> {
    let mut rest = parts;
    std::iter::from_fn(move || {
        let mut bytes = 0;
        let fitting = rest.iter().take_while(|part| {
            bytes += part.len();
            bytes <= TAKEN_APART_BYTES
        });
        let count = fitting.count().max(1).min(rest.len());
        let (few, others) = rest.split_at(count);
        rest = others;
        (count > 0).then_some(few)
    })
}

pub(super) fn encode(message: &LogMsg) -> Result<Bytes, RecordingError> {
    let mut bytes = Vec::new();
    message.to_transport(EncodingOptions::PROTOBUF_COMPRESSED.compression)?.to_rrd_bytes(&mut bytes)?;
    // Parts stay as long as their session: without the room that a growing vector has to spare.
    Ok(Bytes::from(bytes.into_boxed_slice()))
}

/// Messages as one part.
fn encode_all(messages: &[LogMsg]) -> Result<Bytes, RecordingError> {
    Ok(messages.iter().map(encode).collect::<Result<Vec<_>, _>>()?.concat().into())
}
