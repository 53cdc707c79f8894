//! What is asked, and what is answered.

use std::sync::Arc;

use body_schema_ask_tell::{
    ChannelShape, Status,
    integer::{integer, integer_or_none},
    json::{self, Unreadable},
};
use body_schema_recording::{EllipsoidSize, MOST_FRAMES};
use body_schema_scenario::{ScenarioSummary, WorldKind};
use body_schema_wire::Description;
use serde::{Deserialize, Serialize, Serializer, de::DeserializeOwned};
use serde_json::value::RawValue;

use crate::{Kind, Problem};

/// A request draws at most so many postures on the way: each takes some kilobytes of the session's memory.
const MAX_FRAMES_PER_REQUEST: u64 = 1000;

/// What a session is made from.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct NewSession {
    /// Name of a built-in scenario.
    #[cfg_attr(feature = "openapi", schema(example = "arm-6dof"))]
    pub scenario: String,
    /// Seed of all random streams.
    #[serde(default = "first_seed", deserialize_with = "integer")]
    #[cfg_attr(feature = "openapi", schema(default = 1))]
    pub seed: u64,
    /// The learners to compare, by their names in the scenario; all of the scenario's if absent or null.
    #[serde(default)]
    #[cfg_attr(feature = "openapi", schema(example = json!(["active", "random"])))]
    pub learners: Option<Vec<String>>,
    /// How large the ellipsoids of its recording are.
    #[serde(default)]
    pub ellipsoids: EllipsoidSize,
    /// Keys of the scenario file and the values that they are to have, each as `KEY=VALUE`; what they make of the scenario is
    /// held to all that a scenario file is held to.
    #[serde(default)]
    #[cfg_attr(feature = "openapi", schema(example = json!(["sensor.sigma_m=0.002"])))]
    pub set: Vec<String>,
    /// How many times as large its recording draws the differences of a real robot from its description, from 1 to 50; simulated
    /// robots are drawn as they are.
    #[serde(default = "as_they_are")]
    #[cfg_attr(feature = "openapi", schema(default = 1, minimum = 1, maximum = 50))]
    pub enlarge: f64,
}

fn as_they_are() -> f64 {
    1.0
}

fn first_seed() -> u64 {
    1
}

/// The scenarios.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ScenarioList {
    /// All of them: those of one's own, then the built-in ones, simplest first.
    pub scenarios: Vec<ScenarioSummary>,
}

/// A scenario with its source.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ScenarioResource {
    /// The scenario in brief.
    #[serde(flatten)]
    pub summary: ScenarioSummary,
    /// The scenario file, TOML.
    pub source: String,
}

/// How far to go.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct StepRequest {
    /// How many steps to make.
    #[serde(default = "one", deserialize_with = "integer")]
    #[cfg_attr(feature = "openapi", schema(default = 1, minimum = 1))]
    pub count: u64,
    /// The step that the session must be at; otherwise nothing is stepped (409). It makes a repeated request safe.
    #[serde(default, deserialize_with = "integer_or_none")]
    pub expected_step: Option<u64>,
    /// So many postures are drawn on the way to each step in the live recording, on its timeline `motion`; downloads have
    /// none of them. At most 1000 in one request.
    #[serde(default, deserialize_with = "integer")]
    #[cfg_attr(feature = "openapi", schema(default = 0, maximum = 30))]
    pub frames: u64,
    /// Whether the answer carries the reports of the steps. Whoever follows the session's events or its WebSocket gets
    /// them there.
    #[serde(default = "yes")]
    #[cfg_attr(feature = "openapi", schema(default = true))]
    pub reports: bool,
}

fn one() -> u64 {
    1
}

fn yes() -> bool {
    true
}

/// What was made of a [`StepRequest`].
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct MadeSteps {
    /// The step that the session is at after these.
    pub step: u64,
    /// How many steps the recorded data set has left; null without an end.
    pub remaining: Option<u64>,
    /// The reports of the steps made, in order; empty if the request wants none.
    #[serde(serialize_with = "all")]
    #[cfg_attr(feature = "openapi", schema(value_type = Vec<body_schema_wire::StepReport>))]
    pub reports: Vec<Arc<RawValue>>,
}

fn all<S: Serializer>(reports: &[Arc<RawValue>], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(reports.iter().map(AsRef::as_ref))
}

/// A session as its resource shows it.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct SessionResource {
    /// Its id.
    #[cfg_attr(feature = "openapi", schema(format = "uuid"))]
    pub id: String,
    /// Where its movements are made.
    pub world: WorldKind,
    /// What stays the same from step to step.
    pub description: Description,
    /// The latest step; 0 is the start, before any movement. With a robot elsewhere a step is an observation that counts.
    pub step: u64,
    /// How many steps the recorded data set has left; null in a simulated world and with a robot elsewhere, which have no end.
    pub remaining: Option<u64>,
    /// The id of its recording, by which viewers tell one from another: with a robot elsewhere another one each time the
    /// session comes back to memory. Null for one that is not there.
    pub recording: Option<String>,
    /// Name of the recording's file in the server's data directory; null if it keeps none.
    pub file: Option<String>,
    /// Why the recording's file lacks steps, if it could not be written; null otherwise. Nothing else is affected, and it is
    /// written anew when the session ends.
    pub recording_failure: Option<String>,
    /// Why the session can make no more steps, if its engine has failed; null otherwise.
    pub failure: Option<String>,
    /// With a robot elsewhere: how it stands. Null for all others, and in a list for one that was not asked for since the
    /// server was started.
    pub status: Option<Status>,
    /// With a robot elsewhere: its channels, by their names among the measurements of an observation; empty for all others.
    pub channels: Vec<ChannelShape>,
}

/// A posture to be appraised.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct EvaluationRequest {
    /// One position per joint, rad (revolute) or m (prismatic), within its limits.
    pub configuration: Vec<f64>,
    /// Whether those who follow the recording see the posture beside the learner's arm. Sessions with robots elsewhere show what is suggested
    /// instead.
    #[serde(default)]
    pub show: bool,
}

/// The movement that a person chooses.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct ConfigurationRequest {
    /// One position per joint, rad (revolute) or m (prismatic), within its limits.
    pub configuration: Vec<f64>,
}

/// The movement that a person has chosen.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Configuration {
    /// One position per joint, rad (revolute) or m (prismatic); null if none is set for the next step.
    pub configuration: Option<Vec<f64>>,
}

impl StepRequest {
    /// Whether one request may ask for so much, of at most so many steps.
    ///
    /// # Errors
    ///
    /// [`Kind::InvalidValue`] of `count` or `frames`.
    pub fn check(&self, most_steps: u64) -> Result<(), Problem> {
        let Self { count, frames, .. } = *self;
        if !(1..=most_steps).contains(&count) {
            let detail = format!("`count` must be from 1 to {most_steps}, not {count}");
            return Err(Problem::new(Kind::InvalidValue, detail).field("count"));
        }
        if frames > MOST_FRAMES {
            let detail = format!("`frames` must be from 0 to {MOST_FRAMES}, not {frames}");
            return Err(Problem::new(Kind::InvalidValue, detail).field("frames"));
        }
        if count * frames > MAX_FRAMES_PER_REQUEST {
            let detail = format!(
                "{count} steps with {frames} postures on the way to each are more than {MAX_FRAMES_PER_REQUEST} postures; ask \
                 for fewer of them, or for fewer steps"
            );
            return Err(Problem::new(Kind::InvalidValue, detail).field("frames"));
        }
        Ok(())
    }
}

/// Reads a body of JSON. Nothing, and `null`, count as `{}`, so that defaults need no body.
///
/// # Errors
///
/// [`Kind::Malformed`] where it is no JSON, [`Kind::InvalidValue`] of the field that is not as it should be.
pub fn read<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, Problem> {
    let is_nothing = bytes.is_empty() || bytes.trim_ascii() == b"null";
    parse(if is_nothing { b"{}" } else { bytes })
}

/// Reads JSON.
///
/// # Errors
///
/// As those of [`read`].
pub fn parse<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, Problem> {
    json::read(bytes).map_err(|Unreadable { is_malformed, field, what, hint }| {
        if is_malformed {
            return Problem::new(Kind::Malformed, what);
        }
        let detail = match &field {
            Some(field) => format!("`{field}`: {what}; {hint}"),
            None => format!("{what}; {hint}"),
        };
        let problem = Problem::new(Kind::InvalidValue, detail).hint(what, hint);
        field.into_iter().fold(problem, Problem::field)
    })
}
