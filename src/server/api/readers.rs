//! Readers of a session. Each holds an index and goes at its own pace: it gets nothing before it has taken what came
//! before, and a slow one delays no other.

use std::sync::Arc;

use axum::body::Bytes;
use tokio::sync::watch;

use crate::server::session::{Kept, Session, Together, Watching};
use body_schema_recording::LiveLog;

/// The most reports that are taken from the history, and parts from the recording, at a time.
const BATCH: usize = 64;

/// Reads reports from an index on.
pub(super) struct Reports {
    session: Watching,
    next: usize,
    more: watch::Receiver<usize>,
}

impl Reports {
    pub(super) fn new(session: &Arc<Session>, first: u64) -> Self {
        Self {
            next: usize::try_from(first).unwrap_or(usize::MAX),
            more: session.new_reports(),
            session: session.watch(),
        }
    }

    /// The next reports, as soon as there are any; `None` when none are coming. Cancelling loses nothing.
    pub(super) async fn next(&mut self) -> Option<Vec<Kept>> {
        loop {
            // Asked first: what an ended engine has left is still read.
            let ended = self.session.ended().is_cancelled();
            self.more.borrow_and_update();
            let batch = self.session.reports(self.next, BATCH);
            if !batch.is_empty() {
                self.next += batch.len();
                return Some(batch);
            }
            if ended {
                return None;
            }
            changed(&mut self.more, &self.session).await;
        }
    }

    /// The failure of the session's engine, if it has failed.
    pub(super) fn failure(&self) -> Option<String> {
        self.session.failure()
    }

    /// Whether the history ended because it is being rewritten.
    pub(super) fn is_rewritten(&self) -> bool {
        self.session.is_rewritten()
    }
}

/// Reads so many parts at most.
type Read = fn(&LiveLog, usize, usize) -> Vec<Bytes>;

/// Reads parts of the recording from an index on.
pub(super) struct Parts {
    session: Watching,
    read: Read,
    next: usize,
    more: watch::Receiver<usize>,
}

impl Parts {
    pub(super) fn new(session: &Arc<Session>, first: u64, read: Read) -> Self {
        let more = session.live().subscribe();
        session.show();
        Self { next: usize::try_from(first).unwrap_or(usize::MAX), more, read, session: session.watch() }
    }

    /// The next parts, as soon as there are any; `None` when none are coming. Cancelling loses nothing.
    pub(super) async fn next(&mut self) -> Option<Vec<Bytes>> {
        loop {
            let ended = self.session.ended().is_cancelled();
            self.more.borrow_and_update();
            let batch = self.ready();
            if !batch.is_empty() {
                return Some(batch);
            }
            if ended {
                return None;
            }
            changed(&mut self.more, &self.session).await;
        }
    }

    /// The next parts that are there already, or some of them.
    pub(super) fn ready(&mut self) -> Vec<Bytes> {
        let batch = (self.read)(self.session.live(), self.next, BATCH);
        self.next += batch.len();
        batch
    }

    /// The index of the part that comes next.
    pub(super) fn next_index(&self) -> usize {
        self.next
    }

    /// The recording.
    pub(super) fn live(&self) -> &LiveLog {
        self.session.live()
    }

    /// How many there are so far.
    pub(super) fn published(&self) -> usize {
        self.session.live().len()
    }

    /// The recording from its beginning in few parts, after which this reader continues with later ones; `None` if the reader
    /// was not at the beginning, or there are not many parts.
    pub(super) async fn together(&mut self) -> Option<(Bytes, Arc<Together>)> {
        if self.next > 0 {
            return None;
        }
        // One by one they are as good.
        let together = self.session.together().await.ok().flatten()?;
        self.next = together.next;
        Some((self.session.live().header(), together))
    }
}

async fn changed(more: &mut watch::Receiver<usize>, session: &Session) {
    let ended = session.ended().cancelled();
    tokio::select! {
        biased;
        changed = more.changed() => if changed.is_err() {
            // Nothing more can be published, so only the end is left to wait for.
            session.ended().cancelled().await;
        },
        () = ended => {}
    }
}
