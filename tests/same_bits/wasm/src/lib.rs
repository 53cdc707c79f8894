//! Whole runs in WebAssembly.

// The runs name what they use as the program does, which does not build for WebAssembly.
extern crate self as body_schema;
use body_schema_scenario as scenario;

#[path = "../../runs.rs"]
mod runs;

/// What comes of a run: where the text begins in memory, after its length in four bytes.
#[unsafe(no_mangle)]
pub extern "C" fn run(index: usize) -> *const u8 {
    let text = runs::result(runs::RUNS[index]);
    let mut bytes = (text.len() as u32).to_le_bytes().to_vec();
    bytes.extend(text.bytes());
    Box::leak(bytes.into_boxed_slice()).as_ptr()
}
