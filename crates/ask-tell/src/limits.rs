//! How large a session may be.

/// Bytes of a setup as JSON, the text of the URDF included.
pub const MOST_SETUP_BYTES: usize = 8 << 20;
/// Characters of any name, title or other text of a setup but the URDF.
pub const MOST_TEXT_CHARACTERS: usize = 300;
/// Joints that move.
pub const MOST_JOINTS: usize = 40;
/// Targets.
pub const MOST_TARGETS: usize = 16;
/// Points of all targets together.
pub const MOST_POINTS: usize = 200;
/// Cameras.
pub const MOST_CAMERAS: usize = 16;
/// Sockets.
pub const MOST_SOCKETS: usize = 64;
/// Channels, those of sockets and of what is known of them included.
pub const MOST_CHANNELS: usize = 128;
/// Events of a session.
pub const MOST_EVENTS: usize = 100_000;
/// Pending suggestions of one client.
pub const MOST_SUGGESTIONS: usize = 20;
/// Pending suggestions of all clients together.
pub const MOST_PENDING: usize = 60;
/// Characters of a client's name.
pub const MOST_CLIENT_CHARACTERS: usize = 100;
/// Characters of a reason.
pub const MOST_REASON_CHARACTERS: usize = 1000;
/// Evaluations of the criterion for each movement.
pub const MOST_EVALUATIONS: usize = 100_000;

/// How large the robot of a session may be, and how much is computed for each movement. The greatest there may be by default; a
/// server may have less to give.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Most {
    /// Joints that move.
    pub joints: usize,
    /// Targets.
    pub targets: usize,
    /// Evaluations of the criterion for each movement.
    pub evaluations: usize,
}

impl Default for Most {
    fn default() -> Self {
        Self { joints: MOST_JOINTS, targets: MOST_TARGETS, evaluations: MOST_EVALUATIONS }
    }
}
