//! What can be learned of a robot: its parameters in blocks, and how they move its links.
//!
//! * [`State`]: base, joints, corrections of readings, targets, devices, sockets; forward kinematics.
//! * [`Block`]: parameters that belong together; [`Element`]: their values, with chart and transport.
//! * [`Distortion`]: how the lens of a camera bends light.
//! * [`Layout`]: which blocks are learned, and where each stands in the tangent vector.
//! * [`ChainPrior`]: what is known of a described robot, whose errors are local: a covariance for the prior.
//! * [`Prior`]: what is known before any measurement, with a full covariance, or anywhere within bounds.
//! * [`Loads`]: what gravity does to joints that give way.
//! * [`Links`]: where the links of a state are at a posture, and how joints move them.
//! * [`KinematicData`]: one pass over the chain gives every link's motion and the twist of every learned parameter. It stands here
//!   and not among the kinematics since it is the layout that says which parameters there are.
//! * [`Branch`]: joints in a row, for drawings of robots that branch.
//! * [`Workspace`]: where predictions of the hand count.
//! * [`Symmetry`]: changes of a robot that many measurements cannot tell.
//! * [`Names`]: what blocks are called, and what is said of those that nothing determines.
//! * [`Manifold`]: the postures in which a target is at a given place.

mod block;
mod branch;
mod chain_prior;
mod chart;
mod distortion;
mod element;
mod jacobian;
mod kinematic_data;
mod layout;
mod links;
mod loads;
mod manifold;
mod names;
mod points;
mod polynomial;
mod prior;
mod rank;
mod state;
mod symmetry;
mod undetermined;
mod workspace;

pub use crate::kinematics::{Correction, Motion};
pub use block::{Block, Quantity};
pub use branch::Branch;
pub(crate) use chain_prior::Inverted;
pub use chain_prior::{ChainErrors, ChainPrior, Scales};
pub use distortion::{Distortion, DistortionModel, Image};
pub use element::{Displacement, Element};
pub use kinematic_data::{KinematicData, jacobian, prediction_jacobian};
pub use layout::Layout;
pub use links::Links;
pub use loads::{GRAVITY, Load, Loads, Mass};
pub use manifold::Manifold;
pub use names::{Names, listed};
pub use points::Whitening;
pub(crate) use points::{Centre, Centres, Passage, Points, Posture, Ray, Stage};
pub use prior::{Derivatives, Prior, PriorError, anywhere};
pub use rank::{eigen, null_space, rank, singular};
pub use state::{Device, Frame, Hand, Place, State, Target};
pub use symmetry::Symmetry;
pub use workspace::{Workspace, best_motion};

#[cfg(test)]
mod laws;
#[cfg(any(test, feature = "testing"))]
#[doc(hidden)]
pub mod random;
#[cfg(test)]
mod tree_laws;
