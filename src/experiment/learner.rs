//! One learner of a comparison: an agent, and how it has fared.

use super::{
    agent::{AbsorbError, Agent, Executed, OwnedStandpoint, Proposal},
    choice::{AppraisalReport, Choice, ChoiceError},
    judge::Judge,
    metrics::Metrics,
    report::{GazeReport, LearnerDescription, LearnerReport, ModelReport, MovementReport, array, arrays, shown},
    world::World,
};
use crate::{
    estimation::{Belief, ReadingReport, Update},
    kinematics::JointBox,
    model::State,
    selection::{SelectionError, Weights},
    sensing::Observation,
};

/// Steps in a row for which the expected error must stay below the target before a learner calls itself settled.
pub const SETTLING_STEPS: u32 = 5;

/// The estimate's weight among all hypotheses below which a learner is not settled.
const UNAMBIGUOUS: f64 = 0.99;

/// An agent in a comparison.
pub struct Learner {
    /// Its name, estimator and policy.
    pub description: LearnerDescription,
    agent: Agent,
    /// The weights of its trace.
    weights: Weights,
    /// Configurations over which it judges itself.
    workspace: Vec<Vec<f64>>,
    /// It calls itself settled when its expected prediction error stays below this, metres.
    settled_below_m: f64,
    /// Where it stood before its last movement; at the start, where it stands.
    before: OwnedStandpoint,
    /// What it proposed last.
    last: Option<Proposal>,
    /// Why it proposes nothing any more, though its agent has not ended.
    stopped: Option<SelectionError>,
    record: Record,
}

/// Counters of one learner.
#[derive(Clone, Debug, Default)]
struct Record {
    movements: u64,
    misses: u64,
    steps_below_target: u32,
    changes_noticed: u64,
}

impl Learner {
    /// An agent that judges itself over `workspace` and is settled below that expected error, metres.
    pub fn new(
        description: LearnerDescription,
        agent: Agent,
        weights: Weights,
        workspace: Vec<Vec<f64>>,
        settled_below_m: f64,
    ) -> Self {
        let before = agent.standpoint().to_owned();
        let record = Record::default();
        Self { description, agent, weights, workspace, settled_below_m, before, last: None, stopped: None, record }
    }

    /// What it believes.
    pub fn belief(&self) -> &Belief {
        self.agent.belief()
    }

    /// What it makes of every reading so far, where it weighs them.
    pub(super) fn readings(&self) -> Vec<ReadingReport> {
        self.agent.readings()
    }

    /// The joint limits.
    pub(super) fn limits(&self) -> &JointBox {
        self.agent.limits()
    }

    /// How many movements it can still make; `None` without an end.
    pub(super) fn remaining(&self) -> Option<usize> {
        self.agent.actions().remaining()
    }

    /// Its next movement; `None` once it has ended, or found no finite criterion: nothing more can come of it then.
    pub(super) fn propose(&mut self) -> Result<Option<Proposal>, SelectionError> {
        if self.stopped.is_some() {
            return Ok(None);
        }
        match self.agent.propose(1) {
            Ok(proposals) => Ok(proposals.first().cloned()),
            Err(error @ SelectionError::NoFiniteCriterion) => {
                self.stopped = Some(error);
                Ok(None)
            }
            Err(error) => Err(error),
        }
    }

    /// Takes in what was seen after a proposal was carried out.
    pub(super) fn learn(
        &mut self,
        proposal: Proposal,
        observation: Observation,
        world: &World,
    ) -> Result<(MovementReport, Update), AbsorbError> {
        let truth = world.truth();
        let movement = proposal.selection.movement.clone();
        let configuration = movement.configuration.clone();
        let before = self.agent.standpoint().to_owned();
        let predicted = before.belief.state.marker_at(&configuration);
        let measured = observation.marker(&before.belief.rig);
        let seen = !observation.is_miss();
        let executed = Executed { proposal: Some(proposal.id), movement, observation };
        let update = match self.agent.absorb(&[executed]) {
            Ok(updates) => updates.first().copied().unwrap_or_default(),
            Err(AbsorbError::Ended(_)) => Update::default(),
            Err(refused) => return Err(refused),
        };
        self.before = before;
        self.record.movements += 1;
        self.record.misses += u64::from(!seen);
        self.record.changes_noticed += u64::from(update.change_noticed);
        let selection = &proposal.selection;
        let report = MovementReport {
            predicted_marker_m: array(&predicted.coords),
            measured_marker_m: measured.map(|position| array(&position.coords)),
            estimated_skeleton_m: arrays(&shown(&self.belief().state, truth).skeleton(&configuration)),
            true_skeleton_m: truth.map(|truth| arrays(&truth.skeleton(&configuration))),
            gaze: gaze(world, &configuration),
            row: selection.movement.row,
            configuration,
            criterion: selection.criterion,
            gain: selection.gain,
            evaluations: selection.evaluations,
            selection_ms: proposal.selection_ms,
            seen,
            partition: selection.search.as_ref().map(|search| search.partition.clone()),
        };
        self.last = Some(proposal);
        Ok((report, update))
    }

    /// How its last movement was chosen: the search by DIRECT that found it, or for a policy that plans, how the criterion
    /// of the next movement looked and where in it the movement lies.
    pub(super) fn choice(&self, step: u64, report: &LearnerReport, limits: &JointBox) -> Result<Choice, ChoiceError> {
        let not_searched = || ChoiceError::NotSearched(self.description.name.clone());
        let movement = report.movement.as_ref().ok_or_else(not_searched)?;
        let selection = &self.last.as_ref().ok_or_else(not_searched)?.selection;
        let (before, after) = (self.before.borrowed(), self.agent.standpoint());
        let search = match (&selection.plan, &selection.search) {
            (None, Some(search)) => search.clone(),
            (None, None) => return Err(not_searched()),
            (Some(_), _) => self.agent.explain(before)?.ok_or_else(not_searched)?,
        };
        let value = |standpoint| self.agent.appraise(standpoint, &movement.configuration).map(|it| it.before).ok();
        Choice::of(step, report, movement, search, limits, [value(before), value(after)])
    }

    /// What another movement would have taught instead of the last one, by what this learner chooses by.
    pub(super) fn appraise(&self, configuration: &[f64]) -> Result<AppraisalReport, ChoiceError> {
        let appraisal = self.agent.appraise(self.before.borrowed(), configuration)?;
        Ok(AppraisalReport::of(configuration, &appraisal))
    }

    /// The learner as it stands, judged against the truth where one is known.
    pub(super) fn report(
        &mut self,
        movement: Option<MovementReport>,
        update: Update,
        judge: &Judge,
        truth: Option<&State>,
    ) -> LearnerReport {
        let belief = self.agent.belief();
        let expected = belief.expected_error_m(&self.workspace);
        let is_certain = belief.weight() > UNAMBIGUOUS;
        if is_certain && expected.is_some_and(|error| error < self.settled_below_m) {
            self.record.steps_below_target += 1;
        } else {
            self.record.steps_below_target = 0;
        }
        let metrics = Metrics {
            expected_prediction_m: expected,
            trace: belief.covariance.as_ref().map(|covariance| self.weights.trace(covariance)),
            nis: update.nis.map(|(nis, _)| nis),
            nis_dof: update.nis.map(|(_, dof)| dof),
            movements: self.record.movements,
            misses: self.record.misses,
            settled: self.record.steps_below_target >= SETTLING_STEPS,
            changes_noticed: self.record.changes_noticed,
            ..judge.metrics(belief, truth)
        };
        LearnerReport {
            name: self.description.name.clone(),
            movement,
            estimate: ModelReport::of_belief(belief, truth),
            metrics,
            failure: self.agent.failure().map(str::to_owned).or(self.stopped.as_ref().map(ToString::to_string)),
        }
    }
}

/// Where the head that watches looks after the movement: at the true marker, as far as it can turn.
fn gaze(world: &World, configuration: &[f64]) -> Option<GazeReport> {
    let (head, truth) = (world.head()?, world.truth()?);
    Some(GazeReport::of(head, &head.gaze_at(&truth.marker_at(configuration))))
}
