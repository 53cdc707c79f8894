//! Where a recording goes, and how it is made.

use std::path::PathBuf;

use super::{EllipsoidSize, LiveLog};

/// Where a recording goes.
#[derive(Clone, Default)]
pub struct Target {
    pub(super) file: Option<PathBuf>,
    /// Whether the file grows in its place.
    pub(super) grows: bool,
    pub(super) live: Option<LiveLog>,
    pub(super) recording_id: Option<String>,
    pub(super) ellipsoids: EllipsoidSize,
}

impl Target {
    /// A file, by convention `.rrd`. It has its name only once it is finished, and replaces then what was there.
    pub fn file(path: impl Into<PathBuf>) -> Self {
        Self { file: Some(path.into()), ..Self::default() }
    }

    /// A log that viewers follow.
    pub fn live(log: LiveLog) -> Self {
        Self { live: Some(log), ..Self::default() }
    }

    /// Also a file, which grows in its place: what was written outlives the process. It is replaced if it exists.
    pub fn and_file(mut self, path: impl Into<PathBuf>) -> Self {
        (self.file, self.grows) = (Some(path.into()), true);
        self
    }

    /// Sets the recording's id. Viewers take two recordings of one id for one: a server that runs a scenario and seed
    /// twice gives each run an id of its own. Otherwise it is made of scenario and seed.
    pub fn with_recording_id(mut self, id: impl Into<String>) -> Self {
        self.recording_id = Some(id.into());
        self
    }

    /// Sets the size of all ellipsoids; otherwise 1σ.
    pub fn with_ellipsoids(mut self, size: EllipsoidSize) -> Self {
        self.ellipsoids = size;
        self
    }
}
