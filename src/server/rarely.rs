//! Logging of events that may happen many times a second.

use std::{
    sync::{Mutex, PoisonError},
    time::{Duration, Instant},
};

/// The interval in which at most one line is logged.
const APART: Duration = Duration::from_secs(10);

/// A logger of frequent events, which also reports how often they have happened since its last line.
#[derive(Default)]
pub(super) struct Rarely(Mutex<Untold>);

#[derive(Default)]
struct Untold {
    times: u64,
    told: Option<Instant>,
}

impl Rarely {
    /// Notes an event; `line` logs it, unless another was logged a moment ago.
    pub(super) fn tell(&self, line: impl FnOnce(u64)) {
        let mut untold = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        untold.times += 1;
        if untold.told.is_none_or(|told| told.elapsed() >= APART) {
            untold.told = Some(Instant::now());
            line(std::mem::take(&mut untold.times));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_times_are_one_line_and_none_is_lost() {
        let (rarely, mut lines) = (Rarely::default(), Vec::new());
        for _ in 0..5 {
            rarely.tell(|times| lines.push(times));
        }
        assert_eq!(lines, [1]);
        rarely.0.lock().expect("unharmed").told = None;
        rarely.tell(|times| lines.push(times));
        assert_eq!(lines, [1, 5]);
    }
}
