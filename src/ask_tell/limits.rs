//! How large a session may be.

/// Bytes of a setup as JSON, the text of the URDF included.
pub const MOST_SETUP_BYTES: usize = 8 << 20;
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
