//! How far an estimate is from the truth, and how well it predicts.
//!
//! Axes are compared in the frame of the measurements ([`State::measured`]); where the measurements leave a gauge, with the
//! truth moved along it onto the estimate (see [`Gauge`](super::gauge::Gauge)).

use nalgebra::{Point3, Vector3};

use body_schema_engine::{
    kinematics::Joint,
    model::{Layout, Links, State, Workspace},
    sensing::{MeasurementModel, Observation},
};

/// The metrics of one learner after one step. What needs the truth is `None` where none is known.
#[derive(Clone, Debug, Default, PartialEq)]
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
    /// Mean angle between predicted and measured rotations of held-out poses, degrees; `None` where none were measured.
    pub prediction_mean_deg: Option<f64>,
    /// Mean distance between predicted and measured points of held-out pictures, pixels; `None` where there are none.
    pub prediction_mean_px: Option<f64>,
    /// With sockets: mean distance of the predicted target from its mean over the postures that hold it in the same socket, over
    /// sockets that were not trained on, metres; `None` where there are none.
    pub scatter_m: Option<f64>,
    /// The prediction error that the learner itself expects over its workspace: mean of √(tr(H P Hᵀ) + e²), e the model error,
    /// metres.
    pub expected_prediction_m: Option<f64>,
    /// By how much predictions are off that no parameter explains, root mean square, metres; `None` for a learner that takes the noise
    /// for known.
    pub model_error_m: Option<f64>,
    /// tr(W P), in the units of the criterion.
    pub trace: Option<f64>,
    /// Normalised innovation squared of the last update.
    pub nis: Option<f64>,
    /// Its degrees of freedom.
    pub nis_dof: Option<usize>,
    /// Normalised estimation error squared, eᵀP⁻¹e in tangent coordinates, in the subspace that measurements determine.
    pub nees: Option<f64>,
    /// Its degrees of freedom.
    pub nees_dof: Option<usize>,
    /// Movements made so far.
    pub movements: u64,
    /// Movements after which the marker was not seen.
    pub misses: u64,
    /// The learner's own verdict: its expected prediction error has been below the scenario's target for 5 steps.
    pub settled: bool,
    /// tr(W F⁻¹), what prior and data collected so far allow, linearised at the truth (see [`design`](body_schema_engine::design));
    /// since the change of the body, if it changed.
    pub bound_trace: Option<f64>,
    /// How often the learner noticed a change of the body.
    pub changes_noticed: u64,
    /// Every joint of the chain by itself, base first.
    pub joints: Vec<JointMetrics>,
}

/// One joint against the truth; `None` where no truth is known, and for a joint that is not learned.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JointMetrics {
    /// Angle between estimated and true direction, signed, degrees.
    pub axis_deg: Option<f64>,
    /// Distance of the true axis point to the estimated line, metres; `None` for a prismatic joint.
    pub location_m: Option<f64>,
    /// How far this joint's error shows above the noise: with the true arm but for this one joint, which is as
    /// estimated, the root mean square displacement of the marker over the first 50 configurations of the evaluation
    /// set, divided by the standard deviation σ of the sensor per coordinate. At 1 the error is as large as the noise of
    /// one measurement. `None` if the sensor has no noise.
    pub signal_to_noise: Option<f64>,
}

/// Mean absolute difference of the angles between axes, over pairs of learned revolute joints, degrees.
pub fn orientation_deg(estimate: &State, truth: &State, layout: &Layout) -> Option<f64> {
    let pairs = learned_revolute(estimate, truth, layout);
    let angle = |a: &Joint, b: &Joint| a.direction().angle(&b.direction()).to_degrees();
    let differences = (0..pairs.len()).flat_map(|j| (0..j).map(move |i| (i, j))).map(|(i, j)| {
        let ((estimate_i, truth_i), (estimate_j, truth_j)) = (pairs[i], pairs[j]);
        (angle(estimate_i, estimate_j) - angle(truth_i, truth_j)).abs()
    });
    mean(differences)
}

/// Mean angle between estimated and true directions of all learned joints, degrees.
pub fn axis_deg(estimate: &State, truth: &State, layout: &Layout) -> Option<f64> {
    let learned = (0..layout.joints()).filter(|&index| layout.is_learned(index));
    mean(learned.map(|index| {
        let (estimate, truth) = (&estimate.joints[index], &truth.joints[index]);
        estimate.direction().angle(&truth.direction()).to_degrees()
    }))
}

/// Mean distance of the true axis points to the estimated lines of learned revolute joints, metres.
pub fn location_m(estimate: &State, truth: &State, layout: &Layout) -> Option<f64> {
    mean(
        learned_revolute(estimate, truth, layout)
            .into_iter()
            .filter_map(|(estimate, truth)| Some(estimate.line()?.distance_to(&truth.line()?.point))),
    )
}

/// The configurations over which estimates are judged, and where the marker is there.
#[derive(Clone, Debug)]
pub struct Evaluation {
    /// Where the marker is predicted.
    workspace: Workspace,
    /// The true, noise-free marker there; or what was measured.
    markers: Vec<Point3<f64>>,
    /// σ of the sensor per coordinate, metres; `None` for measurements.
    sigma_m: Option<f64>,
    /// What is held in sockets that nobody learns from.
    held: Vec<HeldInSocket>,
    /// What was measured in reality at each configuration.
    measured: Vec<Observation>,
}

/// How far predictions are from what was measured and not learned from.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HeldOutError {
    /// Root mean square and mean of the distances of predicted targets from where they were measured, metres; of measured
    /// distances, of their differences.
    pub prediction_m: Option<(f64, f64)>,
    /// Mean angle between predicted and measured rotations, degrees.
    pub prediction_mean_deg: Option<f64>,
    /// Mean distance of predicted from measured points in pictures, pixels.
    pub prediction_mean_px: Option<f64>,
}

/// Postures that hold a target in one socket.
#[derive(Clone, Debug, PartialEq)]
pub struct HeldInSocket {
    /// The target.
    pub target: usize,
    /// Joint positions, rad or m.
    pub postures: Vec<Vec<f64>>,
}

impl HeldInSocket {
    /// The distances of the predicted target from its mean, metres.
    fn distances(&self, estimate: &State) -> impl Iterator<Item = f64> {
        let points: Vec<_> = self.postures.iter().map(|theta| estimate.target_at(self.target, theta).coords).collect();
        let mean = points.iter().sum::<Vector3<f64>>() / points.len().max(1) as f64;
        points.into_iter().map(move |point| (point - mean).norm())
    }
}

/// Configurations of the evaluation set that serve for the signal-to-noise ratios.
const SIGNAL_SIZE: usize = 50;

impl Evaluation {
    /// Against the noise-free markers of the truth.
    pub fn of_truth(workspace: impl Into<Workspace>, truth: &State, sigma_m: f64) -> Self {
        let workspace = workspace.into();
        let markers = workspace.points(truth);
        Self { workspace, markers, sigma_m: Some(sigma_m), held: Vec::new(), measured: Vec::new() }
    }

    /// Against held-out measurements, one at each configuration.
    pub fn of_measurements(workspace: impl Into<Workspace>, measured: Vec<Observation>) -> Self {
        Self { workspace: workspace.into(), markers: Vec::new(), sigma_m: None, held: Vec::new(), measured }
    }

    /// Also by what is held in these sockets.
    pub fn with_sockets(self, held: Vec<HeldInSocket>) -> Self {
        Self { held, ..self }
    }

    /// Mean distance of the predicted target from its mean over the same socket, metres; `None` without held-out sockets.
    pub fn scatter_m(&self, estimate: &State) -> Option<f64> {
        mean(self.held.iter().flat_map(|held| held.distances(estimate)))
    }

    /// The same configurations, against another truth.
    pub fn follow(&mut self, truth: &State) {
        self.markers = self.workspace.points(truth);
    }

    /// Joint positions and markers.
    pub fn targets(&self) -> impl ExactSizeIterator<Item = (&[f64], &Point3<f64>)> {
        self.workspace.configurations.iter().map(Vec::as_slice).zip(&self.markers)
    }

    /// Root mean square and mean of the distances between predicted and true marker, metres.
    pub fn prediction_m(&self, estimate: &State) -> Option<(f64, f64)> {
        self.workspace.distance(&self.workspace.points(estimate), &self.markers)
    }

    /// How far the predictions of an estimate through `measurement_model` are from held-out measurements; where a truth is known, from its
    /// markers.
    pub fn error(&self, estimate: &State, measurement_model: &MeasurementModel) -> HeldOutError {
        if self.measured.is_empty() {
            return HeldOutError { prediction_m: self.prediction_m(estimate), ..HeldOutError::default() };
        }
        let (mut lengths, mut angles, mut pixels) = (Vec::new(), Vec::new(), Vec::new());
        let mut links = Links::new(estimate);
        for (theta, observation) in self.workspace.configurations.iter().zip(&self.measured) {
            links.at(theta);
            for (sensor, reading) in measurement_model.sensors().iter().zip(&observation.readings) {
                let Some(reading) = reading else { continue };
                let mut predicted = vec![0.0; reading.len()];
                // Where an estimate has what was seen behind the camera it is wrong, and is told by how much.
                if sensor.channel().extended(&links, &mut predicted) {
                    let norms = sensor.subject().residual_norms(reading, &predicted);
                    lengths.extend(norms.length_m);
                    angles.extend(norms.angle_rad.map(f64::to_degrees));
                    pixels.extend(norms.pixels);
                }
            }
        }
        let squares = mean(lengths.iter().map(|length| length * length));
        HeldOutError {
            prediction_m: squares.map(f64::sqrt).zip(mean(lengths.into_iter())),
            prediction_mean_deg: mean(angles.into_iter()),
            prediction_mean_px: mean(pixels.into_iter()),
        }
    }

    /// Every joint by itself.
    pub fn joints(&self, estimate: &State, truth: Option<&State>, layout: &Layout) -> Vec<JointMetrics> {
        let judged = |index: usize| {
            let truth = truth.filter(|_| layout.is_learned(index))?;
            let (found, wanted) = (estimate.joints.get(index)?, truth.joints.get(index)?);
            Some(JointMetrics {
                axis_deg: Some(found.direction().angle(&wanted.direction()).to_degrees()),
                location_m: found.line().zip(wanted.line()).map(|(found, wanted)| found.distance_to(&wanted.point)),
                signal_to_noise: self.signal_to_noise(index, found, truth),
            })
        };
        (0..layout.joints()).map(|index| judged(index).unwrap_or_default()).collect()
    }

    fn signal_to_noise(&self, index: usize, found: &Joint, truth: &State) -> Option<f64> {
        let sigma = self.sigma_m.filter(|sigma| *sigma > 0.0)?;
        let mut state = truth.clone();
        *state.joints.get_mut(index)? = *found;
        let displacements = self.targets().take(SIGNAL_SIZE);
        Some(
            mean(displacements.map(|(theta, marker)| (state.predicted_at(theta) - *marker).norm_squared()))?.sqrt()
                / sigma,
        )
    }
}

fn learned_revolute<'a>(estimate: &'a State, truth: &'a State, layout: &Layout) -> Vec<(&'a Joint, &'a Joint)> {
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
    use nalgebra::UnitVector3;

    use super::*;
    use body_schema_engine::kinematics::Line;

    fn line(direction: [f64; 3], point: [f64; 3]) -> Joint {
        let direction = UnitVector3::new_normalize(Vector3::from(direction));
        Joint::Revolute(Line { point: point.into(), direction })
    }

    /// One joint about z, off by 0.1 m along y: at θ the marker is displaced by (I − R(θ)) (0, 0.1, 0).
    #[test]
    fn the_signal_of_a_joint_worked_by_hand() {
        let truth = State::arm(vec![line([0., 0., 1.], [0., 0., 0.])], Point3::new(1., 0., 0.));
        let estimate = State { joints: vec![line([0., 0., 1.], [0., 0.1, 0.])], ..truth.clone() };
        let layout = Layout::of_arm(&truth, &[], false);
        let turns = [60_f64, 180.].map(|degrees| vec![degrees.to_radians()]);
        let evaluation = Evaluation::of_truth(turns.to_vec(), &truth, 0.05);
        let joint = evaluation.joints(&estimate, Some(&truth), &layout)[0];
        // ‖I − R(θ)‖ = 2 sin θ/2: displaced by 0.1 and 0.2 m.
        let expected = ((0.01_f64 + 0.04) / 2.0).sqrt() / 0.05;
        assert!((joint.signal_to_noise.expect("a truth") - expected).abs() < 1e-9);
        assert!((joint.location_m.expect("a line") - 0.1).abs() < 1e-12 && joint.axis_deg == Some(0.0));
        assert_eq!(evaluation.joints(&estimate, None, &layout), [JointMetrics::default()]);
        let known = Layout::of_arm(&truth, &[false], true);
        assert_eq!(evaluation.joints(&estimate, Some(&truth), &known), [JointMetrics::default()]);
    }

    /// An arm about z, a metre long, that is believed to turn about an axis 1 cm beside the true one.
    #[test]
    fn the_scatter_at_sockets_worked_by_hand() {
        let truth = State::arm(vec![line([0., 0., 1.], [0., 0., 0.])], Point3::new(1., 0., 0.));
        let evaluation = Evaluation::of_truth(Vec::new(), &truth, 0.05);
        assert_eq!(evaluation.scatter_m(&truth), None);
        let estimate = State { joints: vec![line([0., 0., 1.], [0.01, 0., 0.])], ..truth.clone() };
        let turned =
            |degrees: [f64; 2]| HeldInSocket { target: 0, postures: degrees.map(|x| vec![x.to_radians()]).to_vec() };
        // The marker at 0 and 360 degrees is at one place whatever is believed.
        let evaluation = evaluation.with_sockets(vec![turned([0., 360.]), turned([90., -270.])]);
        assert!(evaluation.scatter_m(&estimate).expect("sockets") < 1e-12);
        // At 0 and 180 degrees it is at 1 and at 0.02 − 1: far apart, as no socket would have it.
        let scatter = evaluation.with_sockets(vec![turned([0., 180.])]).scatter_m(&estimate).expect("a socket");
        assert!((scatter - 0.99).abs() < 1e-12, "{scatter}");
    }

    #[test]
    fn metrics_of_a_chain_worked_by_hand() {
        let joints = vec![line([0., 0., 1.], [0., 0., 0.]), line([1., 0., 0.], [0., 0., 1.])];
        let truth = State::arm(joints, Point3::new(0., 0., 2.));
        // The second axis tilted by 30 deg towards the first and shifted by 0.1 m; the first flipped.
        let half = 30_f64.to_radians();
        let joints = vec![line([0., 0., -1.], [0., 0., 5.]), line([half.cos(), 0., half.sin()], [7., 0.1, 1.])];
        let estimate = State { joints, ..truth.clone() };
        let layout = Layout::of_arm(&truth, &[], false);
        // ∠ true 90 deg; ∠ estimated between −z and the tilted axis: 120 deg.
        assert!((orientation_deg(&estimate, &truth, &layout).expect("a pair") - 30.0).abs() < 1e-9);
        assert!((axis_deg(&estimate, &truth, &layout).expect("joints") - (180.0 + 30.0) / 2.0).abs() < 1e-9);
        // The first line still contains the true point; the second passes (0,0,1) at √(0.1² + (7 sin 30)²).
        let expected = (0.01_f64 + 3.5 * 3.5).sqrt() / 2.0;
        assert!((location_m(&estimate, &truth, &layout).expect("lines") - expected).abs() < 1e-9);
        assert_eq!(orientation_deg(&truth, &truth, &layout), Some(0.0));
        let known = Layout::of_arm(&truth, &[false, false], true);
        assert_eq!(location_m(&estimate, &truth, &known), None);
    }
}
