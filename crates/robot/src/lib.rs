//! Robot descriptions in URDF: read into a chain, or several that branch, and written with the axes that were learned.
//!
//! ```
//! use body_schema_engine::kinematics::Joint;
//! use body_schema_robot::Urdf;
//!
//! let text = r#"<robot name="pendulum">
//!   <link name="wall"/>
//!   <link name="rod"/>
//!   <joint name="swing" type="revolute">
//!     <origin xyz="0 0 2"/>
//!     <parent link="wall"/> <child link="rod"/>
//!     <axis xyz="0 1 0"/>
//!     <limit lower="-1" upper="1" effort="1" velocity="1"/>
//!   </joint>
//! </robot>"#;
//! let urdf = Urdf::parse(text)?;
//! let chain = urdf.chain("wall", "rod")?;
//! let mut state = chain.state();
//! let Joint::Revolute(axis) = &mut state.joints[0] else { unreachable!("it swings") };
//! axis.point.x = 0.5;
//! let written = urdf.written(&chain.fitted(&state)?.chain);
//! assert_eq!(written, text.replace("0 0 2", "0.5 0 2"));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Frames
//!
//! A URDF places every joint by its `<origin>` Oᵢ in the frame of its parent link, with the axis aᵢ in the joint's own
//! frame, so that a link's pose in the base link's frame is
//!
//! ```text
//! O₁ e^{a₁θ₁} O₂ e^{a₂θ₂} … Oₙ e^{aₙθₙ}
//! ```
//!
//! With Nᵢ = O₁ … Oᵢ this is `e^{ξ₁θ₁} … e^{ξₙθₙ} Nₙ`, the ξᵢ being the axes at θ = 0 in the base link's frame: that is
//! what [`Chain::state`] gives. Where joints branch, the products are along the way from the base to each link. Lengths are metres and angles radians; `rpy` is `Rz(yaw) Ry(pitch) Rx(roll)`.
//!
//! # What a learned axis leaves open
//!
//! A line fixes a joint's frame but for a shift along it and a turn about it. [`Chain::fitted`] leaves both as they were:
//! a frame's origin moves to the nearest point of the learned line, and the frame turns by the smallest rotation that takes
//! the old direction to the new. A learned reading offset is a turn about the axis (or a shift along it), and goes into the
//! `<origin>`; `<limit>` stays in the readings that the description had. The base link's frame stays where it is: what
//! carries it into the frame of the measurements is [`State::base`](body_schema_engine::model::State::base), of which a URDF knows nothing.
//! Links behind the last moving joint of a way, the tip among them, move with that joint's frame; where only points were measured,
//! nothing else says how the tip is turned.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod attached;
mod chain;
mod coupling;
mod denavit_hartenberg;
mod element;
mod error;
mod fitted;
mod hulls;
mod kinematics;
mod mesh;
mod plain;
mod read;
mod rotation;
mod shape;
mod values;
mod write;

pub use attached::Attached;
pub use chain::{Chain, Follows, Reading, Segment};
pub use coupling::CouplingError;
pub use denavit_hartenberg::{Convention, DhError, urdf_of_dh};
pub use element::SegmentKind;
pub use error::{Unwritable, UrdfError};
pub use fitted::Fitted;
pub use hulls::Hulls;
pub use read::JointEnds;
pub use read::Urdf;
pub use shape::{Shape, Solid};
