//! Fits of a chain's motions to the measurements, with unknown base, target or sockets left free.

use nalgebra::{Isometry3, Matrix3, Point3, Quaternion, SMatrix, SVector, Translation3, UnitQuaternion, Vector3};

use body_schema_engine::{elementary::hypot, kinematics::rotation, model::best_motion, most};

/// The measurements, row by row.
#[derive(Clone, Debug)]
pub enum Sight {
    /// A target on the last link; where base and target are is unknown.
    Target(Seen),
    /// The sockets that held a target; target and sockets are unknown.
    Sockets(Vec<usize>),
}

/// The poses of a target that were measured, row by row.
#[derive(Clone, Debug)]
pub struct Seen {
    /// Its likely position at θ = 0.
    pub guess: Point3<f64>,
    /// Its pose in each row; for a position the rotation means nothing.
    pub poses: Vec<Isometry3<f64>>,
    /// Its rotation vector in each row as written, which may be longer than half a turn.
    pub turns: Vec<Vector3<f64>>,
    /// The length by which a rotation error is weighed: one radian counts as much as a shift by this many metres;
    /// `None` for positions.
    pub arm: Option<f64>,
    /// Its pose in each row if the pictures that it was found in are a mirror's; empty if it was found in none.
    pub mirrored: Vec<Isometry3<f64>>,
}

/// The poses of base and target.
#[derive(Clone, Copy, Debug)]
pub struct Placed {
    /// The base.
    pub base: Isometry3<f64>,
    /// The target at θ = 0.
    pub target: Isometry3<f64>,
}

/// The residuals of a fit.
#[derive(Clone, Debug)]
pub struct Fit {
    /// The root mean square, metres.
    pub rms: f64,
    /// The residual by which fits are compared: `rms`; with sockets it is taken per rotation of the last link, since a link
    /// that does not turn leaves every target where it is.
    pub judged: f64,
    /// The root mean square of rotations, radians, where they were measured.
    pub turned: Option<f64>,
    /// Base and target of the fit, and the rows it rests on; `None` with sockets.
    pub placed: Option<(Placed, Vec<usize>)>,
}

/// The most Gauss–Newton steps; a good hypothesis needs four.
const STEPS: usize = 12;
/// One row in this many may be left out for being far off, so that a few bad rows do not outweigh all others.
pub const FEW: usize = 10;
/// What is so many times as far off as the middle row is far.
const FAR: f64 = 5.0;
/// The most rounds in which rows are left out.
const ROUNDS: usize = 4;
/// How far from its likely position a target is searched for, metres.
const AROUND: f64 = 0.2;

impl Sight {
    /// Fits base, target or sockets when the last link moves by `motions`, row by row; from several starts if
    /// `thorough`.
    pub fn fit(&self, motions: &[Isometry3<f64>], thorough: bool) -> Fit {
        match self {
            Self::Target(seen) => seen.of_most(motions, thorough),
            Self::Sockets(sockets) => of_sockets(sockets, motions),
        }
    }
}

impl Seen {
    /// The points that stand for the target, in its own frame: its origin, and for a pose one along each axis.
    pub fn body(&self) -> Vec<Point3<f64>> {
        let arm = self.arm.into_iter().flat_map(|arm| axes().map(|axis| Point3::from(axis * arm)));
        std::iter::once(Point3::origin()).chain(arm).collect()
    }

    /// The weight of a point's squared distance, such that all points together count as the equations of a reading do.
    pub fn share(&self) -> f64 {
        if self.arm.is_some() { 1.0 / 3.0 } else { 1.0 }
    }

    /// The number of equations of a reading.
    pub fn equations(&self) -> usize {
        if self.arm.is_some() { 6 } else { 3 }
    }

    /// These measurements at the given rows only.
    pub fn of(&self, rows: &[usize]) -> Self {
        let poses = rows.iter().map(|row| self.poses[*row]).collect();
        let turns = rows.iter().map(|row| self.turns[*row]).collect();
        let mirrored = rows.iter().filter_map(|row| self.mirrored.get(*row).copied()).collect();
        Self { poses, turns, mirrored, ..*self }
    }

    /// The fit to all but a few rows that are far off.
    fn of_most(&self, motions: &[Isometry3<f64>], thorough: bool) -> Fit {
        let fit = |rows: &[usize]| {
            let motions: Vec<Isometry3<f64>> = rows.iter().map(|row| motions[*row]).collect();
            (self.of(rows).placed(&motions, thorough), rows.to_vec())
        };
        let body = self.body();
        let away = |(placed, _): &(Placed, Vec<usize>), row: usize| {
            let at = placed.base * motions[row] * placed.target;
            body.iter().map(|point| (at * point - self.poses[row] * point).norm_squared()).sum::<f64>().sqrt()
        };
        let (placed, rows) = most::fitted(self.poses.len(), (FAR, self.poses.len().div_ceil(FEW), ROUNDS), fit, away);
        let mean = |of: &dyn Fn(&Isometry3<f64>, &Isometry3<f64>) -> f64| {
            let sum: f64 =
                rows.iter().map(|row| of(&(placed.base * motions[*row] * placed.target), &self.poses[*row])).sum();
            (sum / rows.len().max(1) as f64).sqrt()
        };
        let rms = mean(&|at, seen| (at.translation.vector - seen.translation.vector).norm_squared());
        let turned = self.arm.map(|_| mean(&|at, seen| at.rotation.angle_to(&seen.rotation).powi(2)));
        let judged = hypot(rms, self.arm.unwrap_or(0.0) * turned.unwrap_or(0.0));
        Fit { rms, judged, turned, placed: Some((placed, rows)) }
    }

    /// Base and target that explain all rows best.
    fn placed(&self, motions: &[Isometry3<f64>], thorough: bool) -> Placed {
        let mut starts = Vec::new();
        if self.arm.is_some() {
            starts.push(self.hand_eye(motions));
        } else {
            let around = if thorough { AROUND } else { 0.0 };
            let shifts = axes().into_iter().flat_map(|axis| [axis * around, -axis * around]);
            let shifts = std::iter::once(Vector3::zeros()).chain(shifts.filter(|_| thorough));
            let seen: Vec<Point3<f64>> = self.poses.iter().map(|pose| pose.translation.vector.into()).collect();
            starts.extend(shifts.map(|shift| {
                let target = self.guess + shift;
                let base = best_motion(&motions.iter().map(|t| t * target).collect::<Vec<_>>(), &seen);
                Placed { base, target: Isometry3::from(Translation3::from(target)) }
            }));
        }
        let found = starts.into_iter().map(|start| self.refined(motions, start));
        let best = found.min_by(|a, b| a.0.total_cmp(&b.0));
        best.map_or(Placed { base: Isometry3::identity(), target: Isometry3::identity() }, |best| best.1)
    }

    /// `Yⱼ = B Tⱼ X` in closed form: the rotation of X brings the turns between rows together (Park and Martin 1994), that of B is
    /// their mean then, and both translations are a linear problem.
    fn hand_eye(&self, motions: &[Isometry3<f64>]) -> Placed {
        let (mut turns, mut sum) = (Matrix3::zeros(), nalgebra::Matrix4::zeros());
        let between = |a: &UnitQuaternion<f64>, b: &UnitQuaternion<f64>| (a.inverse() * b).scaled_axis();
        let n = motions.len();
        for step in [1, 2, 5] {
            for (j, k) in (0..n).map(|j| (j, (j + step) % n)).filter(|(j, k)| j != k) {
                let by_robot = between(&motions[j].rotation, &motions[k].rotation);
                let seen = between(&self.poses[j].rotation, &self.poses[k].rotation);
                turns += by_robot * seen.transpose();
            }
        }
        let x = nearest_rotation(&turns);
        for (motion, seen) in motions.iter().zip(&self.poses) {
            let q = (seen.rotation * x.inverse() * motion.rotation.inverse()).into_inner().coords;
            sum += q * q.transpose();
        }
        let eigen = sum.symmetric_eigen();
        let most = eigen.eigenvalues.imax();
        let b = UnitQuaternion::new_normalize(Quaternion::from_vector(eigen.eigenvectors.column(most).into_owned()));
        let (mut information, mut vector) = (SMatrix::<f64, 6, 6>::identity() * 1e-9, SVector::<f64, 6>::zeros());
        for (motion, seen) in motions.iter().zip(&self.poses) {
            let mut row = SMatrix::<f64, 3, 6>::zeros();
            row.fixed_view_mut::<3, 3>(0, 0).copy_from(&Matrix3::identity());
            row.fixed_view_mut::<3, 3>(0, 3).copy_from((b * motion.rotation).to_rotation_matrix().matrix());
            information += row.transpose() * row;
            vector += row.transpose() * (seen.translation.vector - b * motion.translation.vector);
        }
        let places = information.cholesky().map_or_else(SVector::zeros, |factor| factor.solve(&vector));
        let at = |first: usize| Translation3::from(places.fixed_rows::<3>(first).into_owned());
        Placed { base: Isometry3::from_parts(at(0), b), target: Isometry3::from_parts(at(3), x) }
    }

    /// Refines a start by Gauss–Newton steps: the root mean square of the residuals, and base and target.
    fn refined(&self, motions: &[Isometry3<f64>], start: Placed) -> (f64, Placed) {
        let body = self.body();
        let count = (self.poses.len() * body.len()).max(1) as f64;
        let left = |placed: &Placed| {
            let of = |(t, seen): (&Isometry3<f64>, &Isometry3<f64>)| {
                let at = placed.base * t * placed.target;
                body.iter().map(|point| (at * point - seen * point).norm_squared()).sum::<f64>()
            };
            (motions.iter().zip(&self.poses).map(of).sum::<f64>() / count).sqrt()
        };
        let (mut placed, mut best, mut damping) = (start, left(&start), 1e-6);
        for _ in 0..STEPS {
            let mut information = SMatrix::<f64, 12, 12>::zeros();
            let mut gradient = SVector::<f64, 12>::zeros();
            for (t, seen) in motions.iter().zip(&self.poses) {
                let turned = (placed.base.rotation * t.rotation).to_rotation_matrix();
                for point in &body {
                    let on_link = placed.target * point;
                    let at = placed.base * (t * on_link);
                    let mut row = SMatrix::<f64, 3, 12>::zeros();
                    row.fixed_view_mut::<3, 3>(0, 0).copy_from(&Matrix3::identity());
                    row.fixed_view_mut::<3, 3>(0, 3)
                        .copy_from(&-(at.coords - placed.base.translation.vector).cross_matrix());
                    row.fixed_view_mut::<3, 3>(0, 6).copy_from(turned.matrix());
                    let arm = on_link.coords - placed.target.translation.vector;
                    row.fixed_view_mut::<3, 3>(0, 9).copy_from(&(turned.matrix() * -arm.cross_matrix()));
                    information += row.transpose() * row;
                    gradient += row.transpose() * (seen * point - at);
                }
            }
            let damped = information + SMatrix::<f64, 12, 12>::identity() * (damping * count);
            let Some(step) = damped.cholesky().map(|factor| factor.solve(&gradient)) else { break };
            let part = |first: usize| step.fixed_rows::<3>(first).into_owned();
            let other =
                Placed { base: moved(&placed.base, part(0), part(3)), target: moved(&placed.target, part(6), part(9)) };
            let there = left(&other);
            if there < best {
                let gain = (best - there) / best;
                (placed, best, damping) = (other, there, damping * 0.1);
                if gain < 1e-3 {
                    break;
                }
            } else {
                damping *= 100.0;
            }
        }
        (best, placed)
    }
}

/// A pose shifted by `shift`, and turned by `turn` about its own origin.
pub fn moved(pose: &Isometry3<f64>, shift: Vector3<f64>, turn: Vector3<f64>) -> Isometry3<f64> {
    let translation = Translation3::from(pose.translation.vector + shift);
    Isometry3::from_parts(translation, rotation::exp(&pose.rotation, &turn))
}

/// The rotation R for which `Σ a · R b` is greatest, of `m = Σ a bᵀ`.
fn nearest_rotation(m: &Matrix3<f64>) -> UnitQuaternion<f64> {
    let svd = m.svd(true, true);
    let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else { return UnitQuaternion::identity() };
    let sign = (u.determinant() * v_t.determinant()).signum();
    let r = u * Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, sign)) * v_t;
    UnitQuaternion::from_matrix(&r)
}

/// Unit vectors along the axes.
fn axes() -> [Vector3<f64>; 3] {
    [Vector3::x(), Vector3::y(), Vector3::z()]
}

/// Fits sockets: `Tⱼ p` is the same in all rows of a socket, p free; a linear problem.
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
    Fit { rms, judged: rms / (information.trace() / count).sqrt(), turned: None, placed: None }
}
