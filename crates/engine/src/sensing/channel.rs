//! What all channels have in common.

use std::{fmt, sync::Arc};

use nalgebra::Point3;

use crate::model::{Pass, State, Whitening};

/// One kind of reading: what a model predicts for it, and how predictions differ from what was measured.
///
/// A channel whitens: what it hands out are equations, differences divided by its own standard deviation σ (or multiplied
/// by L⁻¹, where the covariance of its noise is L Lᵀ). Behind it R = I. To add a channel takes a file here, a line in the
/// list of this folder, and the keys that it wants in [`Keys`](super::Keys); the laws of `laws.rs` hold for all in the
/// list.
pub trait Channel: fmt::Debug + Send + Sync {
    /// Equations of one reading, d; as many as numbers of a reading.
    fn equations(&self) -> usize;

    /// σ, in the unit of the reading: the nominal standard deviation of its noise.
    fn sigma(&self) -> f64;

    /// This channel with another σ, and its other noises in proportion.
    fn with_sigma(&self, sigma: f64) -> Arc<dyn Channel>;

    /// This channel with each kind of noise multiplied by its factor, one for each of [`noises`](Self::noises).
    fn scaled(&self, factors: &[f64]) -> Arc<dyn Channel> {
        self.with_sigma(self.sigma() * factors.first().copied().unwrap_or(1.0))
    }

    /// Writes the predicted reading h (d numbers, in the channel's own units) at `positions` (rad or m per joint); false
    /// where there is none, as for a point behind a camera.
    fn predict(&self, state: &State, positions: &[f64], reading: &mut [f64]) -> bool;

    /// Writes the prediction that searches and filters go by: [`predict`](Self::predict)'s, and where there is none, as behind a
    /// camera, a continuation of it that leads back to where there is one. False where there is not even that.
    fn extended(&self, state: &State, positions: &[f64], reading: &mut [f64]) -> bool {
        self.predict(state, positions, reading)
    }

    /// Writes L⁻¹ (y ⊖ h), the difference of two readings, whitened (d numbers); (y − h)/σ unless a channel says otherwise.
    fn difference(&self, y: &[f64], h: &[f64], whitened: &mut [f64]) {
        let sigma = self.sigma();
        whitened.iter_mut().zip(y.iter().zip(h)).for_each(|(whitened, (y, h))| *whitened = (y - h) / sigma);
    }

    /// Writes the [extended](Self::extended) prediction and L⁻¹ ∂h/∂δ, transposed: `rows` holds d columns of m numbers each, all
    /// zero at first. False where there is none; the rows then stay zero.
    fn rows(&self, pass: &Pass<'_>, reading: &mut [f64], rows: &mut [f64]) -> bool;

    /// Adds noise to a noise-free `reading`: y = h ⊕ L v, with v standard normal (d numbers); h + σ v unless a channel says
    /// otherwise.
    fn disturb(&self, reading: &mut [f64], v: &[f64]) {
        reading.iter_mut().zip(v).for_each(|(reading, v)| *reading += self.sigma() * v);
    }

    /// σ of the noise of an equation, and its unit: m, rad or px.
    fn nominal(&self, equation: usize) -> (f64, &'static str) {
        let _ = equation;
        (self.sigma(), "m")
    }

    /// How many kinds of noise a reading has, each with a σ of its own in proportion to [`sigma`](Self::sigma): the equations
    /// are so many equal parts, one after the other. A scale of the noise is learned for each.
    fn noises(&self) -> usize {
        1
    }

    /// How far what is measured is inside what the sensor can see, radians: negative outside, continuous. `None` where the
    /// sensor sees everything.
    fn clearance(&self, state: &State, positions: &[f64]) -> Option<f64> {
        let _ = (state, positions);
        None
    }

    /// Whether [`clearance`](Self::clearance) ever returns a number.
    fn has_view(&self) -> bool {
        false
    }

    /// Where a reading says that a target is, if it says so: the target and its origin, metres.
    fn position(&self, reading: &[f64]) -> Option<(usize, Point3<f64>)> {
        Some((self.target()?, Point3::from_slice(reading.get(..3)?)))
    }

    /// The residual between two readings in physical units, for reports. It is `None` for kinds of quantity that the channel
    /// does not measure.
    fn apart(&self, y: &[f64], h: &[f64]) -> Apart {
        let _ = (y, h);
        Apart::default()
    }

    /// The camera and the target whose known points it pictures, two equations each, if the channel reads those.
    fn sight(&self) -> Option<(usize, usize)> {
        None
    }

    /// The target whose position this channel measures, if it does.
    fn target(&self) -> Option<usize> {
        None
    }

    /// The target and L⁻¹ of the noise, if a reading is the three coordinates of the target's origin in the frame of the
    /// measurements; `None` for any other reading.
    fn point(&self) -> Option<(usize, Whitening)> {
        None
    }

    /// The target that a reading is about, if it is about one.
    fn subject(&self) -> Option<usize> {
        self.target().or(self.sight().map(|(_, target)| target))
    }

    /// When it has a reading.
    fn occasion(&self) -> Occasion {
        Occasion::Always
    }
}

/// The residual between two readings of a channel, in physical units.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Apart {
    /// The distance of places or the difference of lengths, metres.
    pub length_m: Option<f64>,
    /// The angle between rotations, radians.
    pub angle_rad: Option<f64>,
    /// The distance in the picture, pixels, mean over its points.
    pub pixels: Option<f64>,
}

impl Apart {
    pub(super) fn lengths(y: &[f64], h: &[f64]) -> Self {
        let squares: f64 = y.iter().zip(h).map(|(y, h)| (y - h) * (y - h)).sum();
        Self { length_m: Some(squares.sqrt()), ..Self::default() }
    }
}

/// When a channel has a reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Occasion {
    /// After every movement at which it sees its target.
    Always,
    /// After a movement that holds a target in a socket.
    Held {
        /// The socket.
        socket: usize,
        /// The target.
        target: usize,
    },
    /// Once, before any movement: what is known of the equipment.
    Beforehand,
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
            /// The channel that these keys describe, of a robot with this equipment.
            ///
            /// # Errors
            ///
            /// [`KeyError`] if no channel has that name, or if the channel's own keys do not fit each other or the
            /// equipment.
            pub fn channel(&self, equipment: &Equipment) -> Result<std::sync::Arc<dyn Channel>, KeyError> {
                match self.channel.as_deref().unwrap_or(CHANNELS[0]) {
                    $(stringify!($module) => {
                        $Type::from_keys(self, equipment).map(|it| std::sync::Arc::new(it) as _)
                    })*
                    other => Err(KeyError::new(
                        "channel",
                        format!("there is no channel `{other}`"),
                        format!("write one of {}", CHANNELS.join(", ")),
                    )),
                }
            }
        }

        /// One example of each channel, for the laws.
        #[cfg(test)]
        pub(crate) fn examples(rng: &mut rand_chacha::ChaCha8Rng, state: &crate::model::State)
            -> Vec<std::sync::Arc<dyn Channel>> {
            vec![$(std::sync::Arc::new($Type::example(rng, state)),)* $(std::sync::Arc::new($Beside::example(rng, state))),*]
        }
    };
}
pub(super) use channels;
