//! What is doubtful in a table of measurements, before anything is learned from it.
//!
//! Files are wrong in few ways, and each leaves a trace: [`examine`] looks for all of them and names row or column with the
//! evidence. It corrects nothing.
//!
//! Whether numbers fit the description is judged by fits in which what nobody knows is free: where the base stands and
//! where the target is on the last link, or the target alone where it was held in sockets. A column is doubted where
//! reading it otherwise, in another unit, with the other sign, from another zero, in another's place, as another
//! convention of poses or beside other rows, is much likelier by the evidence of the description, whose own errors are those that
//! calibration is for; of sockets, where it brings the residual to less than half. Where nothing explains the table, that is said
//! first. The offset of the first joint moves the whole robot and that of the last may move the target with it: what
//! the base and the target absorb cannot be seen.
//!
//! Time and memory grow with rows and joints: fits use rows spread evenly over the table, at most some hundreds.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod columns;
mod description;
mod doubt;
mod fit;
mod hypotheses;
mod hypothesis;
mod moving;
mod postures;
mod repeats;

use std::sync::Arc;

use nalgebra::{Isometry3, Point3, Vector3};

pub use doubt::{Doubt, DoubtKind, Line, listed};
pub use postures::{SAME, postures};
pub use repeats::few_folds;

use body_schema_engine::kinematics::Joint;

/// The robot as it is described.
#[derive(Clone, Copy, Debug)]
pub struct Subject<'a> {
    /// The columns of the joints, the one nearest the base first.
    pub columns: &'a [String],
    /// The joints at θ = 0.
    pub joints: &'a [Joint],
    /// By joint, rad or m; none where a joint turns without end.
    pub limits: &'a [Option<(f64, f64)>],
    /// Where the target may be at θ = 0, metres: on the last link, to within some decimetres.
    pub target: Point3<f64>,
    /// How well that is known, metres.
    pub target_sd_m: f64,
    /// By joint, whether its axis is to be learned.
    pub learned: &'a [bool],
    /// Parameters that are to be learned.
    pub unknowns: usize,
    /// What the maker of the sensor promises: one standard deviation of a position per coordinate, metres.
    pub sigma_m: f64,
    /// How well the description is known, joint by joint: one standard deviation of a turn, radians.
    pub direction_rad: f64,
    /// The same of a shift, metres.
    pub point_m: f64,
    /// Where the base is said to be; `None` where nobody knows.
    pub base: Option<Base>,
}

/// Where a base is said to be.
#[derive(Clone, Copy, Debug)]
pub struct Base {
    /// In the frame of the measurements.
    pub at: Isometry3<f64>,
    /// One standard deviation of its place per coordinate, metres, and of its rotation per axis, radians.
    pub sd_m: f64,
    /// See `sd_m`.
    pub sd_rad: f64,
}

/// What the table says.
#[derive(Clone, Debug, Default)]
pub struct Evidence<'a> {
    /// By row: the line of its file.
    pub lines: &'a [usize],
    /// By row: its file; empty where all rows are from one.
    pub files: &'a [Arc<str>],
    /// By row: joint positions, rad or m.
    pub configurations: &'a [Vec<f64>],
    /// Targets on the last link whose positions were measured.
    pub targets: Vec<Seen>,
    /// By row, where a target was held in sockets: which socket at which place.
    pub sockets: Option<Vec<usize>>,
    /// Equations of everything that was measured; where it is not told, those of `targets` and `sockets`.
    pub equations: Option<usize>,
    /// Rows that are held out because they are listed, labelled so, or in a file of their own.
    pub held_out: &'a [usize],
    /// Columns that repeat another, with that other (see [`Rows::repeated_columns`](body_schema_table::Rows::repeated_columns)).
    pub repeated: &'a [(String, String)],
}

impl Evidence<'_> {
    /// Where a row stands.
    fn line(&self, row: usize) -> Line {
        Line { file: self.files.get(row).cloned(), number: self.lines.get(row).copied().unwrap_or(row) }
    }
}

/// Where a target was seen.
#[derive(Clone, Debug, Default)]
pub struct Seen {
    /// Its name.
    pub name: String,
    /// By row, metres.
    pub points: Vec<Option<Point3<f64>>>,
    /// By row its rotation vector, as it was written; empty where no rotation was measured.
    pub turns: Vec<Vector3<f64>>,
    /// A turn by one radian is as unlikely a noise as a shift by so many metres.
    pub arm_m: Option<f64>,
}

/// What came of an examination.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Examination {
    /// All doubts, the weightiest first.
    pub doubts: Vec<Doubt>,
    /// The standard deviation of a measured position per coordinate, metres, as far as repeated postures tell.
    pub sigma_m: Option<f64>,
}

/// Examines a table.
pub fn examine(subject: &Subject, evidence: &Evidence) -> Examination {
    let mut doubts = hypotheses::doubts(subject, evidence);
    doubts.extend(columns::doubts(subject, evidence));
    let (repeats, sigma_m) = repeats::doubts(evidence);
    doubts.extend(repeats);
    Examination { doubts, sigma_m }
}
