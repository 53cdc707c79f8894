//! Readers of a session. Each holds an index and goes at its own pace: it is given nothing before it has taken what
//! came before, and a slow one holds up nobody.

use std::sync::Arc;

use axum::body::Bytes;
use tokio::sync::watch;

use crate::{
    recording::LiveLog,
    server::session::{Kept, Session, Watching},
};

/// How many reports are taken from the history at a time.
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

    /// Why the session's engine has failed, if it has.
    pub(super) fn failure(&self) -> Option<String> {
        self.session.failure()
    }

    /// Whether the history ended because it has to be made anew.
    pub(super) fn is_rewritten(&self) -> bool {
        self.session.is_rewritten()
    }
}

/// Reads parts of the recording from an index on.
pub(super) struct Parts {
    session: Watching,
    read: fn(&LiveLog, usize) -> Vec<Bytes>,
    next: usize,
    more: watch::Receiver<usize>,
}

impl Parts {
    pub(super) fn new(session: &Arc<Session>, first: u64, read: fn(&LiveLog, usize) -> Vec<Bytes>) -> Self {
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

    /// Those that are there already.
    pub(super) fn ready(&mut self) -> Vec<Bytes> {
        let batch = (self.read)(self.session.live(), self.next);
        self.next += batch.len();
        batch
    }

    /// The index of the part that comes next.
    pub(super) fn next_index(&self) -> usize {
        self.next
    }

    /// The log that it reads.
    pub(super) fn live(&self) -> &LiveLog {
        self.session.live()
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
