//! What an experiment tells the outside: one [`Description`] at the start, one [`StepReport`] after each step.
//!
//! Everything that shows or stores (recordings, tables, HTTP, the page) reads these and nothing else. Lengths are in
//! metres, angles in radians unless a name says otherwise, all positions in the frame of the measurements.

use nalgebra::{Isometry3, Matrix3, Point3, UnitVector3, Vector3};
use serde::{Deserialize, Serialize};

use super::{
    convergence::Thresholds,
    head::{GazeReport, HeadDescription},
    loads::LoadsReport,
    metrics::Metrics,
    sight::{CameraDescription, ChannelDescription, ChannelReading, CorrectionReport, PlaceReport, TargetDescription},
};
use body_schema_engine::{
    estimation::Belief,
    kinematics::{Joint, JointKind, Line},
    model::{Names, State},
    selection::Partition,
};

/// What stays the same from step to step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
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
    /// What is read after every movement.
    #[serde(default)]
    pub channels: Vec<ChannelDescription>,
    /// The cameras.
    #[serde(default)]
    pub cameras: Vec<CameraDescription>,
    /// What can be looked at, the marker first.
    #[serde(default)]
    pub targets: Vec<TargetDescription>,
    /// Whether the place of the robot's base in the frame of the measurements is learned.
    #[serde(default)]
    pub base_learned: bool,
    /// The sockets in which a target is held; those that learners may use first, in the order of their numbers.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub sockets: Vec<SocketDescription>,
    /// What the robot is drawn as; null for one that is drawn as its own joints and links.
    #[serde(default)]
    pub body: Option<Body>,
}

/// What a robot is drawn as, around the arm that is learned. It has no bearing on anything that is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "lowercase")]
pub enum Body {
    /// A human figure of the arm's proportions, whose right arm it is: x ahead, y to the left, z up. Joints whose names
    /// begin with `torso` or `chest` carry its trunk.
    Humanoid,
}

/// A socket as the scenario describes it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct SocketDescription {
    /// Its name, among those of one place.
    pub name: String,
    /// The place where it stands, with others; null if there is but one place.
    pub place: Option<String>,
    /// Where it truly is, metres; null where no truth is known.
    pub at_m: Option<[f64; 3]>,
    /// Whether it is held out: nobody learns from it, and the scatter of the predicted target there is judged.
    pub held_out: bool,
}

impl Description {
    /// What everything that can be learned is called.
    pub fn called(&self) -> Names {
        Names {
            joints: self.joints.iter().map(|joint| joint.name.clone()).collect(),
            targets: self.targets.iter().map(|target| target.name.clone()).collect(),
            cameras: self.cameras.iter().map(|camera| camera.name.clone()).collect(),
            sockets: self.sockets.iter().map(SocketDescription::label).collect(),
        }
    }
}

impl SocketDescription {
    /// Its place and its name.
    pub fn label(&self) -> String {
        self.place.as_ref().map_or_else(|| self.name.clone(), |place| format!("{place}/{}", self.name))
    }
}

/// A joint as the scenario describes it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
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
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct LearnerDescription {
    /// Its name in the scenario.
    pub name: String,
    /// Its estimator: `rls`, `gradient`, `smoother`, …
    pub estimator: String,
    /// Its policy: `active`, `active-planned`, `random`, …
    pub policy: String,
    /// Whether stabilising noise, added to its covariance step by step, keeps that larger than its data allow.
    #[serde(default)]
    pub stabilised: bool,
    /// Whether its loss knows of outliers, and tells for each reading how likely it is one.
    #[serde(default)]
    pub robust: bool,
}

/// All learners after one step. Step 0 is the start: no movement yet, the initial estimate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
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
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
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
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct MovementReport {
    /// The configuration θ, rad or m per joint.
    pub configuration: Vec<f64>,
    /// The row of the recorded data set; null in a simulated world.
    pub row: Option<usize>,
    /// The socket in which a target was held, by its place, if it has one, and its name; null without sockets.
    #[serde(default)]
    pub socket: Option<String>,
    /// Where the head that watches looks then; null without a head.
    pub gaze: Option<GazeReport>,
    /// The marker as predicted before the measurement, metres.
    pub predicted_marker_m: [f64; 3],
    /// The measured marker, metres; null where no reading says where it was: after a miss, and in the picture of a camera.
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
    /// Every channel's reading beside the estimate after the update.
    #[serde(default)]
    pub readings: Vec<ChannelReading>,
    /// Whether any channel had a reading.
    #[serde(skip, default)]
    pub seen: bool,
    /// DIRECT's partition of the joint box; that of a planner was for the first movement that its plan lacked. Too large for every report: recordings hold it, JSON does not.
    #[serde(skip)]
    pub partition: Option<Partition>,
}

/// A chain at θ = 0, with its uncertainty if it is an estimate that keeps one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ModelReport {
    /// The joints, base first.
    pub joints: Vec<JointReport>,
    /// The marker at θ = 0, metres.
    pub marker_m: [f64; 3],
    /// Covariance of the marker, m², row by row; null if it is known or no covariance is kept.
    pub marker_covariance_m2: Option<[[f64; 3]; 3]>,
    /// The robot's base in the frame of the measurements; null where the two are one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub base: Option<PlaceReport>,
    /// The cameras.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub cameras: Vec<PlaceReport>,
    /// What can be looked at; empty where that is a marker alone, and a point.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub targets: Vec<PlaceReport>,
    /// The sockets in which targets are held, metres, in the order of the description; those that are held out are none of
    /// them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub sockets_m: Vec<[f64; 3]>,
    /// What joints that give way bear; null where none does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub loads: Option<LoadsReport>,
}

/// The axis of one joint at θ = 0.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct JointReport {
    /// Unit direction of the axis.
    pub axis: [f64; 3],
    /// A point on the axis, metres: of an estimate the one nearest to the true axis point, so that drawings compare
    /// like with like, or the pivot of its chart where no truth is known; null for a prismatic joint.
    pub point_m: Option<[f64; 3]>,
    /// Covariance of that point, m², row by row: rank 2, flat along the axis.
    pub point_covariance_m2: Option<[[f64; 3]; 3]>,
    /// The covariance that its prior and its data allow of that point, linearised at the truth: m², row by row, as
    /// `bound_trace` among the metrics. Null where no truth is known, or the learner keeps no covariance to compare.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub allowed_point_covariance_m2: Option<[[f64; 3]; 3]>,
    /// Covariance of the direction, rad², row by row: rank 2, flat along the axis.
    pub direction_covariance_rad2: Option<[[f64; 3]; 3]>,
    /// What its readings are corrected by; null where they are taken for what they say.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub correction: Option<CorrectionReport>,
}

impl ModelReport {
    /// A state without uncertainty, in the frame of the measurements.
    pub fn of_state(state: &State) -> Self {
        let base = PlaceReport::of_base(state);
        let state = state.measured();
        let joints = state
            .joints
            .iter()
            .zip(&state.corrections)
            .map(|(joint, correction)| JointReport {
                axis: array(&joint.direction()),
                point_m: joint.line().map(|line| array(&line.point.coords)),
                point_covariance_m2: None,
                allowed_point_covariance_m2: None,
                direction_covariance_rad2: None,
                correction: CorrectionReport::of(correction),
            })
            .collect();
        Self {
            joints,
            marker_m: array(&state.marker().coords),
            marker_covariance_m2: None,
            base,
            cameras: PlaceReport::of_cameras(&state),
            targets: PlaceReport::of_targets(&state),
            sockets_m: state.sockets.iter().map(|socket| array(&socket.coords)).collect(),
            loads: state.bending().map(LoadsReport::of),
        }
    }

    /// A belief with what it holds of uncertainty; points on axes are those nearest to the truth's, where it is known.
    pub fn of_belief(belief: &Belief, truth: Option<&State>) -> Self {
        let (shown, estimate) = (shown(&belief.state, truth), belief.state.measured());
        let base = PlaceReport::of_base(&belief.state);
        let mut model = Self { base, ..Self::of_state(&shown) };
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

    /// Adds what data allow of every point whose covariance is known; `allowed` is the belief at the truth.
    pub(super) fn allow(&mut self, allowed: &Belief) {
        for (index, joint) in
            self.joints.iter_mut().enumerate().filter(|(_, joint)| joint.point_covariance_m2.is_some())
        {
            joint.allowed_point_covariance_m2 = allowed.point_covariance(index, 0.0).map(|p| rows(&p));
        }
    }

    /// The chain that it describes with its cameras, in the frame of the measurements; `None` if a number in it is not
    /// finite. The first target is the marker, the others are those of the report.
    pub fn state(&self) -> Option<State> {
        let finite = |vector: &[f64; 3]| vector.iter().all(|x| x.is_finite());
        let joint = |joint: &JointReport| {
            let direction = UnitVector3::try_new(Vector3::from(joint.axis), 0.0).filter(|_| finite(&joint.axis))?;
            match joint.point_m {
                Some(point) if finite(&point) => Some(Joint::Revolute(Line { point: point.into(), direction })),
                Some(_) => None,
                None => Some(Joint::Prismatic(direction)),
            }
        };
        let joints = self.joints.iter().map(joint).collect::<Option<Vec<_>>>()?;
        let mut state = finite(&self.marker_m).then(|| State::arm(joints, self.marker_m.into()))?;
        for (correction, joint) in state.corrections.iter_mut().zip(&self.joints) {
            *correction = joint.correction.map_or(*correction, |report| report.correction());
        }
        if let Some(report) = &self.loads {
            state.loads = Some(report.loads(state.joints.len())?.into());
        }
        state.devices = self.cameras.iter().map(PlaceReport::device).collect::<Option<_>>()?;
        state.targets.extend(self.targets.iter().map(PlaceReport::target).collect::<Option<Vec<_>>>()?);
        Some(state)
    }

    /// Where the robot's base is in the frame of the measurements; `None` if a number in it is not finite.
    pub fn base_frame(&self) -> Option<Isometry3<f64>> {
        self.base.as_ref().map_or(Some(Isometry3::identity()), PlaceReport::frame)
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
