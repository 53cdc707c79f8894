//! Long computations that are listened to: Ctrl-C ends the waiting at once, and somebody may be told how far they are.

use std::{
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicBool, Ordering},
        mpsc::{RecvTimeoutError, sync_channel},
    },
    thread,
    time::Duration,
};

use body_schema_calibration::Progress;
use pyo3::prelude::*;

use crate::refusal::Failure;

/// How often Ctrl-C is looked for.
const GLANCE: Duration = Duration::from_millis(50);

/// How far a computation is, and whether anybody still waits for it.
#[derive(Default)]
struct Watched {
    given_up: AtomicBool,
    stage: Mutex<Stage>,
}

/// A stage, with the steps that are done and all of its steps.
#[derive(Clone, Default, PartialEq)]
struct Stage {
    what: String,
    done: u64,
    steps: u64,
}

impl Watched {
    fn change(&self, change: impl FnOnce(&mut Stage)) {
        change(&mut self.stage.lock().unwrap_or_else(PoisonError::into_inner));
    }
}

impl Progress for Watched {
    fn stage(&self, what: &str, steps: u64) {
        self.change(|stage| *stage = Stage { what: what.to_owned(), done: 0, steps });
    }

    fn tick(&self) {
        self.change(|stage| stage.done += 1);
    }

    fn is_given_up(&self) -> bool {
        self.given_up.load(Ordering::Relaxed)
    }
}

/// What `work` finds on a thread of its own. `hear`, if there is one, is called with the name of each stage, the steps that are done and all
/// its steps. After Ctrl-C, or an exception of `hear`, nobody waits any longer, and the computation ends by itself with its next step.
pub fn heard<T: Send + 'static>(
    py: Python<'_>,
    hear: Option<Py<PyAny>>,
    work: impl FnOnce(&dyn Progress) -> T + Send + 'static,
) -> PyResult<T> {
    let (found, mut finding) = sync_channel(1);
    let watched = Arc::new(Watched::default());
    let seen = watched.clone();
    // If nobody waits, nobody takes what was found.
    thread::spawn(move || found.send(work(&*seen)).ok());
    let mut told = Stage::default();
    loop {
        let finding = &mut finding;
        let answer = py.detach(move || finding.recv_timeout(GLANCE));
        let now = watched.stage.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let tell = || match &hear {
            Some(hear) if now != told && now.steps > 0 => hear.call1(py, (&now.what, now.done, now.steps)).map(drop),
            _ => Ok(()),
        };
        if let Err(error) = py.check_signals().and_then(|()| tell()) {
            watched.given_up.store(true, Ordering::Relaxed);
            return Err(error);
        }
        told = now;
        match answer {
            Ok(answer) => return Ok(answer),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => {
                return Err(Failure::new("EngineError", "the computation broke off: please report this").into());
            }
        }
    }
}
