//! What an experiment tells the outside: one [`Description`] at the start, one [`StepReport`] after each step.
//!
//! Everything that shows or stores (recordings, tables, HTTP, the page) reads these and nothing else. Lengths are in
//! metres, angles in radians unless a name says otherwise, all positions in the frame of the measurements.

use nalgebra::{Matrix3, Point3, Vector3};
use serde::{Deserialize, Serialize};

use super::{convergence::Thresholds, metrics::Metrics};
use crate::{
    estimation::Belief,
    kinematics::JointKind,
    model::State,
    selection::Partition,
    sensing::{Gaze, Head},
};

/// What stays the same from step to step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "app", derive(utoipa::ToSchema))]
pub struct Description {
    /// Name of the scenario.
    pub scenario: String,
    /// One line about the scenario.
    pub title: String,
    /// Seed of all random streams.
    pub seed: u64,
    /// Version of body-schema.
    pub version: String,
    /// The joints, base first.
    pub joints: Vec<JointDescription>,
    /// Number of learned parameters in tangent coordinates.
    pub parameters: usize,
    /// Movements after which there are as many independent equations as can be determined: a yardstick to draw beside
    /// curves, not a bound.
    pub movements_by_counting: usize,
    /// The learners, in the order of every report.
    pub learners: Vec<LearnerDescription>,
    /// The thresholds of `converged_at`.
    pub thresholds: Thresholds,
    /// How many movements there are at most (a recorded data set ends); null without an end.
    pub movements_available: Option<usize>,
    /// The true arm at θ = 0; null where no truth is known.
    pub truth: Option<ModelReport>,
    /// The number of movements after which the body changes; null if it does not. `truth` is the one before.
    pub change_at: Option<u64>,
    /// The head that watches; null if the marker is always seen.
    pub head: Option<HeadDescription>,
}

/// A camera head with pan and tilt.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "app", derive(utoipa::ToSchema))]
pub struct HeadDescription {
    /// Where it is, metres.
    pub position_m: [f64; 3],
    /// Unit look direction at rest.
    pub look: [f64; 3],
    /// Unit direction that is upright for the head at rest.
    pub up: [f64; 3],
    /// Limit of pan to either side, radians.
    pub pan_limit_rad: f64,
    /// Limit of tilt up and down, radians.
    pub tilt_limit_rad: f64,
    /// Half-angle of the cone that an eye sees, radians.
    pub lens_half_angle_rad: f64,
    /// Distance between two eyes, metres; null for one eye.
    pub eye_baseline_m: Option<f64>,
}

/// Where a head looks, after it has followed the marker.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "app", derive(utoipa::ToSchema))]
pub struct GazeReport {
    /// Pan, positive to the left, radians.
    pub pan_rad: f64,
    /// Tilt, positive upwards, radians.
    pub tilt_rad: f64,
    /// Unit look direction.
    pub direction: [f64; 3],
    /// The eyes, metres: one, or the left one and the right one.
    pub eyes_m: Vec<[f64; 3]>,
}

impl HeadDescription {
    /// Of a head.
    pub fn of(head: &Head) -> Self {
        Self {
            position_m: array(&head.position.coords),
            look: array(&head.look),
            up: array(&head.axes().0),
            pan_limit_rad: head.pan_limit,
            tilt_limit_rad: head.tilt_limit,
            lens_half_angle_rad: head.lens_half_angle,
            eye_baseline_m: head.baseline,
        }
    }
}

impl GazeReport {
    /// Of a head and where it looks.
    pub fn of(head: &Head, gaze: &Gaze) -> Self {
        let eyes: Vec<_> = head.eyes(gaze).collect();
        let direction = array(&gaze.direction);
        Self { pan_rad: gaze.pan, tilt_rad: gaze.tilt, direction, eyes_m: arrays(&eyes) }
    }
}

/// A joint as the scenario describes it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "app", derive(utoipa::ToSchema))]
pub struct JointDescription {
    /// Its name.
    pub name: String,
    /// Revolute or prismatic.
    pub kind: JointKind,
    /// Whether its axis is learned, or known and held fixed.
    pub learned: bool,
    /// Its limits, rad (revolute) or m (prismatic).
    pub limits: [f64; 2],
}

/// A learner of the comparison.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "app", derive(utoipa::ToSchema))]
pub struct LearnerDescription {
    /// Its name in the scenario.
    pub name: String,
    /// Its estimator: `rls`, `gradient`, `smoother`, …
    pub estimator: String,
    /// Its policy: `active`, `active-planned`, `random`, …
    pub policy: String,
}

/// All learners after one step. Step 0 is the start: no movement yet, the initial estimate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "app", derive(utoipa::ToSchema))]
pub struct StepReport {
    /// The step, counted from 0.
    pub step: u64,
    /// The learners, in the order of the description.
    pub learners: Vec<LearnerReport>,
    /// The true arm at θ = 0, at the one step at which it is another than before; null at all others.
    pub truth: Option<ModelReport>,
}

/// One learner after one step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "app", derive(utoipa::ToSchema))]
pub struct LearnerReport {
    /// Its name.
    pub name: String,
    /// The movement of this step, chosen and predicted before the update; null at step 0 and after a failure.
    pub movement: Option<MovementReport>,
    /// The estimate after the update.
    pub estimate: ModelReport,
    /// The metrics after the update.
    pub metrics: Metrics,
    /// Why the learner stopped learning, if it did (a diverged estimate); null otherwise.
    pub failure: Option<String>,
}

/// A movement: how it was chosen, what was expected, what was seen.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "app", derive(utoipa::ToSchema))]
pub struct MovementReport {
    /// The configuration θ, rad or m per joint.
    pub configuration: Vec<f64>,
    /// The row of the recorded data set; null in a simulated world.
    pub row: Option<usize>,
    /// Where the head that watches looks then; null without a head.
    pub gaze: Option<GazeReport>,
    /// The marker as predicted before the measurement, metres.
    pub predicted_marker_m: [f64; 3],
    /// The measured marker, metres; null for a miss.
    pub measured_marker_m: Option<[f64; 3]>,
    /// The arm in this configuration as estimated after the update: axis points in order, then the marker, metres.
    pub estimated_skeleton_m: Vec<[f64; 3]>,
    /// The true arm in this configuration; null where no truth is known.
    pub true_skeleton_m: Option<Vec<[f64; 3]>>,
    /// The criterion C(θ) of the choice; null for a policy without one.
    pub criterion: Option<f64>,
    /// By how much the criterion was expected to fall: tr(W P) − C(θ), for criterion A.
    pub gain: Option<f64>,
    /// How many configurations were evaluated to choose this one.
    pub evaluations: usize,
    /// How long the choice took, milliseconds of wall time.
    pub selection_ms: f64,
    /// Whether any channel had a reading.
    #[serde(skip, default)]
    pub seen: bool,
    /// DIRECT's partition of the joint box; that of a planner was for the first movement that its plan lacked. Too large for every report: recordings hold it, JSON does not.
    #[serde(skip)]
    pub partition: Option<Partition>,
}

/// A chain at θ = 0, with its uncertainty if it is an estimate that keeps one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "app", derive(utoipa::ToSchema))]
pub struct ModelReport {
    /// The joints, base first.
    pub joints: Vec<JointReport>,
    /// The marker at θ = 0, metres.
    pub marker_m: [f64; 3],
    /// Covariance of the marker, m², row by row; null if it is known or no covariance is kept.
    pub marker_covariance_m2: Option<[[f64; 3]; 3]>,
}

/// The axis of one joint at θ = 0.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "app", derive(utoipa::ToSchema))]
pub struct JointReport {
    /// Unit direction of the axis.
    pub axis: [f64; 3],
    /// A point on the axis, metres: of an estimate the one nearest to the true axis point, so that drawings compare
    /// like with like, or the pivot of its chart where no truth is known; null for a prismatic joint.
    pub point_m: Option<[f64; 3]>,
    /// Covariance of that point, m², row by row: rank 2, flat along the axis.
    pub point_covariance_m2: Option<[[f64; 3]; 3]>,
    /// Covariance of the direction, rad², row by row: rank 2, flat along the axis.
    pub direction_covariance_rad2: Option<[[f64; 3]; 3]>,
}

impl ModelReport {
    /// A state without uncertainty, in the frame of the measurements.
    pub fn of_state(state: &State) -> Self {
        let state = state.measured();
        let joints = state
            .joints
            .iter()
            .map(|joint| JointReport {
                axis: array(&joint.direction()),
                point_m: joint.line().map(|line| array(&line.point.coords)),
                point_covariance_m2: None,
                direction_covariance_rad2: None,
            })
            .collect();
        Self { joints, marker_m: array(&state.marker().coords), marker_covariance_m2: None }
    }

    /// A belief with what it holds of uncertainty; points on axes are those nearest to the truth's, where it is known.
    pub fn of_belief(belief: &Belief, truth: Option<&State>) -> Self {
        let (shown, estimate) = (shown(&belief.state, truth), belief.state.measured());
        let mut model = Self::of_state(&shown);
        for (index, joint) in model.joints.iter_mut().enumerate() {
            let along = match (shown.joints[index].line(), estimate.joints[index].line()) {
                (Some(shown), Some(line)) => line.direction.dot(&(shown.point - line.point)),
                _ => 0.0,
            };
            joint.point_covariance_m2 = belief.point_covariance(index, along).map(|p| rows(&p));
            joint.direction_covariance_rad2 = belief.direction_covariance(index).map(|p| rows(&p));
        }
        model.marker_covariance_m2 = belief.hand_marker_covariance().map(|p| rows(&p));
        model
    }

    /// The arm at θ = 0: axis points in order, then the marker, metres.
    pub fn skeleton_m(&self) -> Vec<[f64; 3]> {
        self.joints.iter().filter_map(|joint| joint.point_m).chain([self.marker_m]).collect()
    }
}

/// An estimate as it is drawn beside the truth.
pub(super) fn shown(estimate: &State, truth: Option<&State>) -> State {
    let estimate = estimate.measured();
    truth.map_or_else(|| estimate.clone().into_owned(), |truth| estimate.slid_towards(&truth.measured()))
}

pub(super) fn array(v: &Vector3<f64>) -> [f64; 3] {
    [v.x, v.y, v.z]
}

pub(super) fn arrays(points: &[Point3<f64>]) -> Vec<[f64; 3]> {
    points.iter().map(|point| array(&point.coords)).collect()
}

fn rows(matrix: &Matrix3<f64>) -> [[f64; 3]; 3] {
    matrix.transpose().into()
}
