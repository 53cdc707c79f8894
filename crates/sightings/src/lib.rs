//! Later sightings of a calibrated robot: read as its calibration file says, held against it, and told.
//!
//! [`Reader`] reads rows that come after the calibration, [`Question::begin`] calibrates the robot by the rows that are learned from, and
//! [`Standing`] takes sightings one by one; what they say is summed by [`body_schema_watch`]. [`page`] shows how it stands, [`Settled::report`]
//! tells all of it.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod error;
mod page;
mod question;
mod rows;
mod standing;

pub use error::SightingsError;
pub use page::page;
pub use question::{Question, Report, Settled, are_at_once, in_order, refuse_followers, split};
pub use rows::{LeftOut, Reader, Row};
pub use standing::{Clock, HeardRow, NamedMovements, Outcome, Shown, Standing, Told, UNLIKELY, alone, apart, drifting};
