//! Diagnostics of a table of measurements, before anything is learned from it.
//!
//! Files are wrong in few ways, and each leaves a trace: [`examine`] looks for all of them and names row or column with the
//! evidence. It corrects nothing.
//!
//! Whether numbers fit the description is judged by fits that leave the unknown free: the pose of the base and the place of the
//! target on the last link, or the target alone where it was held in sockets. A column is doubted where reading it otherwise, in
//! another unit, with the other sign, from another zero, in another's place, as another convention of poses or beside other rows,
//! is much likelier by the evidence of the description, whose own errors are those that calibration is for; of sockets, where it
//! brings the residual to less than half. A table that nothing explains is reported first. The offset of the first joint moves
//! the whole robot and that of the last may move the target with it: what the base and the target absorb cannot be seen.
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

/// The described robot whose table is examined.
#[derive(Clone, Copy, Debug)]
pub struct Subject<'a> {
    /// The columns of the joints, the one nearest the base first; empty for a joint without one.
    pub columns: &'a [String],
    /// The joints at θ = 0.
    pub joints: &'a [Joint],
    /// The limits of each joint, rad or m; `None` where a joint turns without end.
    pub limits: &'a [Option<(f64, f64)>],
    /// The likely position of the target at θ = 0, metres: on the last link, to within some decimetres.
    pub target: Point3<f64>,
    /// The standard deviation of that position, metres.
    pub target_sd_m: f64,
    /// Whether each joint's axis is to be learned.
    pub learned: &'a [bool],
    /// The number of parameters that are to be learned.
    pub unknowns: usize,
    /// The stated noise of the sensor: one standard deviation of a position per coordinate, metres.
    pub sigma_m: f64,
    /// The stated error of the description, joint by joint: one standard deviation of a turn, radians.
    pub direction_rad: f64,
    /// The stated error of the description, joint by joint: one standard deviation of a shift, metres.
    pub point_m: f64,
    /// The stated pose of the base; `None` if unknown.
    pub base: Option<Base>,
}

/// A stated pose of a base.
#[derive(Clone, Copy, Debug)]
pub struct Base {
    /// The pose in the frame of the measurements.
    pub at: Isometry3<f64>,
    /// One standard deviation of its place per coordinate, metres.
    pub sd_m: f64,
    /// One standard deviation of its rotation per axis, radians.
    pub sd_rad: f64,
}

/// The content of the table.
#[derive(Clone, Debug, Default)]
pub struct Evidence<'a> {
    /// The line of each row in its file.
    pub lines: &'a [usize],
    /// The file of each row; empty where all rows are from one.
    pub files: &'a [Arc<str>],
    /// The joint positions of each row, rad or m.
    pub configurations: &'a [Vec<f64>],
    /// Where joints branch: those that move what `targets` and `sockets` are of, in order. Where it is not told all do.
    pub moving: Option<Vec<usize>>,
    /// Targets on the last link, the one behind the last of `moving`, whose positions were measured.
    pub targets: Vec<Seen>,
    /// The socket and place at which a target was held in each row, numbered, where sockets were used.
    pub sockets: Option<Vec<usize>>,
    /// Equations of everything that was measured; where it is not told, those of `targets` and `sockets`.
    pub equations: Option<usize>,
    /// Rows that are held out because they are listed, labelled so, or in a file of their own.
    pub held_out: &'a [usize],
    /// Columns that repeat another, with that other (see [`Rows::repeated_columns`](body_schema_table::Rows::repeated_columns)).
    pub repeated: &'a [(String, String)],
}

impl Evidence<'_> {
    /// The line of a row.
    fn line(&self, row: usize) -> Line {
        Line { file: self.files.get(row).cloned(), number: self.lines.get(row).copied().unwrap_or(row) }
    }
}

/// The measurements of a target.
#[derive(Clone, Debug, Default)]
pub struct Seen {
    /// Its name.
    pub name: String,
    /// Its position in each row, metres.
    pub points: Vec<Option<Point3<f64>>>,
    /// Its rotation vector in each row, as written; empty where no rotation was measured.
    pub turns: Vec<Vector3<f64>>,
    /// The length by which a rotation error is weighed: noise of one radian is as unlikely as a shift by this many
    /// metres.
    pub arm_m: Option<f64>,
}

/// The result of an examination.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Examination {
    /// All doubts, the weightiest first.
    pub doubts: Vec<Doubt>,
    /// The standard deviation of a measured position per coordinate, metres, estimated from repeated postures if there
    /// are any.
    pub sigma_m: Option<f64>,
}

/// Examines a table.
pub fn examine(subject: &Subject, evidence: &Evidence) -> Examination {
    let mut doubts = match &evidence.moving {
        None => hypotheses::doubts(subject, evidence),
        Some(moving) => of_some(subject, evidence, moving),
    };
    doubts.extend(columns::doubts(subject, evidence));
    let (repeats, sigma_m) = repeats::doubts(evidence);
    doubts.extend(repeats);
    Examination { doubts, sigma_m }
}

/// What is doubtful by what moves with some of the joints alone.
fn of_some(subject: &Subject, evidence: &Evidence, joints: &[usize]) -> Vec<Doubt> {
    fn picked<T: Clone>(all: &[T], joints: &[usize]) -> Vec<T> {
        joints.iter().filter_map(|joint| all.get(*joint).cloned()).collect()
    }
    let configurations: Vec<Vec<f64>> = evidence.configurations.iter().map(|row| picked(row, joints)).collect();
    let subject = Subject {
        columns: &picked(subject.columns, joints),
        joints: &picked(subject.joints, joints),
        limits: &picked(subject.limits, joints),
        learned: &picked(subject.learned, joints),
        ..*subject
    };
    hypotheses::doubts(&subject, &Evidence { configurations: &configurations, moving: None, ..evidence.clone() })
}
