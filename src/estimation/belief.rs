//! An estimated chain and its covariance.

use std::sync::Arc;

use nalgebra::{DMatrix, Matrix3, Matrix3x2};

use crate::kinematics::{Chain, TangentLayout, chart, jacobian::jacobian};

/// What an estimator believes: a chain, and the covariance of its learned parameters in the chart at that chain.
#[derive(Clone, Debug)]
pub struct Belief {
    /// The estimated chain, the origin of the chart.
    pub chain: Chain,
    /// Which parameters are learned, and their order in the covariance.
    pub layout: Arc<TangentLayout>,
    /// P (m × m), symmetric and positive; m², m rad and rad². `None` for an estimator that keeps none.
    pub covariance: Option<DMatrix<f64>>,
    /// R = r I as the estimator assumes it: r in m². It may differ from the sensor's own.
    pub noise_m2: f64,
}

impl Belief {
    /// The covariance of the predicted marker, `H P Hᵀ` (m²), without the measurement noise.
    pub fn marker_covariance(&self, positions: &[f64]) -> Option<Matrix3<f64>> {
        let covariance = self.covariance.as_ref()?;
        let (_, h) = jacobian(&self.chain, &self.layout, positions);
        let spread = &h * covariance * h.transpose();
        Some(spread.fixed_view::<3, 3>(0, 0).into_owned())
    }

    /// The mean over `configurations` of √tr(H P Hᵀ): the prediction error that the belief itself expects, metres.
    pub fn expected_error_m(&self, configurations: &[Vec<f64>]) -> Option<f64> {
        if configurations.is_empty() {
            return None;
        }
        let sum = configurations
            .iter()
            .map(|theta| self.marker_covariance(theta).map(|spread| spread.trace().max(0.0).sqrt()))
            .sum::<Option<f64>>()?;
        Some(sum / configurations.len() as f64)
    }

    /// The covariance of a joint's axis point (m², measurement frame): rank 2, flat along the axis.
    pub fn point_covariance(&self, joint: usize) -> Option<Matrix3<f64>> {
        self.embedded(joint, self.layout.point(joint)?.start)
    }

    /// The covariance of a joint's axis direction (rad², measurement frame): rank 2, flat along the axis.
    pub fn direction_covariance(&self, joint: usize) -> Option<Matrix3<f64>> {
        self.embedded(joint, self.layout.direction(joint)?.start)
    }

    /// The covariance of the marker p₀ (m²), if it is learned.
    pub fn hand_marker_covariance(&self) -> Option<Matrix3<f64>> {
        let start = self.layout.marker()?.start;
        Some(self.covariance.as_ref()?.fixed_view::<3, 3>(start, start).into_owned())
    }

    fn embedded(&self, joint: usize, start: usize) -> Option<Matrix3<f64>> {
        let block = self.covariance.as_ref()?.fixed_view::<2, 2>(start, start).into_owned();
        let basis: Matrix3x2<f64> = chart::basis(&self.chain.joints.get(joint)?.direction());
        Some(basis * block * basis.transpose())
    }
}
