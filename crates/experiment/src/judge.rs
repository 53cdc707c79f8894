//! Who judges: what agents believe against the truth, or against what was held out.
//!
//! The judge holds what no agent may know. It turns beliefs into [`Metrics`] and runs into verdicts.

use nalgebra::{DMatrix, Matrix3};
use serde::{Deserialize, Serialize};

use super::{
    convergence::{Convergence, Thresholds},
    gauge::Gauge,
    metrics::{self, Evaluation, Metrics},
    outcome::{MovementOutcome, Standing},
};
use body_schema_engine::{
    design::Problem,
    estimation::Belief,
    kinematics::JointBox,
    model::State,
    sensing::{Head, InView},
};

/// What beliefs and runs are judged by.
#[derive(Clone)]
pub struct Judge {
    evaluation: Evaluation,
    /// One for every layout that learners have: what one learns of another may be known to the next.
    gauges: Vec<Gauge>,
    /// One for each learner, or none at all.
    bounds: Vec<Bound>,
    verdicts: Vec<Verdict>,
    change_at: Option<u64>,
}

/// What the data of a learner allow.
#[derive(Clone)]
struct Bound {
    /// Of what this learner learns.
    problem: Problem,
    /// Λ₀ + Σ HᵀH at the truth.
    information: DMatrix<f64>,
}

/// What the judge hears of a learner after a step.
#[derive(Clone, Copy, Debug)]
pub struct Evidence<'a> {
    /// What it believes.
    pub belief: &'a Belief,
    /// How it stands by its own lights.
    pub standing: &'a Standing,
    /// The movement of the step, if it made one.
    pub movement: Option<&'a MovementOutcome>,
}

/// What the judge says of a learner after a step.
#[derive(Clone, Debug, PartialEq)]
pub struct Judgement {
    /// All metrics, those of the learner's own among them.
    pub metrics: Metrics,
    /// See [`LearnerOutcome::allowed`](super::LearnerOutcome::allowed).
    pub allowed: Vec<Option<Matrix3<f64>>>,
}

/// What is known of one learner's run so far.
#[derive(Clone, Debug)]
pub struct Verdict {
    /// Up to the change of the body, if there is one.
    pub convergence: Convergence,
    /// From the change on.
    pub recovery: Convergence,
    /// The first movement at which the learner called itself settled.
    pub settled_at: Option<u64>,
    /// Movements after the change at which the learner first noticed it.
    pub noticed_at: Option<u64>,
    /// Changes noticed before there was one.
    pub false_alarms: u64,
}

/// What came of a run of which no truth is known.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Concluded {
    settled_at: Option<u64>,
    noticed_at: Option<u64>,
    false_alarms: u64,
}

impl Verdict {
    fn new(thresholds: Thresholds) -> Self {
        let unjudged = Convergence::new(thresholds);
        Self { convergence: unjudged.clone(), recovery: unjudged, settled_at: None, noticed_at: None, false_alarms: 0 }
    }

    /// After one more step of a body that changes after `change_at` movements, if it does.
    fn observe(&mut self, step: u64, change_at: Option<u64>, metrics: &Metrics) {
        let since_change = change_at.and_then(|change| step.checked_sub(change));
        match since_change {
            Some(movements @ 1..) => self.recovery.observe(movements, metrics.orientation_deg, metrics.location_m),
            _ => self.convergence.observe(step, metrics.orientation_deg, metrics.location_m),
        }
        match since_change {
            Some(movements @ 1..) if metrics.changes_noticed > self.false_alarms => {
                self.noticed_at.get_or_insert(movements);
            }
            Some(1..) => {}
            _ => self.false_alarms = metrics.changes_noticed,
        }
        if metrics.settled && self.settled_at.is_none() {
            self.settled_at = Some(metrics.movements);
        }
    }
}

impl Bound {
    /// What the data allow after one more movement.
    fn after(&mut self, movement: Option<&MovementOutcome>) -> Option<Belief> {
        if let Some(movement) = movement.filter(|movement| movement.seen()) {
            self.information += self.problem.information(&movement.configuration);
        }
        self.problem.allowed(&self.information)
    }
}

impl Judge {
    /// Of so many learners, over `evaluation`; the body changes after `change_at` movements, if it does.
    pub fn new(evaluation: Evaluation, learners: usize, thresholds: Thresholds, change_at: Option<u64>) -> Self {
        let verdicts = vec![Verdict::new(thresholds); learners];
        Self { evaluation, gauges: Vec::new(), bounds: Vec::new(), verdicts, change_at }
    }

    /// Learns from a belief what measurements that `head` may watch leave undetermined of a truth.
    pub(super) fn study(&mut self, belief: &Belief, truth: &State, head: Option<&Head>, limits: &JointBox) {
        let Belief { layout, measurement_model, .. } = belief;
        if self.gauge(belief).is_none() {
            self.gauges.push(Gauge::new(truth, layout, measurement_model, InView::By(head), limits));
        }
    }

    /// The gauge of what a belief is about.
    fn gauge(&self, belief: &Belief) -> Option<&Gauge> {
        self.gauges.iter().find(|gauge| *gauge.layout() == *belief.layout)
    }

    /// Also tells what the data of every learner allow; one problem for each, of what it learns.
    pub(super) fn bound(&mut self, problems: Vec<Problem>) {
        let bound = |problem: Problem| Bound { information: problem.prior.clone(), problem };
        self.bounds = problems.into_iter().map(bound).collect();
    }

    /// The body is another from now on.
    pub(super) fn follow(&mut self, truth: &State) {
        self.evaluation.follow(truth);
        self.gauges.iter_mut().for_each(|gauge| gauge.study(truth));
        for Bound { problem, information } in &mut self.bounds {
            // What was measured before says nothing certain of the new body.
            problem.truth = truth.clone();
            *information = problem.prior.clone();
        }
    }

    /// All metrics of a learner, beside the trace that its data allow.
    fn metrics(
        &self,
        belief: &Belief,
        truth: Option<&State>,
        standing: &Standing,
        bound_trace: Option<f64>,
    ) -> Metrics {
        let layout = &*belief.layout;
        let gauge = self.gauge(belief);
        let aligned = truth.map(|truth| match gauge {
            Some(gauge) => gauge.aligned(truth, &belief.state),
            None => truth.clone(),
        });
        let held_out = self.evaluation.error(&belief.state, &belief.measurement_model);
        let nees = aligned.as_ref().and_then(|truth| {
            let (gauge, covariance) = (gauge?, belief.covariance.as_ref()?);
            gauge.nees(&belief.state, covariance, truth)
        });
        let estimate = belief.state.measured();
        let truth = aligned.as_ref().map(|truth| truth.measured());
        let truth = truth.as_deref();
        Metrics {
            orientation_deg: truth.and_then(|truth| metrics::orientation_deg(&estimate, truth, layout)),
            axis_deg: truth.and_then(|truth| metrics::axis_deg(&estimate, truth, layout)),
            location_m: truth.and_then(|truth| metrics::location_m(&estimate, truth, layout)),
            prediction_m: held_out.prediction_m.map(|(rms, _)| rms),
            prediction_mean_m: held_out.prediction_m.map(|(_, mean)| mean),
            prediction_mean_deg: held_out.prediction_mean_deg,
            prediction_mean_px: held_out.prediction_mean_px,
            scatter_m: self.evaluation.scatter_m(&belief.state),
            nees: nees.map(|(nees, _)| nees),
            nees_dof: nees.map(|(_, dof)| dof),
            expected_prediction_m: standing.expected_prediction_m,
            model_error_m: standing.model_error_m,
            trace: standing.trace,
            nis: standing.nis.map(|(nis, _)| nis),
            nis_dof: standing.nis.map(|(_, dof)| dof),
            movements: standing.movements,
            misses: standing.misses,
            settled: standing.settled,
            bound_trace,
            changes_noticed: standing.changes_noticed,
            joints: self.evaluation.joints(&estimate, truth, layout),
        }
    }

    /// What came of the learners' runs so far.
    pub fn verdicts(&self) -> &[Verdict] {
        &self.verdicts
    }

    /// What came of the first learner's run, for one that goes on from there. No truth is known to it.
    pub(super) fn concluded(&self) -> Option<Concluded> {
        let Verdict { settled_at, noticed_at, false_alarms, .. } = *self.verdicts.first()?;
        Some(Concluded { settled_at, noticed_at, false_alarms })
    }

    /// The first learner's run has come to this after so many steps.
    pub(super) fn take_up(&mut self, concluded: &Concluded, step: u64) {
        let Some(verdict) = self.verdicts.first_mut() else { return };
        let Concluded { settled_at, noticed_at, false_alarms } = *concluded;
        (verdict.settled_at, verdict.noticed_at, verdict.false_alarms) = (settled_at, noticed_at, false_alarms);
        verdict.convergence.observe(step, None, None);
    }

    /// Draws the conclusions from a step: one piece of evidence for each learner, in their order, and as many judgements.
    pub fn conclude(&mut self, step: u64, truth: Option<&State>, evidence: &[Evidence<'_>]) -> Vec<Judgement> {
        let mut judgements = Vec::with_capacity(evidence.len());
        for (index, Evidence { belief, standing, movement }) in evidence.iter().enumerate() {
            let bound = self.bounds.get_mut(index);
            let data = bound.and_then(|bound| Some((bound.after(*movement)?, &bound.problem)));
            let bound_trace = data.as_ref().and_then(|(allowed, problem)| {
                allowed.covariance.as_ref().map(|covariance| problem.weights.trace(covariance))
            });
            let points = |allowed: &Belief| {
                (0..allowed.layout.joints()).map(|joint| allowed.point_covariance(joint, 0.0)).collect()
            };
            let allowed = data.map(|(allowed, _)| points(&allowed)).unwrap_or_default();
            let metrics = self.metrics(belief, truth, standing, bound_trace);
            if let Some(verdict) = self.verdicts.get_mut(index) {
                verdict.observe(step, self.change_at, &metrics);
            }
            judgements.push(Judgement { metrics, allowed });
        }
        judgements
    }
}
