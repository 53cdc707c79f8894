//! Learn a robot's kinematic body schema from a few well-chosen movements, and watch it happen.
//!
//! A robot moves its joints to angles θ, and a camera or tracker reports where a marker on its hand is. From such pairs
//! this crate estimates where every joint axis is, with its uncertainty, and chooses the next movement so that it
//! teaches most. The source is
//!
//! > R. Martinez-Cantin, M. Lopes, L. Montesano: *Body Schema Acquisition through Active Learning*, ICRA 2010.
//!
//! ```
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! use body_schema::scenario::builtin;
//!
//! // Two learners in front of the same simulated arm: one chooses its movements, one draws them.
//! let learners = ["active".to_owned(), "random".to_owned()];
//! let mut experiment = builtin("arm-6dof")?.experiment(1, Some(&learners[..]))?;
//! let before = experiment.latest().learners[0].metrics.prediction_m;
//! for _ in 0..40 {
//!     experiment.step()?;
//! }
//! let after = experiment.latest().learners[0].metrics.prediction_m;
//! assert!(after < before.map(|metres| metres / 4.0));
//! # Ok(())
//! # }
//! ```
//!
//! Without scenarios: [`estimation::Rls`] learns from movements that somebody made, [`selection::Active`] chooses the next
//! one, and [`ask_tell::Session`] does both for a robot elsewhere.
//!
//! # Map
//!
//! Each module uses only those above it.
//!
//! | module | what it holds |
//! |---|---|
//! | [`kinematics`] | joints as twists, minimal coordinates of lines, directions and rotations, joint limits |
//! | [`model`] | what can be learned, in blocks; the prior; one pass over the chain that gives every derivative |
//! | [`sensing`] | what is measured after a movement, channel by channel and whitened; what a head can see |
//! | [`table`] | tables of measurements in CSV, read as they stream by |
//! | [`doubts`] | what is doubtful in such a table, with the evidence |
//! | [`estimation`] | estimators and their beliefs: recursive least squares, stochastic gradient, a smoother with several hypotheses |
//! | [`optimize`] | DIRECT and a bounded local search: minimisers over the unit cube that know nothing of robots |
//! | [`selection`] | the A-criterion and its kin, and the policies that choose movements or plan them |
//! | [`design`] | the best movements there could be, and what data allow: for judges, who know the truth; what can be determined before any measurement |
//! | [`experiment`] | agents that propose and absorb, a world, a judge; the reports that everything outside reads |
//! | [`scenario`] | scenario files, strictly read |
//! | [`assembly`] | the experiments that are drawn from them |
//! | [`calibration`] | a robot calibrated by a table: fits, folds, figures, corrected descriptions |
//! | [`json`] | texts of JSON, whose faults are named by their fields |
//! | [`ask_tell`] | sessions with a robot elsewhere, which is asked to move and tells what it saw |
//!
//! These do no input or output, know no threads but those of the feature `parallel`, and build without default
//! features for `wasm32-unknown-unknown`. With the feature `app` (on by default) come `atomic` (files that are written whole or
//! not at all), `recording` (Rerun and CSV files), `chart` (panels of curves for print, as SVG and PNG; private), `paper` (the
//! paper's experiments beside its numbers, drawn as charts), `server` (HTTP and the page), `export` (the page without a
//! server) and the command line.
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
//! | H | [`Rig::jacobian`](sensing::Rig::jacobian), [`jacobian`](model::jacobian()) | ∂h/∂δ in tangent coordinates δ: whitened (transposed, m × d), of the marker (3 × m) |
//! | P | [`Belief::covariance`](estimation::Belief::covariance) | covariance of δ, m × m |
//! | R | [`Belief::rig`](estimation::Belief::rig) | measurement covariance as the filter assumes it; I once equations are whitened |
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
//! *Randomness.* One ChaCha stream per purpose and seed ([`experiment::Stream`]).
//!
//! *Bits.* The same seed gives the same bits on every machine, whatever its processor and the number of threads: no product is added
//! without being rounded, sums have one order, and elementary functions and normal draws are our own.

mod as_numbers;
#[cfg_attr(not(test), warn(clippy::disallowed_methods))]
pub mod ask_tell;
#[cfg_attr(not(test), warn(clippy::disallowed_methods))]
pub mod assembly;
#[cfg(feature = "app")]
pub mod atomic;
#[cfg_attr(not(test), warn(clippy::disallowed_methods))]
pub mod calibration;
#[cfg(feature = "app")]
mod chart;
#[cfg_attr(not(test), warn(clippy::disallowed_methods))]
pub mod design;
#[cfg_attr(not(test), warn(clippy::disallowed_methods))]
pub mod doubts;
mod elementary;
#[cfg_attr(not(test), warn(clippy::disallowed_methods))]
pub mod estimation;
#[cfg_attr(not(test), warn(clippy::disallowed_methods))]
pub mod experiment;
#[cfg(feature = "app")]
pub mod export;
pub mod json;
#[cfg_attr(not(test), warn(clippy::disallowed_methods))]
pub mod kinematics;
#[cfg_attr(not(test), warn(clippy::disallowed_methods))]
mod lanes;
pub mod magnitude;
#[cfg_attr(not(test), warn(clippy::disallowed_methods))]
pub mod model;
mod most;
#[cfg_attr(not(test), warn(clippy::disallowed_methods))]
mod normal;
#[cfg_attr(not(test), warn(clippy::disallowed_methods))]
pub mod optimize;
#[cfg(feature = "app")]
pub mod paper;
#[cfg_attr(not(test), warn(clippy::disallowed_methods))]
mod parallel;
#[cfg(feature = "app")]
pub mod recording;
#[cfg_attr(not(test), warn(clippy::disallowed_methods))]
pub mod scenario;
#[cfg_attr(not(test), warn(clippy::disallowed_methods))]
pub mod selection;
#[cfg_attr(not(test), warn(clippy::disallowed_methods))]
pub mod sensing;
#[cfg(feature = "app")]
pub mod server;
mod similar;
#[cfg_attr(not(test), warn(clippy::disallowed_methods))]
pub mod table;
mod whole;

pub use lanes::{Instructions, use_at_most};

/// The code in the README, compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
