//! The fit of a robot of given structure: Levenberg–Marquardt in tangent coordinates, with a robust loss.
//!
//! A joint's axis moves what is behind it by the twist `Ad_A (I − Ad_E) η`, A the motion of the joints before it, E its own; a learned
//! ratio by `Ad_A ξ (θ − θ₀)`. A rotation R against the measured M has the cost ‖R − M‖²/2 (chordal: φ² for a small angle φ between
//! them), whose Gauss–Newton equations are `JᵀJ = ΩᵀΩ`, `Jᵀr = −Ωᵀ Σₖ Reₖ × Meₖ / 2`, Ω the angular parts (3 × m).

use body_schema_engine::{
    elementary::ln,
    kinematics::{Joint, chart},
    sensing::Loss,
};
use nalgebra::{DMatrix, DVector, Rotation3, UnitQuaternion, Vector2, Vector3, Vector4};

use crate::{
    damped::Damped,
    data::{Data, Reading},
    jacobian::{jacobians, offsets},
    robot::Robot,
};

/// Standard deviations of what is measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Of a coordinate of a place, m.
    pub place_m: f64,
    /// Of a component of a rotation vector, rad.
    pub turn_rad: f64,
}

/// A robot fitted to data.
#[derive(Clone, Debug)]
pub struct Fit {
    /// The robot.
    pub robot: Robot,
    /// The noise that its residuals show.
    pub noise: Noise,
    /// The logarithm of the likelihood, up to a constant of the data.
    pub likelihood: f64,
    /// What its parameters cost of it.
    pub price: f64,
    /// The logarithm of the evidence: the likelihood, by the share of readings that are independent, less the price.
    pub evidence: f64,
}

/// The least deviations that are believed: of numbers written with few digits.
const LEAST: Noise = Noise { place_m: 1e-6, turn_rad: 1e-6 };

/// Minus the logarithm of the odds, before any data, that one given column drives one given joint besides its own: one robot in twenty
/// has such a thing, in one of thirty or so places.
const COUPLING: f64 = 6.5;

/// The least ratio of a coupling, and the least by which a joint's own differs from 1.
const LEAST_RATIO: f64 = 0.1;

/// The normal equations' sums at a robot.
struct Sums {
    cost: f64,
    hessian: DMatrix<f64>,
    gradient: DVector<f64>,
}

/// Squared residuals by kind: of places (m²) and of rotations (rad²), one per reading.
pub(crate) fn squares(data: &Data, robot: &Robot) -> [Vec<f64>; 2] {
    let [mut places, mut turns] = [Vec::new(), Vec::new()];
    for row in &data.rows {
        for (found, reading) in robot.predict(&row.positions).iter().zip(&row.readings) {
            let Some(reading) = reading else { continue };
            places.push((found.translation.vector - reading.point().coords).norm_squared());
            if let Reading::Pose(pose) = reading {
                turns.push(chordal(&found.rotation, &pose.rotation));
            }
        }
    }
    [places, turns]
}

/// ‖R − M‖²/2 = 4 (1 − cos φ)/2.
fn chordal(one: &UnitQuaternion<f64>, other: &UnitQuaternion<f64>) -> f64 {
    // 8 sin²(φ/2) / 2, with sin² of half the angle from the quaternion of the difference.
    4.0 * (other.inverse() * one).imag().norm_squared()
}

/// The deviation of a coordinate by squared residuals of three: robust against outliers, and taken of the rest.
pub(crate) fn deviation(squares: &[f64], share_free: f64) -> f64 {
    // The median of χ² with three degrees of freedom.
    const MEDIAN: f64 = 2.366;
    /// χ² beyond which a reading is left out, and what the mean of the rest falls short of 3 by: under 1 %.
    const MOST: f64 = 16.0;
    if squares.is_empty() {
        return 0.0;
    }
    let mut sorted = squares.to_vec();
    sorted.sort_by(f64::total_cmp);
    let first = sorted[sorted.len() / 2] / MEDIAN;
    let kept: Vec<f64> = sorted.into_iter().take_while(|square| *square <= MOST * first).collect();
    let mean = if kept.is_empty() { first } else { kept.iter().sum::<f64>() / (3.0 * kept.len() as f64) };
    (mean / share_free.max(0.05)).sqrt()
}

/// The noise that the residuals of a robot show.
pub(crate) fn noise_of(data: &Data, robot: &Robot) -> Noise {
    let [places, turns] = squares(data, robot);
    let equations = 3 * (places.len() + turns.len());
    let share = 1.0 - robot.parameters() as f64 / equations.max(1) as f64;
    Noise {
        place_m: deviation(&places, share).max(LEAST.place_m),
        turn_rad: deviation(&turns, share).max(LEAST.turn_rad),
    }
}

/// Minus the logarithm of the likelihood at the given noise, up to a constant of the data.
fn cost(data: &Data, robot: &Robot, noise: &Noise, loss: Loss) -> f64 {
    let [places, turns] = squares(data, robot);
    let of = |squares: &[f64], sigma: f64| -> f64 {
        squares.iter().map(|square| loss.cost(square / (sigma * sigma), 3)).sum()
    };
    of(&places, noise.place_m) + of(&turns, noise.turn_rad)
}

/// The logarithm of the evidence by the Bayesian information criterion with the noise profiled, in two parts: the likelihood over the kinds of
/// readings, `−Σ (3n ln σ + Σ ρ)`, and what parameters cost, `k/2 ln N`, N the number of equations, k that of parameters (Schwarz 1978). Every learned
/// ratio costs [`COUPLING`] more: there are as many that could be as pairs of column and joint (Chen and Chen 2008). One that is too
/// small to be a part of a mechanism is refused: it would explain an error of the robot.
fn evidence(data: &Data, robot: &Robot, noise: &Noise) -> (f64, f64) {
    let [places, turns] = squares(data, robot);
    let equations = 3.0 * (places.len() + turns.len()) as f64;
    let of = |squares: &[f64], sigma: f64| -> f64 {
        let costs: f64 = squares.iter().map(|square| Loss::MIXTURE.cost(square / (sigma * sigma), 3)).sum();
        costs + 3.0 * squares.len() as f64 * ln(sigma)
    };
    let parameters = robot.parameters() as f64;
    let mut price = 0.5 * parameters * ln(equations.max(2.0));
    for joint in &robot.joints {
        for (index, drive) in joint.drives.iter().enumerate().filter(|(_, drive)| drive.is_free) {
            let expected = if index == 0 { 1.0 } else { 0.0 };
            price += if (drive.ratio - expected).abs() < LEAST_RATIO { f64::INFINITY } else { COUPLING };
        }
    }
    (-of(&places, noise.place_m) - of(&turns, noise.turn_rad), price)
}

/// By how much the residuals of a body's markers repeat each other: n / (1 + (m − 1) ρ) of n readings are independent, with ρ the mean
/// correlation of residuals in one row, m the readings of a row. Corners of one tracked body that are computed from its pose say one
/// thing m times.
pub(crate) fn independence(data: &Data, robot: &Robot) -> f64 {
    let (mut squares, mut products, mut pairs, mut count) = (0.0, 0.0, 0.0, 0.0);
    let mut many = 0.0_f64;
    for row in &data.rows {
        let found = robot.predict(&row.positions);
        let off: Vec<Vector3<f64>> = found
            .iter()
            .zip(&row.readings)
            .filter_map(|(found, reading)| Some(found.translation.vector - reading.as_ref()?.point().coords))
            .collect();
        many = many.max(off.len() as f64);
        squares += off.iter().map(Vector3::norm_squared).sum::<f64>();
        count += off.len() as f64;
        for one in 0..off.len() {
            for other in 0..one {
                products += off[one].dot(&off[other]);
                pairs += 1.0;
            }
        }
    }
    if pairs == 0.0 || squares == 0.0 {
        return 1.0;
    }
    let correlation = (products / pairs) / (squares / count);
    1.0 / (1.0 + (many - 1.0) * correlation.clamp(0.0, 1.0))
}

/// Fits a robot to data from where it is: rounds in which the noise is learned anew from the residuals.
pub fn fit(data: &Data, start: &Robot, iterations: usize) -> Fit {
    let mut robot = start.clone();
    if let Some(reading) = data.rows.iter().find_map(|row| row.readings.iter().flatten().next()) {
        robot.pivot_near(&reading.point());
    }
    let mut noise = noise_of(data, &robot);
    for loss in [Loss::Huber, Loss::Huber, Loss::MIXTURE, Loss::MIXTURE] {
        let before = noise;
        descend(data, &mut robot, &noise, loss, iterations);
        noise = noise_of(data, &robot);
        let is_still = |one: f64, other: f64| (one / other - 1.0).abs() < 1e-3;
        if loss == Loss::MIXTURE && is_still(before.place_m, noise.place_m) && is_still(before.turn_rad, noise.turn_rad)
        {
            break;
        }
    }
    let (likelihood, price) = evidence(data, &robot, &noise);
    Fit { robot, noise, likelihood, price, evidence: likelihood - price }
}

/// Levenberg–Marquardt at given noise.
pub(crate) fn descend(data: &Data, robot: &mut Robot, noise: &Noise, loss: Loss, iterations: usize) {
    let mut damped = Damped::new(1e-6, 1e8);
    let mut at = sums(data, robot, noise, loss);
    for _ in 0..iterations {
        let lowered = damped.step(&at.hessian, &at.gradient, |step| {
            let mut tried = robot.clone();
            retract(&mut tried, step);
            let found = cost(data, &tried, noise, loss);
            (found < at.cost).then_some((tried, found))
        });
        let Some((tried, found)) = lowered else { return };
        *robot = tried;
        if at.cost - found < 1e-7 * at.cost.max(1.0) {
            return;
        }
        at = sums(data, robot, noise, loss);
    }
}

/// Moves a robot by tangent coordinates, in the order of [`Robot::parameters`].
pub(crate) fn retract(robot: &mut Robot, delta: &[f64]) {
    let mut numbers = delta.iter().copied();
    let mut next = || numbers.next().unwrap_or(0.0);
    for joint in &mut robot.joints {
        match &mut joint.axis {
            Joint::Revolute(line) => {
                *line = chart::retract_line(line, &Vector4::new(next(), next(), next(), next()));
            }
            Joint::Prismatic(direction) => {
                *direction = chart::retract_direction(direction, &Vector2::new(next(), next()));
            }
        }
        for drive in joint.drives.iter_mut().filter(|drive| drive.is_free) {
            drive.ratio += next();
        }
    }
    for held in &mut robot.targets {
        held.home.translation.vector += Vector3::new(next(), next(), next());
        if held.is_pose {
            let turn = Vector3::new(next(), next(), next());
            held.home.rotation = UnitQuaternion::from_scaled_axis(turn) * held.home.rotation;
        }
    }
}

fn sums(data: &Data, robot: &Robot, noise: &Noise, loss: Loss) -> Sums {
    let (_, _, count) = offsets(robot);
    let mut sums = Sums { cost: 0.0, hessian: DMatrix::zeros(count, count), gradient: DVector::zeros(count) };
    let [by_place, by_turn] = [1.0 / (noise.place_m * noise.place_m), 1.0 / (noise.turn_rad * noise.turn_rad)];
    for row in &data.rows {
        for ((found, entries), reading) in jacobians(robot, &row.positions).iter().zip(&row.readings) {
            let Some(reading) = reading else { continue };
            let off = found.translation.vector - reading.point().coords;
            let square = off.norm_squared() * by_place;
            sums.cost += loss.cost(square, 3);
            let place = by_place * loss.weight(square, 3);
            let (mut turn, mut off_turn) = (0.0, Vector3::zeros());
            if let Reading::Pose(pose) = reading {
                let square = chordal(&found.rotation, &pose.rotation) * by_turn;
                sums.cost += loss.cost(square, 3);
                turn = by_turn * loss.weight(square, 3);
                let (ours, theirs) =
                    (Rotation3::from(found.rotation).into_inner(), Rotation3::from(pose.rotation).into_inner());
                off_turn = (0..3).map(|axis| theirs.column(axis).cross(&ours.column(axis))).sum::<Vector3<f64>>() * 0.5;
            }
            for (index, (one, shift, spin)) in entries.iter().enumerate() {
                sums.gradient[*one] += place * shift.dot(&off) + turn * spin.dot(&off_turn);
                for (other, shift_other, spin_other) in &entries[index..] {
                    let product = place * shift.dot(shift_other) + turn * spin.dot(spin_other);
                    sums.hessian[(*one.max(other), *one.min(other))] += product;
                }
            }
        }
    }
    sums.hessian.fill_upper_triangle_with_lower_triangle();
    sums
}

/// The information matrix of the parameters at the rows' postures, `Σ JᵀR⁻¹J`.
pub(crate) fn information(data: &Data, robot: &Robot, noise: &Noise) -> DMatrix<f64> {
    sums(data, robot, noise, Loss::None).hessian
}
