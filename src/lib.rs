//! Learn a robot's kinematic body schema from a few well-chosen movements.
pub mod estimation;
pub mod experiment;
pub mod kinematics;
pub mod optimize;
#[cfg(feature = "app")]
pub mod recording;
pub mod scenario;
pub mod selection;
pub mod sensing;
#[cfg(feature = "app")]
pub mod server;
