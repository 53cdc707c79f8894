//! The uncertainty of the calibrated robot's size, which a scatter in sockets does not show.
//!
//! With pᵢ the predicted targets at postures all over the joint limits, c their mean and Jᵢ = ∂pᵢ/∂δ, the similarity that fits moved
//! predictions pᵢ + Jᵢ δ best has, to first order, the scale
//!
//! ```text
//! s = 1 + g δ,    g = Σ (pᵢ − c)ᵀ Jᵢ / Σ ‖pᵢ − c‖²
//! ```
//!
//! whatever rigid motion goes with it, so that where the robot stands does not enter. A span of 1 m is then uncertain by √(g P gᵀ)
//! metres, with P the posterior covariance. The model error is not included.

use nalgebra::{DMatrix, DVector, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::{Case, Fit};
use body_schema_engine::model::{Layout, State, Workspace, prediction_jacobian};

/// The number of postures, uniform in the joint limits.
const POSTURES: usize = 300;

impl Case<'_> {
    /// The posterior standard deviation of a span of 1 m over the joint limits, millimetres.
    pub(super) fn span_sd_mm(&self, fit: &Fit) -> Option<f64> {
        // What is told of a table depends on no seed.
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let workspace = Workspace::from((0..POSTURES).map(|_| self.draw(&mut rng)).collect::<Vec<_>>());
        let covariance = fit.belief.covariance.as_ref()?;
        let slope = scale(fit.state(), &fit.belief.layout, &workspace);
        Some(deviation(&slope, covariance) * 1e3)
    }
}

/// √(g P gᵀ).
fn deviation(slope: &DVector<f64>, covariance: &DMatrix<f64>) -> f64 {
    slope.dot(&(covariance * slope)).max(0.0).sqrt()
}

/// gᵀ: the derivative of the scale of the predictions over a workspace by the parameters.
fn scale(state: &State, layout: &Layout, workspace: &Workspace) -> DVector<f64> {
    let points = workspace.points(state);
    let centre = points.iter().map(|point| point.coords).sum::<Vector3<f64>>() / points.len().max(1) as f64;
    let (mut slope, mut squares) = (DVector::zeros(layout.dimension()), 0.0);
    for (theta, point) in workspace.configurations.iter().zip(&points) {
        let away = point.coords - centre;
        slope += prediction_jacobian(state, layout, theta).1.tr_mul(&away);
        squares += away.norm_squared();
    }
    if squares > 0.0 { slope / squares } else { slope }
}

#[cfg(test)]
mod tests {
    use rand::RngExt;

    use super::*;
    use body_schema_engine::model::{Block, random::random_arm};

    fn case() -> (State, Layout, Workspace) {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let state = random_arm(&mut rng, 4);
        let layout = Layout::new(&state, (0..4).map(Block::Axis).chain([Block::Base, Block::Target(0)]));
        // How far a joint slides is read in metres, and does not grow with the robot.
        let turns: Vec<bool> = state.joints.iter().map(|joint| joint.line().is_some()).collect();
        let mut draw = || turns.iter().map(|turns| if *turns { rng.random_range(-2.0..2.0) } else { 0.0 }).collect();
        let postures: Vec<Vec<f64>> = (0..40).map(|_| draw()).collect();
        (state, layout, Workspace::from(postures))
    }

    /// A robot that is everywhere larger by a part in a million is so much larger, and one that stands elsewhere is not.
    #[test]
    fn the_scale_of_a_robot_is_found_wherever_it_stands() {
        let (state, layout, workspace) = case();
        let slope = scale(&state, &layout, &workspace);
        let mut larger = state.clone();
        for (block, _) in layout.blocks() {
            let grown = match block.of(&state) {
                body_schema_engine::model::Element::Point(point) => {
                    body_schema_engine::model::Element::Point(point * (1.0 + 1e-6))
                }
                body_schema_engine::model::Element::Axis(body_schema_engine::kinematics::Joint::Revolute(mut line)) => {
                    line.point *= 1.0 + 1e-6;
                    body_schema_engine::model::Element::Axis(body_schema_engine::kinematics::Joint::Revolute(line))
                }
                other => other,
            };
            block.put(&mut larger, grown);
        }
        let delta = state.local(&layout, &larger).expect("near");
        assert!((slope.dot(&delta) / 1e-6 - 1.0).abs() < 1e-3, "{}", slope.dot(&delta));
        let base = layout.block(Block::Base).expect("learned");
        assert!(slope.rows_range(base).amax() < 1e-12, "where it stands does not enter");
    }

    #[test]
    fn the_deviation_is_that_of_one_direction() {
        let slope = DVector::from_vec(vec![3.0, 4.0]);
        assert_eq!(deviation(&slope, &DMatrix::from_row_slice(2, 2, &[1.0, 0.0, 0.0, 1.0])), 5.0);
        assert_eq!(deviation(&slope, &DMatrix::from_row_slice(2, 2, &[16.0, -12.0, -12.0, 9.0])), 0.0);
    }
}
