//! The limits of a server. A request beyond one is answered at once: 408, 413, 422, 429, 431, or 503 with `Retry-After`.

use std::time::Duration;

use axum::http::{HeaderMap, Method, Uri};
use tokio::sync::Semaphore;

use body_schema_ask_tell::{MOST_EVALUATIONS, MOST_JOINTS, MOST_SETUP_BYTES, MOST_TARGETS, Most};

/// All limits of a server. `docs/trust.md` has them as a table, with the answer beyond each.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Limits {
    /// The most connections, and never more than half of the descriptors that the process may open. When one more comes,
    /// the one that has waited longest for a request makes room.
    pub connections: usize,
    /// How long a request's head may take to come.
    pub header_timeout: Duration,
    /// How long a connection may wait for its next request.
    pub idle_timeout: Duration,
    /// The most bytes of a request's head.
    pub header_bytes: usize,
    /// The most header fields.
    pub headers: usize,
    /// How long a request's body may take to come. What is then done with it takes as long as it takes.
    pub body_timeout: Duration,
    /// The most bytes of a body; that which opens a session with a robot elsewhere may be
    /// [larger](Self::setup_body_bytes).
    pub body_bytes: usize,
    /// How long a client may take nothing of what is written to it.
    pub write_timeout: Duration,
    /// The most followers of one session: its events, its growing recording, its WebSocket.
    pub streams_per_session: usize,
    /// The most sessions in memory, and as many again with robots elsewhere. When one more is asked for, one that was idle for
    /// [`idle_after`](Self::idle_after) makes room.
    pub sessions: usize,
    /// The most sessions with robots elsewhere that are kept.
    pub stored_sessions: usize,
    /// The most bytes of the file in which they are kept; beyond it nothing is accepted.
    pub stored_bytes: u64,
    /// The most bytes of the recordings that are kept as files; beyond it no session is opened whose recording would be.
    pub recordings_bytes: u64,
    /// The most joints that move of a robot elsewhere.
    pub joints: usize,
    /// The most targets of a robot elsewhere.
    pub targets: usize,
    /// The most evaluations of its criterion for each movement.
    pub evaluations: usize,
    /// The most steps of a session.
    pub steps_per_session: u64,
    /// The most steps of one request.
    pub steps_per_request: u64,
    /// The most bytes of reports and recordings of all sessions together; beyond it no session makes steps.
    pub memory_bytes: usize,
    /// The time without a request and without a follower after which a session may have to make room for another. One with a
    /// robot elsewhere then leaves memory, and comes back when it is asked for.
    pub idle_after: Duration,
}

/// The least bytes of answers that may be on their way, however little memory there is.
const LEAST_ANSWERS_BYTES: usize = 16 << 20;
/// The bytes of a head that are read at a time.
const LEAST_HEADER_BYTES: usize = 8 << 10;
/// The multiple of the limit up to which a head is still read, so that it gets an answer that says what is wrong.
const READ_BEYOND: usize = 4;

impl Default for Limits {
    fn default() -> Self {
        Self {
            connections: 512,
            header_timeout: Duration::from_secs(10),
            idle_timeout: Duration::from_secs(60),
            header_bytes: 32 << 10,
            headers: 100,
            body_timeout: Duration::from_secs(30),
            body_bytes: 64 << 10,
            write_timeout: Duration::from_secs(30),
            streams_per_session: 64,
            sessions: 32,
            stored_sessions: 10_000,
            stored_bytes: 8 << 30,
            recordings_bytes: 32 << 30,
            joints: MOST_JOINTS,
            targets: MOST_TARGETS,
            evaluations: MOST_EVALUATIONS,
            steps_per_session: 100_000,
            steps_per_request: 1000,
            memory_bytes: 2 << 30,
            idle_after: Duration::from_secs(15 * 60),
        }
    }
}

impl Limits {
    /// The most bytes of the body that opens a session with a robot elsewhere.
    pub fn setup_body_bytes(&self) -> usize {
        MOST_SETUP_BYTES + self.body_bytes
    }

    /// The most bytes of large answers on their way to clients.
    pub(super) fn answers_bytes(&self) -> usize {
        (self.memory_bytes / 8).max(LEAST_ANSWERS_BYTES)
    }

    /// The limits of a session with a robot elsewhere.
    pub(super) fn most(&self) -> Most {
        Most { joints: self.joints, targets: self.targets, evaluations: self.evaluations }
    }

    /// The bytes of a head that are read, and of an answer that are held, at a time: no less than HTTP asks for.
    pub(super) fn buffer_bytes(&self) -> usize {
        self.header_bytes.saturating_mul(READ_BEYOND).max(LEAST_HEADER_BYTES)
    }

    /// The number of header fields that are read.
    pub(super) fn most_headers(&self) -> usize {
        self.headers.saturating_mul(READ_BEYOND)
    }

    /// Why a request's head is too large, if it is.
    pub(super) fn too_large_a_head(&self, method: &Method, address: &Uri, headers: &HeaderMap) -> Option<String> {
        let line = method.as_str().len() + address.path_and_query().map_or(0, |path| path.as_str().len());
        let fields: usize = headers.iter().map(|(name, value)| name.as_str().len() + value.len() + 4).sum();
        let (bytes, most) = (line + " HTTP/1.1\r\n\r\n".len() + 1 + fields, self.header_bytes);
        if headers.len() > self.headers {
            return Some(format!("a request may have {} header fields, not {}", self.headers, headers.len()));
        }
        (bytes > most).then(|| format!("address and header fields together may have {most} bytes, not {bytes}"))
    }

    /// The number of connections that are possible in this process.
    pub(super) fn possible_connections(&self) -> usize {
        self.connections_within(descriptors()).min(Semaphore::MAX_PERMITS)
    }

    /// The number of connections that these limits and the process's descriptors allow; the other half is for files and
    /// the rest.
    fn connections_within(&self, descriptors: Option<u64>) -> usize {
        let half = descriptors.and_then(|all| usize::try_from(all / 2).ok()).unwrap_or(usize::MAX);
        self.connections.min(half).max(1)
    }
}

/// The number of descriptors that this process may open; `None` where the platform does not say.
fn descriptors() -> Option<u64> {
    #[cfg(unix)]
    return rlimit::Resource::NOFILE.get_soft().ok();
    #[cfg(not(unix))]
    None
}

/// Raises the number of descriptors that this process may open as far as allowed, where the platform has such a limit. For
/// programs, at their start.
pub fn raise_descriptors() {
    // With fewer there are fewer connections.
    drop(rlimit::increase_nofile_limit(u64::MAX));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn connections_leave_half_of_the_descriptors() {
        let limits = Limits::default();
        assert_eq!(limits.connections_within(None), limits.connections);
        assert_eq!(limits.connections_within(Some(1 << 20)), limits.connections);
        assert_eq!(limits.connections_within(Some(64)), 32);
        assert_eq!(limits.connections_within(Some(1)), 1, "one can always be served");
    }
}
