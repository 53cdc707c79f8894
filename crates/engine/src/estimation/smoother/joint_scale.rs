//! The noise of the joints' readings: as it is stated, and the factor t of it that is learned ([`joints`](super::joints)).

use crate::sensing::JointNoise;

/// The noise of the joints' readings, and what is known of it.
#[derive(Clone, Debug)]
pub(super) struct Joints {
    /// The noise as it is assumed.
    pub noise: JointNoise,
    /// The noise as it is stated.
    pub stated: JointNoise,
    /// t.
    pub factor: f64,
    /// Whether t is learned.
    pub unknown: bool,
    /// What marginalised measurements say of t.
    pub marginalised: Said,
}

/// The statistics of t from measurements.
#[derive(Clone, Copy, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct Said {
    /// Σ ê_j²/σ_j², with stated σ.
    pub squares: f64,
    /// Σ (1 − V_jj/t²σ_j²).
    pub determined: f64,
}

impl Joints {
    pub fn new(stated: JointNoise) -> Self {
        Self { noise: stated.clone(), stated, factor: 1.0, unknown: false, marginalised: Said::default() }
    }
}

impl Said {
    pub fn add(&mut self, other: Self) {
        self.squares += other.squares;
        self.determined += other.determined;
    }
}
