//! What stays the same from step to step.

use serde::{Deserialize, Serialize};

use super::{HeadDescription, ModelReport, array, arrays};
use body_schema_engine::{
    kinematics,
    selection::CriterionUnits,
    sensing::{CameraKind, TargetKind},
};
use body_schema_experiment as experiment;
use body_schema_experiment::{ChannelSetting, Experiment, JointSetting, LearnerSetting, Setting, SocketSetting};

/// What stays the same from step to step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Description {
    /// Name of the scenario.
    pub scenario: String,
    /// What is other than in the scenario's file, as `KEY=VALUE`; empty for the scenario as it is.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub set: Vec<String>,
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
    /// The unit of the uncertainty, the trace of the weighted covariance: `rad²`, where lengths count as angles by a
    /// characteristic length, or `prior variances`.
    #[serde(default)]
    pub uncertainty_unit: String,
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

impl SocketDescription {
    /// Its place and its name.
    pub fn label(&self) -> String {
        experiment::socket_label(self.place.as_deref(), &self.name)
    }
}

/// Whether a joint turns or slides.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub enum JointKind {
    /// Turns about a line; position in radians.
    Revolute,
    /// Slides along a direction; position in metres.
    Prismatic,
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

/// A camera, as the scenario describes it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct CameraDescription {
    /// Its name.
    pub name: String,
    /// Width and height of its picture, pixels.
    pub size_px: [f64; 2],
}

/// A target, as the scenario describes it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct TargetDescription {
    /// Its name.
    pub name: String,
    /// Its known points in its own frame, metres; the origin alone for a point.
    pub points_m: Vec<[f64; 3]>,
}

/// What is read after every movement.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ChannelDescription {
    /// What it is called.
    pub name: String,
    /// Its equations.
    pub equations: usize,
    /// The parts of a reading, equal in equations: the points of a target in a picture, the position and the rotation of a pose.
    /// One part is the whole.
    pub parts: Vec<String>,
    /// The camera, by its number; null for what is read without one.
    pub camera: Option<usize>,
    /// What the camera sees, by the number of the target; null without a camera.
    pub target: Option<usize>,
}

/// The thresholds of a scenario.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Thresholds {
    /// Largest `orientation_deg`, degrees.
    pub orientation_deg: f64,
    /// Largest `location_m`, metres.
    pub location_m: f64,
}

impl Description {
    /// Of an experiment.
    pub fn of(experiment: &Experiment) -> Self {
        Self::from(experiment.setting())
    }
}

impl From<&Setting> for Description {
    fn from(setting: &Setting) -> Self {
        Self {
            scenario: setting.scenario.clone(),
            set: setting.replaced.clone(),
            title: setting.title.clone(),
            seed: setting.seed,
            version: setting.version.clone(),
            joints: setting.joints.iter().map(JointDescription::from).collect(),
            parameters: setting.parameters,
            movements_by_counting: setting.movements_by_counting,
            learners: setting.learners.iter().map(LearnerDescription::from).collect(),
            uncertainty_unit: match setting.units {
                CriterionUnits::CharacteristicLength(_) => "rad²",
                CriterionUnits::Prior => "prior variances",
            }
            .to_owned(),
            thresholds: setting.thresholds.into(),
            movements_available: setting.movements_available,
            truth: setting.truth.as_ref().map(ModelReport::of_state),
            change_at: setting.change_at,
            head: setting.head.as_ref().map(HeadDescription::of),
            channels: setting.channels.iter().map(ChannelDescription::from).collect(),
            cameras: setting.equipment.cameras.iter().map(CameraDescription::from).collect(),
            targets: setting.equipment.targets.iter().map(TargetDescription::from).collect(),
            base_learned: setting.base_learned,
            sockets: setting.sockets.iter().map(SocketDescription::from).collect(),
            body: setting.body.map(Body::from),
        }
    }
}

impl From<experiment::Body> for Body {
    fn from(body: experiment::Body) -> Self {
        match body {
            experiment::Body::Humanoid => Self::Humanoid,
        }
    }
}

impl From<kinematics::JointKind> for JointKind {
    fn from(kind: kinematics::JointKind) -> Self {
        match kind {
            kinematics::JointKind::Revolute => Self::Revolute,
            kinematics::JointKind::Prismatic => Self::Prismatic,
        }
    }
}

impl From<&JointSetting> for JointDescription {
    fn from(joint: &JointSetting) -> Self {
        let JointSetting { name, kind, learned, limits } = joint;
        Self { name: name.clone(), kind: (*kind).into(), learned: *learned, limits: *limits }
    }
}

impl From<&LearnerSetting> for LearnerDescription {
    fn from(learner: &LearnerSetting) -> Self {
        let LearnerSetting { name, estimator, policy, stabilised, robust } = learner.clone();
        Self { name, estimator, policy, stabilised, robust }
    }
}

impl From<&SocketSetting> for SocketDescription {
    fn from(socket: &SocketSetting) -> Self {
        let SocketSetting { name, place, at, held_out } = socket.clone();
        Self { name, place, at_m: at.map(|at| array(&at.coords)), held_out }
    }
}

impl From<&ChannelSetting> for ChannelDescription {
    fn from(channel: &ChannelSetting) -> Self {
        let ChannelSetting { name, equations, parts, camera, target } = channel.clone();
        Self { name, equations, parts, camera, target }
    }
}

impl From<&CameraKind> for CameraDescription {
    fn from(camera: &CameraKind) -> Self {
        Self { name: camera.name.clone(), size_px: camera.size_px }
    }
}

impl From<&TargetKind> for TargetDescription {
    fn from(target: &TargetKind) -> Self {
        Self { name: target.name.clone(), points_m: arrays(&target.points) }
    }
}

impl From<experiment::Thresholds> for Thresholds {
    fn from(thresholds: experiment::Thresholds) -> Self {
        let experiment::Thresholds { orientation_deg, location_m } = thresholds;
        Self { orientation_deg, location_m }
    }
}

impl From<Thresholds> for experiment::Thresholds {
    fn from(thresholds: Thresholds) -> Self {
        let Thresholds { orientation_deg, location_m } = thresholds;
        Self { orientation_deg, location_m }
    }
}
