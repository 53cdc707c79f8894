//! A step that cannot be made leaves the experiment as it was.

use std::sync::{
    Arc,
    atomic::{AtomicBool, Ordering},
};

use nalgebra::{DMatrix, DVector, Point3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::{
    Agent, Change, Evaluation, Executed, Experiment, ExperimentError, Learner, LearnerSetting, Metrics,
    MovementOutcome, Proposal, Setting, StepOutcome, Thresholds, World,
};
use body_schema_engine::{
    estimation::{Belief, Rls, StabilisingNoise},
    kinematics::JointBox,
    model::{Layout, State, random::random_arm},
    selection::{
        Actions, Active, Appraisal, CriterionUnits, Minimiser, Movement, Policy, Random, Selection, SelectionError,
        Situation, Weights,
    },
    sensing::{Equipment, MeasurementModel},
};

const JOINTS: usize = 3;

/// Cannot choose the next time that it is asked, if that is told.
struct Faltering {
    policy: Box<dyn Policy>,
    falters: Arc<AtomicBool>,
}

impl Policy for Faltering {
    fn select(&self, situation: &Situation<'_>, rng: &mut ChaCha8Rng) -> Result<Selection, SelectionError> {
        if self.falters.swap(false, Ordering::Relaxed) {
            return Err(SelectionError::NoCovariance);
        }
        self.policy.select(situation, rng)
    }

    fn appraise(
        &self,
        situation: &Situation<'_>,
        limits: &JointBox,
        configuration: &[f64],
    ) -> Result<Appraisal, SelectionError> {
        self.policy.appraise(situation, limits, configuration)
    }
}

fn truth() -> State {
    random_arm(&mut ChaCha8Rng::seed_from_u64(8), JOINTS)
}

fn limits() -> JointBox {
    JointBox::new(vec![(-1.0, 1.0); JOINTS]).expect("limits")
}

/// The truth with its marker at a distance that is no number.
fn beyond_all_numbers() -> State {
    truth().with_marker(Point3::new(f64::INFINITY, 0.0, 0.0))
}

fn world(change: Option<Change>) -> World {
    let measurement_model = Arc::new(MeasurementModel::tracker(0.01));
    let (truth, limits) = (Box::new(truth()), limits());
    World::Simulated { truth, measurement_model, limits, head: None, change: change.map(Box::new), outliers: None }
}

/// Two learners, the first active and the other random; the flag makes the second falter.
fn experiment(world: World) -> (Experiment, Arc<AtomicBool>) {
    let layout = Arc::new(Layout::of_arm(&truth(), &[], false));
    let deviations = DVector::from_element(layout.dimension(), 0.3);
    let weights = Weights::new(CriterionUnits::CharacteristicLength(1.0), &layout, &deviations);
    let initial = truth().retract(&layout, &DVector::from_element(layout.dimension(), 0.1));
    let limits = limits();
    let falters = Arc::new(AtomicBool::new(false));
    let learner = |name: &str, policy: Box<dyn Policy>| {
        let belief = Belief::new(initial.clone(), layout.clone(), Arc::new(MeasurementModel::tracker(0.02)));
        let noise = StabilisingNoise { variance: 1e-4, first_step: 1, every: 2 };
        let covariance = DMatrix::from_diagonal(&deviations.map(|sd| sd * sd));
        let estimator = Box::new(Rls::new(belief, covariance, Some(noise)));
        let agent = Agent::new(estimator, policy, Actions::Box(limits.clone()), limits.clone(), 5);
        let (name, estimator, policy) = (name.to_owned(), "rls".to_owned(), name.to_owned());
        let setting = LearnerSetting { name, estimator, policy, stabilised: true, robust: false };
        Learner::new(setting, agent, weights.clone(), vec![vec![0.5; JOINTS]], 0.01)
    };
    let active = Active::new(weights.clone(), Minimiser::Random { evaluations: 20 });
    let random = Box::new(Random::new(weights.clone(), None));
    let learners = vec![
        learner("active", Box::new(active)),
        learner("faltering", Box::new(Faltering { policy: random, falters: falters.clone() })),
    ];
    let setting = Setting {
        scenario: "two-learners".to_owned(),
        replaced: Vec::new(),
        title: String::new(),
        seed: 5,
        version: String::new(),
        joints: Vec::new(),
        parameters: layout.dimension(),
        movements_by_counting: 1,
        learners: learners.iter().map(|learner| learner.setting.clone()).collect(),
        units: CriterionUnits::CharacteristicLength(1.0),
        thresholds: Thresholds { orientation_deg: 5.0, location_m: 0.02 },
        movements_available: None,
        truth: None,
        change_at: world.change().map(|change| change.step),
        head: None,
        channels: Vec::new(),
        equipment: Equipment::default(),
        base_learned: false,
        sockets: Vec::new(),
        body: None,
    };
    let evaluation = Evaluation::of_truth(vec![vec![0.2; JOINTS], vec![-0.4; JOINTS]], &truth(), 0.01);
    (Experiment::new(setting, world, learners, evaluation, Vec::new()), falters)
}

/// What came of the next step, but for how long the choices took.
fn step(experiment: &mut Experiment) -> StepOutcome {
    timeless(experiment.step().expect("a step"))
}

fn timeless(outcome: &StepOutcome) -> StepOutcome {
    let mut outcome = outcome.clone();
    for movement in outcome.learners.iter_mut().filter_map(|learner| learner.movement.as_mut()) {
        let untimed = |proposal: &Arc<Proposal>| Arc::new(Proposal { selection_ms: 0.0, ..(**proposal).clone() });
        movement.proposal = movement.proposal.as_ref().map(untimed);
    }
    outcome
}

/// The first learner has proposed by then.
#[test]
fn a_learner_that_cannot_choose_changes_nothing() {
    let (mut steady, _) = experiment(world(None));
    let (mut faltering, falters) = experiment(world(None));
    for number in 0..6 {
        if number % 2 == 0 {
            falters.store(true, Ordering::Relaxed);
            let before = timeless(faltering.latest());
            let found = faltering.step().map(|outcome| outcome.step);
            let (learner, source) = ("faltering".to_owned(), SelectionError::NoCovariance);
            assert_eq!(found, Err(ExperimentError::Selection { learner, source }));
            assert_eq!(timeless(faltering.latest()), before);
        }
        let outcome = step(&mut steady);
        assert!(outcome.learners.iter().all(|learner| learner.movement.is_some() && learner.failure.is_none()));
        assert_eq!(step(&mut faltering), outcome);
    }
}

/// The measurement cannot be made, also not when it is tried again; once it can, all is as if it always could.
#[test]
fn a_world_that_has_nothing_to_show_changes_nothing() {
    let (mut steady, _) = experiment(world(None));
    let (mut broken, _) = experiment(world(None));
    (0..2).for_each(|_| assert_eq!(step(&mut steady), step(&mut broken)));
    let mut nowhere = world(None);
    let World::Simulated { truth, .. } = &mut nowhere else { unreachable!("simulated") };
    **truth = beyond_all_numbers();
    let whole = std::mem::replace(&mut broken.world, nowhere);
    for _ in 0..2 {
        let before = timeless(broken.latest());
        let found = broken.step().map(|outcome| outcome.step);
        assert!(matches!(&found, Err(ExperimentError::World { learner, .. }) if learner == "active"), "{found:?}");
        assert_eq!(timeless(broken.latest()), before);
    }
    broken.world = whole;
    (0..4).for_each(|_| assert_eq!(step(&mut broken), step(&mut steady)));
}

/// A change of the body that leaves nothing to be measured has not happened: the truth is the one before.
#[test]
fn a_change_that_cannot_be_shown_has_not_happened() {
    let (mut experiment, _) = experiment(world(Some(Change { step: 2, truth: beyond_all_numbers() })));
    (0..2).for_each(|_| drop(step(&mut experiment)));
    for _ in 0..2 {
        let before = timeless(experiment.latest());
        let found = experiment.step().map(|outcome| outcome.step);
        assert!(matches!(found, Err(ExperimentError::World { .. })), "{found:?}");
        assert_eq!((timeless(experiment.latest()), experiment.world().truth()), (before, Some(&truth())));
        assert!(experiment.world().change().is_some(), "still to come");
    }
}

/// Who learns is told what was done and what was seen: whether anybody knows the truth makes no difference to it.
#[test]
fn a_learner_learns_the_same_where_nobody_knows_the_truth() {
    let ((mut known, _), (mut outside, _)) = (experiment(world(None)), experiment(World::External));
    for _ in 0..8 {
        let made = step(&mut known).learners.remove(0);
        let MovementOutcome { configuration, row, socket, observation, .. } = made.movement.expect("made");
        let movement = Movement { configuration, row, socket };
        outside.tell(Executed { proposal: None, movement, observation }).expect("told");
        let [one, other] = [&known, &outside].map(|it| it.learners()[0].belief());
        assert_eq!((&one.state, &one.covariance), (&other.state, &other.covariance));
        let told = &outside.latest().learners[0];
        let by_itself = |metrics: &Metrics| Metrics {
            orientation_deg: None,
            axis_deg: None,
            location_m: None,
            prediction_m: None,
            prediction_mean_m: None,
            nees: None,
            nees_dof: None,
            joints: Vec::new(),
            ..metrics.clone()
        };
        assert_eq!(by_itself(&made.metrics), by_itself(&told.metrics));
        assert!(made.metrics.axis_deg.is_some() && told.metrics.axis_deg.is_none());
    }
}
