//! Learn a robot's kinematic body schema from a few well-chosen movements, and watch it happen.
//!
//! A robot moves its joints to angles θ, and a camera or tracker reports where a marker on its hand is. From such pairs
//! this crate estimates where every joint axis is, with its uncertainty, and chooses the next movement so that it
//! teaches most. The source is
//!
//! > R. Martinez-Cantin, M. Lopes, L. Montesano: *Body Schema Acquisition through Active Learning*, ICRA 2010.
//!
//! # Map
//!
//! Each module uses only those above it.
//!
//! | module | what it holds |
//! |---|---|
//! | [`kinematics`] | joints as twists, chains as products of exponentials, minimal tangent coordinates, the Jacobian |
//! | [`sensing`] | what is measured after a movement, and what a head can see |
//! | [`estimation`] | estimators and their beliefs: recursive least squares, stochastic gradient, a smoother with several hypotheses |
//! | [`optimize`] | DIRECT and a bounded local search: minimisers over the unit cube that know nothing of robots |
//! | [`selection`] | the A-criterion, and the policies that choose movements or plan them |
//! | [`experiment`] | several learners in one world; metrics; the reports that everything outside reads |
//! | [`scenario`] | scenario files, strictly read, and the experiments drawn from them |
//!
//! These do no input or output, know no threads but those of the feature `parallel`, and build without default
//! features for `wasm32-unknown-unknown`. With the feature `app` (on by default) come `recording` (Rerun and CSV
//! files), `chart` (panels of curves for print, as SVG and PNG; private), `paper` (the paper's experiments beside its
//! numbers, drawn as charts), `server` (HTTP and the page) and the command line.
//!
//! # Notation, frames and units
//!
//! | paper | code | meaning |
//! |---|---|---|
//! | θ | `positions`, `configuration` | joint positions, rad (revolute) or m (prismatic) |
//! | x | [`Chain`](kinematics::Chain) | all joint axes, and the marker p₀ on the hand |
//! | w, v | [`Line`](kinematics::Line)`::direction`, `::point` | unit direction of an axis, a point on it (its pivot) |
//! | e^{ξθ} | [`Joint::exp`](kinematics::Joint::exp) | the motion of one joint |
//! | h(x, θ) | [`Chain::marker_at`](kinematics::Chain::marker_at) | predicted marker |
//! | y | [`Observation`](sensing::Observation) | measured marker |
//! | H | [`jacobian`](kinematics::jacobian::jacobian) | ∂h/∂δ, 3 × m, in tangent coordinates δ |
//! | P | [`Belief::covariance`](estimation::Belief::covariance) | covariance of δ, m × m |
//! | R = r I | [`Belief::noise_m2`](estimation::Belief::noise_m2) | measurement covariance as the filter assumes it |
//! | σn² | [`StabilisingNoise`](estimation::StabilisingNoise) | noise added to P, (5) |
//! | xⱼ, πⱼ, Pⱼ | [`Alternative`](estimation::Alternative) | other hypotheses, with weight and covariance |
//! | C(θ) | [`ACriterion`](selection::ACriterion) | expected posterior error, (7) |
//!
//! *Frame.* All axes and points are expressed at θ = 0 in the frame in which markers are measured. There is no base
//! transform to calibrate beside them.
//!
//! *Units.* Metres and radians inside; files and interfaces name the unit in the field (`sigma_m`, `limits_deg`).
//!
//! *Signs.* A positive angle turns right-handedly about w; w and −w are different robots.
//!
//! *Randomness.* One ChaCha stream per purpose and seed ([`experiment::Stream`]). The same seed gives the same numbers on
//! the same machine, whatever the number of threads.

pub mod assembly;
#[cfg(feature = "app")]
mod chart;
pub mod design;
pub mod estimation;
pub mod experiment;
pub mod kinematics;
pub mod model;
pub mod optimize;
#[cfg(feature = "app")]
pub mod paper;
#[cfg(feature = "app")]
pub mod recording;
pub mod scenario;
pub mod selection;
pub mod sensing;
#[cfg(feature = "app")]
pub mod server;

/// The code in the README, compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
