//! Active selection: the movement that is expected to teach most.

use nalgebra::DVector;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::{
    Actions, Appraisal, Criterion, Domain, Policy, Scope, Search, Selection, SelectionError, Sight, Situation, Sockets,
    Watch, Weights,
    held::{Values, evaluate, held_by},
    search::direct,
};
use crate::{
    estimation::Belief,
    kinematics::JointBox,
    normal::StandardNormal,
    optimize::{Settings, bayesian, least},
};

/// Minimises the A-criterion: over a box of joint limits by DIRECT, normalised to the unit cube; over a pool of
/// recorded movements by trying every one; where targets are held in sockets, by the best of many draws, polished.
///
/// Where a head watches ([`watched`](Self::watched)), the first movement goes to the pose that is known to be visible,
/// the gain is weighed by the chance of being seen, and misses are remembered.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use body_schema_engine::{
///     estimation::Belief,
///     kinematics::{Joint, JointBox, Line},
///     model::{Layout, State},
///     optimize::Settings,
///     selection::{Actions, Active, CriterionUnits, Past, Minimiser, Policy, Situation, Weights},
///     sensing::MeasurementModel,
/// };
/// use nalgebra::{DMatrix, DVector, Point3, Vector3};
/// use rand::SeedableRng;
/// use rand_chacha::ChaCha8Rng;
///
/// // Two parallel axes, known to 10 cm and 0.1 rad, and a marker that is measured with σ = 1 mm.
/// let axis = |x| Joint::Revolute(Line { point: Point3::new(x, 0.0, 0.0), direction: Vector3::z_axis() });
/// let guess = State::arm(vec![axis(0.0), axis(0.3)], Point3::new(0.5, 0.0, 0.0));
/// let layout = Layout::of_arm(&guess, &[true, true], false);
/// let deviations = DVector::from_element(layout.dimension(), 0.1);
/// let weights = Weights::new(CriterionUnits::CharacteristicLength(1.0), &layout, &deviations);
/// let belief = Belief::new(guess, layout.into(), MeasurementModel::tracker(0.001).into())
///     .with_covariance(DMatrix::from_diagonal(&deviations.map(|deviation| deviation * deviation)));
///
/// let actions = Actions::Box(JointBox::new(vec![(-1.5, 1.5), (0.2, 2.5)])?);
/// let history = Past::default();
/// let situation = Situation { belief: &belief, actions: &actions, history: &history, constraints: None };
/// let active = Active::new(weights, Minimiser::Direct(Settings { max_evaluations: 300, ..Settings::default() }));
/// let selection = active.select(&situation, &mut ChaCha8Rng::seed_from_u64(1))?;
/// // The movement (rad), and by how much it is expected to reduce tr(W P).
/// assert_eq!(selection.movement.configuration.len(), 2);
/// assert!(selection.gain > Some(0.0));
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct Active {
    weights: Weights,
    minimiser: Minimiser,
    samples: usize,
    watch: Option<Watch>,
    naive: bool,
}

/// How the criterion is minimised over a box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Minimiser {
    /// DIRECT, original or locally biased.
    Direct(Settings),
    /// The best of so many random configurations: the floor that every search must beat.
    Random {
        /// How many.
        evaluations: usize,
    },
    /// Bayesian optimisation with a Gaussian process, which the paper found not worth its cost.
    Bayesian {
        /// How many configurations are evaluated.
        evaluations: usize,
    },
}

impl Minimiser {
    /// Configurations evaluated at most.
    fn evaluations(&self) -> usize {
        match *self {
            Self::Direct(settings) => settings.max_evaluations,
            Self::Random { evaluations } | Self::Bayesian { evaluations } => evaluations,
        }
    }
}

impl Active {
    /// Selection by the A-criterion with `weights`.
    pub fn new(weights: Weights, minimiser: Minimiser) -> Self {
        Self { weights, minimiser, samples: 0, watch: None, naive: false }
    }

    /// The expectation in (7) by Monte Carlo: the mean of the criterion over so many states drawn from the posterior,
    /// instead of the criterion at the estimate.
    pub fn sampled(self, samples: usize) -> Self {
        Self { samples, ..self }
    }

    /// The same where a head watches.
    pub fn watched(self, watch: Watch) -> Self {
        Self { watch: Some(watch), ..self }
    }

    /// The naive form, for comparison: the plain criterion wherever the *predicted* marker is in view. It believes its
    /// own prediction, and a miss teaches it nothing.
    pub fn watched_naively(self, watch: Watch) -> Self {
        Self { watch: Some(watch), naive: true, ..self }
    }

    /// The beliefs over which the criterion is averaged: the estimate's, or states drawn from it by N(0, P) in its
    /// chart, each with the same P.
    fn drawn(&self, belief: &Belief, rng: &mut ChaCha8Rng) -> Result<Vec<Belief>, SelectionError> {
        if self.samples == 0 {
            return Ok(vec![belief.clone()]);
        }
        let covariance = belief.covariance.clone().ok_or(SelectionError::NoCovariance)?;
        let root = covariance.cholesky().ok_or(SelectionError::NoFiniteCriterion)?.l();
        let draw = |_| {
            let standard = DVector::from_fn(root.nrows(), |_, _| rng.sample(StandardNormal));
            Belief { state: belief.state.retract(&belief.layout, &(&root * standard)), ..belief.clone() }
        };
        Ok((0..self.samples).map(draw).collect())
    }

    fn criterion<'a>(
        &'a self,
        belief: &'a Belief,
        situation: &Situation<'a>,
        limits: &'a JointBox,
    ) -> Result<Criterion<'a>, SelectionError> {
        let criterion = Criterion::new(belief, &self.weights)?;
        let sight = Watch::sight(self.watch.as_ref(), situation, limits).map(|sight| match sight {
            Sight::Chance(visibility, _) if self.naive => Sight::Predicted(visibility),
            sight => sight,
        });
        Ok(criterion.watched(sight))
    }

    /// How DIRECT would search the joint box now; `None` with another minimiser.
    pub(super) fn search(
        &self,
        situation: &Situation<'_>,
        limits: &JointBox,
    ) -> Result<Option<Search>, SelectionError> {
        let Minimiser::Direct(settings) = self.minimiser else { return Ok(None) };
        let criterion = self.criterion(situation.belief, situation, limits)?;
        let Some((scope, searched)) = Scope::around(situation, limits)? else { return Ok(None) };
        let at = |postures: &[Vec<f64>]| scope.evaluate(postures, |feasible| criterion.evaluate_here(feasible));
        Ok(Some(direct(&scope, &searched, settings, &at, Some(&criterion))?))
    }

    /// The criterion in one socket.
    fn values<'a>(&'a self, held: &'a Belief) -> Result<Values<'a>, SelectionError> {
        let criterion = Criterion::new(held, &self.weights)?;
        Ok(Box::new(move |postures| criterion.evaluate(postures)))
    }

    fn select_in_sockets(
        &self,
        belief: &Belief,
        sockets: &Sockets,
        scope: &Scope<'_>,
        rng: &mut ChaCha8Rng,
    ) -> Result<Selection, SelectionError> {
        if let Some(beginning) = sockets.beginning(scope) {
            return Ok(Selection::of(beginning.clone()));
        }
        let (before, held) = (Criterion::new(belief, &self.weights)?.before(), sockets.held(belief));
        let pool = sockets.pool(belief, scope, self.minimiser.evaluations(), rng);
        let mut evaluations = 0;
        let (movement, value) =
            sockets.best((belief, scope), &held, &pool, &mut evaluations, |held| self.values(held))?;
        let (criterion, gain) = (Some(value), Some(before - value));
        Ok(Selection { criterion, gain, evaluations, ..Selection::of(movement) })
    }

    fn search_box(
        &self,
        situation: &Situation<'_>,
        limits: &JointBox,
        scope: &Scope<'_>,
        searched: &JointBox,
        rng: &mut ChaCha8Rng,
    ) -> Result<Selection, SelectionError> {
        let drawn = self.drawn(situation.belief, rng)?;
        let criteria = drawn
            .iter()
            .map(|belief| self.criterion(belief, situation, limits))
            .collect::<Result<Vec<_>, SelectionError>>()?;
        let mean = |candidates: &[Vec<f64>], by: fn(&Criterion<'_>, &[Vec<f64>]) -> Vec<f64>| {
            if let [criterion] = criteria.as_slice() {
                return by(criterion, candidates);
            }
            let mut sums = vec![0.0; candidates.len()];
            for criterion in &criteria {
                sums.iter_mut().zip(by(criterion, candidates)).for_each(|(sum, value)| *sum += value);
            }
            sums.iter().map(|sum| sum / criteria.len() as f64).collect::<Vec<f64>>()
        };
        let evaluate = |candidates: &[Vec<f64>]| {
            scope.evaluate(candidates, |feasible| mean(feasible, |criterion, all| criterion.evaluate(all)))
        };
        let (mut best, mut evaluations, search) = match self.minimiser {
            Minimiser::Direct(settings) => {
                let here = |candidates: &[Vec<f64>]| {
                    scope.evaluate(candidates, |feasible| mean(feasible, |criterion, all| criterion.evaluate_here(all)))
                };
                let alone = if let [criterion] = criteria.as_slice() { Some(criterion) } else { None };
                let search = direct(scope, searched, settings, &here, alone)?;
                let best = search.best().map(|(point, value)| (searched.from_unit(&point), value));
                (best, search.evaluations(), Some(search))
            }
            Minimiser::Random { evaluations } => {
                let draws = (0..evaluations).map(|_| scope.draw(searched, rng));
                let candidates = draws.collect::<Result<Vec<_>, SelectionError>>()?;
                let values = evaluate(&candidates);
                (least(candidates.into_iter().zip(values)), evaluations, None)
            }
            Minimiser::Bayesian { evaluations } => {
                let one = |point: &[f64]| evaluate(&[searched.from_unit(point)])[0];
                let found = bayesian(searched.dimension(), evaluations, rng.random(), one);
                (found.map(|found| (searched.from_unit(&found.point), found.value)), evaluations, None)
            }
        };
        if best.is_none() && scope.is_constrained() {
            // What is feasible may be too small a part of the box for a search to come upon.
            let found = scope.some()?;
            evaluations += found.len();
            let values = evaluate(&found);
            best = least(found.into_iter().zip(values));
        }
        let before = criteria.iter().map(Criterion::before).sum::<f64>() / criteria.len() as f64;
        let Some((configuration, value)) = best.filter(|(_, value)| value.is_finite()) else {
            return Watch::fallback(self.watch.as_ref(), before, scope);
        };
        let configuration = scope.aimed(configuration);
        let value = value - scope.price(&configuration);
        Ok(Selection {
            criterion: Some(value),
            gain: Some(before - value),
            evaluations,
            search,
            ..Selection::plain(configuration)
        })
    }
}

impl Policy for Active {
    fn select(&self, situation: &Situation<'_>, rng: &mut ChaCha8Rng) -> Result<Selection, SelectionError> {
        if let Actions::Sockets(sockets) = situation.actions {
            return self.select_in_sockets(situation.belief, sockets, &Scope::of(situation)?, rng);
        }
        let scope = Scope::of(situation)?;
        if let Some(beginning) = Watch::beginning(self.watch.as_ref(), situation.history, &scope)? {
            return Ok(beginning);
        }
        match &scope.domain {
            Domain::Box { searched, joints } => self.search_box(situation, joints, &scope, searched, rng),
            Domain::List { movements, joints: Some(joints) } => {
                let criterion = self.criterion(situation.belief, situation, joints)?;
                let candidates: Vec<&[f64]> =
                    movements.iter().map(|movement| movement.configuration.as_slice()).collect();
                let (values, before) = (criterion.evaluate(&candidates), criterion.before());
                Selection::of_list(self.watch.as_ref(), &scope, movements, values, before)
            }
            Domain::List { movements, joints: None } => {
                let before = Criterion::new(situation.belief, &self.weights)?.before();
                let held = held_by(situation.belief, movements);
                let values = evaluate(&held, movements, |held| self.values(held))?;
                Selection::of_list(self.watch.as_ref(), &scope, movements, values, before)
            }
        }
    }

    fn appraise(
        &self,
        situation: &Situation<'_>,
        limits: &JointBox,
        configuration: &[f64],
    ) -> Result<Appraisal, SelectionError> {
        self.criterion(situation.belief, situation, limits)?.appraise(configuration)
    }
}
