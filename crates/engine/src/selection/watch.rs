//! What watches a robot, and what a policy does about it.

use super::{Past, Scope, Selection, SelectionError, Sight, Situation, Visibility};
use crate::{kinematics::JointBox, sensing::Head};

/// What is known of what can be seen; every learner of a scenario is told the same.
#[derive(Clone, Debug, PartialEq)]
pub struct Watch {
    /// The head that watches; without one the sensors see what they see by themselves.
    pub head: Option<Head>,
    /// A configuration at which something is known to be seen, rad or m.
    pub visible_pose: Vec<f64>,
}

impl Watch {
    /// How what is seen enters the criterion in a situation: by the head that watches, if there is one, or by what the
    /// sensors themselves can see. `None` where everything is seen.
    pub(super) fn sight<'a>(
        watch: Option<&'a Self>,
        situation: &Situation<'a>,
        limits: &'a JointBox,
    ) -> Option<Sight<'a>> {
        let head = watch.and_then(|watch| watch.head.as_ref());
        let history = situation.history;
        // What has missed once can miss again, for whatever reason.
        let matters = head.is_some() || situation.belief.measurement_model.has_view() || !history.misses().is_empty();
        matters.then(|| Sight::Chance(Visibility::new(head, history), limits))
    }

    /// The first movement of all, where anybody watches: to where the marker is known to be seen, or as near to it as may be.
    pub(super) fn beginning(
        watch: Option<&Self>,
        history: &Past,
        scope: &Scope<'_>,
    ) -> Result<Option<Selection>, SelectionError> {
        let watch = watch.filter(|_| !history.has_moved());
        watch.map(|watch| Ok(Selection::plain(scope.towards(watch.visible_pose.clone())?))).transpose()
    }

    /// The movement where a search found no finite criterion, whose value was `before` before: where nothing in view was
    /// found, back to where the marker is known to be seen.
    pub(super) fn fallback(watch: Option<&Self>, before: f64, scope: &Scope<'_>) -> Result<Selection, SelectionError> {
        let watch = watch.filter(|_| before.is_finite()).ok_or(SelectionError::NoFiniteCriterion)?;
        Ok(Selection::plain(scope.towards(watch.visible_pose.clone())?))
    }
}
