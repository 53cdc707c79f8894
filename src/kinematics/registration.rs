//! A chain carried into the frame of measurements.
//!
//! A robot description gives axes in the robot's own base frame, and a tracker measures in its own; neither the pose of
//! one in the other nor the place of the marker on the hand is known. From pairs (θₖ, yₖ) the fit minimises
//!
//! ```text
//! Σₖ ‖ R p(θₖ; m) + t − yₖ ‖²        over R ∈ SO(3), t ∈ ℝ³ and the marker m ∈ ℝ³ at θ = 0
//! ```
//!
//! Given R, it is linear in (t, Rm); given m, it is the absolute orientation problem (Arun, Huang, Blostein 1987).
//! The two alternate from the 24 rotations of the cube, and Gauss–Newton finishes from the best.

use nalgebra::{
    DMatrix, DVector, Isometry3, Matrix3, Point3, Rotation3, SVD, Translation3, UnitQuaternion, Vector3, Vector6,
};

use super::Chain;

/// The result of a rigid fit.
#[derive(Clone, Debug)]
pub struct Registration {
    /// The chain with its axes and its marker in the measurement frame.
    pub chain: Chain,
    /// Carries the robot's base frame into the measurement frame.
    pub base: Isometry3<f64>,
    /// Root mean square of the residual distances, metres.
    pub rms_m: f64,
}

/// Why a chain could not be registered.
#[derive(Debug, thiserror::Error)]
pub enum RegistrationError {
    /// Nine unknowns need at least three measurements in general position, and a margin.
    #[error("a rigid fit with an unknown marker needs at least 4 measurements, {0} given")]
    TooFew(usize),
    /// The measurements do not determine the frame and the marker.
    #[error("the measurements do not determine the base frame and the marker: move more joints between them")]
    Degenerate,
}

/// Fits the base frame and the marker of `chain` to the pairs of joint positions and measured marker positions.
pub fn register(chain: &Chain, data: &[(Vec<f64>, Point3<f64>)]) -> Result<Registration, RegistrationError> {
    if data.len() < 4 {
        return Err(RegistrationError::TooFew(data.len()));
    }
    let motions: Vec<Isometry3<f64>> = data
        .iter()
        .map(|(theta, _)| chain.motions(theta).last().copied().unwrap_or_else(Isometry3::identity))
        .collect();
    let targets: Vec<Vector3<f64>> = data.iter().map(|(_, y)| y.coords).collect();
    let fit = Fit { motions, targets };

    let mut best: Option<(f64, Isometry3<f64>, Vector3<f64>)> = None;
    for start in cube_rotations() {
        let Some((base, marker)) = fit.alternate(start) else { continue };
        let cost = fit.cost(&base, &marker);
        if best.as_ref().is_none_or(|(lowest, ..)| cost < *lowest) {
            best = Some((cost, base, marker));
        }
    }
    let (_, base, marker) = best.ok_or(RegistrationError::Degenerate)?;
    let (base, marker) = fit.gauss_newton(base, marker).ok_or(RegistrationError::Degenerate)?;
    let rms_m = (fit.cost(&base, &marker) / data.len() as f64).sqrt();
    let joints = chain.joints.iter().map(|joint| joint.transformed(&base)).collect();
    Ok(Registration { chain: Chain { joints, marker: base * Point3::from(marker) }, base, rms_m })
}

struct Fit {
    motions: Vec<Isometry3<f64>>,
    targets: Vec<Vector3<f64>>,
}

impl Fit {
    fn residual(&self, k: usize, base: &Isometry3<f64>, marker: &Vector3<f64>) -> Vector3<f64> {
        self.targets[k] - (base * self.motions[k] * Point3::from(*marker)).coords
    }

    fn cost(&self, base: &Isometry3<f64>, marker: &Vector3<f64>) -> f64 {
        (0..self.targets.len()).map(|k| self.residual(k, base, marker).norm_squared()).sum()
    }

    /// Block coordinate descent from a rotation.
    fn alternate(&self, start: Rotation3<f64>) -> Option<(Isometry3<f64>, Vector3<f64>)> {
        let mut rotation = start;
        let mut solution = None;
        for _ in 0..60 {
            let marker = self.marker_given_rotation(&rotation)?;
            let base = self.base_given_marker(&marker)?;
            rotation = base.rotation.to_rotation_matrix();
            solution = Some((base, marker));
        }
        solution
    }

    /// Least squares in (m, t) for R Aₖ m + t = yₖ − R bₖ.
    fn marker_given_rotation(&self, rotation: &Rotation3<f64>) -> Option<Vector3<f64>> {
        let mut normal = nalgebra::Matrix6::<f64>::zeros();
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

    /// Nine unknowns: a left turn of the base, its shift, and the marker.
    fn gauss_newton(
        &self,
        mut base: Isometry3<f64>,
        mut marker: Vector3<f64>,
    ) -> Option<(Isometry3<f64>, Vector3<f64>)> {
        for _ in 0..20 {
            let mut normal = DMatrix::<f64>::zeros(9, 9);
            let mut right = DVector::<f64>::zeros(9);
            for (k, motion) in self.motions.iter().enumerate() {
                let turned = base.rotation * (motion * Point3::from(marker)).coords;
                let mut row = DMatrix::<f64>::zeros(3, 9);
                row.fixed_view_mut::<3, 3>(0, 0).copy_from(&-turned.cross_matrix());
                row.fixed_view_mut::<3, 3>(0, 3).copy_from(&Matrix3::identity());
                row.fixed_view_mut::<3, 3>(0, 6)
                    .copy_from((base.rotation * motion.rotation).to_rotation_matrix().matrix());
                normal += row.transpose() * &row;
                right += row.transpose() * self.residual(k, &base, &marker);
            }
            let step = normal.cholesky()?.solve(&right);
            base.rotation = UnitQuaternion::from_scaled_axis(step.fixed_rows::<3>(0).into_owned()) * base.rotation;
            base.translation.vector += step.fixed_rows::<3>(3);
            marker += step.fixed_rows::<3>(6);
            if step.norm() < 1e-13 {
                break;
            }
        }
        (base.translation.vector.iter().chain(marker.iter()).all(|x| x.is_finite())).then_some((base, marker))
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
    use crate::kinematics::laws::random_chain;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn recovers_a_known_frame_and_marker_without_noise() {
        for seed in 0..10 {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let truth = random_chain(&mut rng, 7);
            let base = Isometry3::new(
                Vector3::new(0.5, -1.0, 0.3),
                Vector3::from_fn(|_, _| rng.random_range(-3.0..3.0)), //
            );
            let data: Vec<_> = (0..20)
                .map(|_| {
                    let theta: Vec<f64> = (0..7).map(|_| rng.random_range(-1.0..1.0)).collect();
                    let y = base * truth.marker_at(&theta);
                    (theta, y)
                })
                .collect();
            let nominal = Chain { marker: Point3::origin(), ..truth.clone() };
            let fit = register(&nominal, &data).expect("a determined problem");
            assert!(fit.rms_m < 1e-9, "seed {seed}: {}", fit.rms_m);
            assert!((fit.chain.marker - base * truth.marker).norm() < 1e-7, "seed {seed}");
        }
    }

    #[test]
    fn says_when_there_is_too_little_to_fit() {
        let chain = random_chain(&mut ChaCha8Rng::seed_from_u64(1), 3);
        let row = (vec![0.1, 0.2, 0.3], Point3::new(1.0, 0.0, 0.0));
        assert!(matches!(register(&chain, std::slice::from_ref(&row)), Err(RegistrationError::TooFew(1))));
        assert!(matches!(register(&chain, &vec![row; 6]), Err(RegistrationError::Degenerate)));
    }
}
