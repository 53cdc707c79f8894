//! Movements that a person chooses.

use rand_chacha::ChaCha8Rng;

use super::{Active, Appraisal, Policy, Search, Selection, SelectionError, Situation};
use crate::kinematics::JointBox;

/// Chooses nothing: every movement is set from outside, by the `set` of an agent.
///
/// What a movement would teach it tells by the criterion of active selection, and beside it what DIRECT would have found:
/// by these a person is measured.
#[derive(Clone, Debug)]
pub struct Human {
    measure: Active,
}

impl Human {
    /// Measured by `measure`.
    pub fn new(measure: Active) -> Self {
        Self { measure }
    }
}

impl Policy for Human {
    fn select(&self, _: &Situation<'_>, _: &mut ChaCha8Rng) -> Result<Selection, SelectionError> {
        Err(SelectionError::Unset)
    }

    fn appraise(
        &self,
        situation: &Situation<'_>,
        limits: &JointBox,
        configuration: &[f64],
    ) -> Result<Appraisal, SelectionError> {
        self.measure.appraise(situation, limits, configuration)
    }

    fn explain(&self, situation: &Situation<'_>, limits: &JointBox) -> Result<Option<Search>, SelectionError> {
        self.measure.search(situation, limits)
    }

    fn is_set_from_outside(&self) -> bool {
        true
    }
}
