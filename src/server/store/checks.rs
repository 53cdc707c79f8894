//! Checks that what is read is what was written, and where.

use std::path::Path;

use flate2::Crc;

/// The checksum of texts that are written side by side.
pub(super) fn checksum<const N: usize>(texts: [&str; N]) -> u32 {
    let mut crc = Crc::new();
    for text in texts {
        crc.update(text.as_bytes());
        // No text of ours has one: what moves from one to the next is noticed.
        crc.update(&[0]);
    }
    crc.sum()
}

/// The identity of the file that a path leads to.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct FileId(u64, u64);

impl FileId {
    /// The identity; `None` if there is no file, and on platforms that do not release a file's name while it is open.
    pub(super) fn of(path: &Path) -> Option<Self> {
        #[cfg(unix)]
        {
            use std::os::unix::fs::MetadataExt;
            let file = std::fs::metadata(path).ok()?;
            Some(Self(file.dev(), file.ino()))
        }
        #[cfg(not(unix))]
        {
            _ = path;
            None
        }
    }
}
