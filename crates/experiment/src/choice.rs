//! How a movement was chosen, and what another one would have taught: the questions of whoever looks on.

use nalgebra::Matrix3;
use serde::{Deserialize, Serialize};

use super::{
    Experiment,
    report::{LearnerReport, MovementReport, array, arrays},
};
use body_schema_engine::{
    kinematics::JointBox,
    model::State,
    optimize::{DirectError, History},
    selection::{Appraisal, Search, SelectionError},
};

/// Why there is no answer.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ChoiceError {
    /// No such learner.
    #[error("there is no learner `{name}`; there are {known}")]
    UnknownLearner {
        /// The name asked for.
        name: String,
        /// Those that there are.
        known: String,
    },
    /// The last movement was not found by DIRECT.
    #[error("the last movement of `{0}` was not chosen by DIRECT: it has not moved yet, or its policy is another")]
    NotSearched(String),
    /// The learner chooses its movements itself.
    #[error("`{0}` chooses its movements itself; only a learner whose policy is `human` takes a configuration")]
    ChoosesItself(String),
    /// The learner makes no movement any more.
    #[error("`{name}` makes no movement any more: {why}")]
    Ended {
        /// Its name.
        name: String,
        /// Why.
        why: String,
    },
    /// A configuration that this robot does not have.
    #[error("`configuration` {0}")]
    Configuration(String),
    /// The criterion cannot be computed.
    #[error(transparent)]
    Selection(#[from] SelectionError),
    /// The search cannot be repeated.
    #[error("DIRECT: {0}")]
    Search(#[from] DirectError),
}

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
    /// The predicted marker, metres.
    pub predicted_marker_m: [f64; 3],
    /// Its covariance, m², row by row.
    pub marker_covariance_m2: [[f64; 3]; 3],
    /// The believed chance of seeing it; 1 where no head watches.
    pub chance_of_being_seen: f64,
}

impl AppraisalReport {
    pub(super) fn of(configuration: &[f64], appraisal: &Appraisal, estimate: &State, best_gain: Option<f64>) -> Self {
        let rows = |matrix: &Matrix3<f64>| [0, 1, 2].map(|row| [0, 1, 2].map(|column| matrix[(row, column)]));
        Self {
            configuration: configuration.to_vec(),
            criterion: appraisal.criterion,
            gain: appraisal.gain,
            best_gain,
            share: best_gain.filter(|best| *best > 0.0).map(|best| (appraisal.gain / best).clamp(0.0, 1.0)),
            estimated_skeleton_m: arrays(&estimate.measured().skeleton(configuration)),
            trace: appraisal.before,
            predicted_marker_m: array(&appraisal.marker.coords),
            marker_covariance_m2: rows(&appraisal.marker_covariance),
            chance_of_being_seen: appraisal.chance,
        }
    }
}

impl Choice {
    /// `values` are the criterion before and after the movement. The joints' names are left to the caller, who knows them.
    pub(super) fn of(
        step: u64,
        report: &LearnerReport,
        movement: &MovementReport,
        search: Search,
        limits: &JointBox,
        values: [Option<f64>; 2],
    ) -> Result<Self, ChoiceError> {
        let (settings, partition) = (search.settings(), search.partition());
        let searched = partition.searched(limits);
        let point = searched.to_unit(&movement.configuration);
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
        let [before, after] = values;
        Ok(Self {
            step,
            learner: report.name.clone(),
            variant: settings.variant.name().to_owned(),
            epsilon: settings.epsilon,
            joints: (searched.joints().iter())
                .map(|&(lower, upper)| SearchedJoint { name: String::new(), limits: [lower, upper] })
                .collect(),
            trace: before,
            evaluations: partition.leaves.len(),
            chosen: ChosenReport {
                rectangle: partition.chosen,
                configuration: movement.configuration.clone(),
                point,
                criterion: movement.criterion,
                predicted_gain: movement.gain,
                realised_gain: before.zip(after).map(|(before, after)| before - after),
            },
            iterations: iterations.collect(),
            boxes,
        })
    }
}

impl Experiment {
    /// How the last movement of a learner was chosen, by DIRECT or in sight of what DIRECT finds.
    ///
    /// # Errors
    ///
    /// [`ChoiceError::UnknownLearner`] if there is none of that name, [`ChoiceError::NotSearched`] if DIRECT did not
    /// choose its last movement; others if the search cannot be repeated.
    pub fn choice(&self, learner: &str) -> Result<Choice, ChoiceError> {
        let index = self.index_of(learner)?;
        let limits = self.joint_box()?;
        let mut choice = self.learners[index].choice(self.latest.step, &self.latest.learners[index], &limits)?;
        for (joint, description) in choice.joints.iter_mut().zip(&self.description.joints) {
            joint.name.clone_from(&description.name);
        }
        Ok(choice)
    }

    /// What a movement to `configuration` (rad or m per joint) would have taught a learner instead of its last one;
    /// before the first movement, what it would teach now.
    ///
    /// # Errors
    ///
    /// [`ChoiceError::UnknownLearner`] if there is none of that name, [`ChoiceError::Configuration`] if the posture
    /// does not have one position within limits for each joint, [`ChoiceError::Selection`] if the criterion cannot be
    /// computed there.
    pub fn appraise(&self, learner: &str, configuration: &[f64]) -> Result<AppraisalReport, ChoiceError> {
        let index = self.index_of(learner)?;
        self.check_configuration(configuration)?;
        self.learners[index].appraise(configuration)
    }

    /// Sets the next movement of a learner for which a person chooses, to `configuration` (rad or m per joint), and tells
    /// what it is expected to teach. It may be set anew until the next step.
    ///
    /// # Errors
    ///
    /// [`ChoiceError::UnknownLearner`] if there is none of that name, [`ChoiceError::ChoosesItself`] if no person chooses
    /// for it, [`ChoiceError::Ended`] if it moves no more, [`ChoiceError::Configuration`] if the posture does not have
    /// one position within limits for each joint, [`ChoiceError::Selection`] if the policy refuses it.
    pub fn set_configuration(&mut self, learner: &str, configuration: &[f64]) -> Result<AppraisalReport, ChoiceError> {
        let index = self.index_of(learner)?;
        self.check_configuration(configuration)?;
        self.learners[index].set(configuration)
    }

    /// The movement that is set for the next step of a learner for which a person chooses.
    ///
    /// # Errors
    ///
    /// [`ChoiceError::UnknownLearner`] if there is none of that name.
    pub fn configuration(&self, learner: &str) -> Result<Option<&[f64]>, ChoiceError> {
        let index = self.index_of(learner)?;
        Ok(self.learners[index].configuration())
    }

    /// The learners for which a person chooses, as long as they learn, by name and place.
    pub fn chosen_for(&self) -> impl Iterator<Item = (usize, &str)> {
        let learners = self.learners.iter().enumerate().filter(|(_, learner)| learner.takes_configurations());
        learners.map(|(index, learner)| (index, learner.description.name.as_str()))
    }

    fn check_configuration(&self, configuration: &[f64]) -> Result<(), ChoiceError> {
        let limits = self.joint_box()?;
        if configuration.len() != limits.dimension() {
            let (found, wanted) = (configuration.len(), limits.dimension());
            return Err(ChoiceError::Configuration(format!("has {found} numbers; this robot has {wanted} joints")));
        }
        for (joint, q) in configuration.iter().enumerate() {
            if !limits.is_within(joint, *q, JointBox::ROUNDING) {
                let (name, lower, upper) =
                    (&self.description.joints[joint].name, limits.lower(joint), limits.upper(joint));
                let said = format!("has {q} for `{name}`, whose limits are {lower} and {upper} (rad or m)");
                return Err(ChoiceError::Configuration(said));
            }
        }
        Ok(())
    }

    fn joint_box(&self) -> Result<JointBox, ChoiceError> {
        let limits = self.description.joints.iter().map(|joint| (joint.limits[0], joint.limits[1]));
        JointBox::new(limits.collect()).map_err(|error| ChoiceError::Configuration(error.to_string()))
    }

    fn index_of(&self, learner: &str) -> Result<usize, ChoiceError> {
        self.description.learners.iter().position(|known| known.name == learner).ok_or_else(|| {
            let known: Vec<&str> = self.description.learners.iter().map(|known| known.name.as_str()).collect();
            ChoiceError::UnknownLearner { name: learner.to_owned(), known: known.join(", ") }
        })
    }
}
