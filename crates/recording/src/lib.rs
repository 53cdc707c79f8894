//! Recordings of runs: as Rerun recordings (.rrd), live or in a file, and as CSV.
//!
//! A [`Recorder`] observes the [`Description`](body_schema_wire::Description) and every
//! [`StepReport`](body_schema_wire::StepReport) of an experiment, and draws the [`Appearance`] that its scenario states. It
//! writes to a file, to a [`LiveLog`] that viewers follow, or to both.
//!
//! # Entities
//!
//! All on the timeline `step`, a sequence. Positions are in metres (f32), below `/{learner}` in the frame of the measurements, which stands
//! beside those of the others; scalars are f64. `{learner}` is the learner's name in the scenario. "As shown" means in the configuration of
//! the step's movement; at step 0, as near to θ = 0 as limits allow.
//!
//! | entity | archetype | what |
//! |---|---|---|
//! | `/note` | TextDocument, static | scenario, seed, version, learners, units, how to read and reproduce it |
//! | `/key` | Points3D, static | what the colours mean, in a sentence |
//! | `/ground/light`, `/ground/dark` | LineStrips3D, static | the lines of the ground, one of them by the theme of the view |
//! | `/{learner}` | Transform3D, static | where the frame of its measurements stands in the row; in time if the base is learned, so that the robot stays in its place |
//! | `/{learner}/body` | Capsules3D, static | a human figure around the arm, or a pedestal; Transform3D in time if the base is learned: where the learner takes it to be |
//! | `/{learner}/body/base` | Cylinders3D, static | what a pedestal stands on |
//! | `/{learner}/body/trunk` | Capsules3D, static; Transform3D | the part of figure or pedestal that joints of the chain carry; absent if they carry none |
//! | `/{learner}/body/head` | Capsules3D, static; Transform3D | the head of a figure, on the neck of a robot that branches, at the camera there; absent without one |
//! | `/{learner}/body/obstacles` | Boxes3D, Transform3D, static | the boxes and the least height of `[constraints]`, around the nominal base; absent without any |
//! | `/{learner}/body/obstacles/names`, `…/on_dark` | Points3D, static | their names, for light ground, for dark ground and for files (`…/in_files`); beside the first learner only |
//! | `/{learner}/name` | Points3D, static; labels in time | its name before its thighs or its base, and whether it has stopped |
//! | `/{learner}/arm/truth` | Capsules3D | the true arm as shown: links, and a pin along each axis; absent without a truth |
//! | `/{learner}/arm/estimate` | Capsules3D | the estimated arm as shown, after the update |
//! | `/{learner}/arm/broken` | Points3D | the joint that has changed, from then on, and below it what that means, as `…/name`, `…/on_dark` and `…/in_files`; absent before |
//! | `/{learner}/arm/described` | Capsules3D | the robot as described, slim and grey; only where differences from it are enlarged |
//! | `/{learner}/arm/truth`, `…/estimate` | Boxes3D, Cylinders3D, Ellipsoids3D | the shapes that a URDF gives the links; their capsules are absent then |
//! | `/{learner}/arm/truth/mesh-{i}`, `…/estimate/mesh-{i}` | Asset3D, InstancePoses3D, static; Transform3D | the meshes of the URDF that were found |
//! | `/{learner}/point_ellipsoids` | Ellipsoids3D | covariances of the axis points as shown, then of the marker if it is learned |
//! | `/{learner}/allowed_ellipsoids` | Ellipsoids3D | what its data allow of them, where its own standard deviations are 1.5 times as large; absent without a truth |
//! | `/{learner}/sockets` | Points3D | the sockets in which targets are held: static where they truly are, else where the learner takes them to be |
//! | `/{learner}/sockets/names`, `…/on_dark`, `…/in_files` | Points3D | their names, one label for those that stand close together; beside the first learner only |
//! | `/{learner}/marker/predicted`, `…/measured` | Points3D | the marker before the update; measured is empty after a miss |
//! | `/{learner}/marker/error` | LineStrips3D | from the one to the other, labelled with its length; empty after a miss |
//! | `/{learner}/marker/outlier` | LineStrips3D | a cross where the marker was measured, if the learner takes that for an outlier; absent if it weighs no readings |
//! | `/{learner}/marker/missed` | Points3D | the true marker after a miss, otherwise empty; absent without a head |
//! | `/{learner}/on_dark/{name, error, missed}` | as `name`, `marker/error`, `marker/missed` | the same with colours to be read on dark ground, in their place where the view is dark |
//! | `/{learner}/in_files/{name, error, missed}` | as `name`, `marker/error`, `marker/missed` | the same with colours to be read in files, whose scene is light in a viewer of whatever theme |
//! | `/{learner}/sight/truth`, `…/estimate` | LineStrips3D | every camera as its eye and its picture at a fixed distance, and the outlines of tags; an estimated camera is absent where it is the true one; absent without cameras |
//! | `/{learner}/sight/truth/points`, `…/estimate/points` | Points3D | the known points of targets, corners of tags or of boards |
//! | `/{learner}/sight/rays` | LineStrips3D | from the true camera, or without a truth the estimated one, to the points that it saw in the movement; empty after a miss |
//! | `/{learner}/eye/{camera}/frame` | LineStrips2D, static | the frame of the picture of a camera that a link carries, pixels; absent without such a camera, as all of `eye` |
//! | `/{learner}/eye/{camera}/measured`, `…/predicted`, `…/truth` | Points2D | in that picture the known points of its targets: as measured, as predicted before the update, and without noise, be it beside the picture; empty after a miss, behind the camera, and without a truth |
//! | `/{learner}/eye/{camera}/error` | LineStrips2D | from each predicted point to the measured one |
//! | `/{learner}/head/frustum` | LineStrips3D, static | the cone of the lens at rest, and the range over which it can turn; absent without a head |
//! | `/{learner}/head/gaze` | LineStrips3D | the cones of the eyes after the head has followed the marker |
//! | `/{learner}/zero/links`, `…/axes` | LineStrips3D, Arrows3D | the estimate at θ = 0, after the update; hidden at first, as all of `zero` |
//! | `/{learner}/zero/directions` | Ellipsoids3D | covariances of the directions, at the tips of those arrows |
//! | `/{learner}/zero/truth/links`, `…/axes` | LineStrips3D, Arrows3D, static | the true arm at θ = 0; absent without a truth; in time if the body changes |
//! | `/{learner}/direct/criterion` | Image, Transform3D | the criterion over a slice of DIRECT's partition |
//! | `/{learner}/direct/boxes`, `…/centres`, `…/chosen` | Boxes2D, Points2D | the rectangles of the slice, the centres of the others, the choice |
//! | `/{learner}/direct/axes` | LineStrips2D, Points2D, static | frame and labels of the slice: joints and limits |
//! | `/{learner}/direct/leaves` | plain data | the whole partition, see [`Recorder`] |
//! | `/{learner}/metrics/{name}` | Scalars, SeriesLines | every metric, and what is known of the choice |
//! | `/{learner}/readings/residuals/{channel}` | Scalars, SeriesLines | the reading of the movement beside the updated estimate: root mean square over its equations, in standard deviations of its noise; nothing for a miss |
//! | `/{learner}/readings/outliers/{channel}` | Scalars, SeriesLines | the probability that it is an outlier, for a learner whose loss knows of outliers |
//! | `/limits/best_design_trace` | Scalars, SeriesLines | the best designs of 5, 10, 20, … movements, beside the traces; only with `run --limits` |
//! | `/{learner}/failure` | TextLog | why the learner stopped, once, if it did |
//!
//! Of a robot that branches every branch is drawn: capsules from joint to joint and on to the marker, camera or target at its end, the
//! pins, and then a capsule from each joint that carries a branch to where that begins; `zero/links` has a line for each branch.
//!
//! The ellipsoid entities also carry the covariances themselves as `covariances`: nine f64 per instance, row by row, as shown (those of
//! directions at θ = 0). Where a report holds null nothing is logged. `/` holds the view coordinates, `/__properties` the name of the
//! recording.
//!
//! # Live
//!
//! A [`LiveLog`] has a second timeline, `motion`, on which step k is at [`MOTION_PER_STEP`] k. Between two steps it may hold postures on
//! the way from one to the next (`arm/…`, the ellipsoids and `body/trunk` moved, the markers empty), and after a step
//! `/{learner}/arm/ghost`, a posture that is tried out, with its name below it. The timeline `complete` reaches k as soon as all rows of step k have come: a viewer
//! that goes there earlier shows one learner's arm and another's last one. None of this is in files and downloads.
//!
//! # Compatibility
//!
//! Rerun promises to read a recording with the version that wrote it and the next one only: scenario and seed are what
//! lasts. Two recordings of one run under one id have the same bytes but for the series `selection_ms`, which is wall time.

mod appearance;
mod arm;
mod blueprint;
mod body;
mod broken;
mod calibration;
mod charts;
mod colours;
mod compact;
mod csv;
mod decoded;
mod ellipsoid;
mod enlarged;
mod error;
mod eye;
mod file;
mod frames;
mod head;
mod ids;
#[cfg(test)]
mod laws;
mod layout;
mod learner;
mod limb;
mod links;
mod live;
mod message;
mod metrics;
mod model;
mod movement;
mod note;
mod obstacles;
mod partition;
mod posture;
mod readings;
mod recorder;
mod repair;
mod rerun;
mod room;
mod rows;
mod scenery;
mod sheet;
mod shipped;
mod sight;
mod sockets;
mod solid;
mod stage;
mod stream;
mod target;
#[cfg(test)]
mod tree_laws;
mod uncertainty;
mod values;

#[cfg(not(target_arch = "wasm32"))]
pub use self::shipped::mesh_pack;
pub use self::{
    appearance::Appearance,
    blueprint::{Shape, Theme},
    calibration::{CalibrationLook, calibration, calibration_bytes},
    csv::{StepsCsv, comparison_csv},
    ellipsoid::EllipsoidSize,
    error::RecordingError,
    live::LiveLog,
    recorder::Recorder,
    repair::{Condition, examine, restore},
    shipped::bring_meshes,
    target::Target,
};
pub use body_schema_palette::{TRUTH_COLOR, hex, learner_color, learner_slots};

/// The version of Rerun whose recordings are written, and whose viewer opens them.
pub fn rerun_version() -> String {
    re_log_encoding::CrateVersion::LOCAL.to_string()
}

/// How many times as large differences from a description may be drawn.
pub const ENLARGED: std::ops::RangeInclusive<f64> = 1.0..=50.0;

/// The timeline of a recording: the step of the experiment, counted from 0.
pub const TIMELINE: &str = "step";

/// The timeline of a live recording on which there is something between two steps.
pub const MOTION: &str = "motion";

/// The timeline of a live recording, and the entity on it, that tells up to which step it is whole.
pub const COMPLETE: &str = "complete";

/// The number of ticks of [`MOTION`] from one step to the next.
pub const MOTION_PER_STEP: u64 = 32;

/// The most postures that are drawn between two steps.
pub const MOST_FRAMES: u64 = 30;
