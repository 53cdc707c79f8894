//! How far a robot that was found can be trusted: what was measured, what is left open, what rows say that it has not seen.

use nalgebra::{Cholesky, DMatrix};

use crate::{
    data::{Data, Row},
    discovery::{Body, Discovery},
    equivalence::are_equivalent_within,
    fit::{Fit, Noise, deviation, fit, information, squares},
    isolated::SAME,
    jacobian::jacobians,
    robot::Robot,
};

/// Of how many parts one is held out at a time.
const PARTS: usize = 4;

/// The posture of every row, numbered from 0: by the columns that drive joints, whatever the others read.
fn postures(data: &Data, robot: &Robot) -> Vec<usize> {
    let mut columns: Vec<usize> =
        robot.joints.iter().flat_map(|joint| joint.drives.iter().map(|drive| drive.column)).collect();
    columns.sort_unstable();
    columns.dedup();
    let near: Vec<f64> =
        columns.iter().map(|column| data.range(*column).map_or(0.0, |(low, high)| SAME * (high - low))).collect();
    let mut known: Vec<&Row> = Vec::new();
    let of = |row| {
        let row: &Row = row;
        let is_same = |other: &&Row| {
            let mut pairs = columns.iter().zip(&near);
            pairs.all(|(column, near)| (row.positions[*column] - other.positions[*column]).abs() <= *near)
        };
        known.iter().position(is_same).unwrap_or_else(|| {
            known.push(row);
            known.len() - 1
        })
    };
    data.rows.iter().map(of).collect()
}

/// The measured numbers that can be independent: six a posture of a body, three of a point, five of two.
pub(crate) fn numbers(data: &Data, found: &Discovery) -> usize {
    let of = |body: &Body, row: &Row| -> usize {
        let seen =
            body.targets.iter().filter_map(|target| row.readings[*target].map(|_| data.targets[*target].is_pose));
        seen.map(|is_pose| if is_pose { 6 } else { 3 }).sum::<usize>().min(6)
    };
    let postures = postures(data, &found.fit.robot);
    let of_body = |body: &Body| -> usize {
        let mut most = vec![0; postures.iter().max().map_or(0, |last| last + 1)];
        data.rows.iter().zip(&postures).for_each(|(row, posture)| most[*posture] = most[*posture].max(of(body, row)));
        most.iter().sum()
    };
    found.bodies.iter().map(of_body).sum()
}

/// The unknowns of a robot, the places of further markers on a body left out: those are told by rigidity.
pub(crate) fn unknowns(data: &Data, robot: &Robot) -> usize {
    let targets: usize = data.targets.iter().map(|target| if target.is_pose { 6 } else { 3 }).sum();
    robot.parameters() - targets + targets.min(6)
}

/// Whether two structures are one as far as any movement tells.
pub(crate) fn are_alike(best: &Robot, other: &Robot, noise: &Noise) -> bool {
    best.shape() == other.shape() || are_equivalent_within(best, other, noise.turn_rad.clamp(1e-6, 0.02), noise.place_m)
}

/// The deviation of a coordinate on postures that are held out, m, with the structure fitted to the others.
pub(crate) fn held_out(data: &Data, whole: &Fit) -> f64 {
    let postures = postures(data, &whole.robot);
    let mut missed = Vec::new();
    for part in 0..PARTS {
        let of = |is_held: bool| {
            let rows = data.rows.iter().zip(&postures).filter(|(_, posture)| (**posture % PARTS == part) == is_held);
            data.with_rows(rows.map(|(row, _)| row.clone()).collect())
        };
        let fitted = fit(&of(false), &whole.robot, 30);
        let [places, _] = squares(&of(true), &fitted.robot);
        missed.extend(places);
    }
    deviation(&missed, 1.0)
}

/// The covariance of the tangent coordinates, with a metre and a radian known beforehand.
pub(crate) fn covariance(data: &Data, fit: &Fit) -> DMatrix<f64> {
    let mut known = information(data, &fit.robot, &fit.noise);
    let count = known.nrows();
    (0..count).for_each(|index| known[(index, index)] += 1.0);
    Cholesky::new(known).map_or_else(|| DMatrix::identity(count, count), |cholesky| cholesky.inverse())
}

/// √ of the mean of tr(J P Jᵀ) over the rows, m.
pub(crate) fn expected_error(data: &Data, fit: &Fit, covariance: &DMatrix<f64>) -> f64 {
    let (mut sum, mut count) = (0.0, 0);
    for row in &data.rows {
        for (_, entries) in jacobians(&fit.robot, &row.positions) {
            for (one, shift, _) in &entries {
                for (other, shift_other, _) in &entries {
                    sum += covariance[(*one, *other)] * shift.dot(shift_other);
                }
            }
            count += 1;
        }
    }
    (sum / f64::from(count.max(1))).max(0.0).sqrt()
}
