//! A reader that refuses endless or binary input while it is read.

use std::io::{self, Read};

/// The longest table that is read, in bytes: a million rows of twenty columns.
pub const MOST_BYTES: u64 = 512 << 20;

/// A reader that fails at the first byte that no text contains, and after a given number of bytes. The error continues
/// a sentence that begins with the file's name.
#[derive(Debug)]
pub struct Guard<R> {
    inner: R,
    read: u64,
    most: u64,
}

impl<R: Read> Guard<R> {
    /// Reads at most `most` bytes of `inner`.
    pub fn new(inner: R, most: u64) -> Self {
        Self { inner, read: 0, most }
    }
}

impl<R: Read> Read for Guard<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let refused = |what: String| Err(io::Error::new(io::ErrorKind::InvalidData, what));
        let count = self.inner.read(buffer)?;
        if self.read == 0 && count >= 2 && matches!(buffer[..2], [0xFF, 0xFE] | [0xFE, 0xFF]) {
            // The byte order marks of UTF-16, as spreadsheets write it.
            return refused("is text in UTF-16; save it in UTF-8".to_owned());
        }
        if let Some(at) = buffer[..count].iter().position(|&byte| byte == 0) {
            return refused(format!("is not text: its byte {} is 0", self.read + at as u64 + 1));
        }
        self.read += count as u64;
        if self.read > self.most {
            return refused(format!("is longer than {} MiB, the most that is read", self.most >> 20));
        }
        Ok(count)
    }
}
