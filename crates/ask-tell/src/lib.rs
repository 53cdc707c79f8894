//! Ask and tell: sessions with a robot elsewhere.
//!
//! The robot is asked to move ([`Session::prepare_suggest`]) and reports where it moved and what was seen ([`Session::prepare_observe`]).
//! One agent decides, the first learner of the [`Setup`]: by default a smoother that plans by the predicted error over the workspace.
//!
//! ```
//! use body_schema_ask_tell::{Ask, Observation, Session, Setup};
//! use serde_json::json;
//!
//! let urdf = r#"<robot name="pendulum"><link name="wall"/><link name="rod"/>
//!   <joint name="swing" type="revolute"><parent link="wall"/><child link="rod"/>
//!     <axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"#;
//! let setup = Setup::new(json!({ "robot": { "urdf": urdf, "base": "wall", "tip": "rod" } }));
//! let mut session = Session::open(setup)?;
//! let asked = session.suggest(&Ask::default(), None)?;
//! let told: Observation = serde_json::from_value(json!({
//!     "suggestion_id": asked.suggestions[0].id,
//!     "configuration": { "swing": 0.48 },
//!     "measurements": { "marker": [0.1, 0.02, -0.3] },
//! }))?;
//! assert_eq!(session.observe(told, None)?.observation, 1);
//! let restored = Session::from_json(&session.to_json())?;
//! assert_eq!(restored.events(), session.events());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # A session is its list of events
//!
//! [`Session`] is a [`Setup`] and a list of [`Event`]s, and nothing else: replaying the list gives it again, to the last bit on the same
//! build, and without choosing anything again, since a suggestion's event holds its plan. There are no clocks, and no random numbers but
//! those keyed by the seed; the caller passes the time where that matters.
//!
//! Every change of a session has two phases, so that a store can write in between: `prepare_…` tries it on a copy and returns the events
//! that it would append, with the answer; [`Session::commit`] appends them. A `prepare_…` that fails, or that is dropped, has changed
//! nothing. A prepared change belongs to one revision: if another was committed since, `commit` refuses it.
//!
//! # Suggestions
//!
//! | state | meaning | what it does to the next choice |
//! |---|---|---|
//! | `pending` | waits to be carried out | others are chosen given what it will teach |
//! | `observed` | an observation names it | teaches what was observed where the robot truly was |
//! | `not_seen` | an observation names it, and no channel had a reading | the surroundings count as hard to see |
//! | `infeasible` | the robot cannot go there | its neighbourhood is excluded; one that grows with each refusal nearby |
//! | `abandoned` | nobody carries it out | none: the next choice is as if it had never been made, and so may be the same |
//! | `superseded` | the body has changed, the constraints have (by a refusal, or since from where the robot stands now it is out of reach), or its client asked anew | what was planned to follow is forgotten, but where it is only out of reach |
//! | `expired` | its time ran out; only if it was given one | none |
//!
//! An observation is accepted whatever the state of the suggestion that it names, and one that names none is as good. Each client has
//! pending suggestions of its own; all are chosen together, in the order in which they were asked for, as one robot would carry them out.
//!
//! # Observations
//!
//! `configuration` is where the joints were, by name, in the units of the URDF (rad, m); a list is refused. `measurements` has one entry
//! per channel; null, and an entry that is left out, mean that it saw nothing. A joint more than a tenth of its range beyond its limits, or
//! more than two turns beyond where it is asked to go, is refused, and a point more than a tenth of a picture's size outside it.
//!
//! | channel | its name | shape |
//! |---|---|---|
//! | position | the target's | `[x, y, z]`, metres in the frame of the measurements |
//! | pose | the target's | `{"position": [x, y, z], "quaternion": [x, y, z, w]}` |
//! | pixels | `CAMERA_TARGET` | `[[u, v], …]`, one pair for each point of the target; null for a point that is not seen, where the target is `partly_seen` |
//! | distance | `TARGET_distance` | metres |
//! | depth | `CAMERA_TARGET_depth` | metres |
//! | sockets | `socket` | `{"socket": "PLACE/NAME"}`, or `"PLACE/NAME"` |
//!
//! Names that would be taken get `_2`, `_3` behind them. Of an excluded observation nothing counts but where the robot stands.
//!
//! # Results
//!
//! [`Session::observations_csv`] and [`Session::calibration_toml`] are what `calibrate` reads; [`Session::calibrate`] does it here. See
//! [`Results`]. A setup whose observations `calibrate` could not read is refused by [`Session::open`].

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod channel;
mod checkpoint;
mod draft;
mod error;
mod event;
pub mod integer;
pub mod json;
#[cfg(test)]
mod laws;
mod ledger;
mod limits;
mod observation;
mod prepare;
mod prepared;
mod rehearsal;
mod results;
mod session;
mod setup;
mod status;
mod suggestion;
mod table;

pub use channel::{ChannelShape, Shape};
pub use checkpoint::{Checkpoint, Find, Hear, Replayed};
pub use error::{Fault, Refusal, ReplayError, SetupError};
pub use event::{Choice, Document, Event, Happened, Plan, VERSION, Why};
pub use ledger::Told;
pub use limits::*;
pub use observation::{Answer, Observation};
pub use prepared::Prepared;
pub use results::{Results, ResultsError};
pub use session::Session;
pub use setup::Setup;
pub use status::Status;
pub use suggestion::{Ask, Enough, Outcome, Suggestion, SuggestionState, Suggestions};
