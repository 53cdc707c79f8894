//! Compressed forms of files, each made once, at the first request.

use std::{
    io::{Read, Write},
    sync::{Arc, OnceLock},
};

use bytes::Bytes;
use flate2::{Compression, read::GzDecoder, write::GzEncoder};

/// The compressed form of a file, made when it is first wanted; requests that come meanwhile wait for it.
#[derive(Clone, Default)]
pub(crate) struct Compressed(Arc<OnceLock<Option<Bytes>>>);

impl Compressed {
    /// A form that was made when the program was built.
    pub(crate) fn ready(bytes: Bytes) -> Self {
        Self(Arc::new(OnceLock::from(Some(bytes))))
    }

    /// The compressed form of these bytes; `None` if they cannot be compressed.
    pub(crate) fn of(&self, bytes: &[u8]) -> Option<Bytes> {
        self.0.get_or_init(|| gzip(bytes)).clone()
    }

    /// The compressed form, made without blocking the calling thread.
    pub(crate) async fn of_large(&self, bytes: Bytes) -> Option<Bytes> {
        if let Some(done) = self.0.get() {
            return done.clone();
        }
        let compressed = self.clone();
        tokio::task::spawn_blocking(move || compressed.of(&bytes)).await.ok().flatten()
    }

    /// Begins compressing in the background, so that the form is ready when it is asked for.
    pub(crate) fn begin(&self, bytes: Bytes) {
        if self.0.get().is_none() {
            let compressed = self.clone();
            let work = move || drop(compressed.of(&bytes));
            // Without a thread the first who asks has it made.
            drop(std::thread::Builder::new().name("gzip".to_owned()).spawn(work));
        }
    }
}

fn gzip(bytes: &[u8]) -> Option<Bytes> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(bytes).ok()?;
    encoder.finish().ok().map(Bytes::from)
}

/// The unpacked bytes; empty if they do not unpack, which the browser then reports.
pub(crate) fn unpack(compressed: &[u8]) -> Bytes {
    let mut plain = Vec::new();
    drop(GzDecoder::new(compressed).read_to_end(&mut plain));
    plain.into()
}

/// Whether `Accept-Encoding` names gzip and does not refuse it.
pub(crate) fn is_accepted(accepted: &str) -> bool {
    accepted.split(',').any(|coding| {
        let mut parts = coding.split(';').map(str::trim);
        let is_gzip = parts.next().is_some_and(|name| name.eq_ignore_ascii_case("gzip"));
        is_gzip && !parts.any(|weight| matches!(weight, "q=0" | "q=0.0" | "q=0.00" | "q=0.000"))
    })
}

#[cfg(test)]
mod tests {
    use super::is_accepted;

    #[test]
    fn gzip_is_sent_to_those_who_ask_for_it() {
        assert!(is_accepted("gzip, deflate, br") && is_accepted("br;q=1, GZIP;q=0.5"));
        assert!(!is_accepted("") && !is_accepted("br") && !is_accepted("gzip;q=0, br"));
    }
}
