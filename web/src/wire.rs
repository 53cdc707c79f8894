//! What the server sends, as far as the panel reads it: the parts of its OpenAPI description that are shown here.

use serde::Deserialize;

/// A scenario in brief.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct Scenario {
    /// Its name.
    pub name: String,
    /// One line about it.
    pub title: String,
    /// `simulated` or `measured`.
    pub world: String,
    /// The joints, base first.
    pub joints: Vec<Joint>,
    /// Number of learned parameters.
    pub parameters: usize,
    /// Steps of a run unless told otherwise.
    pub steps: u64,
    /// The learners it offers.
    pub learners: Vec<Learner>,
    /// What else can be compared: any estimator with any policy that fits it.
    #[serde(default)]
    pub compositions: Vec<Learner>,
}

impl Scenario {
    /// Every learner that can be compared, the scenario's own first.
    pub fn offered(&self) -> impl Iterator<Item = &Learner> {
        self.learners.iter().chain(&self.compositions)
    }
}

/// A joint.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct Joint {
    /// Its name.
    pub name: String,
    /// `revolute` or `prismatic`; absent in a selection.
    #[serde(default)]
    pub kind: Option<String>,
    /// Its limits, rad or m.
    pub limits: [f64; 2],
}

/// A learner of the comparison.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct Learner {
    /// Its name in the scenario.
    pub name: String,
    /// Its estimator.
    pub estimator: String,
    /// Its policy.
    pub policy: String,
}

/// The thresholds of convergence.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
pub struct Thresholds {
    /// Largest orientation error, degrees.
    pub orientation_deg: f64,
    /// Largest location error, metres.
    pub location_m: f64,
}

/// What stays the same from step to step.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
pub struct Description {
    /// Name of the scenario.
    pub scenario: String,
    /// One line about it.
    pub title: String,
    /// Seed of all random streams.
    pub seed: u64,
    /// The joints, base first.
    pub joints: Vec<Joint>,
    /// Number of learned parameters.
    #[serde(default)]
    pub parameters: u64,
    /// Movements after which there are as many equations as unknowns: a yardstick, not a bound.
    #[serde(default)]
    pub movements_by_counting: u64,
    /// The learners, in the order of every report.
    pub learners: Vec<Learner>,
    /// The thresholds of convergence.
    pub thresholds: Thresholds,
    /// The true arm; only whether it is known matters here.
    #[serde(default)]
    pub truth: Option<serde::de::IgnoredAny>,
    /// After so many movements the body changes.
    #[serde(default)]
    pub change_at: Option<u64>,
}

/// A session.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct Session {
    /// Its id.
    pub id: String,
    /// What it runs.
    pub description: Description,
    /// Its latest step.
    pub step: u64,
    /// Steps that recorded data still offer; null without an end.
    #[serde(default)]
    pub remaining: Option<u64>,
}

/// All learners after one step.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct Report {
    /// The step.
    pub step: u64,
    /// The learners, in the order of the description.
    pub learners: Vec<LearnerReport>,
}

/// One learner after one step.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct LearnerReport {
    /// The movement of this step.
    #[serde(default)]
    pub movement: Option<Movement>,
    /// The metrics after it.
    pub metrics: Metrics,
    /// Why the learner stopped learning.
    #[serde(default)]
    pub failure: Option<String>,
}

/// A movement.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct Movement {
    /// The expected fall of the trace.
    #[serde(default)]
    pub gain: Option<f64>,
    /// How long the choice took, ms.
    #[serde(default)]
    pub selection_ms: f64,
}

/// Errors and verdicts; what needs a truth is null where none is known.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(default)]
pub struct Metrics {
    /// Mean error of the angles between axes, degrees.
    pub orientation_deg: Option<f64>,
    /// Mean distance of the true axis points from the estimated axes, metres.
    pub location_m: Option<f64>,
    /// Mean distance of the predicted from the true marker, metres.
    pub prediction_mean_m: Option<f64>,
    /// tr(W P).
    pub trace: Option<f64>,
    /// Cramér–Rao bound of the data collected on the trace of the error's covariance.
    pub bound_trace: Option<f64>,
    /// Movements made.
    pub movements: u64,
    /// Movements after which the marker was not seen.
    pub misses: u64,
    /// The learner's own verdict.
    pub settled: bool,
}

/// Why the server refused (RFC 9457).
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(default)]
pub struct Problem {
    /// HTTP status; 0 where there was no answer.
    pub status: u16,
    /// What kind of error.
    pub title: String,
    /// What is wrong.
    pub detail: String,
    /// The field that is wrong.
    pub field: Option<String>,
    /// The step that the session is at.
    pub step: Option<u64>,
}

impl Problem {
    /// One sentence.
    pub fn sentence(&self) -> String {
        let text = if self.detail.is_empty() { &self.title } else { &self.detail };
        if text.is_empty() { "the server does not answer".to_owned() } else { text.clone() }
    }
}

/// How DIRECT chose the last movement of a learner.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct Selection {
    /// The step of the movement.
    pub step: u64,
    /// The learner.
    pub learner: String,
    /// `direct` or `direct-l`.
    pub variant: String,
    /// The joints that were chosen for.
    pub joints: Vec<Joint>,
    /// tr(W P) before the choice.
    pub trace: f64,
    /// How many configurations were tried.
    pub evaluations: usize,
    /// The outcome.
    pub chosen: Chosen,
    /// All boxes, in the order of their evaluation.
    pub boxes: Vec<SearchBox>,
    /// The course of the search.
    pub iterations: Vec<Iteration>,
}

/// The configuration that was chosen.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct Chosen {
    /// Its box.
    #[serde(rename = "box")]
    pub index: usize,
    /// Rad or m per joint.
    pub configuration: Vec<f64>,
    /// The same in the unit cube.
    pub point: Vec<f64>,
    /// The criterion there.
    pub criterion: Option<f64>,
    /// Expected fall of the trace.
    pub predicted_gain: Option<f64>,
    /// Fall of the trace over that step.
    pub realised_gain: Option<f64>,
}

/// A box of the partition.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct SearchBox {
    /// Its centre in the unit cube.
    pub centre: Vec<f64>,
    /// The criterion at its centre; null if it is not finite.
    pub value: Option<f64>,
    /// Its shapes, oldest first.
    pub shapes: Vec<BoxShape>,
}

/// The shape of a box from one iteration on.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct BoxShape {
    /// From the end of this iteration on.
    pub iteration: usize,
    /// Side i is 3^-levels\[i\].
    pub levels: Vec<u32>,
}

/// One iteration of the search.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct Iteration {
    /// Its number, from 0.
    pub iteration: usize,
    /// Evaluations up to its end.
    pub evaluations: usize,
    /// The best value up to its end.
    pub best: Option<f64>,
    /// The potentially optimal boxes at its end: those that the next divides.
    pub hull: Vec<usize>,
}

/// What another posture would have taught.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct Evaluation {
    /// Rad or m per joint.
    pub configuration: Vec<f64>,
    /// The criterion there.
    pub criterion: f64,
    /// Expected fall of the trace.
    pub gain: f64,
    /// Where the marker would be expected, metres.
    pub predicted_marker_m: [f64; 3],
    /// How uncertain that is, m².
    pub marker_covariance_m2: [[f64; 3]; 3],
    /// How likely the head would see it.
    pub chance_of_being_seen: f64,
}
