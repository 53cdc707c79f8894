//! Runs kept for later: as Rerun recordings (.rrd), live or in a file, and as csv.
//!
//! A [`Recorder`] observes the [`Description`](crate::experiment::Description) and every
//! [`StepReport`](crate::experiment::StepReport) of an experiment, and reads nothing else. It writes to a file, to a
//! [`LiveLog`] that viewers follow, or to both.
//!
//! # Entities
//!
//! All on the timeline `step`, a sequence. Positions are in metres in the frame of the measurements (f32); scalars are
//! f64. `{learner}` is the learner's name in the scenario.
//!
//! | entity | archetype | what |
//! |---|---|---|
//! | `/note` | TextDocument, static | scenario, seed, version, learners, units, how to read and reproduce it |
//! | `/world/truth/links`, `…/axes` | LineStrips3D, Arrows3D, static | the true arm at θ = 0; absent without a truth; in time if the body changes |
//! | `/world/head/frustum` | LineStrips3D, static | the cone of the lens at rest, and the range over which it can turn; absent without a head |
//! | `/{learner}/head/gaze` | LineStrips3D | the cones of the eyes after the head has followed the marker |
//! | `/{learner}/links`, `…/axes` | LineStrips3D, Arrows3D | the estimate at θ = 0, after the update |
//! | `/{learner}/point_ellipsoids` | Ellipsoids3D | covariances of the axis points, then of the marker if it is learned |
//! | `/{learner}/direction_uncertainty` | Ellipsoids3D | covariances of the directions, at the tips of the arrows |
//! | `/{learner}/movement/links`, `…/truth` | LineStrips3D | estimated and true arm in the step's configuration |
//! | `/{learner}/marker/predicted`, `…/measured` | Points3D | the marker before the update; measured is empty after a miss |
//! | `/{learner}/marker/missed` | Points3D | the true marker after a miss, otherwise empty; absent without a head |
//! | `/{learner}/direct/criterion` | Image, Transform3D | the criterion over a slice of DIRECT's partition |
//! | `/{learner}/direct/boxes`, `…/centres`, `…/chosen` | Boxes2D, Points2D | the rectangles of the slice, the centres of the others, the choice |
//! | `/{learner}/direct/axes` | LineStrips2D, Points2D, static | frame and labels of the slice: joints and limits |
//! | `/{learner}/direct/leaves` | plain data | the whole partition, see [`Recorder`] |
//! | `/{learner}/metrics/{name}` | Scalars, SeriesLines | every metric, and what is known of the choice |
//! | `/limits/best_design_trace` | Scalars, SeriesLines | the best designs of 5, 10, 20, … movements, beside the traces; only with `run --limits` |
//! | `/{learner}/failure` | TextLog | why the learner stopped, once, if it did |
//!
//! The two ellipsoid entities also carry the covariances themselves as `covariances`: nine f64 per instance, row by
//! row. Where a report holds null nothing is logged. `/` holds the view coordinates, `/__properties` the name of the
//! recording.
//!
//! # Compatibility
//!
//! Rerun promises to read a recording with the version that wrote it and the next one only: scenario and seed are what
//! lasts. Two recordings of one seed hold the same data but for `selection_ms`, the wall time, and Rerun's random ids.

mod blueprint;
mod charts;
mod colours;
mod compact;
mod csv;
mod ellipsoid;
mod error;
mod file;
mod head;
mod layout;
mod learner;
mod live;
mod message;
mod metrics;
mod model;
mod movement;
mod note;
mod partition;
mod recorder;
mod rows;
mod scene;
mod target;

pub use self::{
    colours::{TRUTH_COLOR, hex, learner_color, learner_slots},
    csv::{StepsCsv, comparison_csv},
    ellipsoid::EllipsoidSize,
    error::RecordingError,
    live::LiveLog,
    recorder::Recorder,
    target::Target,
};

/// The timeline of a recording: the step of the experiment, counted from 0.
pub const TIMELINE: &str = "step";
