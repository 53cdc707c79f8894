//! How far an estimate is from the truth, and how well it predicts.

use nalgebra::{DMatrix, Point3};
use serde::{Deserialize, Serialize};

use crate::{
    estimation::Belief,
    kinematics::{Chain, Joint, TangentLayout},
};

/// The metrics of one learner after one step. What needs the truth is null where none is known.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "app", derive(utoipa::ToSchema))]
pub struct Metrics {
    /// Mean over pairs i<j of learned revolute joints of |∠(ŵᵢ, ŵⱼ) − ∠(wᵢ, wⱼ)|, degrees: the paper's measure.
    pub orientation_deg: Option<f64>,
    /// Mean angle between estimated and true direction, signed, degrees.
    pub axis_deg: Option<f64>,
    /// Mean distance of each true axis point to the estimated line, learned revolute joints, metres.
    pub location_m: Option<f64>,
    /// Root mean square of the distance between predicted and true (or held-out measured) marker, metres.
    pub prediction_m: Option<f64>,
    /// Mean of that distance, metres.
    pub prediction_mean_m: Option<f64>,
    /// The prediction error that the learner itself expects over its workspace: mean of √tr(H P Hᵀ), metres.
    pub expected_prediction_m: Option<f64>,
    /// tr(W P), in the units of the criterion.
    pub trace: Option<f64>,
    /// Normalised innovation squared of the last update.
    pub nis: Option<f64>,
    /// Its degrees of freedom.
    pub nis_dof: Option<usize>,
    /// Normalised estimation error squared, eᵀP⁻¹e in tangent coordinates.
    pub nees: Option<f64>,
    /// Its degrees of freedom.
    pub nees_dof: Option<usize>,
    /// Movements made so far.
    pub movements: u64,
    /// Movements after which the marker was not seen.
    pub misses: u64,
    /// The learner's own verdict: its expected prediction error has been below the scenario's target for 5 steps.
    pub settled: bool,
}

/// Mean absolute difference of the angles between axes, over pairs of learned revolute joints, degrees.
pub fn orientation_deg(estimate: &Chain, truth: &Chain, layout: &TangentLayout) -> Option<f64> {
    let pairs = learned_revolute(estimate, truth, layout);
    let angle = |a: &Joint, b: &Joint| a.direction().angle(&b.direction()).to_degrees();
    let differences = (0..pairs.len()).flat_map(|j| (0..j).map(move |i| (i, j))).map(|(i, j)| {
        let ((estimate_i, truth_i), (estimate_j, truth_j)) = (pairs[i], pairs[j]);
        (angle(estimate_i, estimate_j) - angle(truth_i, truth_j)).abs()
    });
    mean(differences)
}

/// Mean angle between estimated and true directions of all learned joints, degrees.
pub fn axis_deg(estimate: &Chain, truth: &Chain, layout: &TangentLayout) -> Option<f64> {
    let learned = (0..layout.joints()).filter(|&index| layout.is_learned(index));
    mean(learned.map(|index| {
        let (estimate, truth) = (&estimate.joints[index], &truth.joints[index]);
        estimate.direction().angle(&truth.direction()).to_degrees()
    }))
}

/// Mean distance of the true axis points to the estimated lines of learned revolute joints, metres.
pub fn location_m(estimate: &Chain, truth: &Chain, layout: &TangentLayout) -> Option<f64> {
    mean(
        learned_revolute(estimate, truth, layout)
            .into_iter()
            .filter_map(|(estimate, truth)| Some(estimate.line()?.distance_to(&truth.line()?.point))),
    )
}

/// Normalised estimation error squared of a belief; `None` without a covariance, or with the truth out of its chart.
pub fn nees(belief: &Belief, truth: &Chain) -> Option<f64> {
    let covariance: &DMatrix<f64> = belief.covariance.as_ref()?;
    let error = belief.chain.local(&belief.layout, truth)?;
    Some(error.dot(&covariance.clone().cholesky()?.solve(&error)))
}

/// The configurations over which prediction is judged, and where the marker is there.
#[derive(Clone, Debug)]
pub struct Evaluation {
    /// Joint positions and the true, noise-free marker; or held-out measurements.
    pub targets: Vec<(Vec<f64>, Point3<f64>)>,
}

impl Evaluation {
    /// Root mean square and mean of the distances between predicted and true marker, metres.
    pub fn prediction_m(&self, estimate: &Chain) -> Option<(f64, f64)> {
        let distances = || self.targets.iter().map(|(theta, marker)| (estimate.marker_at(theta) - marker).norm());
        Some((mean(distances().map(|d| d * d))?.sqrt(), mean(distances())?))
    }
}

fn learned_revolute<'a>(estimate: &'a Chain, truth: &'a Chain, layout: &TangentLayout) -> Vec<(&'a Joint, &'a Joint)> {
    (0..layout.joints())
        .filter(|&index| layout.point(index).is_some())
        .map(|index| (&estimate.joints[index], &truth.joints[index]))
        .collect()
}

fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (count, sum) = values.fold((0_usize, 0.0), |(count, sum), value| (count + 1, sum + value));
    (count > 0).then(|| sum / count as f64)
}

#[cfg(test)]
mod tests {
    use nalgebra::{UnitVector3, Vector3};

    use super::*;
    use crate::kinematics::Line;

    fn line(direction: [f64; 3], point: [f64; 3]) -> Joint {
        let direction = UnitVector3::new_normalize(Vector3::from(direction));
        Joint::Revolute(Line { point: point.into(), direction })
    }

    #[test]
    fn metrics_of_a_chain_worked_by_hand() {
        let truth = Chain {
            joints: vec![line([0., 0., 1.], [0., 0., 0.]), line([1., 0., 0.], [0., 0., 1.])],
            marker: Point3::new(0., 0., 2.),
        };
        // The second axis tilted by 30 deg towards the first and shifted by 0.1 m; the first flipped.
        let half = 30_f64.to_radians();
        let estimate = Chain {
            joints: vec![line([0., 0., -1.], [0., 0., 5.]), line([half.cos(), 0., half.sin()], [7., 0.1, 1.])],
            marker: truth.marker,
        };
        let layout = TangentLayout::new(&truth.joints, &[], false);
        // ∠ true 90 deg; ∠ estimated between −z and the tilted axis: 120 deg.
        assert!((orientation_deg(&estimate, &truth, &layout).expect("a pair") - 30.0).abs() < 1e-9);
        assert!((axis_deg(&estimate, &truth, &layout).expect("joints") - (180.0 + 30.0) / 2.0).abs() < 1e-9);
        // The first line still contains the true point; the second passes (0,0,1) at √(0.1² + (7 sin 30)²).
        let expected = (0.01_f64 + 3.5 * 3.5).sqrt() / 2.0;
        assert!((location_m(&estimate, &truth, &layout).expect("lines") - expected).abs() < 1e-9);
        assert_eq!(orientation_deg(&truth, &truth, &layout), Some(0.0));
        let known = TangentLayout::new(&truth.joints, &[false, false], true);
        assert_eq!(location_m(&estimate, &truth, &known), None);
    }
}
