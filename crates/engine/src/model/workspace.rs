//! The workspace: the configurations over which predictions of the hand count.
//!
//! Measurements may leave open where the whole robot stands (a camera on the hand that sees a board at an unknown place). Then only the
//! shape of what is predicted counts, and errors are taken after the rigid motion that fits best. To first order this removes from every
//! column of the stacked Jacobian the part that one rigid motion of all predicted points explains: J − Q Qᵀ J, with Q an orthonormal
//! basis of the six motions.
//!
//! Or only the scatter of the hand counts over several postures in which it is at one place, wherever that is (a ball in a socket). Then
//! errors are taken from their mean over the postures of the place: Jᵢ − J̄, with J̄ the mean over those. An error that makes the robot
//! larger everywhere causes no such scatter.

use std::{collections::BTreeMap, ops::SubAssign};

use nalgebra::{DMatrix, Isometry3, Matrix3, Point3, Rotation3, SVD, Translation3, UnitQuaternion, Vector3};

use super::{Layout, Links, State, prediction_jacobian, singular};

/// Configurations, and how errors over them are measured.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Workspace {
    /// Joint positions, rad or m.
    pub configurations: Vec<Vec<f64>>,
    /// Whether errors are taken after the rigid motion that fits best.
    pub up_to_motion: bool,
    /// The number of each configuration's place, where errors are taken from their mean over one place; empty otherwise.
    pub places: Vec<usize>,
}

impl From<Vec<Vec<f64>>> for Workspace {
    fn from(configurations: Vec<Vec<f64>>) -> Self {
        Self { configurations, ..Self::default() }
    }
}

impl Workspace {
    /// A workspace of postures, each with the number of its place, where errors are taken from their mean over each place. A place
    /// with a single posture leaves nothing to compare.
    pub fn at_places<'a>(postures: impl IntoIterator<Item = (usize, &'a [f64])>) -> Self {
        let postures: Vec<(usize, &[f64])> = postures.into_iter().collect();
        let mut counts: BTreeMap<usize, usize> = BTreeMap::new();
        postures.iter().for_each(|(place, _)| *counts.entry(*place).or_default() += 1);
        let compared = postures.into_iter().filter(|(place, _)| counts[place] > 1);
        let (places, configurations) = compared.map(|(place, posture)| (place, posture.to_vec())).unzip();
        Self { configurations, places, up_to_motion: false }
    }

    /// The predicted hand at every configuration, metres.
    pub fn points(&self, state: &State) -> Vec<Point3<f64>> {
        let mut links = Links::new(state);
        self.configurations.iter().map(|theta| links.at(theta).predicted()).collect()
    }

    /// Whether only the scatter over postures at one place counts.
    fn meets_itself(&self) -> bool {
        !self.places.is_empty()
    }

    /// The stacked Jacobians (3N × m) of the predicted hand, without what a rigid motion of all explains if that does not
    /// count, or without their mean over each place.
    pub fn jacobian(&self, state: &State, layout: &Layout) -> DMatrix<f64> {
        let count = self.configurations.len();
        let up_to_motion = self.up_to_motion && !self.meets_itself();
        let mut stacked = DMatrix::zeros(3 * count, layout.dimension());
        let mut motions = DMatrix::zeros(if up_to_motion { 3 * count } else { 0 }, 6);
        for (index, theta) in self.configurations.iter().enumerate() {
            let (point, h) = prediction_jacobian(state, layout, theta);
            stacked.rows_mut(3 * index, 3).copy_from(&h);
            if up_to_motion {
                let mut motion = motions.rows_mut(3 * index, 3);
                motion.columns_mut(0, 3).copy_from(&Matrix3::identity());
                motion.columns_mut(3, 3).copy_from(&-point.coords.cross_matrix());
            }
        }
        for indices in self.by_place() {
            let mut mean = DMatrix::zeros(3, layout.dimension());
            indices.iter().for_each(|index| mean += stacked.rows(3 * index, 3));
            mean /= indices.len() as f64;
            indices.iter().for_each(|index| stacked.rows_mut(3 * index, 3).sub_assign(&mean));
        }
        if up_to_motion && count > 0 {
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

    /// The configurations of each place, by their index; none where places do not count.
    fn by_place(&self) -> impl Iterator<Item = Vec<usize>> {
        let mut places: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        self.places.iter().enumerate().for_each(|(index, place)| places.entry(*place).or_default().push(index));
        places.into_values()
    }

    /// Root mean square and mean of the distances between two states' predictions, metres; `None` without configurations.
    pub fn distance(&self, predicted: &[Point3<f64>], wanted: &[Point3<f64>]) -> Option<(f64, f64)> {
        if predicted.is_empty() || predicted.len() != wanted.len() {
            return None;
        }
        let up_to_motion = self.up_to_motion && !self.meets_itself();
        let motion = if up_to_motion { best_motion(predicted, wanted) } else { Isometry3::identity() };
        let mut errors: Vec<Vector3<f64>> =
            predicted.iter().zip(wanted).map(|(found, wanted)| motion * found - wanted).collect();
        for indices in self.by_place() {
            let mean = indices.iter().map(|index| errors[*index]).sum::<Vector3<f64>>() / indices.len() as f64;
            indices.iter().for_each(|index| errors[*index] -= mean);
        }
        let (mut squares, mut sum) = (0.0, 0.0);
        for error in &errors {
            let distance = error.norm();
            squares += distance * distance;
            sum += distance;
        }
        let count = predicted.len() as f64;
        Some(((squares / count).sqrt(), sum / count))
    }
}

/// The rigid motion that brings points nearest to others in least squares (Kabsch 1976).
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
    use crate::{
        kinematics::JointBox,
        model::{
            Block, Manifold,
            random::{random_arm, random_pose},
        },
    };

    fn case(seed: u64) -> (State, Layout, Workspace) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let state = random_arm(&mut rng, 5);
        let layout = Layout::new(&state, (0..5).map(Block::Axis).chain([Block::Base]));
        let configurations = (0..20).map(|_| (0..5).map(|_| rng.random_range(-2.0..2.0)).collect()).collect();
        (state, layout, Workspace { configurations, up_to_motion: true, places: Vec::new() })
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
    /// Where the hand is at a place in several postures, neither a shift of the whole counts, nor that everything is larger; what is left
    /// is how far the predicted hand scatters there.
    #[test]
    fn a_hand_that_meets_itself_is_blind_to_where_it_is_and_to_its_size() {
        for seed in 1000..1010 {
            let (state, layout, Workspace { configurations: drawn, .. }) = case(seed);
            let limits = JointBox::new(vec![(-3.0, 3.0); 5]).expect("limits");
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let (mut configurations, mut places) = (Vec::new(), Vec::new());
            for (place, theta) in drawn.iter().take(4).enumerate() {
                let manifold = Manifold::new(&state, 0, state.marker_at(theta), &limits);
                configurations.push(theta.clone());
                configurations.extend((0..3).filter_map(|_| manifold.draw(&mut rng)));
                places.resize(configurations.len(), place);
            }
            let points: Vec<Point3<f64>> = configurations.iter().map(|theta| state.marker_at(theta)).collect();
            let workspace = Workspace { configurations, up_to_motion: true, places };
            let jacobian = workspace.jacobian(&state, &layout);
            let base = layout.block(Block::Base).expect("learned");
            assert!(jacobian.columns(base.start, 3).amax() < 1e-9, "shifts do not count");
            let larger: Vec<Point3<f64>> = points.iter().map(|point| point * 1.01).collect();
            assert!(workspace.distance(&larger, &points).expect("points").0 < 1e-9);
            let mut delta = DVector::zeros(layout.dimension());
            delta.rows_mut(6, 8).fill(1e-5);
            let moved = workspace.points(&state.retract(&layout, &delta));
            let (rms, _) = workspace.distance(&moved, &points).expect("points");
            let expected = ((&jacobian * &delta).norm_squared() / points.len() as f64).sqrt();
            assert!((rms - expected).abs() < 1e-2 * expected + 1e-12, "{seed}: {rms} {expected}");
        }
    }
}
