//! What the fuzzers read with, by the names that the program has for it: `tests/mutated/entries.rs` serves both.

pub use body_schema_ask_tell as ask_tell;
pub use body_schema_recording as recording;
pub use body_schema_robot as robot;
pub use body_schema_scenario as scenario;
pub use body_schema_table as table;
