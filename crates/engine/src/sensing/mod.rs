//! Sensors: what is measured after a movement, and with what noise.
//!
//! * [`Channel`]: one kind of reading, a residual and its Jacobian; the list below names all there are.
//! * [`check_channel`]: the law that every channel keeps, for channels of your own as well.
//! * [`Subject`]: what a channel's readings are about: target, camera, [`Part`]s, and the [`Occasion`] on which it reads.
//! * [`NoiseModel`]: one σ, a σ for each part, or a full covariance.
//! * [`Sensor`]: a channel with its noise, whitened: behind it R = I.
//! * [`MeasurementModel`]: the sensors of a robot together, and what they say at one posture.
//! * [`JointNoise`]: how far the joints' own readings are off, by which all readings of one posture err together.
//! * [`Observation`]: the readings of one movement; a channel may have none.
//! * [`Keys`]: what a scenario may say of a sensor; [`Equipment`]: what it can name.
//! * [`Loss`]: what a reading costs that is far from its prediction.
//! * [`Servo`]: the joints that aim a camera at a target, where a robot keeps what it sees in the middle.
//! * [`Head`]: a camera head that follows the marker; where it cannot, the movement is a miss.
//!
//! An *equation* is a scalar, a *reading* is one channel at one movement.

mod channel;
mod check;
mod covariance;
mod facing;
mod head;
mod joint_noise;
mod keys;
#[cfg(test)]
mod laws;
mod lens;
#[cfg(test)]
mod lens_laws;
mod loss;
mod measurement_model;
mod noise;
mod observation;
mod refused;
mod relative;
mod sensor;
mod separation;
mod servo;
mod subject;
mod visible;

pub use channel::Channel;
pub use check::{ChannelFault, check_channel};
pub use facing::{Facing, PartlySeen};
pub use head::{Gaze, Head};
pub(crate) use joint_noise::JointErrors;
pub use joint_noise::JointNoise;
pub use keys::{CameraKind, Equipment, KeyError, Keys, TargetKind};
pub(crate) use loss::log_sum;
pub use loss::{Graduated, Loss};
pub use measurement_model::{Equations, MeasurementModel, Noise};
pub use noise::{NoiseModel, UnfitNoise, UnusableNoise};
pub use observation::{Observation, present};
pub use pixels::WIDE;
pub use refused::Refused;
pub use relative::Relative;
pub use sensor::Sensor;
pub use separation::Separation;
pub use servo::{Servo, UnfitServo};
pub use subject::{Occasion, Part, ResidualNorms, Subject};
pub use visible::InView;

channel::channels! {
    /// The position of a target, three coordinates.
    position::Position,
    /// The position and rotation of a target, six numbers.
    pose::Pose,
    /// The points of a target in a camera's picture.
    pixels::Pixels,
    /// The distance of a target from a fixed point, or from another target.
    distance::Distance,
    /// The coordinate of a target along the z axis of a camera or of another target.
    depth::Depth;
    /// The contact of a target held in a socket.
    socket::Socket,
    /// The distance between two sockets.
    spacing::Spacing,
    /// The place of a camera in the frame of another.
    baseline::Baseline,
}
