//! The corrections that can be added to axes.

use serde::{Deserialize, Serialize};

/// A correction that can be added to axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Extra {
    /// Ratios of readings, of all joints whose axes are learned.
    Ratios,
    /// Sine and cosine of readings, of all revolute joints whose axes are learned: encoders off their centres.
    Eccentricity,
    /// How much these joints give way to gravity, at the target and at the elbow.
    Compliance,
}

impl Extra {
    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ratios => "ratios",
            Self::Eccentricity => "eccentricity",
            Self::Compliance => "compliance",
        }
    }
}
