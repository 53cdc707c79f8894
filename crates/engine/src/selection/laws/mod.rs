//! Laws of the policies, on one arm of six joints.

mod active;
mod feasible;
mod planner;

use std::sync::Arc;

use nalgebra::{DMatrix, DVector, Point3, UnitVector3, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::{
    Actions, Constraints, CriterionUnits, Movement, Past, Policy, Selection, SelectionError, Situation, Watch, Weights,
};
use crate::{
    estimation::{Alternative, Belief},
    kinematics::{Joint, JointBox, Line},
    model::{Layout, State},
    optimize::{Settings, Variant},
    sensing::{Head, MeasurementModel, Observation},
};

const JOINTS: usize = 6;
/// Learned parameters: four for each axis.
const PARAMETERS: usize = 24;

/// A humanoid arm, outstretched along x at θ = 0.
fn arm() -> State {
    let along = |direction: Vector3<f64>, x: f64| {
        let direction = UnitVector3::new_normalize(direction);
        Joint::Revolute(Line { point: Point3::new(x, 0.0, 0.0), direction })
    };
    let (x, y, z) = (Vector3::x(), Vector3::y(), Vector3::z());
    let joints = vec![along(z, 0.0), along(y, 0.0), along(x, 0.0), along(y, 0.3), along(x, 0.4), along(y, 0.55)];
    State::arm(joints, Point3::new(0.65, 0.02, 0.05))
}

/// What a policy chooses from.
struct Case {
    belief: Belief,
    weights: Weights,
    actions: Actions,
    history: Past,
}

impl Case {
    /// A belief about the arm with this standard deviation of every parameter, in metres and radians alike, and a box.
    fn new(deviation: f64) -> Self {
        Self::of(DVector::from_element(PARAMETERS, deviation))
    }

    fn of(deviations: DVector<f64>) -> Self {
        let state = arm();
        let layout = Arc::new(Layout::of_arm(&state, &[], false));
        let weights = Weights::new(CriterionUnits::CharacteristicLength(1.0), &layout, &deviations);
        let covariance = DMatrix::from_diagonal(&deviations.map(|sd| sd * sd));
        let belief = Belief::new(state, layout, Arc::new(MeasurementModel::tracker(0.01))).with_covariance(covariance);
        let limits = JointBox::new(vec![(-1.5, 1.5); JOINTS]).expect("limits");
        Self { belief, weights, actions: Actions::Box(limits), history: Past::default() }
    }

    /// The same with a rival of the estimate that is as likely.
    fn with_rival(mut self) -> Self {
        let state = self.belief.state.retract(&self.belief.layout, &DVector::from_element(PARAMETERS, 0.2));
        let covariance = self.belief.covariance.clone().expect("kept");
        self.belief.alternatives = vec![Alternative { weight: 0.5, state, covariance }];
        self
    }

    /// The same over recorded movements.
    fn with_pool(mut self, count: usize) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let limits = self.limits();
        let movement = |row| Movement { row: Some(row), ..Movement::to(limits.draw(&mut rng)) };
        self.actions = Actions::Pool((0..count).map(movement).collect());
        self
    }

    fn limits(&self) -> JointBox {
        match &self.actions {
            Actions::Box(limits) => limits.clone(),
            Actions::Pool(_) | Actions::Sockets(_) => JointBox::new(vec![(-1.5, 1.5); JOINTS]).expect("limits"),
        }
    }

    fn situation(&self) -> Situation<'_> {
        Situation { belief: &self.belief, actions: &self.actions, history: &self.history, constraints: None }
    }

    fn select(&self, policy: &impl Policy) -> Result<Selection, SelectionError> {
        policy.select(&self.situation(), &mut ChaCha8Rng::seed_from_u64(1))
    }

    /// The same bound to constraints.
    fn select_within(&self, policy: &dyn Policy, constraints: &Constraints) -> Result<Selection, SelectionError> {
        let situation = Situation { constraints: Some(constraints), ..self.situation() };
        policy.select(&situation, &mut ChaCha8Rng::seed_from_u64(1))
    }

    /// C(θ), as the policy judges it.
    fn value(&self, policy: &impl Policy, configuration: &[f64]) -> f64 {
        policy.appraise(&self.situation(), &self.limits(), configuration).expect("an appraisal").criterion
    }

    /// What the policy says of its selection holds: the criterion is that of the appraisal, and so is the gain.
    fn check_values(&self, policy: &(impl Policy + ?Sized), selection: &Selection) {
        let appraisal = policy.appraise(&self.situation(), &self.limits(), &selection.movement.configuration);
        let appraisal = appraisal.expect("an appraisal");
        let tolerance = 1e-9 * appraisal.before;
        assert!((appraisal.criterion - selection.criterion.expect("chosen by it")).abs() < tolerance, "{appraisal:?}");
        assert!((appraisal.gain - selection.gain.expect("chosen by it")).abs() < tolerance, "{appraisal:?}");
    }

    /// The selection was proposed, and carried out with this success.
    fn moved(&mut self, selection: &Selection, seen: bool) {
        let observation = if seen {
            Observation::of([0.0; 3])
        } else {
            Observation::missed(self.belief.measurement_model.sensors().len())
        };
        self.history.proposed(selection.plan.as_ref());
        self.history.moved(&selection.movement, &self.actions, &observation);
    }
}

/// A short search: laws do not depend on how long it is.
fn search(max_evaluations: usize) -> Settings {
    Settings { variant: Variant::LocallyBiased, max_evaluations, ..Settings::default() }
}

/// A head behind the arm that looks along x, or the other way; the arm outstretched is where it looks first.
fn watch(along_x: f64) -> Watch {
    let head = Head {
        position: Point3::new(-0.5, 0.0, 0.0),
        look: UnitVector3::new_normalize(Vector3::x() * along_x),
        pan_limit: 0.2,
        tilt_limit: 0.2,
        lens_half_angle: 0.3,
        baseline: None,
    };
    Watch { head: Some(head), visible_pose: vec![0.0; JOINTS] }
}

/// The distance of two configurations in the unit cube of the joint box.
fn apart(limits: &JointBox, a: &[f64], b: &[f64]) -> f64 {
    let squared = |(a, b): (f64, f64)| (a - b) * (a - b);
    limits.to_unit(a).into_iter().zip(limits.to_unit(b)).map(squared).sum::<f64>().sqrt()
}

/// Policies that choose by a covariance say so where there is none.
fn needs_a_covariance(policy: &impl Policy) {
    for mut case in [Case::new(0.3), Case::new(0.3).with_pool(3)] {
        case.belief.covariance = None;
        assert_eq!(case.select(policy), Err(SelectionError::NoCovariance));
    }
}

/// The best of a pool is taken, whatever rivals there are, with its row; an empty one is exhausted.
fn takes_the_best_of_a_pool(policy: &impl Policy, case: Case) {
    let mut case = case.with_pool(40);
    let Actions::Pool(pool) = case.actions.clone() else { unreachable!("a pool") };
    let selection = case.select(policy).expect("a selection");
    let values: Vec<f64> = pool.iter().map(|movement| case.value(policy, &movement.configuration)).collect();
    let best = (0..pool.len()).min_by(|a, b| values[*a].total_cmp(&values[*b])).expect("not empty");
    assert_eq!((&selection.movement, selection.evaluations), (&pool[best], pool.len()));
    case.check_values(policy, &selection);
    case.actions = Actions::Pool(Vec::new());
    assert_eq!(case.select(policy), Err(SelectionError::Exhausted));
}
