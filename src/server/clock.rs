//! The clock of the server.

use std::{
    sync::{Mutex, PoisonError},
    time::{Instant, SystemTime},
};

/// Seconds since 1970, by a clock that never goes back, even where that of the machine is set back.
pub(super) fn now_s() -> f64 {
    let told = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).map_or(0.0, |since| since.as_secs_f64());
    never_before(told)
}

/// Advances the clock to this time, if it was behind, and returns its time.
fn never_before(told: f64) -> f64 {
    static LATEST: Mutex<Option<(Instant, f64)>> = Mutex::new(None);
    let mut latest = LATEST.lock().unwrap_or_else(PoisonError::into_inner);
    let now = Instant::now();
    let gone_on = latest.map_or(f64::NEG_INFINITY, |(at, was)| was + (now - at).as_secs_f64());
    let time = told.max(gone_on);
    *latest = Some((now, time));
    time
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn a_clock_that_is_set_back_goes_on() {
        let before = now_s();
        let later = never_before(before + 100.0);
        assert!(later >= before + 100.0);
        let set_back = never_before(before - 1000.0);
        assert!(set_back >= later && set_back < later + 60.0, "{later} {set_back}");
        std::thread::sleep(Duration::from_millis(20));
        assert!(never_before(before - 2000.0) >= set_back + 0.02);
    }
}
