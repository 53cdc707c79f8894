//! Sequential evidence that a calibrated robot has changed.
//!
//! A calibration leaves an estimate x̂ with covariance P, and the noise R that it learned. Sightings that come by themselves (a tag seen now
//! and then, a socket touched once a morning) are held against it, one after the other: has a joint's zero moved, or a link, or the base, or
//! a target; by how much; since when.
//!
//! # Model
//!
//! With whitened rows (R = I) sighting i says, to first order,
//!
//! ```text
//! rᵢ = Hᵢ δ + Dᵢ c + b_p(i) + εᵢ            as calibrated;    δ ~ N(0, P),  c ~ N(0, P_c),  b_p ~ N(0, φ I),  εᵢ ~ N(0, (1 − φ) I)
//! rᵢ = Hᵢ δ + Dᵢ c + b_p(i) + εᵢ + G_d,i a   from sighting τ on, where suspect d has changed;      a ~ N(0, S_d)
//! ```
//!
//! | symbol | shape | meaning |
//! |---|---|---|
//! | δ | m | how far the calibration is off: common to all sightings, so that it is learned rather than taken for noise |
//! | c | joints + 3 | the drift of zeros with a [covariate](Covariate), and of the whole robot's place; none without one |
//! | b_p | d | what sightings at posture p (joints within 0.005 rad or m) share and no parameter explains, a share φ of the variance |
//! | a | k | the change: 1 number of a zero (rad or m), 6 of a link, the base, a camera, 3 or 6 of a target, 3 of a socket |
//!
//! G_d,i is Hᵢ of the layout of everything times the motion that the change makes; a [link](Suspect::Link) carries all that is behind it.
//! A sighting may be wild: f = (1 − ε) N(e; 0, S) + ε q(e), ε = 5 %, q a mixture of normals of 5 to 3125 times the deviations, the same
//! under every hypothesis; what a filter learns from a sighting is weighed by the probability that it is not wild. One suspect has no
//! numbers ([`Suspect::Unlike`]): from τ on ε = 90 %. It explains what no other does, such as a tool of another length, a joint that lost
//! its homing, or another unit, after three sightings or four.
//!
//! # Statistic
//!
//! The mixture Shiryaev–Roberts statistic, with the time t in years and ρₙ the years since the sighting before:
//!
//! ```text
//! Rₙ = Σ_τ≤n ρ_τ Σ_d π_d LR(d, τ, n),      LR(d, τ, n) = Π_τ≤i≤n f(rᵢ | d, τ, r₁ … rᵢ₋₁) / f(rᵢ | as calibrated, r₁ … rᵢ₋₁)
//! ```
//!
//! Every factor is a ratio of predictive densities (a Kalman filter of δ, c, b and a for each d and τ), so E₀(Rₙ | r₁ … rₙ₋₁) = Rₙ₋₁ + ρₙ:
//! Rₙ − tₙ is a martingale, and by optional stopping the mean time to a false alarm at the first R ≥ 1/α is at least 1/α years (Shiryaev
//! 1963, *On optimum methods in quickest detection problems*; Roberts 1966; Pollak 1987, *Average run lengths of an optimal method of
//! detecting a change in distribution*; mixtures: Robbins 1970, *Statistical methods related to the law of the iterated logarithm*).
//! Gaps of any size are allowed, as long as when a sighting comes does not depend on its error; one gap counts for 5 % of the threshold at
//! most. Terms that are dropped (the least likely) only lower R, and so do no harm to the inequality; nor does a smaller share of wild
//! sightings, since q is less concentrated than N and the alternatives' predictions are wider than the null's (Anderson 1955).
//! Where φ is not known an alarm needs R ≥ 1/α under φ = 0 and under φ = 0.8: whichever holds, the inequality does.
//!
//! After an alarm its explanations (d, τ), with their probabilities, are what is believed: later sightings change probabilities and sizes,
//! and the statistic begins anew for a further change, or for the way back, which is one more alternative.
//!
//! # What it does not promise
//!
//! The inequality is of the model. Where errors of the calibration at neighbouring postures are alike, or the noise is larger than it was
//! during the calibration, alarms are more frequent; [`Body::new`] widens both P and R by what folds of the calibration found.
//!
//! # Example
//!
//! ```
//! use std::sync::Arc;
//! use body_schema_engine::{
//!     estimation::Belief,
//!     kinematics::{Joint, Line},
//!     model::{Block, Layout, Names, State},
//!     sensing::{Observation, MeasurementModel},
//! };
//! use body_schema_watch::{Body, Settings, Sighting, Suspect, Watch};
//! use nalgebra::{DMatrix, Point3, Vector3};
//!
//! let axis = Joint::Revolute(Line { direction: Vector3::z_axis(), point: Point3::origin() });
//! let state = State::arm(vec![axis], Point3::new(0.5, 0.0, 0.0));
//! let layout = Layout::new(&state, [Block::Axis(0)]);
//! let belief = Belief::new(state, Arc::new(layout), Arc::new(MeasurementModel::tracker(1e-3)));
//! let belief = belief.with_covariance(DMatrix::identity(4, 4) * 1e-8);
//! let mut watch = Watch::new(Body::new(&belief, Names::default(), 1.0)?, Settings::default())?;
//! for week in 0..20 {
//!     let read = 0.1 * f64::from(week) - 1.0;
//!     // After ten weeks the joint stands two degrees beside what it reads.
//!     let truly = if week < 10 { read } else { read + 2_f64.to_radians() };
//!     let seen = Observation::seen(Point3::new(0.5 * truly.cos(), 0.5 * truly.sin(), 0.0));
//!     let sighting = Sighting { elapsed_years: 1.0 / 52.0, positions: &[read], observation: &seen, covariate: None };
//!     watch.hear(&sighting)?;
//! }
//! let found = &watch.explanations()[0];
//! assert_eq!((found.suspect, found.since), (Suspect::Zero(0), 11));
//! assert!((found.amounts[0].value - 2.0).abs() < 0.2 && found.amounts[0].unit == "deg");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! This crate does no input or output.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod body;
mod error;
mod evidence;
mod filter;
#[cfg(test)]
mod laws;
mod movements;
mod posterior;
mod suspect;
mod watch;

pub use body::Body;
pub use error::{Skipped, WatchError};
pub use movements::{Expected, Known, Movements};
pub use posterior::{Amount, Explanation};
pub use suspect::Suspect;
pub use watch::{Covariate, Drift, Event, Heard, Kind, Mended, Settings, Sighting, Watch};
