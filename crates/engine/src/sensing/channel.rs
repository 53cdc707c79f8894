//! What all channels have in common.

use std::{fmt, ops::Range};

use super::Subject;
use crate::model::{KinematicData, Links};

/// One kind of reading: a residual y ⊖ h(x, θ) and its Jacobian ∂h/∂δ, both in the units of the reading.
///
/// A channel knows nothing of noise. [`Sensor`](super::Sensor) puts a [`NoiseModel`](super::NoiseModel) around it and whitens, and a
/// [`Loss`](super::Loss) weighs what is whitened: any channel goes with any of them.
///
/// To add a channel takes a file here, a line in the list of this folder, and the keys that it wants in
/// [`Keys`](super::Keys). [`check_channel`](super::check_channel) holds it to the law of channels.
pub trait Channel: fmt::Debug + Send + Sync {
    /// What a reading is about. It never changes.
    fn subject(&self) -> Subject;

    /// Writes the predicted reading h (d numbers, in the channel's own units) where the robot's links are; false
    /// where there is none, as for a point behind a camera. Where a reading need not be whole, NaN is written for points that have no
    /// prediction, and false is returned if none has one.
    fn predict(&self, links: &Links<'_>, reading: &mut [f64]) -> bool;

    /// Writes the prediction that searches and filters go by: [`predict`](Self::predict)'s, and where there is none, as behind a
    /// camera, a continuation of it that leads back to where there is one. False where there is not even that.
    fn extended(&self, links: &Links<'_>, reading: &mut [f64]) -> bool {
        self.predict(links, reading)
    }

    /// Writes the [extended](Self::extended) prediction and ∂h/∂δ, transposed: `rows` holds d columns of m numbers each, all
    /// zero at first. False where there is none; the rows then stay zero. (Those of a [`Part::Norm`](super::Part::Norm) y are y ∂y/∂δ.)
    fn rows(&self, data: &KinematicData<'_>, reading: &mut [f64], rows: &mut [f64]) -> bool;

    /// Writes y ⊖ h, the residual between two readings (d numbers); y − h unless a channel says otherwise. NaN where a number of y is
    /// absent.
    fn difference(&self, y: &[f64], h: &[f64], residual: &mut [f64]) {
        residual.iter_mut().zip(y.iter().zip(h)).for_each(|(residual, (y, h))| *residual = y - h);
    }

    /// Turns a reading h into h ⊕ v, the one that is `v` (d numbers) from it: (h ⊕ v) ⊖ h = v. It is h + v unless a channel says
    /// otherwise.
    fn add(&self, reading: &mut [f64], v: &[f64]) {
        reading.iter_mut().zip(v).for_each(|(reading, v)| *reading += v);
    }

    /// How far what is measured is inside what the sensor can see, radians: negative outside, continuous. `None` where the
    /// sensor sees everything.
    fn clearance(&self, links: &Links<'_>) -> Option<f64> {
        let _ = links;
        None
    }

    /// The ranges of equations of a reading that would be absent: of the points that are out of view, where a reading need not be
    /// whole ([`least_points`](Subject::least_points)). A reading has NaN for them.
    fn unseen(&self, links: &Links<'_>) -> Vec<Range<usize>> {
        let _ = links;
        Vec::new()
    }
}

/// Lists the channels: a module and its type each. The module's name is the channel's name in scenarios. Those behind
/// the semicolon come with what stands beside the robot, and no sensor is written for them.
macro_rules! channels {
    ($($(#[$doc:meta])* $module:ident::$Type:ident),* $(,)?;
     $($(#[$beside_doc:meta])* $beside:ident::$Beside:ident),* $(,)?) => {
        $(mod $module; pub use $module::$Type;)*
        $(mod $beside; pub use $beside::$Beside;)*

        /// The names of all channels, as scenarios write them.
        pub const CHANNELS: &[&str] = &[$(stringify!($module)),*];

        impl Keys {
            /// The sensor that these keys describe, of a robot with this equipment: a channel and its noise.
            ///
            /// # Errors
            ///
            /// [`KeyError`] if no channel has that name, or if the channel's own keys do not fit each other or the
            /// equipment.
            pub fn sensor(&self, equipment: &Equipment) -> Result<Sensor, KeyError> {
                match self.channel.as_deref().unwrap_or(CHANNELS[0]) {
                    $(stringify!($module) => $Type::from_keys(self, equipment),)*
                    other => Err(KeyError::new(
                        "channel",
                        format!("there is no channel `{other}`"),
                        format!("write one of {}", CHANNELS.join(", ")),
                    )),
                }
            }
        }

        /// One example of each channel with a noise, for the laws.
        #[cfg(test)]
        pub(crate) fn examples(rng: &mut rand_chacha::ChaCha8Rng, state: &crate::model::State) -> Vec<Sensor> {
            vec![$($Type::example(rng, state),)* $($Beside::example(rng, state)),*]
        }
    };
}
pub(super) use channels;
