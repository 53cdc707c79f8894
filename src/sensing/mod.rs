//! What is measured after a movement, and with what noise.
//!
//! * [`Channel`]: one kind of reading, whitened at the source; the list below names all there are.
//! * [`Rig`]: the channels of a robot together, and what they say at one posture.
//! * [`Observation`]: the readings of one movement; a channel may have none.
//! * [`Loss`]: what a reading costs that is far from its prediction.
//! * [`Head`]: a camera head that follows the marker; where it cannot, the movement is a miss.
//!
//! An *equation* is a scalar, a *reading* is one channel at one movement.

mod channel;
mod head;
#[cfg(test)]
mod laws;
mod loss;
mod observation;
mod rig;

pub use channel::{Channel, KeyError, Keys};
pub use head::{Gaze, Head};
pub use loss::{Graduated, Loss};
pub use observation::{Observation, Refused};
pub use rig::{Equations, Rig};

channel::channels! {
    /// Where a target is, three coordinates.
    position::Position,
    /// How far the marker is from a fixed point.
    distance::Distance,
}
