//! The engine of body-schema: what a robot is, what can be measured of it, how both are learned, and which movement teaches most.
//!
//! A robot moves its joints to angles θ, and a camera or tracker reports where a marker on its hand is. From such pairs
//! this crate estimates where every joint axis is, with its uncertainty, and chooses the next movement so that it
//! teaches most. The source is
//!
//! > R. Martinez-Cantin, M. Lopes, L. Montesano: *Body Schema Acquisition through Active Learning*, ICRA 2010.
//!
//! [`estimation::Rls`] learns from movements that somebody made, and [`selection::Active`] chooses the next one.
//!
//! # Map
//!
//! Each module uses only those above it.
//!
//! | module | what it holds |
//! |---|---|
//! | [`numeric_range`] | which numbers are taken as magnitudes |
//! | [`kinematics`] | joints as twists, minimal coordinates of lines, directions and rotations, joint limits |
//! | [`model`] | what can be learned, in blocks; the prior; one pass along the tree of joints that gives every derivative |
//! | [`sensing`] | what is measured after a movement, channel by channel, and the noise around it; what a head can see |
//! | [`estimation`] | estimators and their beliefs: recursive least squares, stochastic gradient, a smoother with several hypotheses |
//! | [`optimize`] | DIRECT and a bounded local search: minimisers over the unit cube that know nothing of robots |
//! | [`selection`] | the A-criterion and its kin, and the policies that choose movements or plan them |
//! | [`design`] | the best movements there could be, and what data allow: for judges, who know the truth; what can be determined before any measurement |
//!
//! The crate does no input or output, knows no threads but those of the feature `parallel`, and builds for `wasm32-unknown-unknown`.
//!
//! # Notation, frames and units
//!
//! | paper | code | meaning |
//! |---|---|---|
//! | θ | `positions`, `configuration` | joint positions, rad (revolute) or m (prismatic) |
//! | x | [`State`](model::State) | all joint axes, the marker p₀ on the hand, and what else can be learned |
//! | w, v | [`Line`](kinematics::Line)`::direction`, `::point` | unit direction of an axis, a point on it (its pivot) |
//! | e^{ξθ} | [`Joint::exp`](kinematics::Joint::exp) | the motion of one joint |
//! | h(x, θ) | [`Channel::predict`](sensing::Channel::predict), [`State::marker_at`](model::State::marker_at) | predicted readings, predicted marker |
//! | y | [`Observation`](sensing::Observation) | measured readings |
//! | H | [`MeasurementModel::jacobian`](sensing::MeasurementModel::jacobian), [`jacobian`](model::jacobian()) | ∂h/∂δ in tangent coordinates δ: whitened (transposed, m × d), of the marker (3 × m) |
//! | P | [`Belief::covariance`](estimation::Belief::covariance) | covariance of δ, m × m |
//! | R | [`Belief::measurement_model`](estimation::Belief::measurement_model) | measurement covariance as the filter assumes it; I once equations are whitened |
//! | σn² | [`StabilisingNoise`](estimation::StabilisingNoise) | noise added to P, (5) |
//! | xⱼ, πⱼ, Pⱼ | [`Alternative`](estimation::Alternative) | other hypotheses, with weight and covariance |
//! | C(θ) | [`Criterion`](selection::Criterion) | expected posterior error, (7) |
//!
//! *Frame.* Axes and points are expressed at θ = 0 in the frame in which markers are measured; where axes are all free
//! there is no base transform to calibrate beside them. A base that is unknown is a block of its own.
//!
//! *Units.* Metres and radians inside; files and interfaces name the unit in the field (`sigma_m`, `limits_deg`).
//!
//! *Signs.* A positive angle turns right-handedly about w; w and −w are different robots.
//!
//! *Randomness.* One ChaCha stream per purpose and seed (`body_schema_experiment::Stream`).
//!
//! *Bits.* The same seed gives the same bits on every machine, whatever its processor and the number of threads: no product is added
//! without being rounded, sums have one order, and elementary functions and normal draws are our own.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod as_numbers;
pub mod design;
pub mod elementary;
pub mod estimation;
pub mod kinematics;
pub mod model;
pub mod most;
pub mod normal;
pub mod numeric_range;
pub mod optimize;
pub mod parallel;
pub mod selection;
pub mod sensing;
mod simd;
pub mod suggest;

pub use simd::{Instructions, use_at_most};
