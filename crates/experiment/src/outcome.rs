//! What came of a step. The judge draws its conclusions from this, and whoever shows or stores a step begins here.

use std::sync::Arc;

use nalgebra::{Matrix3, Point3};

use super::{agent::Proposal, metrics::Metrics};
use body_schema_engine::{
    estimation::ReadingReport,
    model::{Links, State},
    selection::Partition,
    sensing::{MeasurementModel, Observation},
};

/// All learners after one step. Step 0 is the start: no movement yet, the initial estimate.
#[derive(Clone, Debug, PartialEq)]
pub struct StepOutcome {
    /// The step, counted from 0.
    pub step: u64,
    /// The learners, in the order of the setting.
    pub learners: Vec<LearnerOutcome>,
    /// The true state, at the one step at which it is another than before; `None` at all others.
    pub truth: Option<State>,
}

/// One learner after one step. What it believes then is its [belief](super::Learner::belief).
#[derive(Clone, Debug, PartialEq)]
pub struct LearnerOutcome {
    /// Its name.
    pub name: String,
    /// The movement of this step; `None` at step 0 and after a failure.
    pub movement: Option<MovementOutcome>,
    /// The metrics after the update.
    pub metrics: Metrics,
    /// The covariance that its prior and its data allow of the point on every joint's axis, linearised at the truth, m²: empty
    /// where no truth is known, `None` for a joint whose point is not learned.
    pub allowed: Vec<Option<Matrix3<f64>>>,
    /// Why the learner stopped learning, if it did (a diverged estimate).
    pub failure: Option<String>,
}

/// A movement: how it was chosen, what was expected, what was seen.
#[derive(Clone, Debug, PartialEq)]
pub struct MovementOutcome {
    /// The configuration θ, rad or m per joint.
    pub configuration: Vec<f64>,
    /// The row of the recorded data set; `None` in a simulated world.
    pub row: Option<usize>,
    /// The socket in which a target was held, by its number.
    pub socket: Option<usize>,
    /// The marker as predicted before the measurement, metres.
    pub predicted_marker: Point3<f64>,
    /// The measured marker, metres; `None` where no reading says where it was: after a miss, and in the picture of a camera.
    pub measured_marker: Option<Point3<f64>>,
    /// What was observed.
    pub observation: Observation,
    /// By channel the reading as predicted before the measurement, of those that are pictures of a camera that a link carries, where
    /// there is one.
    pub predicted_pictures: Vec<Option<Vec<f64>>>,
    /// What the estimator makes of the readings after the update, where it weighs them.
    pub weighed: Vec<ReadingReport>,
    /// The proposal that was carried out; `None` for a movement that nobody proposed.
    pub proposal: Option<Arc<Proposal>>,
}

/// How a learner stands after a step by its own lights.
#[derive(Clone, Debug, PartialEq)]
pub struct Standing {
    /// See [`Metrics::expected_prediction_m`].
    pub expected_prediction_m: Option<f64>,
    /// See [`Metrics::model_error_m`].
    pub model_error_m: Option<f64>,
    /// See [`Metrics::trace`].
    pub trace: Option<f64>,
    /// Normalised innovation squared of the last update, and its degrees of freedom.
    pub nis: Option<(f64, usize)>,
    /// Movements made so far.
    pub movements: u64,
    /// Movements after which the marker was not seen.
    pub misses: u64,
    /// See [`Metrics::settled`].
    pub settled: bool,
    /// How often it noticed a change of the body.
    pub changes_noticed: u64,
}

impl MovementOutcome {
    /// Whether any channel had a reading.
    pub fn seen(&self) -> bool {
        !self.observation.is_miss()
    }

    /// The criterion C(θ) of the choice; `None` for a policy without one.
    pub fn criterion(&self) -> Option<f64> {
        self.proposal.as_ref()?.selection.criterion
    }

    /// By how much the criterion was expected to fall: tr(W P) − C(θ), for criterion A.
    pub fn gain(&self) -> Option<f64> {
        self.proposal.as_ref()?.selection.gain
    }

    /// How many configurations were evaluated to choose this one.
    pub fn evaluations(&self) -> usize {
        self.proposal.as_ref().map_or(0, |proposal| proposal.selection.evaluations)
    }

    /// How long the choice took, milliseconds of wall time.
    pub fn selection_ms(&self) -> f64 {
        self.proposal.as_ref().map_or(0.0, |proposal| proposal.selection_ms)
    }

    /// DIRECT's partition of the joint box; that of a planner was for the first movement that its plan lacked.
    pub fn partition(&self) -> Option<Partition> {
        Some(self.proposal.as_ref()?.selection.search.as_ref()?.partition())
    }
}

/// By channel of `measurement_model` the picture that a camera on a link of a robot like `state` has in a posture; `None` for other channels, and
/// where a point is behind the camera.
pub(super) fn predicted_pictures(
    measurement_model: &MeasurementModel,
    state: &State,
    configuration: &[f64],
) -> Vec<Option<Vec<f64>>> {
    let links = Links::of(state, configuration);
    let predicted = measurement_model.sensors().iter().map(|sensor| {
        let (camera, _) = sensor.subject().sight()?;
        state.devices.get(camera)?.link?;
        let mut reading = vec![0.0; sensor.equations()];
        sensor.channel().predict(&links, &mut reading).then_some(reading)
    });
    predicted.collect()
}
