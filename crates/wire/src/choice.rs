//! How a movement was chosen, and what another one would have taught, as they are told.

use nalgebra::Matrix3;
use serde::{Deserialize, Serialize};

use super::{array, arrays, model::branching_bones};
use body_schema_engine::optimize::History;
use body_schema_experiment::{Appraised, ChoiceError, Chosen, Experiment, MovementOutcome};

/// How DIRECT chose a learner's last movement, iteration by iteration.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Choice {
    /// The step of the movement.
    pub step: u64,
    /// The learner.
    pub learner: String,
    /// `direct` or `direct-l`.
    pub variant: String,
    /// Its ε.
    pub epsilon: f64,
    /// The joints, which span the unit cube.
    pub joints: Vec<SearchedJoint>,
    /// The criterion before the movement: tr(W P), but for a policy that goes by more.
    pub trace: Option<f64>,
    /// Evaluations of the criterion.
    pub evaluations: usize,
    /// What was chosen.
    pub chosen: ChosenReport,
    /// All rectangles, in the order of their evaluation, by which they are numbered.
    pub boxes: Vec<BoxReport>,
    /// The iterations; the first holds the undivided cube.
    pub iterations: Vec<IterationReport>,
}

/// A joint as DIRECT sees it: from 0 at its lower limit to 1 at its upper.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct SearchedJoint {
    /// Its name.
    pub name: String,
    /// The limits between which it was searched, rad (revolute) or m (prismatic): the joint's own, or what constraints leave of
    /// them.
    pub limits: [f64; 2],
}

/// The movement that was chosen.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ChosenReport {
    /// The rectangle that holds it: at its centre, if DIRECT chose it. A policy that plans chooses otherwise; the boxes are
    /// then those of a search for the movement that teaches most at once.
    #[serde(rename = "box")]
    pub rectangle: usize,
    /// The configuration, rad or m per joint.
    pub configuration: Vec<f64>,
    /// The same in the unit cube.
    pub point: Vec<f64>,
    /// C(θ).
    pub criterion: Option<f64>,
    /// By how much the criterion was expected to fall.
    pub predicted_gain: Option<f64>,
    /// By how much it fell; stabilising noise lets it rise again.
    pub realised_gain: Option<f64>,
}

/// A rectangle of DIRECT.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct BoxReport {
    /// Its centre in the unit cube.
    pub centre: Vec<f64>,
    /// The criterion there, with the price of the travel to it if that has one; null if it is not finite (certainly out of
    /// view) or the centre is not feasible.
    pub value: Option<f64>,
    /// How it shrank.
    pub shapes: Vec<ShapeReport>,
}

/// The shape of a rectangle from the end of an iteration on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ShapeReport {
    /// The iteration; that of the first shape is the rectangle's birth.
    pub iteration: usize,
    /// Side i is 3^−levels\[i\] long.
    pub levels: Vec<u8>,
}

/// DIRECT at the end of an iteration.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct IterationReport {
    /// Counted from 0, the undivided cube.
    pub iteration: usize,
    /// Evaluations so far.
    pub evaluations: usize,
    /// The best criterion so far.
    pub best: Option<f64>,
    /// Its rectangle.
    pub best_box: Option<usize>,
    /// The potentially optimal rectangles, which the next iteration divides.
    pub hull: Vec<usize>,
    /// All vertices of the lower right hull, from the largest size to the smallest, whether or not they passed the ε
    /// test.
    pub lower_right_hull: Vec<usize>,
}

/// What a movement would have taught instead of the last one, or is expected to teach as the next one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct AppraisalReport {
    /// The configuration, rad or m per joint.
    pub configuration: Vec<f64>,
    /// C(θ) under the belief before that movement.
    pub criterion: f64,
    /// By how much that is less than before.
    pub gain: f64,
    /// The gain of the best movement that DIRECT finds under the same belief; null for a policy that does not go by one.
    #[serde(default)]
    pub best_gain: Option<f64>,
    /// `gain` as a share of `best_gain`, from 0 to 1; null without one. DIRECT's best is not always the best there is: who
    /// finds a better movement has a share of 1.
    #[serde(default)]
    pub share: Option<f64>,
    /// The criterion before: tr(W P), but for a policy that goes by more.
    pub trace: f64,
    /// The arm in this configuration as estimated: axis points in order, then the marker, metres.
    #[serde(default)]
    pub estimated_skeleton_m: Vec<[f64; 3]>,
    /// Of a robot that branches, the same branch by branch, that of the marker first, metres; empty for an arm.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub estimated_bones_m: Vec<Vec<[f64; 3]>>,
    /// The predicted marker, metres.
    pub predicted_marker_m: [f64; 3],
    /// Its covariance, m², row by row.
    pub marker_covariance_m2: [[f64; 3]; 3],
    /// The believed chance of seeing it; 1 where no head watches.
    pub chance_of_being_seen: f64,
}

impl AppraisalReport {
    /// The lines along the branches of the robot, that of the marker first, metres. An arm has one.
    pub fn bones_m(&self) -> Vec<Vec<[f64; 3]>> {
        if self.estimated_bones_m.is_empty() {
            return vec![self.estimated_skeleton_m.clone()];
        }
        self.estimated_bones_m.clone()
    }
}

impl From<&Appraised> for AppraisalReport {
    fn from(appraised: &Appraised) -> Self {
        let Appraised { configuration, appraisal, estimate, best_gain } = appraised;
        let rows = |matrix: &Matrix3<f64>| [0, 1, 2].map(|row| [0, 1, 2].map(|column| matrix[(row, column)]));
        Self {
            configuration: configuration.clone(),
            criterion: appraisal.criterion,
            gain: appraisal.gain,
            best_gain: *best_gain,
            share: appraised.share(),
            estimated_skeleton_m: arrays(&estimate.measured().skeleton(configuration)),
            estimated_bones_m: branching_bones(&estimate.measured(), configuration),
            trace: appraisal.before,
            predicted_marker_m: array(&appraisal.marker.coords),
            marker_covariance_m2: rows(&appraisal.marker_covariance),
            chance_of_being_seen: appraisal.chance,
        }
    }
}

impl Choice {
    /// How the last movement of a learner was chosen, by DIRECT or in sight of what DIRECT finds.
    ///
    /// # Errors
    ///
    /// [`ChoiceError`] where there is no such learner, and where its last movement was not found by DIRECT.
    pub fn of(experiment: &Experiment, learner: &str) -> Result<Self, ChoiceError> {
        let Chosen { configuration, search, limits, before, after } = experiment.choice(learner)?;
        let outcome = experiment.latest();
        let movement = outcome.learners.iter().find(|it| it.name == learner).and_then(|it| it.movement.as_ref());
        let (settings, partition) = (search.settings(), search.partition());
        let searched = partition.searched(&limits);
        let point = searched.to_unit(&configuration);
        let partition = partition.choosing(&point);
        let of_leaves: Vec<f64> = partition.leaves.iter().map(|leaf| leaf.value.unwrap_or(f64::NAN)).collect();
        let dimension = partition.leaves.first().map_or(0, |leaf| leaf.centre.len());
        let history = History::replay(dimension, settings, &of_leaves)?;
        let boxes: Vec<BoxReport> = partition
            .leaves
            .iter()
            .zip(history.shapes)
            .map(|(leaf, shapes)| BoxReport {
                centre: leaf.centre.clone(),
                value: leaf.value,
                shapes: shapes
                    .into_iter()
                    .map(|shape| ShapeReport { iteration: shape.iteration, levels: shape.levels })
                    .collect(),
            })
            .collect();
        let iterations = history.moments.into_iter().enumerate().map(|(iteration, moment)| IterationReport {
            iteration,
            evaluations: moment.evaluations,
            best: moment.best.and_then(|best| boxes.get(best)?.value),
            best_box: moment.best,
            hull: moment.potentially_optimal,
            lower_right_hull: moment.hull.iter().map(|point| point.rectangle).collect(),
        });
        Ok(Self {
            step: outcome.step,
            learner: learner.to_owned(),
            variant: settings.variant.name().to_owned(),
            epsilon: settings.epsilon,
            joints: (searched.joints().iter().zip(&experiment.setting().joints))
                .map(|(&(lower, upper), joint)| SearchedJoint { name: joint.name.clone(), limits: [lower, upper] })
                .collect(),
            trace: before,
            evaluations: partition.leaves.len(),
            chosen: ChosenReport {
                rectangle: partition.chosen,
                configuration,
                point,
                criterion: movement.and_then(MovementOutcome::criterion),
                predicted_gain: movement.and_then(MovementOutcome::gain),
                realised_gain: before.zip(after).map(|(before, after)| before - after),
            },
            iterations: iterations.collect(),
            boxes,
        })
    }
}
