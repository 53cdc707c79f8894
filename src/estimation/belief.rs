//! An estimated chain and its covariance.

use std::sync::Arc;

use nalgebra::{DMatrix, Matrix2, Matrix3, Matrix3x2};

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
    /// Other chains that explain what was seen, the likeliest first; empty if the estimator keeps one hypothesis.
    pub alternatives: Vec<Alternative>,
}

/// A rival of the estimate: another mode of the posterior.
#[derive(Clone, Debug)]
pub struct Alternative {
    /// Its probability. The estimate's own is what all alternatives leave of 1.
    pub weight: f64,
    /// The chain.
    pub chain: Chain,
    /// Its covariance, in the chart at it.
    pub covariance: DMatrix<f64>,
}

impl Belief {
    /// The probability of the estimate, as against its alternatives.
    pub fn weight(&self) -> f64 {
        1.0 - self.alternatives.iter().map(|alternative| alternative.weight).sum::<f64>()
    }

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

    /// The covariance (m², measurement frame) of the point of a joint's axis that lies `along` metres from the pivot:
    /// rank 2, flat along the axis. To first order that point moves by B (a + along · d).
    pub fn point_covariance(&self, joint: usize, along: f64) -> Option<Matrix3<f64>> {
        let (point, direction) = (self.layout.point(joint)?.start, self.layout.direction(joint)?.start);
        let covariance = self.covariance.as_ref()?;
        let block = |row, column| covariance.fixed_view::<2, 2>(row, column).into_owned();
        let cross: Matrix2<f64> = block(point, direction);
        self.embedded(
            joint,
            block(point, point) + (cross + cross.transpose()) * along + block(direction, direction) * (along * along),
        )
    }

    /// The covariance of a joint's axis direction (rad², measurement frame): rank 2, flat along the axis.
    pub fn direction_covariance(&self, joint: usize) -> Option<Matrix3<f64>> {
        let start = self.layout.direction(joint)?.start;
        self.embedded(joint, self.covariance.as_ref()?.fixed_view::<2, 2>(start, start).into_owned())
    }

    /// The covariance of the marker p₀ (m²), if it is learned.
    pub fn hand_marker_covariance(&self) -> Option<Matrix3<f64>> {
        let start = self.layout.marker()?.start;
        Some(self.covariance.as_ref()?.fixed_view::<3, 3>(start, start).into_owned())
    }

    fn embedded(&self, joint: usize, block: Matrix2<f64>) -> Option<Matrix3<f64>> {
        let basis: Matrix3x2<f64> = chart::basis(&self.chain.joints.get(joint)?.direction());
        Some(basis * block * basis.transpose())
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::kinematics::{Joint, laws::random_chain};

    /// The covariance of a point away from the pivot, against the derivative of that point of the retracted line.
    #[test]
    fn the_covariance_of_a_slid_point_follows_the_line() {
        for seed in 0..20 {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let chain = random_chain(&mut rng, 5);
            let layout = Arc::new(TangentLayout::new(&chain.joints, &[], false));
            let m = layout.dimension();
            let root = DMatrix::from_fn(m, m, |_, _| rng.random_range(-0.5..0.5));
            let covariance = &root * root.transpose();
            let along = rng.random_range(-0.8..0.8);
            let belief =
                Belief { chain, layout, covariance: Some(covariance.clone()), noise_m2: 1.0, alternatives: Vec::new() };
            for (index, joint) in belief.chain.joints.iter().enumerate() {
                let Joint::Revolute(line) = joint else {
                    assert!(belief.point_covariance(index, along).is_none());
                    continue;
                };
                let moved = |k: usize, step: f64| {
                    let mut delta = nalgebra::DVector::zeros(m);
                    delta[k] = step;
                    let retracted = belief.chain.retract(&belief.layout, &delta).joints[index];
                    let retracted = retracted.line().map(|line| line.slid(along).point);
                    retracted.unwrap_or(line.point).coords
                };
                let columns: Vec<_> = (0..m).map(|k| (moved(k, 1e-6) - moved(k, -1e-6)) / 2e-6).collect();
                let derivative = nalgebra::Matrix3xX::from_columns(&columns);
                let expected = &derivative * &covariance * derivative.transpose();
                let found = belief.point_covariance(index, along).expect("a revolute joint");
                assert!((expected - found).amax() < 1e-6, "seed {seed}, joint {index}");
            }
        }
    }
}
