//! What all channels have in common.

use std::{fmt, sync::Arc};

use nalgebra::Point3;
use serde::{Deserialize, Serialize};

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
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Keys {
    /// Which channel; `position` unless told otherwise.
    pub channel: Option<String>,
    /// Standard deviation of the noise, metres.
    pub sigma_m: Option<f64>,
    /// A fixed point in the frame of the measurements, three coordinates in metres.
    pub to_m: Option<Vec<f64>>,
}

/// What is wrong with the keys of a sensor.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("`{key}`: {what}")]
pub struct KeyError {
    /// The key.
    pub key: String,
    /// What is wrong.
    pub what: String,
    /// How to mend it.
    pub mend: String,
}

impl Keys {
    pub(super) fn sigma_m(&self) -> Result<f64, KeyError> {
        let error = |what: String, mend: &str| KeyError { key: "sigma_m".to_owned(), what, mend: mend.to_owned() };
        let sigma = self.sigma_m.ok_or_else(|| error("missing".to_owned(), "add `sigma_m = …`, in metres"))?;
        let holds = sigma.is_finite() && sigma >= 0.0;
        holds
            .then_some(sigma)
            .ok_or_else(|| error(format!("{sigma} is out of range"), "write a number that is 0 or more"))
    }

    pub(super) fn to_m(&self) -> Result<Point3<f64>, KeyError> {
        let given = self.to_m.as_deref().unwrap_or_default();
        let is_point = given.len() == 3 && given.iter().all(|x| x.is_finite());
        let what = self.to_m.as_ref().map_or("missing".to_owned(), |given| format!("{given:?} is no point"));
        let mend = "write `to_m = [x, y, z]`, in metres, in the frame of the measurements".to_owned();
        let error = || KeyError { key: "to_m".to_owned(), what, mend };
        is_point.then(|| Point3::from_slice(given)).ok_or_else(error)
    }

    /// Refuses keys that a channel has no use for.
    pub(super) fn only(&self, known: &[&str]) -> Result<(), KeyError> {
        let given = serde_json::to_value(self).unwrap_or_default();
        let given = given.as_object().into_iter().flatten().filter(|(_, value)| !value.is_null());
        let unknown = given.map(|(key, _)| key).find(|key| *key != "channel" && !known.contains(&key.as_str()));
        unknown.map_or(Ok(()), |key| {
            let what = "this channel has no use for it".to_owned();
            Err(KeyError { key: key.clone(), what, mend: format!("remove it; the keys here are {}", known.join(", ")) })
        })
    }
}

/// Lists the channels: a module and its type each. The module's name is the channel's name in scenarios.
macro_rules! channels {
    ($($(#[$doc:meta])* $module:ident::$Type:ident),* $(,)?) => {
        $(mod $module; pub use $module::$Type;)*

        /// The names of all channels, as scenarios write them.
        pub const CHANNELS: &[&str] = &[$(stringify!($module)),*];

        impl Keys {
            /// The channel that these keys describe.
            pub fn channel(&self) -> Result<std::sync::Arc<dyn Channel>, KeyError> {
                match self.channel.as_deref().unwrap_or(CHANNELS[0]) {
                    $(stringify!($module) => $Type::from_keys(self).map(|it| std::sync::Arc::new(it) as _),)*
                    other => Err(KeyError {
                        key: "channel".to_owned(),
                        what: format!("there is no channel `{other}`"),
                        mend: format!("write one of {}", CHANNELS.join(", ")),
                    }),
                }
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
