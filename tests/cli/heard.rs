//! What tests of signals ask first.
#![cfg(unix)]

/// Whether programs that are begun here hear of a signal: below `nohup` they are not to hear of HUP.
pub fn is_heard(signal: &str) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:")).map(str::trim);
    let ignored = ignored.and_then(|mask| u64::from_str_radix(mask, 16).ok()).unwrap_or(0);
    signal != "HUP" || ignored & 1 == 0
}
