//! What no movement can tell: the order of joints that commute.

use body_schema_engine::kinematics::Joint;

use crate::robot::{Driven, Robot};

/// Directions are parallel, rad, and lines one, m, up to this.
const CLOSE: f64 = 1e-6;

/// Whether e^{ξ₁a} e^{ξ₂b} = e^{ξ₂b} e^{ξ₁a} for all a and b: two slides, two turns about one line, a turn about a line and a slide along it.
/// `turn_rad` and `shift_m` say up to what lines and directions are one.
pub fn commute(one: &Joint, other: &Joint, turn_rad: f64, shift_m: f64) -> bool {
    let is_parallel = one.direction().cross(&other.direction()).norm() <= turn_rad;
    match (one, other) {
        (Joint::Prismatic(_), Joint::Prismatic(_)) => true,
        (Joint::Revolute(one), Joint::Revolute(other)) => is_parallel && one.distance_to(&other.point) <= shift_m,
        _ => is_parallel,
    }
}

/// Whether two robots have the same joints in orders that no movement tells apart: joints of which one comes first here and the other
/// there commute, by the axes of `truth` (words of a trace monoid are equal where their projections on every pair that does not commute are).
pub fn are_equivalent(truth: &Robot, found: &Robot) -> bool {
    are_equivalent_within(truth, found, CLOSE, CLOSE)
}

/// The same, with directions one up to `turn_rad` and lines up to `shift_m`.
pub(crate) fn are_equivalent_within(truth: &Robot, found: &Robot, turn_rad: f64, shift_m: f64) -> bool {
    let words = |robot: &Robot| -> Vec<Vec<usize>> {
        (0..robot.targets.len())
            .map(|target| robot.chain_of(target).iter().map(|joint| robot.joints[*joint].column()).collect())
            .collect()
    };
    let (theirs, ours) = (words(truth), words(found));
    theirs.len() == ours.len()
        && theirs
            .iter()
            .zip(&ours)
            .all(|(theirs, ours)| is_same_word([truth, found], theirs, ours, [turn_rad, shift_m]))
}

fn is_same_word([truth, found]: [&Robot; 2], theirs: &[usize], ours: &[usize], [turn_rad, shift_m]: [f64; 2]) -> bool {
    let joint = |robot: &Robot, column: usize| robot.joints.iter().find(|joint| joint.column() == column).cloned();
    if theirs.len() != ours.len() {
        return false;
    }
    let place = |word: &[usize], column: usize| word.iter().position(|of| *of == column);
    theirs.iter().enumerate().all(|(at, column)| {
        let (Some(true_joint), Some(found_joint), Some(here)) =
            (joint(truth, *column), joint(found, *column), place(ours, *column))
        else {
            return false;
        };
        let behind = theirs[at + 1..].iter().all(|other| {
            let is_behind = place(ours, *other).is_some_and(|there| there > here);
            let commutes =
                joint(truth, *other).is_some_and(|other| commute(&true_joint.axis, &other.axis, turn_rad, shift_m));
            is_behind || commutes
        });
        let columns = |joint: &Driven| {
            let mut columns: Vec<(usize, bool)> =
                joint.drives.iter().map(|drive| (drive.column, drive.is_free)).collect();
            columns.sort_unstable();
            columns
        };
        let is_same_joint =
            true_joint.axis.kind() == found_joint.axis.kind() && columns(&true_joint) == columns(&found_joint);
        is_same_joint && behind
    })
}
