//! How far a calibration has come.

/// Is told what is being done; from any thread.
pub trait Progress: Sync {
    /// So many steps of something begin.
    fn stage(&self, what: &str, steps: u64);

    /// One of them is done.
    fn tick(&self);
}

/// Tells nobody.
#[derive(Clone, Copy, Debug, Default)]
pub struct Silent;

impl Progress for Silent {
    fn stage(&self, _what: &str, _steps: u64) {}

    fn tick(&self) {}
}
