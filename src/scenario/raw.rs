//! The keys of a scenario file, and the errors of reading them.

use std::collections::BTreeMap;

use serde::Deserialize;
use toml::Spanned;

use super::{ErrorDraw, EstimatorKind, PolicyKind, error::Problem, error::similar};
use crate::{kinematics::JointKind, selection::Optimality};

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    pub name: Spanned<String>,
    pub title: String,
    pub steps: Spanned<u64>,
    pub robot: Robot,
    pub sensor: Option<Spanned<Sensor>>,
    pub initial_error: Option<Spanned<InitialError>>,
    pub measurements: Option<Spanned<Measurements>>,
    pub head: Option<Spanned<Head>>,
    pub change: Option<Spanned<Change>>,
    pub prior: Spanned<Prior>,
    pub filter: Filter,
    pub unscented: Option<Filter>,
    pub smoother: Option<Smoother>,
    pub gradient: Gradient,
    pub selection: Selection,
    pub thresholds: Thresholds,
    pub settled: Settled,
    #[serde(rename = "learner")]
    pub learners: Spanned<Vec<Learner>>,
    #[serde(default)]
    pub promises: BTreeMap<Spanned<String>, Spanned<u64>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Robot {
    pub marker_m: Spanned<[f64; 3]>,
    pub learn_marker: bool,
    #[serde(rename = "joint")]
    pub joints: Spanned<Vec<Spanned<Joint>>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Joint {
    pub name: Spanned<String>,
    pub kind: JointKind,
    pub axis: Spanned<[f64; 3]>,
    pub point_m: Option<Spanned<[f64; 3]>>,
    pub limits_deg: Option<Spanned<[f64; 2]>>,
    pub limits_m: Option<Spanned<[f64; 2]>>,
    #[serde(default = "yes")]
    pub learned: bool,
    pub column: Option<Spanned<String>>,
}

fn yes() -> bool {
    true
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sensor {
    pub sigma_m: Spanned<f64>,
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
pub struct Measurements {
    pub file: Spanned<String>,
    pub marker_columns_m: Spanned<[String; 3]>,
    pub held_out: Spanned<usize>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Head {
    pub position_m: Spanned<[f64; 3]>,
    pub look: Spanned<[f64; 3]>,
    pub pan_limit_deg: Option<Spanned<f64>>,
    pub tilt_limit_deg: Option<Spanned<f64>>,
    pub lens_half_angle_deg: Option<Spanned<f64>>,
    pub eye_baseline_m: Option<Spanned<f64>>,
    pub visible_pose_deg: Spanned<Vec<f64>>,
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
    pub towards: Spanned<[f64; 3]>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Shift {
    pub joint: Spanned<String>,
    pub by_m: Spanned<[f64; 3]>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Prior {
    pub direction_rad: Spanned<f64>,
    pub point_m: Spanned<f64>,
    pub marker_m: Option<Spanned<f64>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Filter {
    pub measurement_variance_m2: Spanned<f64>,
    pub stabilising_noise: Option<StabilisingNoise>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Smoother {
    pub measurement_variance_m2: Option<Spanned<f64>>,
    pub hypotheses: Option<Spanned<u64>>,
    pub spawned: Option<Spanned<u64>>,
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
    #[serde(default = "yes")]
    pub by_default: bool,
}

/// Reads the keys of `text`.
pub fn read(text: &str) -> Result<Scenario, Problem> {
    let deserializer = toml::Deserializer::parse(text).map_err(|error| problem(text, "", &error))?;
    serde_path_to_error::deserialize(deserializer).map_err(|error| {
        let path = readable_path(&error.path().to_string());
        problem(text, &path, error.inner())
    })
}

/// The line (from 1) of a byte offset.
pub fn line_of(text: &str, offset: usize) -> usize {
    text.as_bytes().iter().take(offset).filter(|&&byte| byte == b'\n').count() + 1
}

/// Drops what `Spanned` adds to paths, but for the index of a sequence.
fn readable_path(path: &str) -> String {
    let mut readable = String::new();
    for part in path.split('.') {
        let (name, index) = part.find('[').map_or((part, ""), |bracket| part.split_at(bracket));
        if !(name.starts_with("$__") || name == "?" || name.is_empty()) {
            if !readable.is_empty() {
                readable.push('.');
            }
            readable.push_str(name);
        }
        readable.push_str(index);
    }
    readable
}

fn problem(text: &str, path: &str, error: &toml::de::Error) -> Problem {
    let message = error.message().to_owned();
    let line = error.span().map_or(1, |span| line_of(text, span.start));
    let quoted: Vec<&str> = message.split('`').skip(1).step_by(2).collect();
    let below = |key: &str| match path {
        "" => key.to_owned(),
        _ if path == key || path.ends_with(&format!(".{key}")) => path.to_owned(),
        _ => format!("{path}.{key}"),
    };
    match quoted.split_first() {
        Some((unknown, expected)) if message.starts_with("unknown field") => {
            let with_unit = expected.iter().find(|known| known.starts_with(&format!("{unknown}_")));
            let mend = match (with_unit, similar(unknown, expected.iter().copied())) {
                (Some(known), _) => format!("write `{known}`: the unit belongs to the key"),
                (None, Some(known)) => format!("did you mean `{known}`? The keys here are {}", expected.join(", ")),
                (None, None) => format!("remove it; the keys here are {}", expected.join(", ")),
            };
            Problem { line, key: below(unknown), what: "unknown key".into(), mend }
        }
        Some((missing, _)) if message.starts_with("missing field") => Problem {
            line,
            key: below(missing),
            what: "missing".into(),
            mend: format!("add `{missing} = …` here; the built-in scenarios show each key with its meaning"),
        },
        Some((value, expected)) if message.starts_with("unknown variant") => Problem {
            line,
            key: path.to_owned(),
            what: format!("`{value}` is not a choice"),
            mend: format!("write one of {}", expected.join(", ")),
        },
        _ => {
            let key = if path.is_empty() { "(file)".to_owned() } else { path.to_owned() };
            let (what, mend) = match message.split_once(", expected ") {
                Some((what, expected)) => (what.to_owned(), format!("write {expected}")),
                None => (message.clone(), "correct the TOML on this line".to_owned()),
            };
            Problem { line, key, what, mend }
        }
    }
}
