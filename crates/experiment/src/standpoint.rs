//! Where an agent stands when it chooses: what it believes, what it may do, what it has done.

use std::sync::Arc;

use body_schema_engine::{
    estimation::Belief,
    selection::{Actions, Constraints, History, Situation},
};

/// What a choice rests on, at one moment.
#[derive(Clone, Copy, Debug)]
pub struct Standpoint<'a> {
    pub(super) belief: &'a Belief,
    pub(super) actions: &'a Actions,
    pub(super) history: &'a History,
    pub(super) constraints: &'a Option<Arc<Constraints>>,
}

impl<'a> Standpoint<'a> {
    pub(super) fn situation(&self) -> Situation<'a> {
        let constraints = self.constraints.as_deref();
        Situation { belief: self.belief, actions: self.actions, history: self.history, constraints }
    }

    /// A copy to keep.
    pub fn to_owned(&self) -> OwnedStandpoint {
        let (actions, history) = (self.actions.clone(), self.history.clone());
        OwnedStandpoint { belief: self.belief.clone(), actions, history, constraints: self.constraints.clone() }
    }
}

/// A [`Standpoint`] that was kept.
#[derive(Clone, Debug)]
pub struct OwnedStandpoint {
    /// What was believed.
    pub belief: Belief,
    pub(super) actions: Actions,
    pub(super) history: History,
    pub(super) constraints: Option<Arc<Constraints>>,
}

impl OwnedStandpoint {
    /// The same to look at.
    pub fn borrowed(&self) -> Standpoint<'_> {
        let Self { belief, actions, history, constraints } = self;
        Standpoint { belief, actions, history, constraints }
    }
}
