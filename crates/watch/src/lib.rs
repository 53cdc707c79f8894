//! placeholder

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod body;
mod error;
mod evidence;
mod filter;
mod movements;
mod posterior;
mod suspect;
mod watch;

pub use body::Body;
pub use error::{Skipped, WatchError};
pub use movements::{Expected, Known, Movements};
pub use posterior::{Amount, Explanation};
pub use suspect::Suspect;
pub use watch::{Covariate, Drift, Event, Heard, Kind, Settings, Sighting, Watch};
