//! What a choice rests on.

use std::{collections::VecDeque, sync::Arc};

use super::{Actions, Constraints, Movement};
use crate::{estimation::Belief, sensing::Observation};

/// Misses that are remembered, the latest ones.
pub(super) const MEMORY: usize = 50;

/// Everything that a policy chooses from. A policy remembers nothing itself.
#[derive(Clone, Copy, Debug)]
pub struct Situation<'a> {
    /// What is believed, given also what pending proposals are expected to teach.
    pub belief: &'a Belief,
    /// What may be done.
    pub actions: &'a Actions,
    /// What was done.
    pub history: &'a Past,
    /// What movements are bound to, if to anything.
    pub constraints: Option<&'a Constraints>,
}

impl Situation<'_> {
    /// A copy to keep.
    pub fn kept(&self) -> KeptSituation {
        let (belief, actions, history) = (self.belief.clone(), self.actions.clone(), self.history.clone());
        KeptSituation { belief, actions, history, constraints: self.constraints.cloned() }
    }
}

/// A [`Situation`] that was kept.
#[derive(Clone, Debug)]
pub struct KeptSituation {
    /// What was believed.
    pub belief: Belief,
    /// What could be done.
    pub actions: Actions,
    /// What had been done.
    pub history: Past,
    /// What movements were bound to, if to anything.
    pub constraints: Option<Constraints>,
}

impl KeptSituation {
    /// The same to choose from.
    pub fn borrowed(&self) -> Situation<'_> {
        let Self { belief, actions, history, constraints } = self;
        Situation { belief, actions, history, constraints: constraints.as_ref() }
    }
}

/// What policies go by of all that happened: made of the list of events, and nothing else.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Past {
    has_moved: bool,
    /// Shared, since a history is copied at every step.
    made: Vec<Arc<[f64]>>,
    posture: Option<Vec<f64>>,
    misses: VecDeque<Vec<f64>>,
    seen: VecDeque<Vec<f64>>,
    misses_in_a_row: usize,
    plan: Option<Planned>,
}

/// Movements that were planned with a proposal and come after it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Planned {
    /// Joint positions, rad or m.
    pub poses: Vec<Vec<f64>>,
    /// How many of them are to be made before the next plan.
    pub committed: usize,
}

impl Past {
    /// A movement was proposed, with this plan if there is one.
    pub fn proposed(&mut self, plan: Option<&Planned>) {
        if let Some(plan) = plan {
            self.plan = Some(plan.clone());
        }
    }

    /// This is what is planned now, whatever was proposed with.
    pub fn plan_anew(&mut self, plan: Option<Planned>) {
        self.plan = plan;
    }

    /// A movement was made.
    pub fn moved(&mut self, movement: &Movement, actions: &Actions, observation: &Observation) {
        self.expect(&movement.configuration);
        self.made.push(movement.configuration.as_slice().into());
        if let Actions::Box(limits) = actions {
            let is_miss = observation.is_miss();
            self.misses_in_a_row = if is_miss { self.misses_in_a_row + 1 } else { 0 };
            let latest = if is_miss { &mut self.misses } else { &mut self.seen };
            latest.push_back(limits.to_unit(&movement.configuration));
            if latest.len() > MEMORY {
                latest.pop_front();
            }
        }
    }

    /// The reading of the movement made last was rejected: there is as little to be hoped of its neighbourhood as where nothing was
    /// seen.
    pub fn rejected(&mut self, movement: &Movement, actions: &Actions) {
        if let Actions::Box(limits) = actions {
            self.misses.push_back(limits.to_unit(&movement.configuration));
            if self.misses.len() > MEMORY {
                self.misses.pop_front();
            }
        }
    }

    /// These are the latest movements after which nothing was seen, or nothing that counted.
    pub fn missed(&mut self, misses: VecDeque<Vec<f64>>) {
        self.misses = misses;
    }

    /// As if a movement to `configuration` had been made already: it is pending.
    pub fn expect(&mut self, configuration: &[f64]) {
        self.has_moved = true;
        self.posture = Some(configuration.to_vec());
    }

    /// Where the robot stands: the posture of the latest movement as it was executed, rad or m per joint.
    pub fn posture(&self) -> Option<&[f64]> {
        self.posture.as_deref()
    }

    /// All movements made, rad or m.
    pub fn made(&self) -> &[Arc<[f64]>] {
        &self.made
    }

    /// Whether any movement was made.
    pub fn has_moved(&self) -> bool {
        self.has_moved
    }

    /// The latest movements after which nothing was seen, or nothing that counted, scaled to the unit cube of the joint box.
    pub fn misses(&self) -> &VecDeque<Vec<f64>> {
        &self.misses
    }

    /// The latest movements after which anything was seen, scaled likewise.
    pub fn seen(&self) -> &VecDeque<Vec<f64>> {
        &self.seen
    }

    /// How many of the latest movements were misses, one after the other.
    pub fn misses_in_a_row(&self) -> usize {
        self.misses_in_a_row
    }

    /// The plan of the latest proposal.
    pub fn plan(&self) -> Option<&Planned> {
        self.plan.as_ref()
    }
}
