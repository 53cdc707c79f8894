//! Signals that ask the program to end.
//!
//! The first is a request: what is under way is brought to a good end. The second is an order.

use std::{
    fmt,
    sync::{
        Arc,
        atomic::{AtomicU8, Ordering},
        mpsc,
    },
    thread,
    time::Duration,
};

use anyhow::{Context, Result};
use body_schema_files as atomic;

/// A signal that asks to end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Signal(u8);

impl Signal {
    const HANG_UP: Self = Self(1);
    const INTERRUPT: Self = Self(2);
    const TERMINATE: Self = Self(15);

    /// The exit code that a shell expects of a program ended by this signal.
    pub fn exit_code(self) -> u8 {
        128 + self.0
    }
}

impl fmt::Display for Signal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match *self {
            Self::HANG_UP => "SIGHUP",
            Self::TERMINATE => "SIGTERM",
            _ => "Ctrl-C",
        })
    }
}

/// All signals that ask to end, received from when this is made. From then on, a file that has become too large for the process
/// (`ulimit -f`) is a reported error rather than a silent end.
pub struct Signals {
    #[cfg(unix)]
    unix: [tokio::signal::unix::Signal; 2],
    /// The hang-up signal; `None` if the program was started to stay when its terminal goes, for example by `nohup`.
    #[cfg(unix)]
    hang_up: Option<tokio::signal::unix::Signal>,
    #[cfg(unix)]
    _too_large: tokio::signal::unix::Signal,
}

/// SIGXFSZ, on all systems but those on MIPS.
#[cfg(unix)]
const TOO_LARGE: i32 = if cfg!(any(target_arch = "mips", target_arch = "mips64")) { 31 } else { 25 };

impl Signals {
    /// Registers the signals; to be called within a runtime.
    pub fn new() -> std::io::Result<Self> {
        #[cfg(unix)]
        {
            use tokio::signal::unix::{SignalKind, signal};
            let unix = [signal(SignalKind::interrupt())?, signal(SignalKind::terminate())?];
            let hang_up = if ignores_hang_up() { None } else { Some(signal(SignalKind::hangup())?) };
            Ok(Self { unix, hang_up, _too_large: signal(SignalKind::from_raw(TOO_LARGE))? })
        }
        #[cfg(not(unix))]
        Ok(Self {})
    }

    /// The next signal.
    pub async fn next(&mut self) -> Signal {
        #[cfg(unix)]
        {
            let Self { unix: [interrupt, terminate], hang_up, .. } = self;
            let hung_up = async {
                match hang_up {
                    Some(hang_up) => drop(hang_up.recv().await),
                    None => std::future::pending().await,
                }
            };
            tokio::select! {
                _ = interrupt.recv() => Signal::INTERRUPT,
                _ = terminate.recv() => Signal::TERMINATE,
                () = hung_up => Signal::HANG_UP,
            }
        }
        #[cfg(not(unix))]
        {
            // Without Ctrl-C there is none.
            if tokio::signal::ctrl_c().await.is_err() {
                std::future::pending::<()>().await;
            }
            Signal::INTERRUPT
        }
    }
}

/// Whether the program was started with SIGHUP ignored; known on Linux only.
#[cfg(unix)]
fn ignores_hang_up() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| u64::from_str_radix(line.strip_prefix("SigIgn:")?.trim(), 16).ok());
    ignored.is_some_and(|ignored| ignored & 1 != 0)
}

/// For work outside of a runtime: whether it was asked to end. A second signal ends the program at once.
#[derive(Clone)]
pub struct Interruption(Arc<AtomicU8>);

/// The time that the program may still take after the second signal, to write the footers of files.
pub const INSTANT: Duration = Duration::from_millis(250);

/// The interval at which work that cannot be interrupted is checked.
const LOOK_EVERY: Duration = Duration::from_millis(50);

impl Interruption {
    /// Begins to watch for signals.
    pub fn watch() -> Result<Self> {
        let told = Self(Arc::default());
        let number = told.0.clone();
        wait(async move |signals| {
            number.store(signals.next().await.0, Ordering::Relaxed);
            let order = signals.next().await;
            tokio::time::sleep(INSTANT).await;
            order
        })?;
        Ok(told)
    }

    /// The signal that came, if one did.
    pub fn signal(&self) -> Option<Signal> {
        match self.0.load(Ordering::Relaxed) {
            0 => None,
            number => Some(Signal(number)),
        }
    }

    /// Does work that cannot be interrupted, and abandons it if a signal comes.
    pub fn unless<T: Send + 'static>(&self, work: impl FnOnce() -> T + Send + 'static) -> Option<T> {
        if self.signal().is_some() {
            return None;
        }
        let (send, done) = mpsc::channel();
        // Nobody waits for work that was left.
        let working = thread::spawn(move || drop(send.send(work())));
        loop {
            match done.recv_timeout(LOOK_EVERY) {
                Ok(done) => return Some(done),
                Err(mpsc::RecvTimeoutError::Timeout) if self.signal().is_none() => {}
                Err(mpsc::RecvTimeoutError::Timeout) => return None,
                // It has panicked, and so does whoever wanted it.
                Err(mpsc::RecvTimeoutError::Disconnected) => {
                    return working.join().map_or_else(|panic| std::panic::resume_unwind(panic), |()| None);
                }
            }
        }
    }
}

/// Lets the first signal end the program at once: for work whose unfinished results are not kept.
pub fn end_at_once() -> Result<()> {
    wait(async |signals| signals.next().await)
}

/// Ends the program by the signal that `order` waits for, and removes everything unfinished.
fn wait(order: impl AsyncFnOnce(&mut Signals) -> Signal + Send + 'static) -> Result<()> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().context("cannot start")?;
    let mut signals = {
        let _within = runtime.enter();
        Signals::new().context("cannot wait for signals")?
    };
    let wait = move || atomic::exit(runtime.block_on(order(&mut signals)).exit_code().into());
    thread::Builder::new().name("signals".to_owned()).spawn(wait).context("cannot start")?;
    Ok(())
}

/// An error: a signal ended the work early.
#[derive(Debug, thiserror::Error)]
#[error("{told}")]
pub struct Interrupted {
    pub signal: Signal,
    /// What was done, and what is left of it.
    pub told: String,
}
