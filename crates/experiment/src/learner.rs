//! One learner of a comparison: an agent, and how it has fared.

use std::{
    mem::take,
    sync::{Arc, OnceLock},
};

use serde::{Deserialize, Serialize};

use super::{
    agent::{AbsorbError, Agent, Executed, Learned, Proposal},
    chosen::{Appraised, ChoiceError, Chosen},
    outcome::{MovementOutcome, Standing, predicted_pictures},
    setting::LearnerSetting,
};
use body_schema_engine::{
    estimation::{Alternative, Belief, NoiseReport, ReadingReport, Update},
    kinematics::JointBox,
    model::{Hand, Workspace},
    selection::{KeptSituation, Movement, SelectionError, Situation, Weights},
    sensing::Observation,
};

/// Steps in a row for which the expected error must stay below the target before a learner calls itself settled.
pub const SETTLING_STEPS: u32 = 5;

/// The estimate's weight among all hypotheses below which a learner is not settled. Nor is one whose readings do not fit.
const UNAMBIGUOUS: f64 = 0.99;

/// An agent in a comparison.
#[derive(Clone)]
pub struct Learner {
    /// Its name, estimator and policy.
    pub setting: LearnerSetting,
    agent: Agent,
    /// The weights of its trace.
    weights: Weights,
    /// Configurations over which it judges itself.
    workspace: Workspace,
    /// It calls itself settled when its expected prediction error stays below this, metres.
    settled_below_m: f64,
    /// The situation before its last movement; at the start, the present one.
    before: KeptSituation,
    /// The gain of the best movement that DIRECT finds, once asked for, in the situation before and in the present one;
    /// `None` where its policy does not search.
    best_gain_before: OnceLock<Option<f64>>,
    best_gain: OnceLock<Option<f64>>,
    /// What it proposed last.
    last: Option<Arc<Proposal>>,
    /// Why it proposes nothing any more, though its agent has not ended.
    stopped: Option<SelectionError>,
    record: Record,
}

/// Counters of one learner.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Record {
    movements: u64,
    misses: u64,
    steps_below_target: u32,
    changes_noticed: u64,
}

impl Learner {
    /// An agent that judges itself over `workspace` and is settled below that expected error, metres.
    pub fn new(
        setting: LearnerSetting,
        agent: Agent,
        weights: Weights,
        workspace: impl Into<Workspace>,
        settled_below_m: f64,
    ) -> Self {
        let before = agent.situation().kept();
        Self {
            setting,
            agent,
            weights,
            workspace: workspace.into(),
            settled_below_m,
            before,
            best_gain_before: OnceLock::new(),
            best_gain: OnceLock::new(),
            last: None,
            stopped: None,
            record: Record::default(),
        }
    }

    /// What it believes.
    pub fn belief(&self) -> &Belief {
        self.agent.belief()
    }

    /// What it makes of every reading so far, where it weighs them.
    pub fn readings(&self) -> Vec<ReadingReport> {
        self.agent.readings()
    }

    /// The scales of noise that it learns.
    pub fn noise(&self) -> Vec<NoiseReport> {
        self.agent.noise()
    }

    /// How far joints' readings are off, where it learns that: one standard deviation each, rad or m.
    pub fn reading_sigmas(&self) -> Vec<f64> {
        self.agent.reading_sigmas()
    }

    /// The joint limits.
    pub(super) fn limits(&self) -> &JointBox {
        self.agent.limits()
    }

    /// How many movements it can still make; `None` without an end.
    pub(super) fn remaining(&self) -> Option<usize> {
        self.agent.actions().remaining()
    }

    /// Its next movement; `None` once it has ended, or found no finite criterion, nothing feasible or no socket within
    /// reach: nothing more can come of
    /// it then.
    pub(super) fn propose(&mut self) -> Result<Option<Proposal>, SelectionError> {
        if self.stopped.is_some() {
            return Ok(None);
        }
        match self.agent.propose(1) {
            Ok(proposals) => Ok(proposals.first().cloned()),
            Err(
                error
                @ (SelectionError::NoFiniteCriterion | SelectionError::Infeasible(_) | SelectionError::OutOfReach),
            ) => {
                self.stopped = Some(error);
                Ok(None)
            }
            Err(error) => Err(error),
        }
    }

    /// Whether a person chooses its movements, and may still do so.
    pub(super) fn takes_configurations(&self) -> bool {
        self.agent.is_set_from_outside() && self.end().is_none()
    }

    /// The movement that was set for the next step, rad or m per joint.
    pub(super) fn configuration(&self) -> Option<&[f64]> {
        let proposal = self.agent.pending().first().filter(|_| self.agent.is_set_from_outside())?;
        Some(&proposal.selection.movement.configuration)
    }

    /// Sets its next movement, and tells what that is expected to teach.
    pub(super) fn set(&mut self, configuration: &[f64]) -> Result<Appraised, ChoiceError> {
        if !self.agent.is_set_from_outside() {
            return Err(ChoiceError::ChoosesItself(self.setting.name.clone()));
        }
        if let Some(why) = self.end() {
            return Err(ChoiceError::Ended { name: self.setting.name.clone(), why });
        }
        let appraisal = self.agent.set(configuration).map_err(|error| match error {
            SelectionError::Refused(why) => ChoiceError::Configuration(format!("is not feasible: {why}")),
            error => error.into(),
        })?;
        let best_gain = *self.best_gain.get_or_init(|| self.searched_gain(self.agent.situation()));
        let (configuration, estimate) = (configuration.to_vec(), self.belief().state.clone());
        Ok(Appraised { configuration, appraisal, estimate, best_gain })
    }

    /// Why it proposes nothing any more, if it does not.
    pub(super) fn end(&self) -> Option<String> {
        self.agent.failure().map(str::to_owned).or(self.stopped.as_ref().map(ToString::to_string))
    }

    /// The gain of the best movement that DIRECT finds in a situation, for a policy that explains itself by one.
    fn searched_gain(&self, situation: Situation<'_>) -> Option<f64> {
        let partition = self.agent.explain(situation).ok()??.partition();
        let values = partition.leaves.iter().filter_map(|leaf| Some((leaf, leaf.value?)));
        let (best, _) = values.min_by(|a, b| a.1.total_cmp(&b.1))?;
        let centre = partition.searched(self.limits()).from_unit(&best.centre);
        // Without the price of the travel there.
        Some(self.agent.appraise(situation, &centre).ok()?.gain)
    }

    /// Its agent.
    pub(super) fn agent(&self) -> &Agent {
        &self.agent
    }

    /// Its agent, to be told of anything but observations.
    pub(super) fn agent_mut(&mut self) -> &mut Agent {
        &mut self.agent
    }

    /// The configurations over which it judges itself.
    pub(super) fn workspace(&self) -> &Workspace {
        &self.workspace
    }

    /// Takes in a movement, by which a proposal was carried out or which nobody proposed, and what was seen after it.
    pub(super) fn learn(
        &mut self,
        proposal: Option<Proposal>,
        movement: Movement,
        observation: Observation,
    ) -> Result<(MovementOutcome, Update), AbsorbError> {
        let Movement { configuration, row, socket } = movement.clone();
        let before = self.agent.situation().kept();
        let predicted_marker = before.belief.state.marker_at(&configuration);
        let measured_marker = match before.belief.state.hand {
            Hand::Target(hand) => observation.position(&before.belief.measurement_model, hand),
            // What it sees is elsewhere.
            Hand::Device(_) => None,
        };
        let predicted_pictures =
            predicted_pictures(&before.belief.measurement_model, &before.belief.state, &configuration);
        let seen = !observation.is_miss();
        let observed = observation.clone();
        let proposed = proposal.as_ref().map(|proposal| proposal.id);
        let executed = Executed { proposal: proposed, movement, observation };
        let update = match self.agent.absorb(&[executed]) {
            Ok(updates) => updates.first().copied().unwrap_or_default(),
            Err(AbsorbError::Ended(_)) => Update::default(),
            Err(refused) => return Err(refused),
        };
        self.before = before;
        self.best_gain_before = take(&mut self.best_gain);
        self.record.movements += 1;
        self.record.misses += u64::from(!seen);
        self.record.changes_noticed += u64::from(update.change_noticed);
        let movements = self.record.movements;
        self.last = proposal.map(Arc::new);
        let outcome = MovementOutcome {
            configuration,
            row,
            socket,
            predicted_marker,
            measured_marker,
            observation: observed,
            predicted_pictures,
            weighed: self.agent.latest_readings(movements),
            proposal: self.last.clone(),
        };
        Ok((outcome, update))
    }

    /// All that it has learned; `None` where nothing can go on from that.
    pub(super) fn learned(&self) -> Option<(Learned, Record)> {
        Some((self.agent.learned()?, self.record.clone()))
    }

    /// Knows from now on what was learned from the movements that its agent has made.
    pub(super) fn take_up(&mut self, (learned, record): (Learned, Record)) -> bool {
        self.record = record;
        self.agent.take_up(learned)
    }

    /// How its last movement was chosen: the search by DIRECT that found it, or for a policy that plans, how the criterion
    /// of the next movement looked and where in it the movement lies.
    pub(super) fn choice(&self, movement: Option<&MovementOutcome>, limits: JointBox) -> Result<Chosen, ChoiceError> {
        let not_searched = || ChoiceError::NotSearched(self.setting.name.clone());
        let movement = movement.ok_or_else(not_searched)?;
        let selection = &movement.proposal.as_ref().ok_or_else(not_searched)?.selection;
        let (before, after) = (self.before.borrowed(), self.agent.situation());
        let search = match (&selection.plan, &selection.search) {
            (None, Some(search)) => search.clone(),
            _ => self.agent.explain(before)?.ok_or_else(not_searched)?,
        };
        let value = |situation| self.agent.appraise(situation, &movement.configuration).map(|it| it.before).ok();
        let (before, after) = (value(before), value(after));
        Ok(Chosen { configuration: movement.configuration.clone(), search, limits, before, after })
    }

    /// What another movement would have taught instead of the last one, by what this learner chooses by.
    pub(super) fn appraise(&self, configuration: &[f64]) -> Result<Appraised, ChoiceError> {
        let before = self.before.borrowed();
        let appraisal = self.agent.appraise(before, configuration)?;
        let searched =
            self.last.as_ref().filter(|last| last.selection.search.is_some() && last.selection.plan.is_none());
        let best_gain = match searched {
            Some(last) => last.selection.gain,
            None => *self.best_gain_before.get_or_init(|| self.searched_gain(before)),
        };
        let (configuration, estimate) = (configuration.to_vec(), self.before.belief.state.clone());
        Ok(Appraised { configuration, appraisal, estimate, best_gain })
    }

    /// Whether hardly anything but the estimate is possible. Where predictions count up to one motion, nothing is another account that predicts
    /// the same but for one: what nothing tells may be anywhere along it.
    // Inlined it costs what the page loads 22 kB.
    #[inline(never)]
    fn is_unambiguous(&self, belief: &Belief) -> bool {
        if belief.weight() > UNAMBIGUOUS || !self.workspace.up_to_motion {
            return belief.weight() > UNAMBIGUOUS;
        }
        let estimate = self.workspace.points(&belief.state);
        let is_other = |other: &&Alternative| {
            let distance = self.workspace.distance(&self.workspace.points(&other.state), &estimate);
            distance.is_none_or(|(_, mean)| mean > self.settled_below_m)
        };
        let others: f64 = belief.alternatives.iter().filter(is_other).map(|other| other.weight).sum();
        1.0 - others > UNAMBIGUOUS
    }

    /// How it stands after an update, by its own lights.
    pub(super) fn stand(&mut self, update: Update) -> Standing {
        let belief = self.agent.belief();
        let expected = belief.expected_error_m(&self.workspace);
        let is_certain = self.is_unambiguous(belief) && self.agent.misfit().is_none();
        if is_certain && expected.is_some_and(|error| error < self.settled_below_m) {
            self.record.steps_below_target += 1;
        } else {
            self.record.steps_below_target = 0;
        }
        Standing {
            expected_prediction_m: expected,
            model_error_m: (!self.agent.noise().is_empty()).then_some(belief.model_error_m),
            trace: belief.covariance.as_ref().map(|covariance| self.weights.trace(covariance)),
            nis: update.nis,
            movements: self.record.movements,
            misses: self.record.misses,
            settled: self.record.steps_below_target >= SETTLING_STEPS,
            changes_noticed: self.record.changes_noticed,
        }
    }
}
