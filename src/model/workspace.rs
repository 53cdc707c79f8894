//! Where predictions count: the configurations over which the hand is predicted.
//!
//! Measurements may leave open where the whole robot stands (a camera on the hand that sees a board at an unknown place). Then
//! only the shape of what is predicted counts, and errors are taken after the rigid motion that fits best. To first order that
//! takes the part of every column of the stacked Jacobian away that one rigid motion of all predicted points explains:
//! J − Q Qᵀ J, with Q an orthonormal basis of the six motions.

use nalgebra::{DMatrix, Isometry3, Matrix3, Point3, Rotation3, SVD, Translation3, UnitQuaternion, Vector3};

use super::{Layout, State, jacobian, singular};

/// Configurations, and what an error there is.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Workspace {
    /// Joint positions, rad or m.
    pub configurations: Vec<Vec<f64>>,
    /// Whether errors are taken after the rigid motion that fits best.
    pub up_to_motion: bool,
}

impl From<Vec<Vec<f64>>> for Workspace {
    fn from(configurations: Vec<Vec<f64>>) -> Self {
        Self { configurations, up_to_motion: false }
    }
}

impl Workspace {
    /// The predicted hand at every configuration, metres.
    pub fn points(&self, state: &State) -> Vec<Point3<f64>> {
        self.configurations.iter().map(|theta| state.marker_at(theta)).collect()
    }

    /// The Jacobians of the predicted hand, one upon the other (3N × m), without what a rigid motion of all explains if that
    /// does not count.
    pub fn jacobian(&self, state: &State, layout: &Layout) -> DMatrix<f64> {
        let count = self.configurations.len();
        let mut stacked = DMatrix::zeros(3 * count, layout.dimension());
        let mut motions = DMatrix::zeros(if self.up_to_motion { 3 * count } else { 0 }, 6);
        for (index, theta) in self.configurations.iter().enumerate() {
            let (point, h) = jacobian(state, layout, theta);
            stacked.rows_mut(3 * index, 3).copy_from(&h);
            if self.up_to_motion {
                let mut motion = motions.rows_mut(3 * index, 3);
                motion.columns_mut(0, 3).copy_from(&Matrix3::identity());
                motion.columns_mut(3, 3).copy_from(&-point.coords.cross_matrix());
            }
        }
        if self.up_to_motion && count > 0 {
            // An orthonormal basis also where the points lie on a line.
            let Some(svd) = singular(motions, true) else { return stacked };
            let greatest = svd.singular_values.amax();
            if let Some(basis) = svd.u {
                for k in (0..basis.ncols()).filter(|k| svd.singular_values[*k] > 1e-9 * greatest) {
                    let axis = basis.column(k);
                    let along = axis.tr_mul(&stacked);
                    stacked.ger(-1.0, &axis, &along.transpose(), 1.0);
                }
            }
        }
        stacked
    }

    /// Root mean square and mean of the distances between two states' predictions, metres; `None` without configurations.
    pub fn distance(&self, predicted: &[Point3<f64>], wanted: &[Point3<f64>]) -> Option<(f64, f64)> {
        if predicted.is_empty() || predicted.len() != wanted.len() {
            return None;
        }
        let motion = if self.up_to_motion { best_motion(predicted, wanted) } else { Isometry3::identity() };
        let (mut squares, mut sum) = (0.0, 0.0);
        for (found, wanted) in predicted.iter().zip(wanted) {
            let distance = (motion * found - wanted).norm();
            squares += distance * distance;
            sum += distance;
        }
        let count = predicted.len() as f64;
        Some(((squares / count).sqrt(), sum / count))
    }
}

/// The rigid motion that brings points nearest to others, in the sum of squares (Kabsch 1976).
pub fn best_motion(from: &[Point3<f64>], to: &[Point3<f64>]) -> Isometry3<f64> {
    let centre = |points: &[Point3<f64>]| {
        points.iter().map(|point| point.coords).sum::<Vector3<f64>>() / points.len().max(1) as f64
    };
    let (a, b) = (centre(from), centre(to));
    let product: Matrix3<f64> = from.iter().zip(to).map(|(p, q)| (q.coords - b) * (p.coords - a).transpose()).sum();
    let svd =
        product.iter().all(|x| x.is_finite()).then(|| SVD::try_new(product, true, true, 5.0 * f64::EPSILON, 10_000));
    let parts = svd.flatten().and_then(|svd| svd.u.zip(svd.v_t));
    let rotation = parts.map_or(Matrix3::identity(), |(u, v_t)| {
        let handed = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, (u * v_t).determinant().signum()));
        u * handed * v_t
    });
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation));
    Isometry3::from_parts(Translation3::from(b - rotation * a), rotation)
}

#[cfg(test)]
mod tests {
    use nalgebra::DVector;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::model::{
        Block,
        laws::{random_arm, random_pose},
    };

    fn case(seed: u64) -> (State, Layout, Workspace) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let state = random_arm(&mut rng, 5);
        let layout = Layout::new(&state, (0..5).map(Block::Axis).chain([Block::Base]));
        let configurations = (0..20).map(|_| (0..5).map(|_| rng.random_range(-2.0..2.0)).collect()).collect();
        (state, layout, Workspace { configurations, up_to_motion: true })
    }

    #[test]
    fn a_motion_of_all_points_is_found() {
        let (state, _, workspace) = case(3);
        let motion = random_pose(&mut ChaCha8Rng::seed_from_u64(8));
        let points = workspace.points(&state);
        let moved: Vec<_> = points.iter().map(|point| motion * point).collect();
        let (rms, mean) = workspace.distance(&points, &moved).expect("points");
        assert!(rms < 1e-9 && mean < 1e-9);
        assert!(Workspace { up_to_motion: false, ..workspace }.distance(&points, &moved).expect("points").1 > 0.1);
    }

    /// Without the base's six columns nothing changes, and what is left is the distance after the best motion.
    #[test]
    fn the_jacobian_forgets_motions_of_the_whole() {
        for seed in 0..10 {
            let (state, layout, workspace) = case(seed);
            let jacobian = workspace.jacobian(&state, &layout);
            let base = layout.block(Block::Base).expect("learned");
            assert!(jacobian.columns(base.start, 6).amax() < 1e-9, "a base that moves moves everything");
            let mut delta = DVector::zeros(layout.dimension());
            delta.rows_mut(6, 8).fill(1e-5);
            let moved = workspace.points(&state.retract(&layout, &delta));
            let (rms, _) = workspace.distance(&moved, &workspace.points(&state)).expect("points");
            let expected = ((&jacobian * &delta).norm_squared() / 20.0).sqrt();
            assert!((rms / expected - 1.0).abs() < 1e-2, "{rms} {expected}");
        }
    }
}
