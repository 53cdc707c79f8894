//! Columns that were moved alone: each shows its axis by itself, and what is left is their order.
//!
//! From a posture in which everything stood a column moves alone to one or more others. That fits a chain of one joint. With the axes of
//! all columns known at that posture, an order predicts every other row without another unknown, so that all orders can be tried.

use body_schema_engine::kinematics::JointKind;
use nalgebra::Isometry3;

use crate::{
    beam,
    data::{Data, Row},
    fit::{Fit, fit, squares},
    places::{Piece, solve},
    robot::{Driven, Robot},
    turns,
};

/// Positions that differ by less than this share of a column's range are one.
pub(crate) const SAME: f64 = 0.003;
/// A column stands still where it has one value in so many rows.
const TIES: usize = 3;
/// The most joints of which all orders are tried; of more, joints are put in one by one.
const ALL_ORDERS: usize = 7;
/// How many orders are handed on.
const KEPT: usize = 12;

/// Robots by columns that were moved alone, the most plausible orders first; none where fewer than two were. `poses` are the rotations of
/// the body's parts where they are known.
pub(crate) fn starts(data: &Data, poses: Option<&Data>, columns: &[usize]) -> Vec<Robot> {
    let steps: Vec<f64> =
        columns.iter().map(|column| data.range(*column).map_or(0.0, |(low, high)| SAME * (high - low))).collect();
    let is_same = |one: &Row, other: &Row, at: usize| {
        (one.positions[columns[at]] - other.positions[columns[at]]).abs() <= steps[at]
    };
    // What runs by itself, as time and temperature, stands still in no two rows.
    let standing = |anchor: &Row| -> Vec<usize> {
        let ties = |at: &usize| data.rows.iter().filter(|row| is_same(anchor, row, *at)).count();
        (0..columns.len()).filter(|at| ties(at) >= TIES).collect()
    };
    let alone = |anchor: &Row, column: usize| -> Vec<usize> {
        let others: Vec<usize> = standing(anchor).into_iter().filter(|at| columns[*at] != column).collect();
        let rows = data.rows.iter().enumerate();
        rows.filter(|(_, row)| others.iter().all(|at| is_same(anchor, row, *at))).map(|(index, _)| index).collect()
    };
    let moved = |anchor: &Row| -> Vec<usize> {
        let of = |at: &usize| alone(anchor, columns[*at]).iter().any(|row| !is_same(anchor, &data.rows[*row], *at));
        standing(anchor).into_iter().filter(of).map(|at| columns[at]).collect()
    };
    let count = |anchor: &Row| moved(anchor).len();
    let Some(anchor) = data.rows.iter().max_by_key(|row| (count(row), std::cmp::Reverse(row.line))) else {
        return Vec::new();
    };
    if count(anchor) < 2 {
        return Vec::new();
    }
    let mut found: Vec<Driven> = Vec::new();
    for column in moved(anchor) {
        let rows = alone(anchor, column);
        let of = |data: &Data| data.with_rows(rows.iter().filter_map(|row| data.rows.get(*row).cloned()).collect());
        let own_poses = poses.filter(|poses| poses.rows.len() == data.rows.len()).map(of);
        let own = of(data);
        if let Some(single) = single(&own, own_poses.as_ref(), &anchor.positions, column) {
            found.extend(single.robot.joints.into_iter().map(|joint| Driven { parent: None, ..joint }));
        }
    }
    let homes = still(data, anchor);
    orders(data, &homes, &found)
}

/// The targets where they were in one row.
fn still(data: &Data, anchor: &Row) -> Robot {
    let mut robot = Robot::still(data);
    robot.middle.clone_from(&anchor.positions);
    for (held, reading) in robot.targets.iter_mut().zip(&anchor.readings) {
        match reading {
            Some(crate::data::Reading::Pose(pose)) => held.home = *pose,
            Some(crate::data::Reading::Point(point)) => held.home = Isometry3::translation(point.x, point.y, point.z),
            None => {}
        }
    }
    robot
}

/// What one column does alone: a joint, or nothing.
fn single(data: &Data, poses: Option<&Data>, middle: &[f64], column: usize) -> Option<Fit> {
    let kind = data.columns[column].kind;
    let mut tried = vec![solve(data, middle, &[])?.0];
    if kind != Some(JointKind::Revolute) {
        tried.extend(solve(data, middle, &[Piece::Slide(column)]).map(|found| found.0));
    }
    if kind != Some(JointKind::Prismatic) {
        let directions: Vec<_> = match poses {
            Some(poses) => beam::search(poses, middle, &[column], 2)
                .into_iter()
                .filter_map(|chain| chain.order.first().map(|(_, direction)| *direction))
                .take(2)
                .collect(),
            None => turns::directions(),
        };
        let mut turned: Vec<(Robot, f64)> = directions
            .into_iter()
            .filter_map(|direction| solve(data, middle, &[Piece::turn(column, direction)]))
            .collect();
        turned.sort_by(|one, other| other.1.total_cmp(&one.1));
        tried.extend(turned.into_iter().take(3).map(|found| found.0));
    }
    let fits = tried.into_iter().map(|robot| fit(data, &robot, 15));
    fits.max_by(|one, other| one.evidence.total_cmp(&other.evidence))
}

/// The orders that predict all rows best.
fn orders(data: &Data, homes: &Robot, joints: &[Driven]) -> Vec<Robot> {
    let in_order = |order: &[usize]| {
        let mut robot = homes.clone();
        for (index, of) in order.iter().enumerate() {
            robot.joints.push(Driven { parent: index.checked_sub(1), ..joints[*of].clone() });
        }
        let carrier = order.len().checked_sub(1);
        robot.targets.iter_mut().for_each(|held| held.carrier = carrier);
        robot
    };
    let mut kept: Vec<(Vec<usize>, f64)> = vec![(Vec::new(), 0.0)];
    let width = if joints.len() <= ALL_ORDERS { usize::MAX } else { 200 };
    for joint in 0..joints.len() {
        let is_last = joint + 1 == joints.len();
        let grown = kept.iter().flat_map(|(order, _)| {
            (0..=order.len()).map(move |at| {
                let mut order = order.clone();
                order.insert(at, joint);
                order
            })
        });
        let cost = |order: Vec<usize>| {
            let cost = if is_last || width < usize::MAX { misses(data, &in_order(&order)) } else { 0.0 };
            (order, cost)
        };
        kept = grown.map(cost).collect();
        if is_last || width < usize::MAX {
            kept.sort_by(|one, other| one.1.total_cmp(&other.1));
            kept.truncate(if is_last { KEPT } else { width });
        }
    }
    kept.into_iter().map(|(order, _)| in_order(&order)).collect()
}

/// How far predictions miss: the sum of distances, m, and of angles, half a metre a radian, each bounded so that no outlier decides.
fn misses(data: &Data, robot: &Robot) -> f64 {
    let [places, turns] = squares(data, robot);
    let bounded = |square: &f64, scale: f64| (square.sqrt() * scale).min(0.3);
    places.iter().map(|square| bounded(square, 1.0)).sum::<f64>()
        + turns.iter().map(|square| bounded(square, 0.5)).sum::<f64>()
}
