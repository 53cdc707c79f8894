//! What all channels have in common.

use std::{fmt, sync::Arc};

use crate::model::{Pass, State};

/// One kind of reading: what a model predicts for it, and how predictions differ from what was measured.
///
/// A channel whitens: what it hands out are equations, differences divided by its own standard deviation σ (or multiplied
/// by L⁻¹, where the covariance of its noise is L Lᵀ). Behind it R = I. Adding one takes a file here, a line in the list of
/// this folder, and the keys that it wants in [`Keys`]; the laws of `laws.rs` hold for all in the list.
pub trait Channel: fmt::Debug + Send + Sync {
    /// Equations of one reading, d; as many as numbers of a reading.
    fn equations(&self) -> usize;

    /// σ, in the unit of the reading: the nominal standard deviation of its noise.
    fn sigma(&self) -> f64;

    /// The same channel with another σ.
    fn with_sigma(&self, sigma: f64) -> Arc<dyn Channel>;

    /// Writes the predicted reading h (d numbers, in the channel's own units) at `positions` (rad or m per joint); false
    /// where there is none, as for a point behind a camera.
    fn predict(&self, state: &State, positions: &[f64], reading: &mut [f64]) -> bool;

    /// Writes L⁻¹ (y ⊖ h), the difference of two readings, whitened (d numbers).
    fn difference(&self, y: &[f64], h: &[f64], whitened: &mut [f64]);

    /// Writes the predicted reading and L⁻¹ ∂h/∂δ, transposed: `rows` holds d columns of m numbers each, all zero at
    /// first. False where there is no prediction; the rows then stay zero.
    fn rows(&self, pass: &Pass<'_>, reading: &mut [f64], rows: &mut [f64]) -> bool;

    /// What is read where `reading` would be without noise: y = h ⊕ L v, with v standard normal (d numbers).
    fn disturb(&self, reading: &mut [f64], v: &[f64]);

    /// The target whose position this channel measures, if it does.
    fn target(&self) -> Option<usize> {
        None
    }
}

/// What a scenario may say of a sensor. A channel takes the keys that it knows and refuses the others.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Keys {
    /// Standard deviation of the noise, metres.
    pub sigma_m: Option<f64>,
    /// A fixed point beside the robot, metres, in the frame of the measurements.
    pub to_m: Option<[f64; 3]>,
}

/// What is wrong with the keys of a sensor.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("`{key}`: {what}")]
pub struct KeyError {
    /// The key.
    pub key: &'static str,
    /// What is wrong.
    pub what: &'static str,
    /// How to mend it.
    pub mend: &'static str,
}

impl Keys {
    pub(super) fn sigma_m(&self) -> Result<f64, KeyError> {
        let error = |what| KeyError { key: "sigma_m", what, mend: "write `sigma_m = …`, 0 or more, in metres" };
        let sigma = self.sigma_m.ok_or_else(|| error("missing"))?;
        if sigma.is_finite() && sigma >= 0.0 { Ok(sigma) } else { Err(error("out of range")) }
    }

    pub(super) fn without_to(&self) -> Result<(), KeyError> {
        let what = "this channel has no use for it";
        self.to_m.map_or(Ok(()), |_| Err(KeyError { key: "to_m", what, mend: "remove it" }))
    }
}

/// Lists the channels: a module and its type each. The module's name is the channel's name in scenarios.
macro_rules! channels {
    ($($(#[$doc:meta])* $module:ident::$Type:ident),* $(,)?) => {
        $(mod $module; pub use $module::$Type;)*

        /// The names of all channels, as scenarios write them.
        pub const CHANNELS: &[&str] = &[$(stringify!($module)),*];

        /// The channel of that name with the keys of a scenario; `None` for a name that is not in [`CHANNELS`].
        pub fn channel(name: &str, keys: &Keys) -> Option<Result<std::sync::Arc<dyn Channel>, KeyError>> {
            match name {
                $(stringify!($module) => Some($Type::from_keys(keys).map(|it| std::sync::Arc::new(it) as _)),)*
                _ => None,
            }
        }

        /// One of each, for the laws.
        #[cfg(test)]
        pub(crate) fn examples(rng: &mut rand_chacha::ChaCha8Rng, state: &crate::model::State)
            -> Vec<std::sync::Arc<dyn Channel>> {
            vec![$(std::sync::Arc::new($Type::example(rng, state))),*]
        }
    };
}
pub(super) use channels;
