//! Tables of measurements: CSV in, rows of joint positions and readings out.
//!
//! A table is read as a stream: nothing is kept but what the caller keeps. It has a line of titles, then one line per movement. Columns
//! stand in any order and are found by title; columns that are not asked for are ignored.
//!
//! ```
//! use body_schema_table::{Columns, Layout, Quantity, Table};
//!
//! let text = "shoulder_deg,lift,hand_x_mm,hand_y_mm,hand_z_mm\n90,0.2,100,0,1500\n45,0.1,,,\n";
//! let table = Table::open(text.as_bytes())?;
//! let titles = table.titles();
//! let columns = Columns {
//!     joints: vec![titles.find("shoulder", Quantity::Angle)?, titles.find("lift", Quantity::Length)?],
//!     readings: vec![titles.reading(Layout::Position, "hand")?],
//!     labels: vec![],
//! };
//! let rows: Vec<_> = table.rows(columns).collect::<Result<_, _>>()?;
//! assert_eq!(rows[0].positions, [std::f64::consts::FRAC_PI_2, 0.2]);
//! assert_eq!(rows[0].observation.readings, [Some(vec![0.1, 0.0, 1.5])]);
//! assert_eq!((rows[1].line, rows[1].observation.is_miss()), (3, true));
//! # Ok::<(), body_schema_table::TableError>(())
//! ```
//!
//! # Units
//!
//! Inside there are metres and radians only. The end of a title is the unit of its numbers: `_m`, `_cm`, `_mm`, `_um` or `_in`, `_rad` or
//! `_deg`, `_px`; without one they are metres, radians or pixels, as in a URDF. Words (`_inches`), capitals and brackets (`x (mm)`) say the
//! same; another unit, as in `x_ft`, is refused. A joint's column is titled with the joint's name.
//!
//! # Readings
//!
//! Titles begin with the name of the target (`hand` here), for pixels with the camera's and the target's (`cam_hand`); the name may be left
//! out where there is no ambiguity; capitals do not matter. Titles of other kinds can be named one by one: where they are names of
//! components, as `qw`, these say which number is which, in any order, and else their order does.
//!
//! | layout | titles | a line |
//! |---|---|---|
//! | [`Position`](Layout::Position) | `elbow,hand_x,hand_y,hand_z` | `0.5,0.31,-0.12,0.87` |
//! | [`Pose`](Layout::Pose), rotation vector | `elbow_deg,hand_x_mm,hand_y_mm,hand_z_mm,hand_rx,hand_ry,hand_rz` | `30,310,-120,870,0,0,1.57` |
//! | roll, pitch, yaw | `elbow,hand_x,hand_y,hand_z,hand_roll_deg,hand_pitch_deg,hand_yaw_deg` | `0.5,0.31,-0.12,0.87,0,0,90` |
//! | quaternion | `elbow,hand_x,hand_y,hand_z,hand_qx,hand_qy,hand_qz,hand_qw` | `0.5,0.31,-0.12,0.87,0,0,0.707,0.707` |
//! | [`Pixels`](Layout::Pixels) of a point | `elbow,cam_hand_u,cam_hand_v` | `0.5,412.3,208.9` |
//! | of a body's points | `elbow,cam_tag_u1,cam_tag_v1,cam_tag_u2,cam_tag_v2` | `0.5,412.3,208.9,430.1,210.4` |
//! | [`Distance`](Layout::Distance) | `elbow,hand_distance_mm` | `0.5,742.5` |
//! | labels, as of sockets | `elbow,place,socket` | `0.5,front left,1` |
//!
//! Where a sensor had no reading its cells are empty, all of them, or say so: `nan`, `NA`, `N/A`, `None`, `null` or `-`, in any case. Of a
//! target that is [partly seen](Reading::partly_seen) both cells of an absent point may be. A
//! joint always has a position: a line with an empty joint cell is refused.
//!
//! # Errors
//!
//! [`TableError`] names line and column. Input that is no text, is longer than [`MOST_BYTES`] or has more than [`MOST_ROWS`], two columns
//! with one title, a line with too few or too many cells, and a cell that is no finite number are each refused as soon as they are seen.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod absent;
mod error;
mod guard;
mod lines;
mod names;
mod quantity;
mod reading;
mod rows;
mod titles;
mod writer;

pub use absent::is_absent;
pub use error::TableError;
pub use guard::{Guard, MOST_BYTES};
pub use names::split;
pub use names::{Component, Title};
pub use quantity::Quantity;
pub use reading::{Layout, Reading, Rotation};
pub use rows::{Columns, MOST_ROWS, Row, Rows, Table};
pub use titles::{Column, Titles};
pub use writer::Writer;
