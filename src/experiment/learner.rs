//! One learner of a comparison: an estimator, a policy, and what was seen so far.

use rand_chacha::ChaCha8Rng;
use web_time::Instant;

use super::choice::{AppraisalReport, Choice, ChoiceError};
use super::{
    metrics::{self, Evaluation, Metrics},
    report::{GazeReport, LearnerDescription, LearnerReport, ModelReport, MovementReport, array, arrays, shown},
    world::World,
};
use crate::{
    estimation::{Belief, Estimator, Update},
    kinematics::Chain,
    selection::{ACriterion, Actions, Policy, Selection, SelectionError, Sight, Visibility, Weights},
    sensing::Observation,
};

/// Steps in a row for which the expected error must stay below the target before a learner calls itself settled.
pub const SETTLING_STEPS: u32 = 5;

/// The estimate's weight among all hypotheses below which a learner is not settled.
const UNAMBIGUOUS: f64 = 0.99;

/// What a learner is told: nothing here comes from the truth.
pub struct Learner {
    /// Its name, estimator and policy.
    pub description: LearnerDescription,
    /// Revises its belief.
    pub estimator: Box<dyn Estimator>,
    /// Chooses its movements.
    pub policy: Box<dyn Policy>,
    /// What it may do.
    pub actions: Actions,
    /// The weights of its criterion and of its trace.
    pub weights: Weights,
    /// Configurations over which it judges itself.
    pub workspace: Vec<Vec<f64>>,
    /// It calls itself settled when its expected prediction error stays below this, metres.
    pub settled_below_m: f64,
    /// What it believed before its last movement; at the start, what it believes.
    pub before: Belief,
    /// Random numbers of its policy.
    pub rng: ChaCha8Rng,
    /// How it has fared.
    pub record: Record,
}

/// Counters of one learner.
#[derive(Clone, Debug, Default)]
pub struct Record {
    movements: u64,
    misses: u64,
    steps_below_target: u32,
    changes_noticed: u64,
    failure: Option<String>,
}

impl Learner {
    /// Chooses the next movement and says how long that took, in milliseconds. `None` once the learner has failed.
    pub(super) fn choose(&mut self) -> Result<Option<(Selection, f64)>, SelectionError> {
        if self.record.failure.is_some() {
            return Ok(None);
        }
        let start = Instant::now();
        match self.policy.select(self.estimator.belief(), &self.actions, &mut self.rng) {
            Ok(selection) => Ok(Some((selection, start.elapsed().as_secs_f64() * 1e3))),
            Err(error @ SelectionError::NoFiniteCriterion) => {
                self.record.failure = Some(error.to_string());
                Ok(None)
            }
            Err(error) => Err(error),
        }
    }

    /// Takes in what was seen after `selection`.
    pub(super) fn learn(
        &mut self,
        (selection, selection_ms): (Selection, f64),
        observation: &Observation,
        world: &World,
    ) -> (MovementReport, Update) {
        let truth = world.truth();
        let configuration = selection.movement.configuration.clone();
        self.before = self.estimator.belief().clone();
        let predicted = self.before.chain.marker_at(&configuration);
        self.policy.observe(&selection.movement, &self.actions, observation);
        self.actions.use_up(&selection.movement);
        self.record.movements += 1;
        self.record.misses += u64::from(*observation == Observation::Missed);
        let update = self.estimator.update(&configuration, observation).unwrap_or_else(|error| {
            self.record.failure = Some(error.to_string());
            Update::default()
        });
        let report = MovementReport {
            predicted_marker_m: array(&predicted.coords),
            measured_marker_m: observation.position().map(|position| array(&position.coords)),
            estimated_skeleton_m: arrays(&shown(&self.estimator.belief().chain, truth).skeleton(&configuration)),
            true_skeleton_m: truth.map(|truth| arrays(&truth.skeleton(&configuration))),
            gaze: gaze(world, &configuration),
            row: selection.movement.row,
            configuration,
            criterion: selection.criterion,
            gain: selection.gain,
            evaluations: selection.evaluations,
            selection_ms,
            partition: selection.partition,
        };
        (report, update)
    }

    /// How its last movement was chosen, as far as DIRECT chose it.
    pub(super) fn choice(&self, step: u64, report: &LearnerReport) -> Result<Choice, ChoiceError> {
        let not_searched = || ChoiceError::NotSearched(self.description.name.clone());
        let movement = report.movement.as_ref().ok_or_else(not_searched)?;
        let partition = movement.partition.as_ref().ok_or_else(not_searched)?;
        let settings = self.policy.direct().ok_or_else(not_searched)?;
        let traces = [&self.before, self.estimator.belief()]
            .map(|belief| belief.covariance.as_ref().map(|covariance| self.weights.trace(covariance)));
        Choice::of(step, report, movement, partition, settings, traces)
    }

    /// What another movement would have taught instead of the last one, within the joints' `limits`.
    pub(super) fn appraise(
        &self,
        configuration: &[f64],
        limits: &[(f64, f64)],
        world: &World,
    ) -> Result<AppraisalReport, ChoiceError> {
        let unseen = world.head().map(|head| Visibility::new(*head));
        let visibility = self.policy.visibility().or(unseen.as_ref());
        let criterion = ACriterion::new(&self.before, &self.weights)?;
        let criterion = match visibility {
            Some(visibility) => criterion.watched(Sight::Chance(visibility, limits)),
            None => criterion,
        };
        let appraisal = criterion.appraise(configuration)?;
        Ok(AppraisalReport::of(configuration, criterion.trace(), &appraisal))
    }

    /// The learner as it stands, judged against the truth where one is known.
    pub(super) fn report(
        &mut self,
        movement: Option<MovementReport>,
        update: Update,
        evaluation: &Evaluation,
        truth: Option<&Chain>,
    ) -> LearnerReport {
        self.record.changes_noticed += u64::from(update.change_noticed);
        let belief = self.estimator.belief();
        let (estimate, layout) = (&belief.chain, &*belief.layout);
        let expected = belief.expected_error_m(&self.workspace);
        let is_certain = belief.weight() > UNAMBIGUOUS;
        if is_certain && expected.is_some_and(|error| error < self.settled_below_m) {
            self.record.steps_below_target += 1;
        } else {
            self.record.steps_below_target = 0;
        }
        let prediction = evaluation.prediction_m(estimate);
        let nees = truth.and_then(|truth| metrics::nees(belief, truth));
        let metrics = Metrics {
            orientation_deg: truth.and_then(|truth| metrics::orientation_deg(estimate, truth, layout)),
            axis_deg: truth.and_then(|truth| metrics::axis_deg(estimate, truth, layout)),
            location_m: truth.and_then(|truth| metrics::location_m(estimate, truth, layout)),
            prediction_m: prediction.map(|(rms, _)| rms),
            prediction_mean_m: prediction.map(|(_, mean)| mean),
            expected_prediction_m: expected,
            trace: belief.covariance.as_ref().map(|covariance| self.weights.trace(covariance)),
            nis: update.nis.map(|(nis, _)| nis),
            nis_dof: update.nis.map(|(_, dof)| dof),
            nees,
            nees_dof: nees.map(|_| layout.dimension()),
            movements: self.record.movements,
            misses: self.record.misses,
            settled: self.record.steps_below_target >= SETTLING_STEPS,
            bound_trace: None,
            changes_noticed: self.record.changes_noticed,
            joints: evaluation.joints(estimate, truth, layout),
        };
        LearnerReport {
            name: self.description.name.clone(),
            movement,
            estimate: ModelReport::of_belief(belief, truth),
            metrics,
            failure: self.record.failure.clone(),
        }
    }
}

/// Where the head that watches looks after the movement: at the true marker, as far as it can turn.
fn gaze(world: &World, configuration: &[f64]) -> Option<GazeReport> {
    let (head, truth) = (world.head()?, world.truth()?);
    Some(GazeReport::of(head, &head.gaze_at(&truth.marker_at(configuration))))
}
