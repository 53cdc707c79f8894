//! Selection that plans: the movements that are still needed, chosen together, under all hypotheses.

use rand_chacha::ChaCha8Rng;

use super::{
    Actions, Movement, Optimality, Outlook, Partition, Policy, Selection, SelectionError, Sight, Visibility, Watch,
    Weights, criterion::scaled, plan::Plan,
};
use crate::{
    estimation::Belief,
    optimize::{Direct, Polish, Settings, polish},
    sensing::Observation,
};

/// How movements are planned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Planning {
    /// What a movement is chosen by.
    pub optimality: Optimality,
    /// Movements planned at most; 1 chooses greedily.
    pub ahead: usize,
    /// Movements carried out before the plan is made anew. More than one lets a robot execute several in one go.
    pub batch: usize,
    /// A direction of parameter space counts as unknown above this standard deviation, in the units of the criterion.
    pub unknown: f64,
    /// Movements planned beyond those needed to determine what is unknown.
    pub spare: usize,
    /// Hypotheses looked at, the heaviest ones.
    pub considered: usize,
    /// How many of DIRECT's best leaves are polished.
    pub polished: usize,
    /// How far.
    pub polish: Polish,
    /// How often every pose of a plan is exchanged.
    pub sweeps: usize,
    /// How far a pose is polished when it is exchanged.
    pub exchange: Polish,
}

impl Default for Planning {
    fn default() -> Self {
        let polish = |steps| Polish { steps, tolerance: 1e-4 };
        Self {
            optimality: Optimality::A,
            ahead: 20,
            batch: 1,
            unknown: 0.1,
            spare: 1,
            considered: 8,
            polished: 3,
            polish: polish(12),
            sweeps: 2,
            exchange: polish(5),
        }
    }
}

/// Plans the movements that are still needed to determine what is unknown, and makes them one by one, the one that
/// teaches most at once first. After each (or after a batch) the plan is made anew, from where it stood.
///
/// Once nothing is unknown any more, one plan of as many movements as a third of the parameters is carried out before
/// the next is made: together they shrink the covariance more than as many greedy ones, and nothing that they teach
/// would change the plan by much.
///
/// Over a pool of recorded movements every one is tried, and the best is taken.
#[derive(Clone, Debug)]
pub struct Planner {
    weights: Weights,
    search: Settings,
    planning: Planning,
    workspace: Vec<Vec<f64>>,
    watch: Option<Watched>,
    planned: Vec<Vec<f64>>,
    /// Movements of the plan that are still to be made before the next plan.
    committed: usize,
}

#[derive(Clone, Debug)]
struct Watched {
    visible_pose: Vec<f64>,
    visibility: Visibility,
    has_moved: bool,
}

/// Where everything of one choice is looked up.
struct Scene<'a> {
    planner: &'a Planner,
    limits: &'a [(f64, f64)],
    /// No movement planned: the belief as it is.
    now: Plan,
}

impl Planner {
    /// Planning by the criterion with `weights`; `workspace` holds the configurations over which criterion I predicts.
    pub fn new(weights: Weights, search: Settings, planning: Planning, workspace: Vec<Vec<f64>>) -> Self {
        Self { weights, search, planning, workspace, watch: None, planned: Vec::new(), committed: 0 }
    }

    /// The same where a head watches: the first movement goes to the pose that is known to be visible, gains are
    /// weighed by the chance of being seen, and misses are remembered.
    pub fn watched(self, watch: Watch) -> Self {
        let Watch { head, visible_pose } = watch;
        let visibility = Visibility::new(head);
        Self { watch: Some(Watched { visible_pose, visibility, has_moved: false }), ..self }
    }

    fn select_in_box(&mut self, belief: &Belief, limits: &[(f64, f64)]) -> Result<Selection, SelectionError> {
        let now = Plan::new(belief, self.planning.considered);
        let unknown = now.unknown(&self.weights, self.planning.unknown)?;
        let scene = Scene { planner: self, limits, now };
        let (mut evaluations, mut partition, mut committed) = (0, None, self.committed);
        let poses = if committed > 0 && (unknown == 0 || self.planning.batch > 1) && !self.planned.is_empty() {
            self.planned.clone()
        } else {
            let determined = unknown == 0 && self.planning.ahead > 1;
            let wanted = if determined {
                belief.layout.dimension().div_ceil(3)
            } else {
                (unknown + self.planning.spare).max(self.planning.batch)
            };
            let horizon = wanted.clamp(1, self.planning.ahead.max(self.planning.batch).max(1));
            let plan = scene.plan(horizon, &mut evaluations, &mut partition)?;
            committed = if determined { plan.poses.len() } else { self.planning.batch };
            plan.poses
        };
        // Of the plan, what teaches most at once comes first.
        let (first, trace) = {
            let outlook = scene.outlook(&scene.now)?;
            let values = outlook.evaluate(&poses).into_iter().enumerate();
            (values.min_by(|a, b| a.1.total_cmp(&b.1)), outlook.trace())
        };
        drop(scene);
        self.planned = poses;
        self.committed = committed.saturating_sub(1);
        let Some((index, value)) = first.filter(|(_, value)| value.is_finite()) else {
            self.committed = 0;
            return match &self.watch {
                // Nothing in view was found: back to where the marker is known to be seen.
                Some(watch) if trace.is_finite() => Ok(Selection::plain(watch.visible_pose.clone())),
                _ => Err(SelectionError::NoFiniteCriterion),
            };
        };
        Ok(Selection {
            movement: Movement { configuration: self.planned.remove(index), row: None },
            criterion: Some(value),
            gain: Some(trace - value),
            evaluations,
            partition,
        })
    }

    fn select_from_pool(&self, belief: &Belief, pool: &[Movement]) -> Result<Selection, SelectionError> {
        let outlook = Outlook::new(belief, &self.weights, self.planning.optimality, &self.workspace)?;
        let candidates: Vec<&[f64]> = pool.iter().map(|movement| movement.configuration.as_slice()).collect();
        Selection::of_pool(pool, outlook.evaluate(&candidates), outlook.trace())
    }
}

impl Scene<'_> {
    /// The criterion once `plan` is carried out.
    fn outlook<'b>(&'b self, plan: &'b Plan) -> Result<Outlook<'b>, SelectionError> {
        let Planner { weights, planning, workspace, watch, .. } = self.planner;
        let outlook = Outlook::new(&plan.after, weights, planning.optimality, workspace)?.told(&plan.told());
        Ok(match watch {
            Some(watch) => outlook.unsure(&self.now.after).watched(Sight::Chance(&watch.visibility, self.limits)),
            None => outlook,
        })
    }

    fn configuration(&self, point: &[f64]) -> Vec<f64> {
        point.iter().zip(self.limits).map(|(x, (lower, upper))| lower + x * (upper - lower)).collect()
    }

    /// The criterion at points of the unit cube.
    fn evaluate(&self, outlook: &Outlook<'_>, points: &[Vec<f64>]) -> Vec<f64> {
        let candidates: Vec<Vec<f64>> = points.iter().map(|point| self.configuration(point)).collect();
        outlook.evaluate(&candidates)
    }

    fn add(&self, plan: &mut Plan, pose: Vec<f64>) -> Result<(), SelectionError> {
        let (chances, told) = self.outlook(plan)?.expectations(&pose);
        plan.add(pose, chances, told);
        Ok(())
    }

    /// A plan of `horizon` movements, from the one there is. The partition is that of DIRECT's first search.
    fn plan(
        &self,
        horizon: usize,
        evaluations: &mut usize,
        partition: &mut Option<Partition>,
    ) -> Result<Plan, SelectionError> {
        let mut plan = self.now.clone();
        for pose in self.planner.planned.iter().take(horizon) {
            self.add(&mut plan, pose.clone())?;
        }
        // The weakest pose is sought anew over the whole box, as is what the plan lacks.
        if plan.poses.len() >= horizon {
            let mut weakest: Option<(f64, usize)> = None;
            for index in 0..plan.poses.len() {
                let mut without = plan.clone();
                without.remove(index);
                let trace = self.outlook(&without)?.trace();
                if weakest.is_none_or(|(least, _)| trace < least) {
                    weakest = Some((trace, index));
                }
            }
            if let Some((_, index)) = weakest {
                plan.remove(index);
            }
        }
        while plan.poses.len() < horizon {
            let Some(pose) = self.search(&plan, evaluations, partition)? else { break };
            self.add(&mut plan, pose)?;
        }
        if plan.poses.len() > 1 {
            for _ in 0..self.planner.planning.sweeps * plan.poses.len() {
                // Always the first; what replaces it goes to the end.
                let pose = plan.remove(0);
                let found = {
                    let outlook = self.outlook(&plan)?;
                    let evaluate = |points: &[Vec<f64>]| {
                        *evaluations += points.len();
                        self.evaluate(&outlook, points)
                    };
                    polish(&scaled(&pose, self.limits), self.planner.planning.exchange, evaluate).0
                };
                self.add(&mut plan, self.configuration(&found))?;
            }
        }
        Ok(plan)
    }

    /// The best pose to add to a plan: DIRECT over the joint box, its best leaves polished.
    fn search(
        &self,
        plan: &Plan,
        evaluations: &mut usize,
        partition: &mut Option<Partition>,
    ) -> Result<Option<Vec<f64>>, SelectionError> {
        let Planner { search, planning, .. } = self.planner;
        let outlook = self.outlook(plan)?;
        let mut evaluate = |points: &[Vec<f64>]| {
            *evaluations += points.len();
            self.evaluate(&outlook, points)
        };
        let mut direct = Direct::new(self.limits.len(), *search).map_err(SelectionError::Search)?;
        while let Some(batch) = direct.ask() {
            let points: Vec<Vec<f64>> = batch.iter().map(<[f64]>::to_vec).collect();
            direct.tell(&evaluate(&points)).map_err(SelectionError::Search)?;
        }
        let found = Partition::of(&direct);
        let leaves = found.leaves.iter().filter_map(|leaf| Some((leaf.value?, leaf.centre.as_slice())));
        let mut starts: Vec<(f64, &[f64])> = leaves.collect();
        starts.sort_by(|a, b| a.0.total_cmp(&b.0));
        let polished = starts.into_iter().take(planning.polished.max(1));
        let best =
            polished.map(|(_, start)| polish(start, planning.polish, &mut evaluate)).min_by(|a, b| a.1.total_cmp(&b.1));
        partition.get_or_insert(found);
        Ok(best.map(|(point, _)| self.configuration(&point)))
    }
}

impl Policy for Planner {
    fn select(
        &mut self,
        belief: &Belief,
        actions: &Actions,
        _rng: &mut ChaCha8Rng,
    ) -> Result<Selection, SelectionError> {
        match actions {
            Actions::Pool(pool) => self.select_from_pool(belief, pool),
            Actions::Box(limits) => match self.watch.as_ref().filter(|watch| !watch.has_moved) {
                Some(watch) => Ok(Selection::plain(watch.visible_pose.clone())),
                None => self.select_in_box(belief, limits),
            },
        }
    }

    fn observe(&mut self, movement: &Movement, actions: &Actions, observation: &Observation) {
        let Some(watch) = &mut self.watch else { return };
        watch.has_moved = true;
        if let (Actions::Box(limits), Observation::Missed) = (actions, observation) {
            watch.visibility.missed(scaled(&movement.configuration, limits));
        }
    }
}
