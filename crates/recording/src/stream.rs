//! The frames of a recording (.rrd), with their stated lengths checked.
//!
//! Rerun's decoder allocates as many bytes as a message states: for the frame in the file, uncompressed, and for each of Arrow's
//! messages within. In a damaged file these may exceed the memory, which ends the process. So every length is compared with what is
//! there before the decoder sees it.

use std::io::{self, BufRead, Read};

use re_chunk::external::arrow::ipc::root_as_message;
use re_log_encoding::{
    Decodable, MessageHeader, MessageKind, RRD_FOURCC, StreamFooter, StreamHeader, external::lz4_flex,
};
use re_protos::{common::v1alpha1::Compression, log_msg::v1alpha1::ArrowMsg};

/// The most bytes of a message.
const MOST: u64 = 1 << 30;
/// The most bytes that LZ4 makes of one.
const LZ4_RATIO: u64 = 255;

/// A stream whose frames are read one by one. It ends with an error at the first frame that cannot be whole.
pub(super) struct Frames<R> {
    stream: R,
    next: Next,
    frame: Vec<u8>,
    /// The number of bytes of the frame that were read.
    taken: usize,
}

/// The next item of the stream.
enum Next {
    Header,
    Message,
    Footer,
    Nothing,
}

impl<R: BufRead> Frames<R> {
    /// A stream from its header on.
    pub fn new(stream: R) -> Self {
        Self { stream, next: Next::Header, frame: Vec::new(), taken: 0 }
    }

    fn advance(&mut self) -> io::Result<()> {
        self.frame.clear();
        self.taken = 0;
        self.next = match std::mem::replace(&mut self.next, Next::Nothing) {
            Next::Header => {
                self.read_on(StreamHeader::ENCODED_SIZE_BYTES as u64)?;
                if self.frame.starts_with(&RRD_FOURCC) { Next::Message } else { Next::Nothing }
            }
            Next::Message => self.message()?,
            Next::Footer => {
                self.read_on(StreamFooter::ENCODED_SIZE_BYTES as u64)?;
                if entries(&self.frame) > 1 {
                    return Err(damaged(format!("its end says that it has {} footers", entries(&self.frame))));
                }
                Next::Header
            }
            Next::Nothing => Next::Nothing,
        };
        Ok(())
    }

    fn message(&mut self) -> io::Result<Next> {
        // Streams may stand one behind the other without an end between them.
        self.read_on(RRD_FOURCC.len() as u64)?;
        if self.frame == RRD_FOURCC {
            self.read_on((StreamHeader::ENCODED_SIZE_BYTES - RRD_FOURCC.len()) as u64)?;
            return Ok(Next::Message);
        }
        self.read_on((MessageHeader::ENCODED_SIZE_BYTES - RRD_FOURCC.len()) as u64)?;
        if self.frame.len() < MessageHeader::ENCODED_SIZE_BYTES {
            return Ok(Next::Nothing);
        }
        let MessageHeader { kind, len } =
            MessageHeader::from_rrd_bytes(&self.frame).map_err(|error| damaged(error.to_string()))?;
        if len > MOST {
            return Err(damaged(format!("a message says that it has {len} bytes")));
        }
        let found = self.read_on(len)?;
        if found < len {
            return Err(damaged(format!("a message of {len} bytes ends after {found}")));
        }
        if kind == MessageKind::ArrowMsg {
            hold_arrow(&self.frame[MessageHeader::ENCODED_SIZE_BYTES..]).map_err(damaged)?;
        }
        Ok(if kind == MessageKind::End { Next::Footer } else { Next::Message })
    }

    /// Reads `count` more bytes into the frame, or as many as there are, and returns their number.
    fn read_on(&mut self, count: u64) -> io::Result<u64> {
        self.stream.by_ref().take(count).read_to_end(&mut self.frame).map(|found| found as u64)
    }
}

/// Whether these bytes are a stream's end.
pub(super) fn is_end(bytes: &[u8]) -> bool {
    entries(bytes) <= 1 && StreamFooter::from_rrd_bytes(bytes).is_ok()
}

/// The number of footers that the end of a stream names in its last bytes: Rerun's decoder trusts them, and Rerun
/// writes one.
fn entries(end: &[u8]) -> u32 {
    end.last_chunk().map_or(0, |count| u32::from_le_bytes(*count))
}

fn damaged(why: String) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, why)
}

/// Checks that the content of one of Arrow's messages can be as long as it states. What cannot be read at all is left
/// to the decoder.
fn hold_arrow(bytes: &[u8]) -> Result<(), String> {
    let Ok(message) = ArrowMsg::from_rrd_bytes(bytes) else { return Ok(()) };
    if message.compression() != Compression::Lz4 {
        return hold_batches(&message.payload);
    }
    let size = message.uncompressed_size;
    if size > LZ4_RATIO * message.payload.len() as u64 {
        return Err(format!("{} bytes say that they are {size} uncompressed", message.payload.len()));
    }
    match lz4_flex::block::decompress(&message.payload, size as usize) {
        Ok(payload) => hold_batches(&payload),
        Err(_) => Ok(()),
    }
}

/// Checks the stated lengths of Arrow's own messages, a schema and batches, one after the other:
///
/// ```text
/// ff ff ff ff │ length of the metadata │ metadata, with the length of the body │ body
/// ```
fn hold_batches(mut rest: &[u8]) -> Result<(), String> {
    const MARK: [u8; 4] = [0xff; 4];
    while let Some((mark, behind)) = rest.split_first_chunk() {
        let (length, behind) = match behind.split_first_chunk() {
            Some((length, behind)) if *mark == MARK => (i32::from_le_bytes(*length), behind),
            // As it was written before Arrow 0.15.
            _ => (i32::from_le_bytes(*mark), behind),
        };
        if length == 0 {
            break;
        }
        let metadata = usize::try_from(length).ok().and_then(|length| behind.split_at_checked(length));
        let Some((metadata, behind)) = metadata else {
            return Err(format!("Arrow's metadata say that they have {length} bytes of {}", behind.len()));
        };
        let Ok(message) = root_as_message(metadata) else { break };
        if message.header_as_record_batch().is_some_and(|batch| batch.compression().is_some()) {
            return Err("Arrow's buffers are compressed, which nobody writes".to_owned());
        }
        let length = message.bodyLength();
        let body = usize::try_from(length).ok().and_then(|length| behind.get(length..));
        rest = body.ok_or_else(|| format!("Arrow's buffers say that they have {length} bytes of {}", behind.len()))?;
    }
    Ok(())
}

impl<R: BufRead> Read for Frames<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.fill_buf()?.read(buffer)?;
        self.consume(count);
        Ok(count)
    }
}

impl<R: BufRead> BufRead for Frames<R> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        if self.taken == self.frame.len() {
            self.advance()?;
        }
        Ok(&self.frame[self.taken..])
    }

    fn consume(&mut self, count: usize) {
        self.taken += count;
    }
}

#[cfg(test)]
mod tests {
    use super::{super::decoded::messages, *};
    use crate::LiveLog;
    use body_schema_scenario::builtin;
    use body_schema_wire::{Description, StepReport};

    /// A recording of a single step, and where its messages begin, with their kinds.
    fn recorded() -> (Vec<u8>, Vec<(usize, MessageKind)>) {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("whole.rrd");
        let learners = Some(&["random".to_owned()][..]);
        let mut experiment = builtin("arm-6dof").expect("built in").experiment(1, learners).expect("valid");
        let target = crate::Target::file(&file);
        let mut recorder = crate::Recorder::new(&Description::of(&experiment), target).expect("a recorder");
        experiment.step().expect("a step");
        recorder.log(&StepReport::of(&experiment)).expect("recorded");
        recorder.finish().expect("finished");
        let bytes = std::fs::read(&file).expect("a file");
        let (mut at, mut found) = (StreamHeader::ENCODED_SIZE_BYTES, Vec::new());
        while let Ok(header) = MessageHeader::from_rrd_bytes(&bytes[at..at + MessageHeader::ENCODED_SIZE_BYTES]) {
            found.push((at, header.kind));
            at += MessageHeader::ENCODED_SIZE_BYTES + header.len as usize;
            if header.kind == MessageKind::End {
                break;
            }
        }
        (bytes, found)
    }

    fn read(bytes: &[u8]) -> (usize, Option<String>) {
        let all: Vec<_> = messages(bytes).collect();
        (all.iter().filter(|message| message.is_ok()).count(), all.into_iter().find_map(Result::err))
    }

    /// Found by mutation: the decoder looked for the second of them behind the end.
    #[test]
    fn an_end_that_names_more_footers_than_there_are_is_an_error() {
        let (mut bytes, _) = recorded();
        let size = StreamFooter::ENCODED_SIZE_BYTES;
        assert!(is_end(&bytes[bytes.len() - size..]) && read(&bytes).1.is_none());
        let count = bytes.len() - 4;
        for named in [2, 3, u32::MAX] {
            bytes[count..].copy_from_slice(&named.to_le_bytes());
            assert!(!is_end(&bytes[bytes.len() - size..]));
            assert!(read(&bytes).1.is_some_and(|why| why.contains("footers")));
        }
    }

    #[test]
    fn what_is_whole_passes_as_it_is() {
        let (bytes, places) = recorded();
        let mut passed = Vec::new();
        Frames::new(&bytes[..]).read_to_end(&mut passed).expect("whole");
        assert!(passed == bytes);
        assert_eq!(read(&bytes), (places.len() - 1, None));
        // One behind the other, with an end between them and without.
        let twice = [&bytes[..], &bytes[..]].concat();
        assert_eq!(read(&twice), (2 * (places.len() - 1), None));
        let end = places.last().expect("the end").0;
        assert_eq!(read(&[&bytes[..end], &bytes[..]].concat()), (2 * (places.len() - 1), None));
        assert_eq!(read(&LiveLog::new().header()), (0, None));
    }

    /// Whatever length it is that lies, what stands before it is read, and no room is made for what is not there.
    #[test]
    fn no_length_is_believed() {
        let (bytes, places) = recorded();
        let index = places.iter().rposition(|(_, kind)| *kind == MessageKind::ArrowMsg).expect("data");
        let at = places[index].0;
        for length in [u64::MAX, 1 << 62, 1 << 40, MOST, bytes.len() as u64] {
            let mut lying = bytes.clone();
            lying[at + 8..at + 16].copy_from_slice(&length.to_le_bytes());
            let (count, damage) = read(&lying);
            assert_eq!(count, index, "{length}");
            assert!(damage.is_some_and(|why| why.contains("a message")), "{length}");
        }
        let mut neither = bytes.clone();
        neither[at..at + 8].fill(0x2a);
        assert!(matches!(read(&neither), (count, Some(_)) if count == index));
        // Cut off in a message, and between two.
        assert!(
            matches!(read(&bytes[..at + 40]), (count, Some(why)) if count == index && why.contains("ends after 24"))
        );
        assert_eq!(read(&bytes[..at]), (index, None));
    }

    #[test]
    fn no_length_within_is_believed() {
        let (bytes, places) = recorded();
        let (at, _) = places.into_iter().find(|(_, kind)| *kind == MessageKind::ArrowMsg).expect("data");
        let header = at + MessageHeader::ENCODED_SIZE_BYTES;
        let length = MessageHeader::from_rrd_bytes(&bytes[at..header]).expect("a header").len as usize;
        let message = ArrowMsg::from_rrd_bytes(&bytes[header..header + length]).expect("a message");
        let framed = |message: &ArrowMsg| {
            use re_protos::external::prost::Message as _;
            hold_arrow(&message.encode_to_vec())
        };
        assert_eq!(framed(&message), Ok(()));
        let greater = ArrowMsg { uncompressed_size: 1 << 50, ..message.clone() };
        assert!(framed(&greater).is_err_and(|why| why.contains("uncompressed")));

        let plain = lz4_flex::block::decompress(&message.payload, message.uncompressed_size as usize).expect("whole");
        let uncompressed = |plain: Vec<u8>| {
            let mut message = message.clone();
            message.set_compression(Compression::None);
            framed(&ArrowMsg { uncompressed_size: plain.len() as u64, payload: plain.into(), ..message })
        };
        assert_eq!(uncompressed(plain.clone()), Ok(()));
        for length in [i32::MAX, -1, plain.len() as i32] {
            let mut lying = plain.clone();
            lying[4..8].copy_from_slice(&length.to_le_bytes());
            assert!(uncompressed(lying).is_err_and(|why| why.contains("metadata")), "{length}");
        }
        // The schema has no body; the batch's is what is behind it.
        let of_schema = i32::from_le_bytes(plain[4..8].try_into().expect("four")) as usize;
        let of_batch = 8 + of_schema;
        let of_body =
            of_batch + 8 + i32::from_le_bytes(plain[of_batch + 4..of_batch + 8].try_into().expect("four")) as usize;
        assert!(uncompressed(plain[..of_body + 8].to_vec()).is_err_and(|why| why.contains("buffers")));
    }
}
