//! The next movement: first every column alone, then what separates the structures that are in doubt, then what teaches most.

use nalgebra::{Cholesky, DMatrix};

use crate::{
    data::Data,
    discovery::Discovery,
    fit::{Fit, Noise, information},
    jacobian::jacobians,
    robot::Robot,
};

/// How many postures are looked at.
const CANDIDATES: usize = 256;
/// How many postures stand for the whole workspace.
const WORKSPACE: usize = 48;
/// Of how many structures predictions are compared.
const RIVALS: usize = 8;
/// Structures less probable than this are out of doubt.
const DOUBT: f64 = 1e-3;
/// How far a column moves alone, as a share of half of its range.
const STEP: f64 = 0.7;
/// Differences beyond this many deviations are as good as any.
const PLAIN: f64 = 5.0;

/// Why a movement is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reason {
    /// From here columns move alone.
    Home,
    /// This column moves alone.
    Alone(usize),
    /// The most probable structures differ most here.
    Diagnostic,
    /// Predictions become more accurate by it.
    Accuracy,
}

/// A movement that is asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct Asked {
    /// The positions by column, rad or m; of columns without limits, 0.
    pub positions: Vec<f64>,
    /// Why.
    pub reason: Reason,
}

/// The next movement. `limits` are those of the columns that can be commanded, rad or m; `found` is what is known by the rows so far.
pub fn next(data: &Data, limits: &[Option<(f64, f64)>], found: Option<&Discovery>) -> Asked {
    let home: Vec<f64> = limits.iter().map(|limits| limits.map_or(0.0, |(low, high)| 0.5 * (low + high))).collect();
    if data.rows.is_empty() {
        return Asked { positions: home, reason: Reason::Home };
    }
    if let Some((positions, column)) = alone(data, limits, &home) {
        return Asked { positions, reason: Reason::Alone(column) };
    }
    let candidates: Vec<Vec<f64>> =
        (0..CANDIDATES).map(|index| spread(limits, 1 + index + CANDIDATES * (data.rows.len() % 97))).collect();
    let Some(found) = found else {
        return Asked { positions: candidates[0].clone(), reason: Reason::Accuracy };
    };
    let doubts = |positions: &Vec<f64>| disagreement(found, positions);
    let scores: Vec<f64> = candidates.iter().map(doubts).collect();
    let best = (0..CANDIDATES).max_by(|one, other| scores[*one].total_cmp(&scores[*other])).unwrap_or(0);
    if scores[best] > 0.0 {
        return Asked { positions: candidates[best].clone(), reason: Reason::Diagnostic };
    }
    let gains = gains(data, limits, &found.fit, &candidates);
    let best = (0..CANDIDATES).max_by(|one, other| gains[*one].total_cmp(&gains[*other])).unwrap_or(0);
    Asked { positions: candidates[best].clone(), reason: Reason::Accuracy }
}

/// A movement of one column alone that is still missing: one where rotations are measured, two for points.
fn alone(data: &Data, limits: &[Option<(f64, f64)>], home: &[f64]) -> Option<(Vec<f64>, usize)> {
    let wanted = if data.targets.iter().any(|target| target.is_pose) || data.targets.len() >= 3 { 1 } else { 2 };
    for round in 0..wanted {
        for (column, limit) in limits.iter().enumerate() {
            let Some((low, high)) = limit else { continue };
            let is_alone = |row: &&crate::data::Row| {
                limits.iter().enumerate().all(|(other, limit)| {
                    let Some((low, high)) = limit else { return true };
                    let off = (row.positions[other] - home[other]).abs();
                    let step = 0.05 * (high - low);
                    if other == column { off > step } else { off <= step }
                })
            };
            if data.rows.iter().filter(is_alone).count() <= round {
                let mut positions = home.to_vec();
                let side = if round == 0 { 1.0 } else { -1.0 };
                positions[column] += side * STEP * 0.5 * (high - low);
                return Some((positions, column));
            }
        }
    }
    None
}

/// A point of a sequence that fills the box evenly (additive recurrence by the roots of x^{d+1} = x + 1; Roberts 2018).
fn spread(limits: &[Option<(f64, f64)>], index: usize) -> Vec<f64> {
    let dimensions = limits.iter().flatten().count();
    let mut root = 2.0_f64;
    for _ in 0..40 {
        root = body_schema_engine::elementary::powf(1.0 + root, 1.0 / (dimensions as f64 + 1.0));
    }
    let mut step = 1.0;
    let of = |limit: &Option<(f64, f64)>| {
        let Some((low, high)) = limit else { return 0.0 };
        step /= root;
        low + (high - low) * (0.5 + step * index as f64).fract()
    };
    limits.iter().map(of).collect()
}

/// Σ pᵢ pⱼ d² over pairs of structures, d their distance in deviations of the noise; 0 where one is out of doubt.
fn disagreement(found: &Discovery, positions: &[f64]) -> f64 {
    found
        .bodies
        .iter()
        .map(|body| {
            let rivals: Vec<(&Fit, f64)> = body
                .fits
                .iter()
                .zip(body.probabilities.iter().copied())
                .take(RIVALS)
                .filter(|(_, probability)| *probability > DOUBT)
                .collect();
            let Some((first, _)) = rivals.first() else { return 0.0 };
            let predictions: Vec<_> = rivals.iter().map(|(fit, _)| fit.robot.predict(positions)).collect();
            let mut sum = 0.0;
            for one in 0..rivals.len() {
                for other in 0..one {
                    let square = distance(&first.robot, &first.noise, &predictions[one], &predictions[other]);
                    // What is within the noise tells nothing.
                    if square > 1.0 {
                        sum += rivals[one].1 * rivals[other].1 * square.min(PLAIN * PLAIN);
                    }
                }
            }
            sum
        })
        .sum()
}

fn distance(robot: &Robot, noise: &Noise, one: &[nalgebra::Isometry3<f64>], other: &[nalgebra::Isometry3<f64>]) -> f64 {
    robot
        .targets
        .iter()
        .zip(one.iter().zip(other))
        .map(|(held, (one, other))| {
            let place = (one.translation.vector - other.translation.vector).norm() / noise.place_m;
            let turn = if held.is_pose { one.rotation.angle_to(&other.rotation) / noise.turn_rad } else { 0.0 };
            place * place + turn * turn
        })
        .sum()
}

/// By how much each posture lessens the mean variance of predictions over the workspace: tr(S⁻¹ J P G P Jᵀ), S = I + J P Jᵀ, J whitened,
/// G = Σ JᵀJ over the workspace (the I-criterion).
fn gains(data: &Data, limits: &[Option<(f64, f64)>], fit: &Fit, candidates: &[Vec<f64>]) -> Vec<f64> {
    let Fit { robot, noise, .. } = fit;
    let mut known = information(data, robot, noise);
    let count = known.nrows();
    (0..count).for_each(|index| known[(index, index)] += 1.0);
    let Some(covariance) = Cholesky::new(known).map(|cholesky| cholesky.inverse()) else {
        return vec![0.0; candidates.len()];
    };
    let mut workspace = DMatrix::<f64>::zeros(count, count);
    for index in 0..WORKSPACE {
        let rows = whitened(robot, noise, &spread(limits, 7 * index + 3));
        workspace += rows.transpose() * rows;
    }
    let weighted = &covariance * workspace * &covariance;
    let gain = |positions: &Vec<f64>| {
        let rows = whitened(robot, noise, positions);
        let within = DMatrix::identity(rows.nrows(), rows.nrows()) + &rows * &covariance * rows.transpose();
        let told = &rows * &weighted * rows.transpose();
        Cholesky::new(within).map_or(0.0, |cholesky| cholesky.solve(&told).trace())
    };
    candidates.iter().map(gain).collect()
}

/// The whitened Jacobian of all targets at a posture.
fn whitened(robot: &Robot, noise: &Noise, positions: &[f64]) -> DMatrix<f64> {
    let found = jacobians(robot, positions);
    let rows: usize = robot.targets.iter().map(|held| if held.is_pose { 6 } else { 3 }).sum();
    let mut matrix = DMatrix::zeros(rows, robot.parameters());
    let mut at = 0;
    for (held, (_, entries)) in robot.targets.iter().zip(&found) {
        for (parameter, shift, turn) in entries {
            for axis in 0..3 {
                matrix[(at + axis, *parameter)] = shift[axis] / noise.place_m;
                if held.is_pose {
                    matrix[(at + 3 + axis, *parameter)] = turn[axis] / noise.turn_rad;
                }
            }
        }
        at += if held.is_pose { 6 } else { 3 };
    }
    matrix
}
