#![no_main]
#[allow(dead_code, reason = "one entry of several")]
#[path = "../../tests/mutated/entries.rs"]
mod entries;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| entries::recording(bytes));
