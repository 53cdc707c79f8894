//! What is told of a step, made of its outcome by whoever wants it.

use serde::{Deserialize, Serialize};

use super::{
    GazeReport, Metrics, ModelReport, array, arrays,
    model::{branching_bones, shown},
};
use body_schema_engine::selection::Partition;
use body_schema_experiment::{self as experiment, Experiment, Learner, LearnerOutcome, MovementOutcome, Reading};

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
    /// Of a robot that branches, the same arm branch by branch, that of the marker first: the pivot of the joint that carries the branch,
    /// the axis points of its own joints, and the marker or what its last link carries, metres. Empty for an arm.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub estimated_bones_m: Vec<Vec<[f64; 3]>>,
    /// The true arm likewise; empty for an arm, and where no truth is known.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub true_bones_m: Vec<Vec<[f64; 3]>>,
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
    /// The pictures of cameras that links carry. Recordings show them, JSON does not have them.
    #[serde(skip)]
    pub pictures: Vec<Picture>,
    /// Whether any channel had a reading.
    #[serde(skip, default)]
    pub seen: bool,
    /// DIRECT's partition of the joint box; that of a planner was for the first movement that its plan lacked. Too large for every report: recordings hold it, JSON does not.
    #[serde(skip)]
    pub partition: Option<Partition>,
}

/// The known points of a target in the picture of a camera that a link carries, pixels each.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Picture {
    /// The camera, by its number.
    pub camera: usize,
    /// The target, by its number.
    pub target: usize,
    /// Where the points were measured; `None` for a miss.
    pub measured_px: Option<Vec<[f64; 2]>>,
    /// Where they were predicted before the measurement; `None` where the estimate has them behind the camera.
    pub predicted_px: Option<Vec<[f64; 2]>>,
    /// Where they truly are without noise, be it beside the picture; `None` behind the camera, and where no truth is known.
    pub true_px: Option<Vec<[f64; 2]>>,
}

/// A reading of the present movement beside what the estimate after the update says of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ChannelReading {
    /// The channel, counted from 0.
    pub channel: usize,
    /// ‖L⁻¹ (y ⊖ h)‖/√d, the root mean square over its d equations in standard deviations of the sensor's noise: about 1
    /// where noise is all that is left. Null for a miss.
    pub residual_sigmas: Option<f64>,
    /// The same of each part, null for one that was not seen; empty for a miss.
    pub parts_sigmas: Vec<Option<f64>>,
    /// The weight that a robust loss gives its equations; null for an estimator without one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub weight: Option<f64>,
    /// The probability that it is an outlier; null for an estimator whose loss knows of none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub outlier_probability: Option<f64>,
}

impl ChannelReading {
    /// From this probability on a reading is called an outlier.
    pub const OUTLIER: f64 = Reading::OUTLIER;

    /// Whether it rather is an outlier than not.
    pub fn is_outlier(&self) -> bool {
        self.outlier_probability.is_some_and(|probability| probability > Self::OUTLIER)
    }
}

impl StepReport {
    /// Of the latest step of an experiment.
    pub fn of(experiment: &Experiment) -> Self {
        let outcome = experiment.latest();
        let learners = experiment.learners().iter().zip(&outcome.learners).enumerate();
        Self {
            step: outcome.step,
            learners: learners.map(|(index, it)| LearnerReport::of(experiment, index, it)).collect(),
            truth: outcome.truth.as_ref().map(ModelReport::of_state),
        }
    }
}

impl LearnerReport {
    fn of(experiment: &Experiment, index: usize, (learner, outcome): (&Learner, &LearnerOutcome)) -> Self {
        let LearnerOutcome { name, movement, metrics, allowed, failure } = outcome;
        let (belief, truth) = (learner.belief(), experiment.world().truth());
        Self {
            name: name.clone(),
            movement: movement.as_ref().map(|movement| MovementReport::of(experiment, index, learner, movement)),
            estimate: ModelReport::of_outcome(belief, truth, allowed),
            metrics: metrics.into(),
            failure: failure.clone(),
        }
    }
}

impl MovementReport {
    fn of(experiment: &Experiment, index: usize, learner: &Learner, movement: &MovementOutcome) -> Self {
        let configuration = &movement.configuration;
        let (world, setting) = (experiment.world(), experiment.setting());
        let socket = movement.socket.and_then(|socket| setting.sockets.get(socket));
        let gaze = world.head().zip(experiment.gaze(configuration));
        Self {
            configuration: configuration.clone(),
            row: movement.row,
            socket: socket.map(|socket| socket.label()),
            gaze: gaze.map(|(head, gaze)| GazeReport::of(head, &gaze)),
            predicted_marker_m: array(&movement.predicted_marker.coords),
            measured_marker_m: movement.measured_marker.map(|position| array(&position.coords)),
            estimated_skeleton_m: arrays(&shown(&learner.belief().state, world.truth()).skeleton(configuration)),
            true_skeleton_m: world.truth().map(|truth| arrays(&truth.skeleton(configuration))),
            estimated_bones_m: branching_bones(&shown(&learner.belief().state, world.truth()), configuration),
            true_bones_m: world.truth().map_or_else(Vec::new, |truth| branching_bones(truth, configuration)),
            criterion: movement.criterion(),
            gain: movement.gain(),
            evaluations: movement.evaluations(),
            selection_ms: movement.selection_ms(),
            readings: experiment.readings(index).into_iter().map(ChannelReading::from).collect(),
            pictures: experiment.pictures(index).into_iter().map(Picture::from).collect(),
            seen: movement.seen(),
            partition: movement.partition(),
        }
    }
}

impl From<experiment::Picture> for Picture {
    fn from(picture: experiment::Picture) -> Self {
        let pairs = |numbers: Vec<f64>| numbers.chunks_exact(2).map(|point| [point[0], point[1]]).collect();
        let experiment::Picture { camera, target, measured, predicted, truth } = picture;
        Self {
            camera,
            target,
            measured_px: measured.map(pairs),
            predicted_px: predicted.map(pairs),
            true_px: truth.map(pairs),
        }
    }
}

impl From<Reading> for ChannelReading {
    fn from(reading: Reading) -> Self {
        let Reading { channel, residual_sigmas, parts_sigmas, weight, outlier_probability } = reading;
        let parts_sigmas = parts_sigmas.into_iter().map(|part| Some(part).filter(|part| part.is_finite())).collect();
        Self { channel, residual_sigmas, parts_sigmas, weight, outlier_probability }
    }
}
