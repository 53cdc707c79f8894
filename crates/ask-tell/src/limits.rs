//! The limits of a session's size.

/// The most bytes of a setup as JSON, the text of the URDF included.
pub const MOST_SETUP_BYTES: usize = 8 << 20;
/// The most characters of any name, title or other text of a setup except the URDF.
pub const MOST_TEXT_CHARACTERS: usize = 300;
/// The most joints that move.
pub const MOST_JOINTS: usize = 40;
/// The most targets.
pub const MOST_TARGETS: usize = 16;
/// The most points of all targets together.
pub const MOST_POINTS: usize = 200;
/// The most cameras.
pub const MOST_CAMERAS: usize = 16;
/// The most sockets.
pub const MOST_SOCKETS: usize = 64;
/// The most channels, those of sockets and of what is known of them included.
pub const MOST_CHANNELS: usize = 128;
/// The most events of a session.
pub const MOST_EVENTS: usize = 100_000;
/// The most pending suggestions of one client.
pub const MOST_SUGGESTIONS: usize = 20;
/// The most pending suggestions of all clients together.
pub const MOST_PENDING: usize = 60;
/// The most characters of a client's name.
pub const MOST_CLIENT_CHARACTERS: usize = 100;
/// The most characters of a reason.
pub const MOST_REASON_CHARACTERS: usize = 1000;
/// The most evaluations of the criterion for each movement.
pub const MOST_EVALUATIONS: usize = 100_000;

/// Limits of the robot's size, and of the computation for each movement. The defaults are the greatest possible; a server may
/// set lower ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Most {
    /// The most joints that move.
    pub joints: usize,
    /// The most targets.
    pub targets: usize,
    /// The most evaluations of the criterion for each movement.
    pub evaluations: usize,
}

impl Default for Most {
    fn default() -> Self {
        Self { joints: MOST_JOINTS, targets: MOST_TARGETS, evaluations: MOST_EVALUATIONS }
    }
}
