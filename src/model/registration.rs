//! A robot carried into the frame of measurements.
//!
//! A robot description gives axes in the robot's own base frame, and a tracker measures in its own; neither the pose of
//! one in the other nor, often, the place of the marker on the hand is known. From pairs (θₖ, yₖ) the fit minimises
//!
//! ```text
//! Σₖ ‖ R p(θₖ; m) + t − yₖ ‖²        over R ∈ SO(3), t ∈ ℝ³ and, if it is not known, the marker m ∈ ℝ³ at θ = 0
//! ```
//!
//! Given R, it is linear in (t, Rm); given m, it is the absolute orientation problem (Arun, Huang, Blostein 1987).
//! The two alternate from the 24 rotations of the cube, and Levenberg–Marquardt finishes from the best.
//!
//! How well the motion determines the fit is told by the rank of its Jacobian, whose columns are scaled to one length,
//! and by the covariance s²(JᵀJ)⁻¹, s² being the variance of the residuals per degree of freedom.

use nalgebra::{
    Cholesky, DMatrix, DVector, Isometry3, Matrix3, Matrix6, Point3, Rotation3, SVD, Translation3, UnitQuaternion,
    Vector3, Vector6,
};

use super::{Block, Layout, State, jacobian, rank};

/// The result of a rigid fit.
#[derive(Clone, Debug)]
pub struct Registration {
    /// The robot with its base, and its marker if that was fitted.
    pub state: State,
    /// Base and, if it was fitted, marker.
    pub layout: Layout,
    /// Root mean square of the residual distances, metres.
    pub rms_m: f64,
    /// Directions of these parameters that the measurements determine; all of them.
    pub rank: usize,
    /// Covariance of these parameters in tangent coordinates.
    pub covariance: DMatrix<f64>,
}

/// Why a robot could not be registered.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RegistrationError {
    /// Six unknowns, or nine, need measurements in general position, and a margin.
    #[error("a rigid fit of {unknowns} unknowns needs at least 4 measurements, {given} given")]
    TooFew {
        /// Parameters.
        unknowns: usize,
        /// Measurements.
        given: usize,
    },
    /// The measurements do not determine the frame and the marker.
    #[error(
        "the measurements determine only {rank} of {unknowns} parameters of base frame and marker: move more joints \
         between them"
    )]
    Degenerate {
        /// Directions that are determined.
        rank: usize,
        /// Parameters.
        unknowns: usize,
    },
    /// The search did not come to rest.
    #[error("the rigid fit did not converge in {0} steps")]
    NotConverged(usize),
}

const STEPS: usize = 200;

/// Fits the base of `state`, and its marker if `fit_marker`, to pairs of joint positions and measured marker positions.
pub fn register(
    state: &State,
    data: &[(Vec<f64>, Point3<f64>)],
    fit_marker: bool,
) -> Result<Registration, RegistrationError> {
    let layout = Layout::new(state, [Block::Base].into_iter().chain(fit_marker.then_some(Block::Target(0))));
    let unknowns = layout.dimension();
    if data.len() < 4 {
        return Err(RegistrationError::TooFew { unknowns, given: data.len() });
    }
    let degenerate = |rank| RegistrationError::Degenerate { rank, unknowns };
    let start = start(state, data, fit_marker).ok_or_else(|| degenerate(0))?;
    let fit = Fit { layout: &layout, data };
    let (state, residuals, h) = fit.descend(start)?;
    let rank = rank(&h);
    if rank < unknowns {
        return Err(degenerate(rank));
    }
    let cost = residuals.norm_squared();
    let freedom = (residuals.len() - unknowns).max(1) as f64;
    let covariance = Cholesky::new(h.transpose() * &h).ok_or_else(|| degenerate(rank))?.inverse() * (cost / freedom);
    let rms_m = (cost / data.len() as f64).sqrt();
    Ok(Registration { state, layout, rms_m, rank, covariance })
}

impl Registration {
    /// The robot in the frame of the measurements, its base the identity, and what the fit leaves unsure of the
    /// parameters in `layout` there: `J Σ Jᵀ` (m × m), with J by central differences.
    pub fn carried(&self, layout: &Layout) -> (State, DMatrix<f64>) {
        let carried = self.state.measured().into_owned();
        let mut spread = DMatrix::zeros(layout.dimension(), self.layout.dimension());
        let step = 1e-6;
        for k in 0..self.layout.dimension() {
            let moved = |sign: f64| {
                let mut delta = DVector::zeros(self.layout.dimension());
                delta[k] = sign * step;
                let moved = self.state.retract(&self.layout, &delta);
                carried.local(layout, &moved.measured().slid_towards(&carried))
            };
            if let (Some(above), Some(below)) = (moved(1.0), moved(-1.0)) {
                spread.set_column(k, &((above - below) / (2.0 * step)));
            }
        }
        let covariance = &spread * &self.covariance * spread.transpose();
        (carried, (&covariance + covariance.transpose()) * 0.5)
    }
}

struct Fit<'a> {
    layout: &'a Layout,
    data: &'a [(Vec<f64>, Point3<f64>)],
}

impl Fit<'_> {
    fn linearised(&self, state: &State) -> (DVector<f64>, DMatrix<f64>) {
        let mut residuals = DVector::zeros(3 * self.data.len());
        let mut stacked = DMatrix::zeros(3 * self.data.len(), self.layout.dimension());
        for (k, (theta, y)) in self.data.iter().enumerate() {
            let (predicted, h) = jacobian(state, self.layout, theta);
            residuals.fixed_rows_mut::<3>(3 * k).copy_from(&(y - predicted));
            stacked.fixed_rows_mut::<3>(3 * k).copy_from(&h);
        }
        (residuals, stacked)
    }

    /// Levenberg–Marquardt; at rest where a step promises less than rounding.
    fn descend(&self, mut state: State) -> Result<(State, DVector<f64>, DMatrix<f64>), RegistrationError> {
        let (mut residuals, mut h) = self.linearised(&state);
        let mut lambda = 1e-6;
        for _ in 0..STEPS {
            let information = h.transpose() * &h;
            let descent = h.transpose() * &residuals;
            let mut damped = information.clone();
            let floor = information.diagonal().amax() * 1e-12;
            (0..damped.nrows()).for_each(|k| damped[(k, k)] += lambda * damped[(k, k)].max(floor));
            let Some(step) = Cholesky::new(damped).map(|cholesky| cholesky.solve(&descent)) else {
                lambda = (lambda * 10.0).max(1e-9);
                continue;
            };
            let promised = step.dot(&descent);
            if promised <= 1e-14 * (residuals.norm_squared() + 1e-12) {
                return Ok((state, residuals, h));
            }
            let next = state.retract(self.layout, &step);
            let (next_residuals, next_h) = self.linearised(&next);
            if next_residuals.norm_squared() < residuals.norm_squared() {
                (state, residuals, h) = (next, next_residuals, next_h);
                lambda *= 0.1;
            } else if lambda > 1e9 {
                // No step lowers the cost any more: rounding.
                return Ok((state, residuals, h));
            } else {
                lambda = (lambda * 10.0).max(1e-9);
            }
        }
        Err(RegistrationError::NotConverged(STEPS))
    }
}

/// A base and a marker near the best.
fn start(state: &State, data: &[(Vec<f64>, Point3<f64>)], fit_marker: bool) -> Option<State> {
    let at_origin = State { base: Isometry3::identity(), ..state.clone() };
    let link = at_origin.targets.first()?.link;
    let motions = data.iter().map(|(theta, _)| at_origin.links(theta)[link]).collect();
    let targets = data.iter().map(|(_, y)| y.coords).collect();
    let alternation = Alternation { motions, targets };
    if !fit_marker {
        let base = alternation.base_given_marker(&at_origin.marker().coords)?;
        return Some(State { base, ..at_origin });
    }
    let found = cube_rotations().into_iter().filter_map(|start| alternation.run(start));
    let (base, marker, _) = found.min_by(|a, b| a.2.total_cmp(&b.2))?;
    Some(State { base, ..at_origin }.with_marker(Point3::from(marker)))
}

/// Block coordinate descent in base and marker.
struct Alternation {
    motions: Vec<Isometry3<f64>>,
    targets: Vec<Vector3<f64>>,
}

impl Alternation {
    fn cost(&self, base: &Isometry3<f64>, marker: &Vector3<f64>) -> f64 {
        let predicted = self.motions.iter().map(|motion| (base * motion * Point3::from(*marker)).coords);
        self.targets.iter().zip(predicted).map(|(y, predicted)| (y - predicted).norm_squared()).sum()
    }

    /// Descends from a rotation; base, marker and their cost, a finite number.
    fn run(&self, start: Rotation3<f64>) -> Option<(Isometry3<f64>, Vector3<f64>, f64)> {
        let mut rotation = start;
        let mut found = None;
        for _ in 0..60 {
            let marker = self.marker_given_rotation(&rotation)?;
            let base = self.base_given_marker(&marker)?;
            rotation = base.rotation.to_rotation_matrix();
            found = Some((base, marker));
        }
        let (base, marker) = found?;
        let cost = self.cost(&base, &marker);
        cost.is_finite().then_some((base, marker, cost))
    }

    /// Least squares in (m, t) for R Aₖ m + t = yₖ − R bₖ.
    fn marker_given_rotation(&self, rotation: &Rotation3<f64>) -> Option<Vector3<f64>> {
        let mut normal = Matrix6::<f64>::zeros();
        let mut right = Vector6::<f64>::zeros();
        for (motion, y) in self.motions.iter().zip(&self.targets) {
            let a: Matrix3<f64> = (rotation * motion.rotation.to_rotation_matrix()).into_inner();
            let target = y - rotation * motion.translation.vector;
            let mut row = nalgebra::Matrix3x6::<f64>::zeros();
            row.fixed_view_mut::<3, 3>(0, 0).copy_from(&a);
            row.fixed_view_mut::<3, 3>(0, 3).copy_from(&Matrix3::identity());
            normal += row.transpose() * row;
            right += row.transpose() * target;
        }
        // A little damping, so that what the motion leaves free stays small instead of failing.
        let damping = 1e-9 * normal.diagonal().amax();
        (0..6).for_each(|k| normal[(k, k)] += damping);
        normal.cholesky().map(|cholesky| cholesky.solve(&right).fixed_rows::<3>(0).into_owned())
    }

    /// Absolute orientation of the points p(θₖ; m) onto yₖ.
    fn base_given_marker(&self, marker: &Vector3<f64>) -> Option<Isometry3<f64>> {
        let points: Vec<Vector3<f64>> = self.motions.iter().map(|t| (t * Point3::from(*marker)).coords).collect();
        let count = points.len() as f64;
        let centre = points.iter().sum::<Vector3<f64>>() / count;
        let target_centre = self.targets.iter().sum::<Vector3<f64>>() / count;
        let spread: Matrix3<f64> =
            points.iter().zip(&self.targets).map(|(p, y)| (y - target_centre) * (p - centre).transpose()).sum();
        let svd = SVD::new(spread, true, true);
        let (u, vt) = (svd.u?, svd.v_t?);
        let mirror = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, (u * vt).determinant().signum()));
        let rotation = Rotation3::from_matrix_unchecked(u * mirror * vt);
        let translation = target_centre - rotation * centre;
        Some(Isometry3::from_parts(Translation3::from(translation), UnitQuaternion::from_rotation_matrix(&rotation)))
    }
}

/// The 24 rotations that carry a cube into itself.
fn cube_rotations() -> Vec<Rotation3<f64>> {
    let axes = [Vector3::x(), Vector3::y(), Vector3::z(), -Vector3::x(), -Vector3::y(), -Vector3::z()];
    let mut rotations = Vec::with_capacity(24);
    for x in &axes {
        for y in axes.iter().filter(|y| x.dot(y) == 0.0) {
            rotations.push(Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[*x, *y, x.cross(y)])));
        }
    }
    rotations
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::laws::random_arm;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    type Case = (State, State, Vec<(Vec<f64>, Point3<f64>)>);

    /// The nominal robot, the truth, and what was measured.
    fn case(seed: u64, moving: &[usize], sigma: f64) -> Case {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let nominal = random_arm(&mut rng, 7);
        let base = Isometry3::new(Vector3::new(0.5, -1.0, 0.3), Vector3::from_fn(|_, _| rng.random_range(-3.0..3.0)));
        let truth = State { base, ..nominal.clone() };
        let data = (0..20)
            .map(|_| {
                let mut theta = vec![0.3; 7];
                moving.iter().for_each(|k| theta[*k] = rng.random_range(-1.0..1.0));
                let y = truth.marker_at(&theta) + Vector3::from_fn(|_, _| sigma * rng.sample::<f64, _>(StandardNormal));
                (theta, y)
            })
            .collect();
        (nominal, truth, data)
    }

    #[test]
    fn recovers_a_known_frame_and_marker_without_noise() {
        for seed in 0..10 {
            let (nominal, truth, data) = case(seed, &[0, 1, 2, 3, 4, 5, 6], 0.0);
            let fit = register(&nominal.clone().with_marker(Point3::origin()), &data, true).expect("determined");
            assert!(fit.rms_m < 1e-9, "seed {seed}: {}", fit.rms_m);
            assert!((fit.state.marker() - truth.marker()).norm() < 1e-7, "seed {seed}");
            assert_eq!(fit.rank, 9);
            let known = register(&nominal, &data, false).expect("determined");
            assert_eq!((known.rank, known.state.marker()), (6, truth.marker()), "a known marker stays");
            assert!(known.rms_m < 1e-9);
        }
    }

    /// Over many fits the error is what the covariance says, also where the motion is nearly degenerate.
    #[test]
    fn the_covariance_covers_the_error_even_of_poor_motion() {
        let (mut total, mut count) = (0.0, 0);
        for seed in 0..60 {
            let (nominal, truth, mut data) = case(seed, &[0, 1, 2, 3, 4, 5, 6], 1e-3);
            // Excursions of a few degrees.
            let amplitude = if seed % 2 == 0 { 0.05 } else { 1.0 };
            let mut rng = ChaCha8Rng::seed_from_u64(1000 + seed);
            for (theta, y) in &mut data {
                theta.iter_mut().for_each(|angle| *angle *= amplitude);
                *y = truth.marker_at(theta) + Vector3::from_fn(|_, _| 1e-3 * rng.sample::<f64, _>(StandardNormal));
            }
            let Ok(fit) = register(&nominal.clone().with_marker(Point3::origin()), &data, true) else { continue };
            let error = fit.state.local(&fit.layout, &truth).expect("poses");
            let covariance = fit.covariance.clone().cholesky().expect("positive");
            // Far outside the linear range a Gaussian says nothing; the deviation says that.
            if fit.covariance.diagonal().amax().sqrt() < 0.2 {
                total += error.dot(&covariance.solve(&error));
                count += 1;
            }
        }
        let mean = total / f64::from(count);
        assert!(count >= 30 && (5.0..16.0).contains(&mean), "{mean} over {count}, 9 expected");
    }

    #[test]
    fn says_when_there_is_too_little_to_fit() {
        let (nominal, _, data) = case(1, &[0, 1, 2], 0.0);
        let row = data[0].clone();
        assert!(matches!(
            register(&nominal, std::slice::from_ref(&row), true),
            Err(RegistrationError::TooFew { given: 1, .. })
        ));
        assert!(matches!(register(&nominal, &vec![row; 6], true), Err(RegistrationError::Degenerate { .. })));
    }

    /// One revolute joint: the hand moves on a circle, and neither the marker nor the base is determined.
    #[test]
    fn a_motion_that_determines_too_little_is_no_success() {
        for seed in 0..10 {
            let (nominal, _, data) = case(seed, &[3], 1e-3);
            let found = register(&nominal, &data, true);
            assert!(matches!(found, Err(RegistrationError::Degenerate { rank, unknowns: 9 }) if rank < 9), "{found:?}");
        }
    }
}
