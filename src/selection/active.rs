//! Active selection: the movement that is expected to teach most.

use nalgebra::DVector;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use serde::{Deserialize, Serialize};

use super::{
    ACriterion, Actions, Movement, Policy, Selection, SelectionError, Sight, Visibility, Watch, Weights,
    criterion::scaled, draw_configuration,
};
use crate::{
    estimation::Belief,
    optimize::{Direct, Settings, bayesian},
    sensing::Observation,
};

/// Minimises the A-criterion: over a box of joint limits by DIRECT, normalised to the unit cube; over a pool of
/// recorded movements by trying every one.
///
/// Where a head watches ([`watched`](Self::watched)), the first movement goes to the pose that is known to be visible,
/// the gain is weighed by the chance of being seen, and misses are remembered.
#[derive(Clone, Debug)]
pub struct Active {
    weights: Weights,
    search: Search,
    samples: usize,
    watch: Option<Watched>,
}

/// How the criterion is minimised over a box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Search {
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

#[derive(Clone, Debug)]
struct Watched {
    visible_pose: Vec<f64>,
    visibility: Visibility,
    naive: bool,
    has_moved: bool,
}

/// The rectangles into which DIRECT had divided the joint box when its budget ended.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "app", derive(utoipa::ToSchema))]
pub struct Partition {
    /// All rectangles; they fill the unit cube (each joint from its lower limit, 0, to its upper, 1).
    pub leaves: Vec<Leaf>,
    /// Which of them has the chosen configuration as its centre.
    pub chosen: usize,
}

/// One rectangle of a partition.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "app", derive(utoipa::ToSchema))]
pub struct Leaf {
    /// Its centre in the unit cube, where the criterion was evaluated.
    pub centre: Vec<f64>,
    /// How often each side was trisected: side i is 3^−levels\[i\] long.
    pub levels: Vec<u8>,
    /// The criterion at the centre; null if it is not finite.
    pub value: Option<f64>,
    /// The iteration of DIRECT that gave the rectangle its present shape.
    pub generation: usize,
    /// Whether DIRECT would divide it next.
    pub potentially_optimal: bool,
}

impl Partition {
    pub(super) fn of(direct: &Direct) -> Self {
        let leaves: Vec<Leaf> = direct
            .partition()
            .iter()
            .map(|rectangle| Leaf {
                centre: rectangle.centre.to_vec(),
                levels: rectangle.levels.to_vec(),
                value: rectangle.value,
                generation: rectangle.generation,
                potentially_optimal: rectangle.potentially_optimal,
            })
            .collect();
        let best = direct.best().map(|(centre, _)| centre);
        let chosen = leaves.iter().position(|leaf| Some(leaf.centre.as_slice()) == best).unwrap_or(0);
        Self { leaves, chosen }
    }
}

impl Active {
    /// Selection by the A-criterion with `weights`, minimised by `search`.
    pub fn new(weights: Weights, search: Search) -> Self {
        Self { weights, search, samples: 0, watch: None }
    }

    /// The expectation in (7) by Monte Carlo: the mean of the criterion over so many chains drawn from the posterior,
    /// instead of the criterion at the estimate.
    pub fn sampled(self, samples: usize) -> Self {
        Self { samples, ..self }
    }

    /// The same where a head watches.
    pub fn watched(self, watch: Watch) -> Self {
        let Watch { head, visible_pose } = watch;
        let visibility = Visibility::new(head);
        Self { watch: Some(Watched { visible_pose, visibility, naive: false, has_moved: false }), ..self }
    }

    /// The naive form, for comparison: the plain criterion wherever the *predicted* marker is in view. It believes its
    /// own prediction, and a miss teaches it nothing.
    pub fn watched_naively(self, watch: Watch) -> Self {
        let mut active = self.watched(watch);
        active.watch.iter_mut().for_each(|watch| watch.naive = true);
        active
    }

    /// The beliefs over which the criterion is averaged: the estimate's, or chains drawn from it by N(0, P) in its
    /// chart, each with the same P.
    fn outlooks(&self, belief: &Belief, rng: &mut ChaCha8Rng) -> Result<Vec<Belief>, SelectionError> {
        if self.samples == 0 {
            return Ok(vec![belief.clone()]);
        }
        let covariance = belief.covariance.clone().ok_or(SelectionError::NoCovariance)?;
        let root = covariance.cholesky().ok_or(SelectionError::NoFiniteCriterion)?.l();
        let draw = |_| {
            let standard = DVector::from_fn(root.nrows(), |_, _| rng.sample(StandardNormal));
            Belief { chain: belief.chain.retract(&belief.layout, &(&root * standard)), ..belief.clone() }
        };
        Ok((0..self.samples).map(draw).collect())
    }

    fn search_box(
        &self,
        criteria: &[ACriterion<'_>],
        limits: &[(f64, f64)],
        rng: &mut ChaCha8Rng,
    ) -> Result<Selection, SelectionError> {
        let scale = |centre: &[f64]| -> Vec<f64> {
            centre.iter().zip(limits).map(|(c, (lower, upper))| lower + c * (upper - lower)).collect()
        };
        let evaluate = |candidates: &[Vec<f64>]| {
            let mut sums = vec![0.0; candidates.len()];
            for criterion in criteria {
                sums.iter_mut().zip(criterion.evaluate(candidates)).for_each(|(sum, value)| *sum += value);
            }
            sums.iter().map(|sum| sum / criteria.len() as f64).collect::<Vec<f64>>()
        };
        let (best, evaluations, partition) = match self.search {
            Search::Direct(settings) => {
                let mut direct = Direct::new(limits.len(), settings).map_err(SelectionError::Search)?;
                while let Some(batch) = direct.ask() {
                    let candidates: Vec<Vec<f64>> = batch.iter().map(scale).collect();
                    direct.tell(&evaluate(&candidates)).map_err(SelectionError::Search)?;
                }
                let best = direct.best().map(|(centre, value)| (scale(centre), value));
                (best, direct.evaluations(), Some(Partition::of(&direct)))
            }
            Search::Random { evaluations } => {
                let candidates: Vec<_> = (0..evaluations).map(|_| draw_configuration(limits, rng)).collect();
                let values = evaluate(&candidates).into_iter();
                let finite = candidates.into_iter().zip(values).filter(|(_, value)| value.is_finite());
                (finite.min_by(|a, b| a.1.total_cmp(&b.1)), evaluations, None)
            }
            Search::Bayesian { evaluations } => {
                let found = bayesian(limits.len(), evaluations, rng.random(), |x| evaluate(&[scale(x)])[0]);
                (found.map(|found| (scale(&found.point), found.value)), evaluations, None)
            }
        };
        let trace = criteria.iter().map(ACriterion::trace).sum::<f64>() / criteria.len() as f64;
        let Some((configuration, value)) = best else {
            return match &self.watch {
                // Nothing in view was found: back to where the marker is known to be seen.
                Some(watch) if trace.is_finite() => Ok(Selection::plain(watch.visible_pose.clone())),
                _ => Err(SelectionError::NoFiniteCriterion),
            };
        };
        Ok(Selection {
            movement: Movement { configuration, row: None },
            criterion: Some(value),
            gain: Some(trace - value),
            evaluations,
            partition,
        })
    }
}

impl Policy for Active {
    fn select(
        &mut self,
        belief: &Belief,
        actions: &Actions,
        rng: &mut ChaCha8Rng,
    ) -> Result<Selection, SelectionError> {
        match actions {
            Actions::Box(limits) => {
                if let Some(watch) = self.watch.as_ref().filter(|watch| !watch.has_moved) {
                    return Ok(Selection::plain(watch.visible_pose.clone()));
                }
                let outlooks = self.outlooks(belief, rng)?;
                let criterion = |belief| {
                    let criterion = ACriterion::new(belief, &self.weights)?;
                    Ok(match &self.watch {
                        Some(watch) if watch.naive => criterion.watched(Sight::Predicted(&watch.visibility)),
                        Some(watch) => criterion.watched(Sight::Chance(&watch.visibility, limits)),
                        None => criterion,
                    })
                };
                let criteria = outlooks.iter().map(criterion).collect::<Result<Vec<_>, SelectionError>>()?;
                self.search_box(&criteria, limits, rng)
            }
            Actions::Pool(pool) => {
                let criterion = ACriterion::new(belief, &self.weights)?;
                let candidates: Vec<&[f64]> = pool.iter().map(|movement| movement.configuration.as_slice()).collect();
                Selection::of_pool(pool, criterion.evaluate(&candidates), criterion.trace())
            }
        }
    }

    fn visibility(&self) -> Option<&Visibility> {
        self.watch.as_ref().map(|watch| &watch.visibility)
    }

    fn direct(&self) -> Option<Settings> {
        if let Search::Direct(settings) = self.search { Some(settings) } else { None }
    }

    fn observe(&mut self, movement: &Movement, actions: &Actions, observation: &Observation) {
        let Some(watch) = &mut self.watch else { return };
        watch.has_moved = true;
        if let (Actions::Box(limits), Observation::Missed) = (actions, observation) {
            watch.visibility.missed(scaled(&movement.configuration, limits));
        }
    }
}
