//! How far a robot that was found can be trusted: what was measured, what is left open, what rows say that it has not seen.

use nalgebra::{Cholesky, DMatrix};

use crate::{
    data::{Data, Row},
    discovery::{Body, Discovery},
    equivalence::are_equivalent_within,
    fit::{Fit, Noise, deviation, fit, information, squares},
    jacobian::jacobians,
    robot::Robot,
};

/// Of how many parts one is held out at a time.
const PARTS: usize = 4;

/// The measured numbers that can be independent: six a row of a body, three of a point, five of two.
pub(crate) fn numbers(data: &Data, found: &Discovery) -> usize {
    let of = |body: &Body, row: &Row| -> usize {
        let seen =
            body.targets.iter().filter_map(|target| row.readings[*target].map(|_| data.targets[*target].is_pose));
        seen.map(|is_pose| if is_pose { 6 } else { 3 }).sum::<usize>().min(6)
    };
    found.bodies.iter().map(|body| data.rows.iter().map(|row| of(body, row)).sum::<usize>()).sum()
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

/// The deviation of a coordinate on rows that are held out, m, with the structure fitted to the others.
pub(crate) fn held_out(data: &Data, whole: &Fit) -> f64 {
    let mut missed = Vec::new();
    for part in 0..PARTS {
        let of = |is_held: bool| {
            let rows = data.rows.iter().enumerate().filter(|(index, _)| (index % PARTS == part) == is_held);
            data.with_rows(rows.map(|(_, row)| row.clone()).collect())
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
