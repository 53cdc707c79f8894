//! How a movement was chosen, and what another one would have taught: the questions of whoever looks on.

use super::Experiment;
use body_schema_engine::{
    kinematics::JointBox,
    model::State,
    optimize::DirectError,
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

/// How a learner's last movement was chosen, by DIRECT or in sight of what DIRECT finds.
#[derive(Clone, Debug)]
pub struct Chosen {
    /// The movement, rad or m per joint.
    pub configuration: Vec<f64>,
    /// The search that found it, or in which it lies.
    pub search: Search,
    /// The joint limits.
    pub limits: JointBox,
    /// The criterion before the movement: tr(W P), but for a policy that goes by more.
    pub before: Option<f64>,
    /// The same after it.
    pub after: Option<f64>,
}

/// What a movement would have taught instead of the last one, or is expected to teach as the next one.
#[derive(Clone, Debug, PartialEq)]
pub struct Appraised {
    /// The configuration, rad or m per joint.
    pub configuration: Vec<f64>,
    /// What it would teach.
    pub appraisal: Appraisal,
    /// The estimate before it.
    pub estimate: State,
    /// The gain of the best movement that DIRECT finds under the same belief; `None` for a policy that does not go by one.
    pub best_gain: Option<f64>,
}

impl Appraised {
    /// Its gain as a share of the best one, from 0 to 1; `None` without one. DIRECT's best is not always the best there is: who
    /// finds a better movement has a share of 1.
    pub fn share(&self) -> Option<f64> {
        self.best_gain.filter(|best| *best > 0.0).map(|best| (self.appraisal.gain / best).clamp(0.0, 1.0))
    }
}

impl Experiment {
    /// How the last movement of a learner was chosen, by DIRECT or in sight of what DIRECT finds.
    ///
    /// # Errors
    ///
    /// [`ChoiceError::UnknownLearner`] if there is none of that name, [`ChoiceError::NotSearched`] if DIRECT did not choose
    /// its last movement, [`ChoiceError::Search`] if the search cannot be repeated.
    pub fn choice(&self, learner: &str) -> Result<Chosen, ChoiceError> {
        let index = self.index_of(learner)?;
        self.learners[index].choice(self.latest.learners[index].movement.as_ref(), self.joint_box()?)
    }

    /// What a movement to `configuration` (rad or m per joint) would have taught a learner instead of its last one;
    /// before the first movement, what it would teach now.
    ///
    /// # Errors
    ///
    /// [`ChoiceError::UnknownLearner`] if there is none of that name, [`ChoiceError::Configuration`] if the posture does not
    /// have one position within limits for each joint, [`ChoiceError::Selection`] if the criterion cannot be computed there.
    pub fn appraise(&self, learner: &str, configuration: &[f64]) -> Result<Appraised, ChoiceError> {
        let index = self.index_of(learner)?;
        self.check_configuration(configuration)?;
        self.learners[index].appraise(configuration)
    }

    /// Sets the next movement of a learner for which a person chooses, to `configuration` (rad or m per joint), and tells
    /// what it is expected to teach. It may be set anew until the next step.
    ///
    /// # Errors
    ///
    /// [`ChoiceError::UnknownLearner`] if there is none of that name, [`ChoiceError::ChoosesItself`] if no person chooses for it,
    /// [`ChoiceError::Ended`] if it moves no more, [`ChoiceError::Configuration`] if the posture does not have one position
    /// within limits for each joint, [`ChoiceError::Selection`] if the policy refuses it.
    pub fn set_configuration(&mut self, learner: &str, configuration: &[f64]) -> Result<Appraised, ChoiceError> {
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
        learners.map(|(index, learner)| (index, learner.setting.name.as_str()))
    }

    fn check_configuration(&self, configuration: &[f64]) -> Result<(), ChoiceError> {
        let limits = self.joint_box()?;
        if configuration.len() != limits.dimension() {
            let (found, wanted) = (configuration.len(), limits.dimension());
            return Err(ChoiceError::Configuration(format!("has {found} numbers; this robot has {wanted} joints")));
        }
        for (joint, q) in configuration.iter().enumerate() {
            if !limits.is_within(joint, *q, JointBox::ROUNDING) {
                let (name, lower, upper) = (&self.setting.joints[joint].name, limits.lower(joint), limits.upper(joint));
                let said = format!("has {q} for `{name}`, whose limits are {lower} and {upper} (rad or m)");
                return Err(ChoiceError::Configuration(said));
            }
        }
        Ok(())
    }

    fn joint_box(&self) -> Result<JointBox, ChoiceError> {
        let limits = self.setting.joints.iter().map(|joint| (joint.limits[0], joint.limits[1]));
        JointBox::new(limits.collect()).map_err(|error| ChoiceError::Configuration(error.to_string()))
    }

    fn index_of(&self, learner: &str) -> Result<usize, ChoiceError> {
        self.setting.learners.iter().position(|known| known.name == learner).ok_or_else(|| {
            let known: Vec<&str> = self.setting.learners.iter().map(|known| known.name.as_str()).collect();
            ChoiceError::UnknownLearner { name: learner.to_owned(), known: known.join(", ") }
        })
    }
}
