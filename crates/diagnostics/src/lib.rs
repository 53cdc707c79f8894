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
mod diagnostic;
mod fit;
mod hypotheses;
mod hypothesis;
mod moving;
mod postures;
mod repeats;

use std::sync::Arc;

use nalgebra::{Isometry3, Point3, Vector3};

pub use diagnostic::{Diagnostic, DiagnosticKind, Line, listed};
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
    /// Of a robot that branches, the joints that carry the target, the one nearest the base first; `None` where all of them do.
    pub carriers: Option<&'a [usize]>,
    /// The limits of each joint, rad or m; `None` where a joint turns without end.
    pub limits: &'a [Option<(f64, f64)>],
    /// The likely position of the target at θ = 0, metres: on the last link, to within some decimetres.
    pub target: Point3<f64>,
    /// The standard deviation of that position, metres.
    pub target_sd_m: f64,
    /// Whether each joint's axis is to be learned.
    pub learned: &'a [bool],
    /// The stated error of each joint's zero, where an offset of its readings is learned: one standard deviation, radians;
    /// 0 where none is. Empty if none is at all.
    pub zeros_rad: &'a [f64],
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
    /// The number of each row in its file, where lines without a measurement are no rows but counted; empty where every line is a row.
    pub numbers: &'a [usize],
    /// The joint positions of each row, rad or m.
    pub configurations: &'a [Vec<f64>],
    /// Targets on the last link whose positions were measured.
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

/// Fewer rows than these fit under too many hypotheses.
const LEAST_ROWS: usize = 6;
/// More moments than any lag.
const GAP: isize = 1000;

impl Evidence<'_> {
    /// The line of a row.
    fn line(&self, row: usize) -> Line {
        Line { file: self.files.get(row).cloned(), number: self.lines.get(row).copied().unwrap_or(row) }
    }

    /// The rows by which columns are judged: those with a socket, or with a place of the first target.
    fn usable(&self) -> Vec<usize> {
        match (&self.sockets, self.targets.first()) {
            (Some(sockets), _) => (0..sockets.len()).collect(),
            (None, Some(seen)) => (0..seen.points.len()).filter(|row| seen.points[*row].is_some()).collect(),
            (None, None) => Vec::new(),
        }
    }

    /// Why columns cannot be judged.
    fn unjudged(&self) -> Option<String> {
        if self.sockets.is_none() && self.targets.is_empty() {
            return Some(
                "no place of a target is measured, and none is found in pictures: that takes a body of four points, and either it or the \
                 camera beside the robot"
                    .to_owned(),
            );
        }
        let usable = self.usable().len();
        (usable < LEAST_ROWS).then(|| format!("{usable} rows have a reading, and it takes {LEAST_ROWS}"))
    }

    /// The moment of each row: those of neighbouring lines of a file follow one another. Between two files there is a gap.
    fn moments(&self) -> Vec<isize> {
        let number = |row: usize| self.numbers.get(row).copied().unwrap_or(row) as isize;
        let mut begun = 0;
        let moment = |row: usize| {
            if row > 0 && self.files.get(row) != self.files.get(row - 1) {
                begun += number(row - 1) + GAP;
            }
            begun + number(row)
        };
        (0..self.configurations.len()).map(moment).collect()
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
    /// Where they were found in pictures of known points: the pose in each row if the picture is a mirror's. Empty where places or poses
    /// themselves were measured.
    pub mirrored: Vec<Option<Isometry3<f64>>>,
}

impl Seen {
    /// Whether it was found in pictures: then no column has a length or a rotation.
    fn is_pictured(&self) -> bool {
        !self.mirrored.is_empty()
    }
}

/// The result of an examination.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Examination {
    /// All diagnostics, the weightiest first.
    pub diagnostics: Vec<Diagnostic>,
    /// The standard deviation of a measured position per coordinate, metres, estimated from repeated postures if there
    /// are any.
    pub sigma_m: Option<f64>,
    /// Why the joints' columns could not be held against what was measured, as the end of a sentence; `None` where they were.
    pub unjudged: Option<String>,
}

/// Other ways to read a table of a robot that branches, by the joints that carry its target alone: no other joint moves that.
fn diagnostics_along(carriers: &[usize], subject: &Subject, evidence: &Evidence) -> Vec<Diagnostic> {
    let columns: Vec<String> = carriers.iter().map(|joint| subject.columns[*joint].clone()).collect();
    let joints: Vec<Joint> = carriers.iter().map(|joint| subject.joints[*joint]).collect();
    let limits: Vec<_> = carriers.iter().map(|joint| subject.limits[*joint]).collect();
    let learned: Vec<bool> = carriers.iter().map(|joint| subject.learned[*joint]).collect();
    let zeros_rad: Vec<f64> = carriers.iter().filter_map(|joint| subject.zeros_rad.get(*joint).copied()).collect();
    let of_row = |row: &Vec<f64>| carriers.iter().map(|joint| row[*joint]).collect();
    let configurations: Vec<Vec<f64>> = evidence.configurations.iter().map(of_row).collect();
    let subject = Subject {
        columns: &columns,
        joints: &joints,
        carriers: None,
        limits: &limits,
        learned: &learned,
        zeros_rad: &zeros_rad,
        ..*subject
    };
    hypotheses::diagnostics(&subject, &Evidence { configurations: &configurations, ..evidence.clone() })
}

/// Examines a table.
pub fn examine(subject: &Subject, evidence: &Evidence) -> Examination {
    let unjudged = evidence.unjudged();
    let mut diagnostics = match subject.carriers {
        Some(carriers) => diagnostics_along(carriers, subject, evidence),
        None => hypotheses::diagnostics(subject, evidence),
    };
    diagnostics.extend(columns::diagnostics(subject, evidence));
    // What was found in pictures is no measurement of its own.
    let targets = evidence.targets.iter().filter(|seen| !seen.is_pictured()).cloned().collect();
    let (repeats, sigma_m) = repeats::diagnostics(&Evidence { targets, ..evidence.clone() });
    diagnostics.extend(repeats);
    Examination { diagnostics, sigma_m, unjudged }
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitVector3;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use body_schema_engine::{kinematics::Line, model::State};

    /// A neck of two joints between those of an arm of four: tables of the hand are judged by the arm's joints alone.
    #[test]
    fn a_table_of_a_branch_is_judged_by_the_joints_that_carry_its_target() {
        let (x, y, z) = (Vector3::x(), Vector3::y(), Vector3::z());
        let axes = [
            ([0.0, 0.0, 0.0], z),
            ([0.0, 0.0, 0.5], z),
            ([0.0, 0.0, 0.6], y),
            ([0.1, 0.0, 0.2], y),
            ([0.4, 0.05, 0.2], y),
            ([0.5, 0.05, 0.3], x),
        ];
        let joint = |(point, axis): ([f64; 3], Vector3<f64>)| {
            Joint::Revolute(Line { point: point.into(), direction: UnitVector3::new_normalize(axis) })
        };
        let parents = vec![None, Some(0), Some(1), Some(0), Some(3), Some(4)];
        let marker = Point3::new(0.7, 0.1, 0.35);
        let state = State::branching(axes.map(joint).to_vec(), parents, (6, marker)).expect("a tree");
        let mut rng = ChaCha8Rng::seed_from_u64(1401);
        let rows: Vec<Vec<f64>> = (0..40).map(|_| (0..6).map(|_| rng.random_range(-1.2..1.2)).collect()).collect();
        let points =
            rows.iter().map(|row| Some(state.marker_at(row) + Vector3::from_fn(|_, _| rng.random_range(-1e-3..1e-3))));
        let seen = Seen { name: "hand".to_owned(), points: points.collect(), ..Seen::default() };
        let columns = ["a", "neck_1", "neck_2", "b", "c", "d"].map(str::to_owned);
        let diagnostics = |rows: &[Vec<f64>], carriers: Option<&[usize]>| {
            let subject = Subject {
                columns: &columns,
                joints: &state.joints,
                carriers,
                limits: &[Some((-1.3, 1.3)); 6],
                target: marker,
                target_sd_m: 0.3,
                learned: &[true; 6],
                zeros_rad: &[],
                unknowns: 30,
                sigma_m: 1e-3,
                direction_rad: 0.02,
                point_m: 0.01,
                base: None,
            };
            let lines: Vec<usize> = (0..rows.len()).collect();
            let targets = vec![seen.clone()];
            let evidence = Evidence { lines: &lines, configurations: rows, targets, ..Evidence::default() };
            examine(&subject, &evidence).diagnostics
        };
        let carriers = Some(&[0, 3, 4, 5][..]);
        assert_eq!(diagnostics(&rows, carriers), [], "the table is right");
        assert!(!diagnostics(&rows, None).is_empty(), "as of an arm of six joints it makes no sense");
        let reversed: Vec<Vec<f64>> = rows.iter().map(|row| [&row[..3], &[-row[3]], &row[4..]].concat()).collect();
        let found = diagnostics(&reversed, carriers);
        let told: Vec<_> = found.iter().map(|diagnostic| (diagnostic.kind, diagnostic.column.as_deref())).collect();
        assert_eq!(told, [(DiagnosticKind::Sign, Some("b"))]);
    }
}
