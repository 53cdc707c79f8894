//! How well a chain's motions explain what was seen, with what nobody knows left free.

use nalgebra::{Isometry3, Matrix3, Point3, SMatrix, SVector, Translation3, UnitQuaternion, Vector3};

use crate::{model::best_motion, most};

/// What was seen, row by row.
#[derive(Clone, Debug)]
pub enum Sight {
    /// A target's positions; base and target are unknown. The first is where the target may be at θ = 0.
    Points(Point3<f64>, Vec<Point3<f64>>),
    /// Sockets that held a target; target and sockets are unknown.
    Sockets(Vec<usize>),
}

/// What a fit leaves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fit {
    /// Root mean square, metres.
    pub rms: f64,
    /// What fits are compared by: `rms`; with sockets per rotation of the last link, since a link that does not turn leaves
    /// every target where it is.
    pub judged: f64,
}

/// Steps of Gauss and Newton at most; a good hypothesis needs four.
const STEPS: usize = 12;

impl Sight {
    /// What is left when the last link moves by `motions`, row by row.
    pub fn fit(&self, motions: &[Isometry3<f64>]) -> Fit {
        match self {
            Self::Points(guess, points) => {
                let rms = of_most_points(*guess, points, motions);
                Fit { rms, judged: rms }
            }
            Self::Sockets(sockets) => of_sockets(sockets, motions),
        }
    }
}

/// Of all rows one in so many at most is left out that is far off: a few that went wrong shall not decide what all others say.
const FEW: usize = 10;
/// How often rows are left out, at most.
const ROUNDS: usize = 4;

/// The same as [`of_points`] but for a few rows that are far off.
fn of_most_points(guess: Point3<f64>, points: &[Point3<f64>], motions: &[Isometry3<f64>]) -> f64 {
    let fit = |rows: &[usize]| {
        let (points, motions): (Vec<_>, Vec<_>) = rows.iter().map(|row| (points[*row], motions[*row])).unzip();
        of_points(guess, &points, &motions)
    };
    let away = |(_, base, target): &(f64, Isometry3<f64>, Point3<f64>), row: usize| {
        (base * (motions[row] * target) - points[row]).norm()
    };
    most::fitted(points.len(), points.len().div_ceil(FEW), ROUNDS, fit, away).0
}

/// `y = B Tⱼ p`, B and p free: the root mean square, B and p.
fn of_points(
    guess: Point3<f64>,
    points: &[Point3<f64>],
    motions: &[Isometry3<f64>],
) -> (f64, Isometry3<f64>, Point3<f64>) {
    let rms = |base: &Isometry3<f64>, target: &Point3<f64>| {
        let sum: f64 = points.iter().zip(motions).map(|(y, t)| (base * (t * target) - y).norm_squared()).sum();
        (sum / points.len() as f64).sqrt()
    };
    let mut target = guess;
    let mut base = best_motion(&motions.iter().map(|t| t * target).collect::<Vec<_>>(), points);
    let mut best = rms(&base, &target);
    let mut damping = 1e-6;
    for _ in 0..STEPS {
        let mut information = SMatrix::<f64, 9, 9>::zeros();
        let mut gradient = SVector::<f64, 9>::zeros();
        for (y, t) in points.iter().zip(motions) {
            let at = base * (t * target);
            let mut row = SMatrix::<f64, 3, 9>::zeros();
            row.fixed_view_mut::<3, 3>(0, 0).copy_from(&Matrix3::identity());
            row.fixed_view_mut::<3, 3>(0, 3).copy_from(&-(at - Point3::from(base.translation.vector)).cross_matrix());
            row.fixed_view_mut::<3, 3>(0, 6).copy_from((base.rotation * t.rotation).to_rotation_matrix().matrix());
            information += row.transpose() * row;
            gradient += row.transpose() * (y - at);
        }
        let damped = information + SMatrix::<f64, 9, 9>::identity() * (damping * points.len() as f64);
        let Some(step) = damped.cholesky().map(|factor| factor.solve(&gradient)) else { break };
        let shift = Translation3::from(base.translation.vector + step.fixed_rows::<3>(0));
        let turn = UnitQuaternion::from_scaled_axis(step.fixed_rows::<3>(3).into_owned());
        let moved = Isometry3::from_parts(shift, turn * base.rotation);
        let other = target + step.fixed_rows::<3>(6);
        let left = rms(&moved, &other);
        if left < best {
            let gain = (best - left) / best;
            (base, target, best, damping) = (moved, other, left, damping * 0.1);
            if gain < 1e-3 {
                break;
            }
        } else {
            damping *= 100.0;
        }
    }
    (best, base, target)
}

/// `Tⱼ p` is the same in all rows of a socket, p free: a linear problem.
fn of_sockets(sockets: &[usize], motions: &[Isometry3<f64>]) -> Fit {
    let count = sockets.iter().max().map_or(0, |last| last + 1);
    let mut means = vec![(0.0, Matrix3::<f64>::zeros(), Vector3::<f64>::zeros()); count];
    let parts = |t: &Isometry3<f64>| (t.rotation.to_rotation_matrix().into_inner(), t.translation.vector);
    for (socket, motion) in sockets.iter().zip(motions) {
        let (turn, shift) = parts(motion);
        let mean = &mut means[*socket];
        *mean = (mean.0 + 1.0, mean.1 + turn, mean.2 + shift);
    }
    let centred = |(socket, motion): (&usize, &Isometry3<f64>)| {
        let ((turn, shift), mean) = (parts(motion), &means[*socket]);
        (turn - mean.1 / mean.0, shift - mean.2 / mean.0)
    };
    let (mut information, mut gradient) = (Matrix3::identity() * 1e-12, Vector3::zeros());
    for (turn, shift) in sockets.iter().zip(motions).map(centred) {
        information += turn.transpose() * turn;
        gradient -= turn.transpose() * shift;
    }
    let target = information.cholesky().map_or_else(Vector3::zeros, |factor| factor.solve(&gradient));
    let sum: f64 =
        sockets.iter().zip(motions).map(centred).map(|(turn, shift)| (turn * target + shift).norm_squared()).sum();
    let count = sockets.len().max(1) as f64;
    let rms = (sum / count).sqrt();
    Fit { rms, judged: rms / (information.trace() / count).sqrt() }
}
