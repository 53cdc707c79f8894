//! How well a description explains the measurements, its own errors included.
//!
//! A description with errors that calibration would correct does not fit before it is calibrated either. So descriptions are compared
//! by their evidence: with eⱼ how far the frame of joint j is off in the frame before it (a shift and a turn, so that errors are
//! carried along), P₀ the prior of these and of where base and target are, and r what is left of the readings,
//!
//! ```text
//! ln p = −½ [ N ln s² + ‖r‖²/s² + eᵀ P₀⁻¹ e + ln det(I + P₀ JᵀJ/s²) ]
//! ```
//!
//! at the mode, which Gauss and Newton's steps find with s in turn: `s² = ‖r‖²/(N − γ)`, γ the equations that parameters account for,
//! and not below the σ of the sensor (MacKay, *Bayesian interpolation*, 1992). The number of equations that count is limited: what no
//! parameter explains, such as gears and bending, is the same in many rows. Rows that went wrong stand out from what is explained,
//! and are left out.

use nalgebra::{
    DMatrix, DVector, Isometry3, Matrix3, Matrix3xX, Point3, Rotation3, UnitQuaternion, UnitVector3, Vector3,
};

use super::{
    Base, Subject,
    fit::{Placed, Seen, moved},
};
use body_schema_engine::{
    elementary::ln,
    kinematics::Joint,
    model::{Links, State},
};

/// The standard deviation of a joint's zero, rad; calibrations correct less than that.
const ZERO_RAD: f64 = 0.02;
/// The standard deviations of the unknown: metres and radians.
const ANYWHERE: (f64, f64) = (10.0, 3.0);
/// The most steps.
const STEPS: usize = 20;
/// The change of the cost below which the search ends.
const FOUND: f64 = 1e-3;
/// The most equations that count.
const COUNTED: f64 = 60.0;

/// The part of the measurements that a description explains.
#[derive(Clone, Debug)]
pub struct Explained {
    /// The logarithm of the evidence, up to a constant that does not depend on the description.
    pub log_evidence: f64,
    /// The residual of positions, root mean square, metres.
    pub rms: f64,
    /// The residual of rotations, root mean square, radians, where they were measured.
    pub turned: Option<f64>,
    /// The offset of every joint that turns from its reading, rad.
    pub zeros: Vec<f64>,
    /// The chain with the errors that were found.
    pub standing: Standing,
}

impl Explained {
    /// The explained positions of the target at other rows, in the frame of the measurements.
    pub fn places(&self, subject: &Subject, rows: &[Vec<f64>], seen: &Seen) -> Vec<Point3<f64>> {
        let chain = Chain::new(subject.joints, rows, seen);
        let robot = chain.robot(&self.standing);
        let mut links = Links::new(&robot.state);
        let mut at = |row: &Vec<f64>| robot.tip(&mut links, row) * self.standing.placed.target;
        rows.iter().map(|row| at(row).translation.vector.into()).collect()
    }

    /// This with what is left of other rows.
    pub fn judged_by(self, subject: &Subject, rows: &[Vec<f64>], seen: &Seen) -> Self {
        let (rms, turned) = Chain::new(subject.joints, rows, seen).left(&self.standing);
        Self { rms, turned, ..self }
    }

    /// How far the target is in each row from where it is explained to be: the root of the summed squares of its points, metres.
    pub fn away(&self, subject: &Subject, rows: &[Vec<f64>], seen: &Seen) -> Vec<f64> {
        let chain = Chain::new(subject.joints, rows, seen);
        chain.each_square(&self.standing).iter().map(|square| square.sqrt()).collect()
    }
}

/// What is known in addition to the description.
#[derive(Clone, Copy, Debug)]
pub struct Known<'a> {
    /// The pose of the base; `None` if unknown.
    pub base: Option<&'a Base>,
    /// Standard deviation of the zeros of joints that turn, rad.
    pub zero_rad: f64,
}

impl Known<'_> {
    /// The description is right, up to errors that calibration corrects.
    pub const DESCRIBED: Self = Self { base: None, zero_rad: ZERO_RAD };
    /// Any joint's zero may be anywhere.
    pub const ZEROS_ANYWHERE: Self = Self { base: None, zero_rad: 1.5 };
}

/// A chain whose frames may be off.
struct Chain<'a> {
    joints: &'a [Joint],
    /// For each joint a point on its axis, and axes of which the third is its direction.
    frames: Vec<(Point3<f64>, Rotation3<f64>)>,
    seen: &'a Seen,
    body: Vec<Point3<f64>>,
    rows: &'a [Vec<f64>],
}

/// A chain with its errors, as a robot: every axis is where the errors up to it leave it.
struct Robot {
    state: State,
    /// By which motion each joint's axis is off at θ = 0.
    off: Vec<Isometry3<f64>>,
}

impl Robot {
    /// The pose of the last link at a row.
    fn tip(&self, links: &mut Links<'_>, row: &[f64]) -> Isometry3<f64> {
        let off = self.off.last().copied().unwrap_or_default();
        links.at(row).link(row.len()).pose() * off
    }
}

/// A chain with its errors.
#[derive(Clone, Debug)]
pub struct Standing {
    placed: Placed,
    /// For each joint a shift and a turn, in its axes.
    errors: DVector<f64>,
}

const PLACES: usize = 12;

/// Explains `seen` at `rows` by the description, beginning with the base and target that are found without its errors.
pub fn explain(
    subject: &Subject,
    rows: &[Vec<f64>],
    seen: &Seen,
    start: Placed,
    known: Known<'_>,
) -> Option<Explained> {
    let base = known.base;
    let chain = Chain::new(subject.joints, rows, seen);
    let parameters = PLACES + 6 * subject.joints.len();
    let share = seen.share();
    let equations = (rows.len() * seen.equations()) as f64;
    let deviations = chain.deviations(subject, seen, known);
    let information_before = DMatrix::from_diagonal(&deviations.map(|sd| (sd * sd).recip()));
    let mut standing = Standing {
        placed: base.map_or(start, |base| Placed { base: base.at, ..start }),
        errors: DVector::zeros(6 * subject.joints.len()),
    };
    let from_prior = |standing: &Standing| {
        let mut off = DVector::zeros(parameters);
        off.rows_mut(PLACES, 6 * subject.joints.len()).copy_from(&standing.errors);
        if let Some(base) = base {
            let (at, of) = (&standing.placed.base, &base.at);
            off.fixed_rows_mut::<3>(0).copy_from(&(at.translation.vector - of.translation.vector));
            off.fixed_rows_mut::<3>(3).copy_from(&(at.rotation * of.rotation.inverse()).scaled_axis());
        }
        off
    };
    let cost_of_prior = |off: &DVector<f64>| off.component_div(&deviations).norm_squared();
    let least = subject.sigma_m.max(1e-9);
    let mut squares = share * chain.squares(&standing);
    let mut variance = (squares / equations).max(least * least);
    let mut damping = 1e-6;
    let mut last = None;
    for _ in 0..STEPS {
        let (information, gradient) = chain.equations(&standing, parameters);
        let (information, gradient) = (information * (share / variance), gradient * (share / variance));
        let off = from_prior(&standing);
        let before = squares / variance + cost_of_prior(&off);
        let posterior = &information + &information_before;
        let negative_gradient = gradient - &information_before * &off;
        let mut moved = None;
        while damping < 1e6 {
            let mut damped = posterior.clone();
            (0..parameters).for_each(|k| damped[(k, k)] *= 1.0 + damping);
            let step = damped.cholesky()?.solve(&negative_gradient);
            let other = standing.stepped(&step);
            let left = share * chain.squares(&other);
            let after = left / variance + cost_of_prior(&from_prior(&other));
            if after <= before {
                moved = Some((other, left, before - after));
                damping = (damping * 0.1).max(1e-9);
                break;
            }
            damping *= 10.0;
        }
        let inverse = posterior.clone().cholesky()?.inverse();
        let accounted = parameters as f64 - inverse.component_mul(&information_before).sum();
        let mut ended = true;
        if let Some((other, left, gain)) = moved {
            (standing, squares, ended) = (other, left, gain < FOUND * before.max(1.0));
        }
        let learned = (squares / (equations - accounted).max(1.0)).max(least * least);
        ended &= ln(learned / variance).abs() < 0.02;
        variance = learned;
        last = Some(posterior);
        if ended {
            break;
        }
    }
    let off = from_prior(&standing);
    // With every σ as it was found: the last information is of one step before.
    let factor = last?.cholesky()?;
    let log_determinant = 2.0 * factor.l_dirty().diagonal().iter().map(|x| ln(*x)).sum::<f64>()
        + 2.0 * deviations.iter().map(|sd| ln(*sd)).sum::<f64>();
    let counted = subject.counted(rows.len() * seen.equations()) / equations;
    let data = equations * ln(variance) + squares / variance;
    let log_evidence = -0.5 * (counted * data + cost_of_prior(&off) + log_determinant);
    let (rms, turned) = chain.left(&standing);
    let zeros = (0..subject.joints.len()).map(|joint| standing.errors[6 * joint + 5]).collect();
    log_evidence.is_finite().then_some(Explained { log_evidence, rms, turned, zeros, standing })
}

impl Subject<'_> {
    /// How many of `equations` count.
    pub(super) fn counted(&self, equations: usize) -> f64 {
        (equations as f64).min(COUNTED)
    }
}

impl<'a> Chain<'a> {
    fn new(joints: &'a [Joint], rows: &'a [Vec<f64>], seen: &'a Seen) -> Self {
        let mut point = Point3::origin();
        let frames = joints.iter().map(|joint| {
            if let Some(line) = joint.line() {
                point = line.point;
            }
            (point, axes_of(joint.direction()))
        });
        Self { joints, frames: frames.collect(), seen, body: seen.body(), rows }
    }

    fn deviations(&self, subject: &Subject, seen: &Seen, known: Known<'_>) -> DVector<f64> {
        let (place, turn) = known.base.map_or(ANYWHERE, |base| (base.sd_m, base.sd_rad));
        let target_turns = if seen.arm.is_some() { ANYWHERE.1 } else { 1e-6 };
        let target = subject.target_sd_m;
        let mut all = vec![place, place, place, turn, turn, turn, target, target, target];
        all.extend([target_turns; 3]);
        let [shift, turn] = [subject.point_m, subject.direction_rad].map(|sd| sd.clamp(1e-6, 1.0));
        for (index, joint) in self.joints.iter().enumerate() {
            let stated = subject.zeros_rad.get(index).copied().unwrap_or(0.0);
            let zero = if joint.line().is_some() { turn.max(known.zero_rad).max(stated) } else { turn };
            all.extend([shift, shift, shift, turn, turn, zero]);
        }
        DVector::from_vec(all)
    }

    fn error(&self, standing: &Standing, joint: usize) -> Isometry3<f64> {
        let (centre, axes) = &self.frames[joint];
        let of = standing.errors.fixed_rows::<6>(6 * joint);
        let turn = UnitQuaternion::from_scaled_axis(axes * of.fixed_rows::<3>(3).into_owned());
        let about = Isometry3::rotation_wrt_point(turn, *centre);
        nalgebra::Translation3::from(of.fixed_rows::<3>(0).into_owned()) * about
    }

    /// The chain with its errors as a robot.
    fn robot(&self, standing: &Standing) -> Robot {
        let errors = (0..self.joints.len()).map(|joint| self.error(standing, joint));
        let off: Vec<Isometry3<f64>> = errors
            .scan(Isometry3::identity(), |off, error| {
                *off *= error;
                Some(*off)
            })
            .collect();
        let joints = self.joints.iter().zip(&off).map(|(joint, off)| joint.transformed(off)).collect();
        Robot { state: State { base: standing.placed.base, ..State::arm(joints, Point3::origin()) }, off }
    }

    fn squares(&self, standing: &Standing) -> f64 {
        self.each_square(standing).iter().sum()
    }

    /// The summed squared distances of the target's points from where it was seen, row by row.
    fn each_square(&self, standing: &Standing) -> Vec<f64> {
        let robot = self.robot(standing);
        let mut links = Links::new(&robot.state);
        let rows = self.rows.iter().zip(&self.seen.poses);
        rows.map(|(row, seen)| {
            let at = robot.tip(&mut links, row) * standing.placed.target;
            self.body.iter().map(|point| (at * point - seen * point).norm_squared()).sum()
        })
        .collect()
    }

    fn left(&self, standing: &Standing) -> (f64, Option<f64>) {
        let robot = self.robot(standing);
        let mut links = Links::new(&robot.state);
        let (mut squares, mut turns) = (0.0, 0.0);
        for (row, seen) in self.rows.iter().zip(&self.seen.poses) {
            let at = robot.tip(&mut links, row) * standing.placed.target;
            squares += (at.translation.vector - seen.translation.vector).norm_squared();
            turns += at.rotation.angle_to(&seen.rotation).powi(2);
        }
        let count = self.rows.len().max(1) as f64;
        ((squares / count).sqrt(), self.seen.arm.map(|_| (turns / count).sqrt()))
    }

    /// `JᵀJ` and `Jᵀr`.
    fn equations(&self, standing: &Standing, parameters: usize) -> (DMatrix<f64>, DVector<f64>) {
        let robot = self.robot(standing);
        let mut links = Links::new(&robot.state);
        let (mut information, mut gradient) = (DMatrix::zeros(parameters, parameters), DVector::zeros(parameters));
        let mut columns = Matrix3xX::zeros(parameters);
        for (row, seen) in self.rows.iter().zip(&self.seen.poses) {
            let at = robot.tip(&mut links, row);
            let stands = robot.off.iter().enumerate().map(|(joint, off)| links.link(joint).pose() * off);
            let stands: Vec<Isometry3<f64>> = stands.collect();
            let turned = at.rotation.to_rotation_matrix();
            for point in &self.body {
                let on_link = standing.placed.target * point;
                let world = at * on_link;
                let base = standing.placed.base.translation.vector;
                columns.fixed_columns_mut::<3>(0).copy_from(&Matrix3::identity());
                columns.fixed_columns_mut::<3>(3).copy_from(&-(world.coords - base).cross_matrix());
                columns.fixed_columns_mut::<3>(6).copy_from(turned.matrix());
                let arm = on_link.coords - standing.placed.target.translation.vector;
                columns.fixed_columns_mut::<3>(9).copy_from(&(turned.matrix() * -arm.cross_matrix()));
                for (index, (stand, (centre, axes))) in stands.iter().zip(&self.frames).enumerate() {
                    let frame = stand.rotation.to_rotation_matrix();
                    let from_axis = world - stand * centre;
                    let first = PLACES + 6 * index;
                    columns.fixed_columns_mut::<3>(first).copy_from(frame.matrix());
                    let turns = -from_axis.cross_matrix() * (frame * axes).matrix();
                    columns.fixed_columns_mut::<3>(first + 3).copy_from(&turns);
                }
                information.gemm_tr(1.0, &columns, &columns, 1.0);
                gradient.gemv_tr(1.0, &columns, &(seen * point - world), 1.0);
            }
        }
        (information, gradient)
    }
}

impl Standing {
    fn stepped(&self, step: &DVector<f64>) -> Self {
        let part = |first: usize| step.fixed_rows::<3>(first).into_owned();
        let Placed { base, target } = &self.placed;
        let placed = Placed { base: moved(base, part(0), part(3)), target: moved(target, part(6), part(9)) };
        Self { placed, errors: &self.errors + step.rows(PLACES, self.errors.len()) }
    }
}

/// Axes of which the third is a direction.
fn axes_of(direction: UnitVector3<f64>) -> Rotation3<f64> {
    let other = if direction.x.abs() < 0.7 { Vector3::x() } else { Vector3::y() };
    Rotation3::face_towards(&direction, &other)
}
