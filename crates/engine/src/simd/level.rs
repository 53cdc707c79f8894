//! The vector instructions that are used.

use std::sync::atomic::{AtomicU8, Ordering};

use fearless_simd::Level;

/// Instructions of a processor, from the plainest to the widest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Instructions {
    /// The instructions that every processor of the architecture has: SSE2 on `x86_64`.
    Baseline,
    /// SSE 4.2, where the processor has it.
    Sse4_2,
    /// AVX2, where the processor has it.
    Avx2,
    /// The widest instructions that the processor has.
    Widest,
}

static MOST: AtomicU8 = AtomicU8::new(Instructions::Widest as u8);

/// Uses no wider instructions from now on, in the whole process. Results are the same to the last bit; this function exists to show
/// that.
pub fn use_at_most(instructions: Instructions) {
    MOST.store(instructions as u8, Ordering::Relaxed);
}

/// The widest instructions that may be used.
pub(crate) fn level() -> Level {
    let most = MOST.load(Ordering::Relaxed);
    let is = |instructions: Instructions| most == instructions as u8;
    let limited = if is(Instructions::Baseline) {
        Some(Level::baseline())
    } else if is(Instructions::Sse4_2) {
        sse4_2()
    } else if is(Instructions::Avx2) {
        avx2()
    } else {
        None
    };
    limited.unwrap_or_else(Level::new)
}

#[cfg(target_arch = "x86_64")]
fn sse4_2() -> Option<Level> {
    Level::new().as_sse4_2().map(Level::Sse4_2)
}

#[cfg(target_arch = "x86_64")]
fn avx2() -> Option<Level> {
    Level::new().as_avx2().map(Level::Avx2)
}

#[cfg(not(target_arch = "x86_64"))]
fn sse4_2() -> Option<Level> {
    None
}

#[cfg(not(target_arch = "x86_64"))]
fn avx2() -> Option<Level> {
    None
}
