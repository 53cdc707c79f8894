//! The metrics as they are told.

use serde::{Deserialize, Serialize};

use body_schema_experiment as experiment;

/// The metrics of one learner after one step. What needs the truth is null where none is known.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
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
    /// Mean angle between predicted and measured rotations of held-out poses, degrees; null where none were measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub prediction_mean_deg: Option<f64>,
    /// Mean distance between predicted and measured points of held-out pictures, pixels; null where there are none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub prediction_mean_px: Option<f64>,
    /// With sockets: mean distance of the predicted target from its mean over the postures that hold it in the same socket, over
    /// sockets that were not trained on, metres; null where there are none.
    #[serde(default)]
    pub scatter_m: Option<f64>,
    /// The prediction error that the learner itself expects over its workspace: mean of √(tr(H P Hᵀ) + e²), e the model error,
    /// metres.
    pub expected_prediction_m: Option<f64>,
    /// By how much predictions are off that no parameter explains, root mean square, metres; null for a learner that takes the noise
    /// for known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
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
    #[serde(default)]
    pub bound_trace: Option<f64>,
    /// How often the learner noticed a change of the body.
    #[serde(default)]
    pub changes_noticed: u64,
    /// Every joint of the chain by itself, base first.
    pub joints: Vec<JointMetrics>,
}

/// One joint against the truth; null where no truth is known, and for a joint that is not learned.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct JointMetrics {
    /// Angle between estimated and true direction, signed, degrees.
    pub axis_deg: Option<f64>,
    /// Distance of the true axis point to the estimated line, metres; null for a prismatic joint.
    pub location_m: Option<f64>,
    /// How far this joint's error shows above the noise: with the true arm but for this one joint, which is as
    /// estimated, the root mean square displacement of the marker over the first 50 configurations of the evaluation
    /// set, divided by the standard deviation σ of the sensor per coordinate. At 1 the error is as large as the noise of
    /// one measurement. Null if the sensor has no noise.
    pub signal_to_noise: Option<f64>,
}

impl From<&experiment::Metrics> for Metrics {
    fn from(metrics: &experiment::Metrics) -> Self {
        Self {
            orientation_deg: metrics.orientation_deg,
            axis_deg: metrics.axis_deg,
            location_m: metrics.location_m,
            prediction_m: metrics.prediction_m,
            prediction_mean_m: metrics.prediction_mean_m,
            prediction_mean_deg: metrics.prediction_mean_deg,
            prediction_mean_px: metrics.prediction_mean_px,
            scatter_m: metrics.scatter_m,
            expected_prediction_m: metrics.expected_prediction_m,
            model_error_m: metrics.model_error_m,
            trace: metrics.trace,
            nis: metrics.nis,
            nis_dof: metrics.nis_dof,
            nees: metrics.nees,
            nees_dof: metrics.nees_dof,
            movements: metrics.movements,
            misses: metrics.misses,
            settled: metrics.settled,
            bound_trace: metrics.bound_trace,
            changes_noticed: metrics.changes_noticed,
            joints: metrics.joints.iter().map(JointMetrics::from).collect(),
        }
    }
}

impl From<&experiment::JointMetrics> for JointMetrics {
    fn from(joint: &experiment::JointMetrics) -> Self {
        let experiment::JointMetrics { axis_deg, location_m, signal_to_noise } = *joint;
        Self { axis_deg, location_m, signal_to_noise }
    }
}
