//! The outcome of a run: the metrics at its end and the learned models, to take away and use.

use serde::{Deserialize, Serialize};

use super::{BestDesign, JointKind, Metrics, Thresholds, array};
use body_schema_engine::{
    design,
    estimation::{self, Belief},
    kinematics::chart,
    model::Block,
};
use body_schema_experiment::{Experiment, Outlier};

/// The outcome of one run: `result.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct RunResult {
    /// Name of the scenario.
    pub scenario: String,
    /// What is other than in the scenario's file, as `KEY=VALUE`; empty for the scenario as it is.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub set: Vec<String>,
    /// Seed of all random streams.
    pub seed: u64,
    /// Version of body-schema that computed this.
    pub version: String,
    /// Steps made.
    pub steps: u64,
    /// The thresholds of `converged_at`.
    pub thresholds: Thresholds,
    /// See [`Description::movements_by_counting`](super::Description::movements_by_counting).
    #[serde(default)]
    pub movements_by_counting: usize,
    /// The best designs of several lengths up to this run's, by step; empty unless they were asked for, and where no
    /// truth is known.
    #[serde(default)]
    pub best_designs: Vec<BestDesign>,
    /// The readings that had nothing to do with the robot, where the world is simulated and has such.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub outliers: Vec<OutlierReading>,
    /// The learners.
    pub learners: Vec<LearnerResult>,
}

/// A reading that had nothing to do with the robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct OutlierReading {
    /// The movement, counted from 1.
    pub movement: u64,
    /// The channel, counted from 0.
    pub channel: usize,
}

/// The outcome of one learner.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct LearnerResult {
    /// Its name.
    pub name: String,
    /// Its estimator.
    pub estimator: String,
    /// Its policy.
    pub policy: String,
    /// First movement of the final stretch within the thresholds, confirmed by 20 more; null if there is none.
    pub converged_at: Option<u64>,
    /// After a change of the body: the first movement, counted from the change, of the final stretch within the
    /// thresholds, confirmed by 20 more; null if there is none or no change. `converged_at` is judged up to the change.
    pub recovered_at: Option<u64>,
    /// The movement, counted from the change, at which the learner itself noticed it; null for a learner that does not
    /// look for changes.
    pub change_detected_at: Option<u64>,
    /// How often the learner noticed a change of the body before there was one.
    #[serde(default)]
    pub false_alarms: u64,
    /// First movement at which the learner called itself settled; null if it did not.
    pub settled_at: Option<u64>,
    /// Why the learner stopped learning, if it did.
    pub failure: Option<String>,
    /// The A-efficiency of the data collected: the trace of the last of `best_designs` as a fraction of `bound_trace` at
    /// the end; null without one of them.
    #[serde(default)]
    pub efficiency: Option<f64>,
    /// How many parameters it learns.
    #[serde(default)]
    pub parameters: usize,
    /// The metrics at the end.
    pub metrics: Metrics,
    /// What it makes of every reading, for a learner with a robust loss.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub readings: Vec<ReadingReport>,
    /// The scales of noise that it learned.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub noise: Vec<NoiseReport>,
    /// How far the joints' readings are off as it learned it: one standard deviation for each joint, rad or m.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub reading_sigmas: Vec<f64>,
    /// What is to be said of it in words: what no movement can tell, noise other than promised, outliers, alarms.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub remarks: Vec<String>,
    /// The learned model.
    pub model: Model,
}

/// What an estimator makes of one reading, by its belief.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ReadingReport {
    /// The movement, counted from 1; 0 for what was known before the first.
    pub movement: u64,
    /// The channel, counted from 0.
    pub channel: usize,
    /// Its equations.
    pub equations: usize,
    /// How far it is from what the belief predicts, in standard deviations of its noise.
    pub residual_sigmas: f64,
    /// The weight of its equations; 1 for least squares.
    pub weight: f64,
    /// The probability that it is an outlier; null for a loss that knows of none.
    pub outlier_probability: Option<f64>,
}

/// The learned scale of one kind of noise.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct NoiseReport {
    /// The channel, counted from 0.
    pub channel: usize,
    /// The first of its equations that this noise is of.
    pub first: usize,
    /// Its standard deviation in nominal ones.
    pub scale: f64,
}

/// A learned chain with its covariance, at θ = 0, in the frame of the measurements.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Model {
    /// The joints, base first.
    pub joints: Vec<JointModel>,
    /// The joint that carries each joint, counted from 0, null for one on the base; empty for an arm, whose every joint is carried by the
    /// one before it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub parents: Vec<Option<usize>>,
    /// The marker on the hand.
    pub marker: MarkerModel,
    /// What else is learned: base, ratios, offsets, other targets, cameras.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub others: Vec<OtherModel>,
    /// Covariance of all learned parameters in tangent coordinates, row by row; null if the estimator keeps none. Every part
    /// of the model lists its own under `coordinates`.
    pub covariance: Option<Vec<Vec<f64>>>,
}

/// A learned joint.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct JointModel {
    /// Its name.
    pub name: String,
    /// Revolute or prismatic.
    pub kind: JointKind,
    /// Whether it was learned, or known and held fixed.
    pub learned: bool,
    /// Unit direction of the axis.
    pub axis: [f64; 3],
    /// A point on the axis, metres; null for a prismatic joint.
    pub point_m: Option<[f64; 3]>,
    /// The chart's basis: two unit vectors ⟂ axis along which point (m) and direction (rad) move.
    pub basis: [[f64; 3]; 2],
    /// What its readings are multiplied by; 1 unless it is learned.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub ratio: f64,
    /// What is added to its readings, rad or m; 0 unless it is learned.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub offset: f64,
    /// Indices of this joint's coordinates in the covariance: two of the point (revolute only), two of the direction.
    pub coordinates: Vec<usize>,
}

/// Something learned besides axes and marker.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct OtherModel {
    /// What it is, by its name in the engine and its number from 0: `Base`, `Ratio(3)`.
    pub what: String,
    /// Indices of its coordinates in the covariance.
    pub coordinates: Vec<usize>,
}

fn one() -> f64 {
    1.0
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde calls it")]
fn is_one(x: &f64) -> bool {
    *x == 1.0
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde calls it")]
fn is_zero(x: &f64) -> bool {
    *x == 0.0
}

/// The marker on the hand.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct MarkerModel {
    /// Its position at θ = 0, metres.
    pub position_m: [f64; 3],
    /// What carries it on a robot that branches: 0 is its base, i what moves with the i-th joint. Null for an arm, whose last link
    /// carries it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub link: Option<usize>,
    /// Whether it was learned.
    pub learned: bool,
    /// Indices of its coordinates in the covariance: x, y, z (m).
    pub coordinates: Vec<usize>,
}

impl Model {
    fn new(belief: &Belief, names: &[String]) -> Self {
        let layout = &belief.layout;
        // With a base of its own the basis turns with it, as the axis does.
        let state = belief.state.measured();
        let rotation = belief.state.base.rotation;
        let joints = belief
            .state
            .joints
            .iter()
            .enumerate()
            .zip(&state.joints)
            .map(|((index, own), joint)| {
                let basis = rotation.to_rotation_matrix().matrix() * chart::basis(&own.direction());
                let coordinates = [layout.point(index), layout.direction(index)];
                JointModel {
                    name: names.get(index).cloned().unwrap_or_default(),
                    kind: joint.kind().into(),
                    learned: layout.is_learned(index),
                    axis: array(&joint.direction()),
                    point_m: joint.line().map(|line| array(&line.point.coords)),
                    basis: [array(&basis.column(0).into_owned()), array(&basis.column(1).into_owned())],
                    ratio: belief.state.corrections[index].ratio,
                    offset: belief.state.corrections[index].offset,
                    coordinates: coordinates.into_iter().flatten().flatten().collect(),
                }
            })
            .collect();
        let marker = MarkerModel {
            position_m: array(&state.marker().coords),
            link: (!state.tree.is_serial()).then(|| state.hand_link()),
            learned: layout.marker().is_some(),
            coordinates: layout.marker().into_iter().flatten().collect(),
        };
        let others = layout.blocks().filter(|(block, _)| !matches!(block, Block::Axis(_)));
        let others = others.filter(|(_, range)| Some(range.start) != layout.marker().map(|marker| marker.start));
        let others =
            others.map(|(block, range)| OtherModel { what: format!("{block:?}"), coordinates: range.collect() });
        let others = others.collect();
        let covariance =
            belief.covariance.as_ref().map(|p| p.row_iter().map(|row| row.iter().copied().collect()).collect());
        Self { joints, parents: state.tree.clone().into(), marker, others, covariance }
    }
}

impl RunResult {
    /// The outcome of an experiment so far.
    pub fn of(experiment: &Experiment) -> Self {
        let setting = experiment.setting();
        let names: Vec<String> = setting.joints.iter().map(|joint| joint.name.clone()).collect();
        let learners = (experiment.learners().iter().zip(&experiment.latest().learners))
            .zip(experiment.verdicts())
            .enumerate()
            .map(|(index, ((learner, outcome), verdict))| LearnerResult {
                name: outcome.name.clone(),
                estimator: learner.setting.estimator.clone(),
                policy: learner.setting.policy.clone(),
                converged_at: verdict.convergence.converged_at(),
                recovered_at: verdict.recovery.converged_at(),
                change_detected_at: verdict.noticed_at,
                false_alarms: verdict.false_alarms,
                settled_at: verdict.settled_at,
                failure: outcome.failure.clone(),
                efficiency: None,
                parameters: learner.belief().layout.dimension(),
                metrics: Metrics::from(&outcome.metrics),
                readings: learner.readings().into_iter().map(ReadingReport::from).collect(),
                noise: learner.noise().into_iter().map(NoiseReport::from).collect(),
                reading_sigmas: learner.reading_sigmas(),
                remarks: experiment.remarks(index),
                model: Model::new(learner.belief(), &names),
            })
            .collect();
        Self {
            scenario: setting.scenario.clone(),
            set: setting.replaced.clone(),
            seed: setting.seed,
            version: setting.version.clone(),
            steps: experiment.latest().step,
            thresholds: setting.thresholds.into(),
            movements_by_counting: setting.movements_by_counting,
            best_designs: Vec::new(),
            outliers: experiment.outliers().iter().map(OutlierReading::from).collect(),
            learners,
        }
    }

    /// The same beside the best designs of the scenario.
    pub fn beside(mut self, best_designs: Vec<design::BestDesign>) -> Self {
        for learner in &mut self.learners {
            learner.efficiency =
                design::BestDesign::efficiency(&best_designs, learner.metrics.bound_trace, learner.parameters);
        }
        Self { best_designs: best_designs.into_iter().map(BestDesign::from).collect(), ..self }
    }
}

impl From<&Outlier> for OutlierReading {
    fn from(outlier: &Outlier) -> Self {
        let Outlier { movement, channel } = *outlier;
        Self { movement, channel }
    }
}

impl From<estimation::ReadingReport> for ReadingReport {
    fn from(reading: estimation::ReadingReport) -> Self {
        let estimation::ReadingReport { movement, channel, equations, residual_sigmas, weight, outlier_probability } =
            reading;
        Self { movement, channel, equations, residual_sigmas, weight, outlier_probability }
    }
}

impl From<estimation::NoiseReport> for NoiseReport {
    fn from(noise: estimation::NoiseReport) -> Self {
        let estimation::NoiseReport { channel, first, scale } = noise;
        Self { channel, first, scale }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::{Point3, Vector3};

    use super::*;
    use body_schema_engine::{
        kinematics::{Joint, Line},
        model::{Layout, State},
        sensing::MeasurementModel,
    };

    #[test]
    fn a_result_tells_of_branches_and_of_an_arm_no_more_than_ever() {
        let joints = vec![Joint::Revolute(Line { point: Point3::origin(), direction: Vector3::z_axis() }); 3];
        let told = |parents: [Option<usize>; 3], link: usize| {
            let state = State::branching(joints.clone(), parents.to_vec(), (link, Point3::origin())).expect("a tree");
            let layout = Arc::new(Layout::of_arm(&state, &[], false));
            let belief = Belief::new(state, layout, Arc::new(MeasurementModel::tracker(0.01)));
            serde_json::to_value(Model::new(&belief, &[])).expect("JSON")
        };
        let tree = told([None, Some(0), Some(0)], 2);
        assert_eq!(
            (tree["parents"].clone(), tree["marker"]["link"].clone()),
            (serde_json::json!([null, 0, 0]), 2.into())
        );
        let arm = told([None, Some(0), Some(1)], 3);
        assert!(arm.get("parents").is_none() && arm["marker"].get("link").is_none(), "{arm}");
    }
}
