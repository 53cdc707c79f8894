//! The keys of a scenario file.

mod constraints;
mod defaults;
mod exactly;
mod measurements;
mod read;
mod sensors;

use std::collections::BTreeMap;

use serde::Deserialize;
use toml::Spanned;

use super::{ErrorDraw, EstimatorKind, PolicyKind};
use body_schema_engine::{kinematics::JointKind, selection::Optimality};
use body_schema_experiment as experiment;

pub use constraints::{Constraints, ForbiddenBox};
pub use exactly::Exactly;
pub use measurements::{HeldOut, Measurements, Sockets};
pub use read::{key_in, line_of, read};
pub use sensors::Sensors;

/// The kind of a text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// A scenario file.
    File,
    /// A description of a robot elsewhere.
    External,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    pub name: Spanned<String>,
    pub title: String,
    pub steps: Spanned<u64>,
    pub robot: Robot,
    pub sensor: Option<Spanned<Sensors>>,
    pub initial_error: Option<Spanned<InitialError>>,
    pub measurements: Option<Spanned<Measurements>>,
    pub held_out: Option<Spanned<HeldOut>>,
    #[serde(rename = "sockets")]
    pub held: Option<Spanned<Sockets>>,
    pub base: Option<Spanned<Base>>,
    pub head: Option<Spanned<Head>>,
    pub view: Option<Spanned<View>>,
    #[serde(rename = "target", default)]
    pub targets: Vec<Spanned<Target>>,
    #[serde(rename = "camera", default)]
    pub cameras: Vec<Spanned<Camera>>,
    #[serde(rename = "socket", default)]
    pub sockets: Vec<Spanned<Socket>>,
    pub prediction: Option<Spanned<Prediction>>,
    pub change: Option<Spanned<Change>>,
    pub outliers: Option<Spanned<Outliers>>,
    pub prior: Spanned<Prior>,
    pub filter: Spanned<Filter>,
    pub unscented: Option<Spanned<Filter>>,
    pub smoother: Option<Smoother>,
    pub gradient: Option<Gradient>,
    pub selection: Selection,
    pub constraints: Option<Spanned<Constraints>>,
    pub thresholds: Option<Thresholds>,
    pub settled: Settled,
    #[serde(rename = "learner")]
    pub learners: Spanned<Vec<Learner>>,
    #[serde(default)]
    pub promises: BTreeMap<Spanned<String>, Spanned<u64>>,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Body {
    Humanoid,
}

impl From<Body> for experiment::Body {
    fn from(body: Body) -> Self {
        match body {
            Body::Humanoid => Self::Humanoid,
        }
    }
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Robot {
    pub marker_m: Option<Spanned<Exactly<f64, 3>>>,
    #[serde(default)]
    pub learn_marker: bool,
    pub body: Option<Body>,
    pub urdf: Option<Spanned<String>>,
    pub shapes: Option<Spanned<String>>,
    pub base: Option<Spanned<String>>,
    pub tip: Option<Spanned<String>>,
    pub tips: Option<Spanned<Vec<Spanned<String>>>>,
    #[serde(default)]
    pub hold: Vec<Spanned<String>>,
    pub up: Option<Spanned<Exactly<f64, 3>>>,
    pub elbow: Option<Spanned<String>>,
    #[serde(default)]
    pub offsets: Vec<Spanned<String>>,
    pub learn: Option<Spanned<Learn>>,
    #[serde(default)]
    pub coupled: BTreeMap<Spanned<String>, Spanned<String>>,
    pub reading_sigma_deg: Option<Spanned<Deviations>>,
    pub reading_sigma_m: Option<Spanned<Deviations>>,
    pub first_joints: Option<Spanned<u64>>,
    pub first_targets: Option<Spanned<u64>>,
    #[serde(rename = "joint")]
    pub joints: Spanned<Vec<Spanned<Joint>>>,
}

/// What is learned of the joints of a description.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Learn {
    /// Their axes.
    Axes,
    /// The zeros of their readings alone.
    Zeros,
}

/// Standard deviations: one for all, one for each, or a word.
#[derive(Debug, PartialEq, Deserialize)]
#[serde(untagged, expecting = "expected a number, a list of numbers or \"unknown\"")]
pub enum Deviations {
    One(f64),
    Each(Vec<f64>),
    Word(String),
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Joint {
    pub name: Spanned<String>,
    pub parent: Option<Spanned<String>>,
    pub kind: JointKind,
    pub axis: Spanned<Exactly<f64, 3>>,
    pub point_m: Option<Spanned<Exactly<f64, 3>>>,
    pub limits_deg: Option<Spanned<Exactly<f64, 2>>>,
    pub limits_m: Option<Spanned<Exactly<f64, 2>>>,
    #[serde(default = "yes")]
    pub learned: bool,
    pub ratio: Option<Spanned<f64>>,
    #[serde(default)]
    pub learn_ratio: bool,
    pub offset_deg: Option<Spanned<f64>>,
    pub offset_m: Option<Spanned<f64>>,
    #[serde(default)]
    pub learn_offset: bool,
    pub eccentricity_deg: Option<Spanned<Exactly<f64, 2>>>,
    #[serde(default)]
    pub learn_eccentricity: bool,
    pub compliance_deg_per_nm: Option<Spanned<Exactly<f64, 2>>>,
    #[serde(default)]
    pub learn_compliance: bool,
    pub column: Option<Spanned<String>>,
}

fn yes() -> bool {
    true
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Target {
    pub name: Spanned<String>,
    pub link: Option<Spanned<String>>,
    pub at_m: Option<Spanned<Exactly<f64, 3>>>,
    pub rpy_deg: Option<Spanned<Exactly<f64, 3>>>,
    pub points_m: Option<Spanned<Vec<Exactly<f64, 3>>>>,
    pub facing: Option<Spanned<Exactly<f64, 3>>>,
    pub facing_within_deg: Option<Spanned<f64>>,
    pub partly_seen: Option<Spanned<bool>>,
    pub points_facing: Option<Spanned<Vec<Exactly<f64, 3>>>>,
    pub least_points: Option<Spanned<u64>>,
    #[serde(default)]
    pub known: Known,
}

/// A camera. Its lens is written in keys of a scenario or in those of ROS's `camera_info`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Camera {
    pub name: Spanned<String>,
    pub link: Option<Spanned<String>>,
    pub at_m: Option<Spanned<Exactly<f64, 3>>>,
    pub rpy_deg: Option<Spanned<Exactly<f64, 3>>>,
    pub looks_at_m: Option<Spanned<Exactly<f64, 3>>>,
    pub size_px: Option<Spanned<Exactly<f64, 2>>>,
    pub image_width: Option<Spanned<f64>>,
    pub image_height: Option<Spanned<f64>>,
    pub focal_px: Option<Spanned<Focal>>,
    pub centre_px: Option<Spanned<Exactly<f64, 2>>>,
    pub fov_deg: Option<Spanned<f64>>,
    pub camera_matrix: Option<Spanned<Matrix>>,
    #[serde(rename = "K", alias = "k")]
    pub k: Option<Spanned<Matrix>>,
    pub model: Option<Spanned<String>>,
    pub distortion_model: Option<Spanned<String>>,
    pub distortion: Option<Spanned<Vec<f64>>>,
    pub distortion_coefficients: Option<Spanned<Matrix>>,
    #[serde(rename = "D", alias = "d")]
    pub d: Option<Spanned<Matrix>>,
    #[serde(default)]
    pub known: Known,
    pub known_to_px: Option<Spanned<f64>>,
    pub learn_distortion_to: Option<Spanned<OneOrEach>>,
    /// The other camera of a stereo pair, and how well it is known where this one is in its frame.
    pub stereo_with: Option<Spanned<String>>,
    #[serde(default)]
    pub baseline: Known,
}

/// Focal lengths: one for both directions, or each.
#[derive(Debug, Deserialize)]
#[serde(untagged, expecting = "is no focal length, expected one number, or two: across and down")]
pub enum Focal {
    Both(f64),
    Each(Exactly<f64, 2>),
}

/// The numbers of a matrix, row by row: a list of them, a list of rows, or as ROS writes it.
#[derive(Debug, Deserialize)]
#[serde(untagged, expecting = "is no matrix, expected a list of numbers, row by row, or { data = [numbers] }")]
pub enum Matrix {
    List(Vec<f64>),
    Rows(Vec<Vec<f64>>),
    Ros { data: Vec<f64> },
}

impl Matrix {
    /// All numbers, row by row.
    pub fn numbers(&self) -> Vec<f64> {
        match self {
            Self::List(data) | Self::Ros { data } => data.clone(),
            Self::Rows(rows) => rows.concat(),
        }
    }
}

/// A number for all, or one for each.
#[derive(Debug, Deserialize)]
#[serde(untagged, expecting = "is no deviation, expected a number, or a list of one for each coefficient")]
pub enum OneOrEach {
    One(f64),
    Each(Vec<f64>),
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Socket {
    pub name: Spanned<String>,
    pub place: Option<Spanned<String>>,
    pub target: Option<Spanned<String>>,
    pub at_m: Option<Spanned<Exactly<f64, 3>>>,
    #[serde(default)]
    pub known: Known,
    pub posture_deg: Option<Spanned<Vec<f64>>>,
    pub sigma_m: Option<Spanned<f64>>,
    pub to: Option<Spanned<String>>,
    pub distance_m: Option<Spanned<f64>>,
    pub sigma_distance_m: Option<Spanned<f64>>,
    #[serde(default)]
    pub held_out: bool,
}

/// The pose of the robot in the frame of the measurements.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Base {
    pub at_m: Spanned<Exactly<f64, 3>>,
    pub rpy_deg: Spanned<Exactly<f64, 3>>,
    #[serde(default)]
    pub known: Known,
}

/// The prior knowledge of a place; without any of these keys it is known exactly. `"unknown"` is anywhere within a metre.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, remote = "Self")]
pub struct Known {
    #[serde(rename = "to_m")]
    pub known_to_m: Option<Spanned<f64>>,
    #[serde(rename = "to_deg")]
    pub known_to_deg: Option<Spanned<f64>>,
    pub anywhere_m: Option<Spanned<f64>>,
}

impl Known {
    /// What nobody knows is within so many metres of where it is guessed.
    const UNKNOWN_M: f64 = 1.0;

    /// Whether nothing is known of it.
    pub fn is_anywhere(&self) -> bool {
        self.anywhere_m.is_some()
    }

    /// Whether it is known exactly.
    pub fn is_exact(&self) -> bool {
        self.known_to_m.is_none() && self.known_to_deg.is_none() && self.anywhere_m.is_none()
    }
}

impl<'de> Deserialize<'de> for Known {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Word;

        impl<'de> serde::de::Visitor<'de> for Word {
            type Value = Known;

            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("how well it is known: { to_m = 0.05, to_deg = 5.0 }, { anywhere_m = 1.0 } or \"unknown\"")
            }

            fn visit_str<E: serde::de::Error>(self, word: &str) -> Result<Known, E> {
                match word {
                    "unknown" => {
                        Ok(Known { anywhere_m: Some(Spanned::new(0..0, Known::UNKNOWN_M)), ..Known::default() })
                    }
                    _ => Err(E::invalid_value(serde::de::Unexpected::Str(word), &self)),
                }
            }

            fn visit_map<A: serde::de::MapAccess<'de>>(self, map: A) -> Result<Known, A::Error> {
                Known::deserialize(serde::de::value::MapAccessDeserializer::new(map))
            }
        }

        deserializer.deserialize_any(Word)
    }
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Prediction {
    pub of: Spanned<String>,
    #[serde(rename = "in")]
    pub seen_in: Option<Spanned<String>>,
    #[serde(default)]
    pub up_to_motion: bool,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InitialError {
    pub draw: ErrorDraw,
    pub angle_deg: Spanned<f64>,
    pub point_m: Spanned<f64>,
    pub marker_m: Option<Spanned<f64>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Head {
    pub position_m: Spanned<Exactly<f64, 3>>,
    pub look: Spanned<Exactly<f64, 3>>,
    pub pan_limit_deg: Option<Spanned<f64>>,
    pub tilt_limit_deg: Option<Spanned<f64>>,
    pub lens_half_angle_deg: Option<Spanned<f64>>,
    pub eye_baseline_m: Option<Spanned<f64>>,
    pub visible_pose_deg: Spanned<Vec<f64>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct View {
    pub visible_pose_deg: Spanned<Vec<f64>>,
    pub servo: Option<Spanned<Vec<Spanned<String>>>>,
    pub camera: Option<Spanned<String>>,
    pub target: Option<Spanned<Names>>,
}

/// One name, or several.
#[derive(Debug, Deserialize)]
#[serde(untagged, expecting = "is no name, expected one, or a list of names")]
pub enum Names {
    One(String),
    Several(Vec<String>),
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Change {
    pub step: Spanned<u64>,
    pub tilt: Option<Tilt>,
    pub shift: Option<Shift>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tilt {
    pub joint: Spanned<String>,
    pub angle_deg: Spanned<f64>,
    pub towards: Spanned<Exactly<f64, 3>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Shift {
    pub joint: Spanned<String>,
    pub by_m: Spanned<Exactly<f64, 3>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Outliers {
    pub fraction: Spanned<f64>,
    pub box_m: Spanned<f64>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Prior {
    pub direction_rad: Spanned<f64>,
    pub point_m: Spanned<f64>,
    pub marker_m: Option<Spanned<f64>>,
    pub ratio: Option<Spanned<f64>>,
    pub offset_rad: Option<Spanned<f64>>,
    pub offset_m: Option<Spanned<f64>>,
    pub eccentricity_rad: Option<Spanned<f64>>,
    pub compliance_rad_per_nm: Option<Spanned<f64>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Filter {
    pub measurement_variance_m2: Option<Spanned<f64>>,
    pub stabilising_noise: Option<StabilisingNoise>,
    pub underweighting: Option<Spanned<f64>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Smoother {
    pub measurement_variance_m2: Option<Spanned<f64>>,
    pub hypotheses: Option<Spanned<u64>>,
    pub spawned: Option<Spanned<u64>>,
    pub loss: Option<Loss>,
    pub outlier_fraction: Option<Spanned<f64>>,
    pub outlier_spread: Option<Spanned<f64>>,
    /// The knowledge of the noise; also written `sigma = "unknown"`.
    #[serde(alias = "sigma")]
    pub noise: Option<NoiseKnowledge>,
    /// The knowledge of the joints' readings' noise.
    pub reading_sigma: Option<NoiseKnowledge>,
}

/// Whether the size of a noise is stated or to be learned.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum NoiseKnowledge {
    Known,
    Unknown,
}

#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Loss {
    None,
    Huber,
    Mixture,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StabilisingNoise {
    pub variance: Spanned<f64>,
    pub first_step: Spanned<u64>,
    pub every: Spanned<u64>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Gradient {
    pub rate: Spanned<f64>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Selection {
    pub variant: DirectVariant,
    pub epsilon: Spanned<f64>,
    pub evaluations: Spanned<usize>,
    pub units: Units,
    pub characteristic_length_m: Option<Spanned<f64>>,
    #[serde(default)]
    pub criterion: Optimality,
    pub ahead: Option<Spanned<u64>>,
    pub batch: Option<Spanned<u64>>,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DirectVariant {
    Direct,
    DirectL,
}

#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Units {
    CharacteristicLength,
    Prior,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Thresholds {
    pub orientation_deg: Spanned<f64>,
    pub location_m: Spanned<f64>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Settled {
    pub expected_prediction_m: Spanned<f64>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Learner {
    pub name: Spanned<String>,
    pub estimator: EstimatorKind,
    pub policy: Spanned<PolicyKind>,
    pub stabilising_noise: Option<Spanned<bool>>,
    pub robust: Option<Spanned<bool>>,
    pub holds_axes: Option<Spanned<bool>>,
    #[serde(default = "yes")]
    pub by_default: bool,
}
