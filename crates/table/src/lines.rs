//! Line endings of any kind, read as one kind, so that lines can be counted.

use std::io::{self, Read};

/// A reader that turns `\r\n` and `\r` into `\n`, and ends the last line too.
#[derive(Debug)]
pub struct Lines<R> {
    inner: R,
    /// The last byte of `inner`.
    last: u8,
}

impl<R: Read> Lines<R> {
    pub fn new(inner: R) -> Self {
        Self { inner, last: b'\n' }
    }
}

impl<R: Read> Read for Lines<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        loop {
            let count = self.inner.read(buffer)?;
            if count == 0 && !buffer.is_empty() && !matches!(self.last, b'\n' | b'\r') {
                (buffer[0], self.last) = (b'\n', b'\n');
                return Ok(1);
            }
            let mut kept = 0;
            for index in 0..count {
                let byte = buffer[index];
                if !(byte == b'\n' && self.last == b'\r') {
                    buffer[kept] = if byte == b'\r' { b'\n' } else { byte };
                    kept += 1;
                }
                self.last = byte;
            }
            // Nothing is left of what was but the second half of a line's end; 0 would mean that the end is here.
            if kept > 0 || count == 0 {
                return Ok(kept);
            }
        }
    }
}
