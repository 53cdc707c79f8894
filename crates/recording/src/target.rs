//! The target of a recording, and its settings.

use std::path::PathBuf;

use super::{Appearance, EllipsoidSize, LiveLog};

/// The target of a recording.
#[derive(Clone, Default)]
pub struct Target {
    pub(super) file: Option<PathBuf>,
    /// Whether the file grows in its place.
    pub(super) grows: bool,
    pub(super) live: Option<LiveLog>,
    pub(super) recording_id: Option<String>,
    pub(super) ellipsoids: EllipsoidSize,
    pub(super) appearance: Appearance,
    pub(super) enlarged: Option<f64>,
}

impl Target {
    /// A file, by convention `.rrd`. It gets its name only once it is finished, and then replaces a file of that name.
    pub fn file(path: impl Into<PathBuf>) -> Self {
        Self { file: Some(path.into()), ..Self::default() }
    }

    /// A log that viewers follow.
    pub fn live(log: LiveLog) -> Self {
        Self { live: Some(log), ..Self::default() }
    }

    /// Adds a file that grows in its place, so that what was written outlives the process. It replaces an existing one.
    pub fn and_file(mut self, path: impl Into<PathBuf>) -> Self {
        (self.file, self.grows) = (Some(path.into()), true);
        self
    }

    /// Sets the recording's id; by default it is made of scenario and seed. Viewers take two recordings with one id for
    /// one, so a server that runs a scenario and seed twice gives each run its own id.
    pub fn with_recording_id(mut self, id: impl Into<String>) -> Self {
        self.recording_id = Some(id.into());
        self
    }

    /// Sets the size of all ellipsoids; otherwise 1σ.
    pub fn with_ellipsoids(mut self, size: EllipsoidSize) -> Self {
        self.ellipsoids = size;
        self
    }

    /// Draws robots of which no truth is known with `times` as large differences from their description, which stands beside
    /// them; simulated ones as they are.
    pub fn with_enlarged(mut self, times: f64) -> Self {
        self.enlarged = Some(times).filter(|times| *times != 1.0);
        self
    }

    /// Draws the robot and its surroundings as a scenario states them; otherwise links and pins, and nothing around them.
    pub fn with_appearance(mut self, appearance: Appearance) -> Self {
        self.appearance = appearance;
        self
    }
}
