//! Selection that plans: the movements that are still needed, chosen together, under all hypotheses.

mod search_domain;

use std::sync::Arc;

use rand_chacha::ChaCha8Rng;

use super::{
    Actions, Appraisal, Domain, MixtureCriterion, Movement, Optimality, Planned, Policy, Scope, Search, Selection,
    SelectionError, Sight, Situation, Watch, Weights,
    held::{evaluate, held_by},
    herding::herd,
    plan::Plan,
    setting::Setting,
    views::Views,
};
use crate::{
    estimation::Belief,
    kinematics::JointBox,
    model::Workspace,
    optimize::{Polish, Settings, least},
};
use search_domain::SearchDomain;

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
/// Once nothing is unknown any more, one plan of as many movements as have one equation per parameter is carried out
/// before the next is made: together they shrink the covariance more than as many greedy ones, and nothing that they teach
/// would change the plan by much.
///
/// Over a pool of recorded movements every one is tried, and the best is taken.
///
/// Once what no parameter explains makes predictions worse than what is not known of the parameters, movements are chosen to be
/// distributed like those over which predictions count, by `herding`. No criterion of variance helps then: it goes to the edges, where it would tell
/// parameters best, and the parameters come out as suits the edges; the best design against bias has the moments of the region
/// that counts (Box and Draper, *J. Am. Stat. Assoc.* 54, 1959).
#[derive(Clone, Debug)]
pub struct Planner {
    pub(super) weights: Weights,
    pub(super) search: Settings,
    pub(super) planning: Planning,
    pub(super) workspace: Workspace,
    watch: Option<Watch>,
}

/// Draws of which one is to be seen, likelier than not.
const DRAWS: usize = 64;

/// Where everything of one choice is looked up.
struct Scene<'a> {
    planner: &'a Planner,
    /// No movement planned: the belief as it is.
    now: Plan,
    setting: Setting,
    /// What enters that not everything is seen: how, and by hypothesis what states drawn from it would see.
    sight: Option<(Sight<'a>, Vec<Option<Arc<Views>>>)>,
}

impl Planner {
    /// Planning by the criterion with `weights`; `workspace` holds the configurations over which criterion I predicts.
    pub fn new(weights: Weights, search: Settings, planning: Planning, workspace: Workspace) -> Self {
        Self { weights, search, planning, workspace, watch: None }
    }

    /// The same where a head watches: the first movement goes to the pose that is known to be visible, gains are
    /// weighed by the chance of being seen, and misses are remembered.
    pub fn watched(self, watch: Watch) -> Self {
        Self { watch: Some(watch), ..self }
    }

    /// A movement like those over which predictions count.
    fn represent(
        &self,
        situation: &Situation<'_>,
        limits: &JointBox,
        scope: &Scope<'_>,
        searched: &JointBox,
        rng: &mut ChaCha8Rng,
    ) -> Result<Selection, SelectionError> {
        let scene = Scene::new(self, situation, limits);
        let mixture = scene.mixture(&scene.now)?;
        let drawn = (0..DRAWS).map(|_| scope.draw(searched, rng)).collect::<Result<Vec<_>, _>>()?;
        let is_seen = |pose: &&Vec<f64>| mixture.expectations(pose).chances.first().is_none_or(|chance| *chance >= 0.5);
        let seen: Vec<&Vec<f64>> = drawn.iter().filter(is_seen).collect();
        match herd(&seen, &drawn, situation.history.made()) {
            Some(index) => {
                let pose = seen[index];
                let value = mixture.evaluate(&[pose]).first().copied();
                let gain = value.map(|value| mixture.before() - value);
                Ok(Selection { criterion: value, gain, evaluations: 1, ..Selection::plain(pose.clone()) })
            }
            None => self.select_in_box(situation, limits, scope, searched),
        }
    }

    fn select_in_box(
        &self,
        situation: &Situation<'_>,
        limits: &JointBox,
        scope: &Scope<'_>,
        searched: &JointBox,
    ) -> Result<Selection, SelectionError> {
        let scene = Scene::new(self, situation, limits);
        let mut domain = SearchDomain::new(situation, limits, scope, searched, self.planning.polished);
        // As many movements are needed as bring one independent equation for each unknown. How many one brings is much the
        // same at any posture off the middle, where axes may be in line.
        let equations = scene.now.equations(&limits.from_unit(&vec![0.37; limits.dimension()]));
        let unknown = scene.now.unknown(&self.weights, self.planning.unknown)?.div_ceil(equations);
        let before = situation.history.plan();
        let mut committed = before.map_or(0, |plan| plan.committed);
        let mut standing = before.map(|plan| plan.poses.clone()).unwrap_or_default();
        // Of what was planned elsewhere some may be out of reach from here.
        standing.retain(|pose| scope.is_feasible(pose));
        // What was committed when nothing was unknown may be more than a batch.
        let mut poses = if committed > 0 && (unknown == 0 || committed < self.planning.batch) && !standing.is_empty() {
            standing
        } else {
            let determined = unknown == 0 && self.planning.ahead > 1;
            let wanted = if determined {
                situation.belief.layout.dimension().div_ceil(equations)
            } else {
                (unknown + self.planning.spare).max(self.planning.batch)
            };
            let horizon = wanted.clamp(1, self.planning.ahead.max(self.planning.batch).max(1));
            let plan = scene.plan(horizon, standing, &mut domain)?;
            committed = if determined { plan.poses.len() } else { self.planning.batch };
            plan.poses
        };
        // Of the plan, what teaches most at once comes first.
        let mixture = scene.mixture(&scene.now)?;
        let values = scope.evaluate(&poses, |poses| mixture.evaluate(poses));
        let Some((index, value)) = least(values.into_iter().enumerate()) else {
            let selection = Watch::fallback(self.watch.as_ref(), mixture.before(), scope)?;
            return Ok(Selection { plan: Some(Planned { poses, committed: 0 }), ..selection });
        };
        let configuration = poses.remove(index);
        let value = value - scope.price(&configuration);
        let chosen = searched.to_unit(&configuration);
        let SearchDomain { evaluations, search, .. } = domain;
        Ok(Selection {
            movement: Movement::to(configuration),
            criterion: Some(value),
            gain: Some(mixture.before() - value),
            evaluations,
            search: search.map(|search| search.choosing(chosen)),
            plan: Some(Planned { poses, committed: committed.saturating_sub(1) }),
        })
    }
}

impl<'a> Scene<'a> {
    fn new(planner: &'a Planner, situation: &'a Situation<'a>, limits: &'a JointBox) -> Self {
        let now = Plan::new(situation.belief, planner.planning.considered);
        let sight = Watch::sight(planner.watch.as_ref(), situation, limits).map(|sight| {
            let Belief { state, layout, measurement_model, covariance, alternatives, .. } = &now.after;
            let estimate = covariance.as_ref().map(|covariance| (state, covariance));
            let others = alternatives.iter().map(|alternative| (&alternative.state, &alternative.covariance));
            let views =
                estimate.into_iter().chain(others).map(|(state, p)| sight.views(state, layout, p, measurement_model));
            (sight, views.collect())
        });
        let Planner { weights, planning, workspace, .. } = planner;
        let setting = Setting::new(&now.after, weights, planning.optimality, workspace);
        Self { planner, now, setting, sight }
    }

    /// The criterion once `plan` is carried out.
    fn mixture<'b>(&'b self, plan: &'b Plan) -> Result<MixtureCriterion<'b>, SelectionError> {
        let Planner { weights, planning, workspace, .. } = self.planner;
        let mixture = MixtureCriterion::over(&plan.after, weights, planning.optimality, workspace, &self.setting)?;
        let mixture = mixture.told(&plan.told());
        Ok(match &self.sight {
            Some((sight, views)) => mixture.unsure(&self.now.after).watched_by(*sight, views),
            None => mixture,
        })
    }

    fn add(&self, plan: &mut Plan, pose: Vec<f64>) -> Result<(), SelectionError> {
        let expected = self.mixture(plan)?.expectations(&pose);
        plan.add(pose, expected);
        Ok(())
    }

    /// The criterion once `plan` is carried out but for one of its poses.
    fn left_without(&self, plan: &Plan, index: usize) -> Result<f64, SelectionError> {
        let Planner { weights, planning, .. } = self.planner;
        if planning.optimality == Optimality::A
            && let Some(within) = plan.trace_without(index, weights)
        {
            return Ok(within + self.setting.between(&plan.told_without(index)));
        }
        let mut without = plan.clone();
        without.remove(index);
        Ok(self.mixture(&without)?.before())
    }

    /// A plan of `horizon` movements, from where it stood. The search that is kept is DIRECT's first.
    fn plan(
        &self,
        horizon: usize,
        standing: Vec<Vec<f64>>,
        domain: &mut SearchDomain<'_>,
    ) -> Result<Plan, SelectionError> {
        let searched = domain.searched;
        let mut plan = self.now.clone();
        for pose in standing.into_iter().take(horizon) {
            self.add(&mut plan, pose)?;
        }
        // The weakest pose is sought anew over the whole box, as is what the plan lacks.
        if plan.poses.len() >= horizon {
            let mut weakest: Option<(f64, usize)> = None;
            for index in 0..plan.poses.len() {
                let left = self.left_without(&plan, index)?;
                if weakest.is_none_or(|(least, _)| left < least) {
                    weakest = Some((left, index));
                }
            }
            if let Some((_, index)) = weakest {
                plan.remove(index);
            }
        }
        while plan.poses.len() < horizon {
            let Some(pose) = self.search(&plan, domain)? else { break };
            self.add(&mut plan, domain.scope.aimed(pose))?;
        }
        if plan.poses.len() > 1 {
            for _ in 0..self.planner.planning.sweeps * plan.poses.len() {
                // Always the first; what replaces it goes to the end.
                let pose = plan.remove(0);
                let found = {
                    let mixture = self.mixture(&plan)?;
                    domain.polish(&mixture, &plan.poses, &searched.to_unit(&pose), self.planner.planning.exchange).0
                };
                let found = domain.scope.aimed(searched.from_unit(&found));
                // On the edge of what is feasible rounding alone may put the pose beyond it.
                let is_feasible = domain.scope.is_feasible(&found);
                self.add(&mut plan, if is_feasible { found } else { pose })?;
            }
        }
        Ok(plan)
    }

    /// The best pose to add to a plan: DIRECT over the box, its best leaves polished.
    fn search(&self, plan: &Plan, domain: &mut SearchDomain<'_>) -> Result<Option<Vec<f64>>, SelectionError> {
        let Planner { search, planning, .. } = self.planner;
        let (scope, searched) = (domain.scope, domain.searched);
        let mixture = self.mixture(plan)?;
        let search = domain.search(&mixture, &plan.poses, *search)?;
        let mut starts = search.best_of_all(planning.polished.max(1));
        // The best of some that are feasible. Scaled to the unit cube and back, one on the edge may be so no more.
        let mut feasible = None;
        if starts.is_empty() && scope.is_constrained() {
            // What is feasible may be too small a part of the box for DIRECT to come upon.
            let found = scope.some()?;
            let values = scope.evaluate_beside(&plan.poses, &found, |feasible| mixture.evaluate(feasible));
            starts.extend(values.iter().copied().zip(found.iter().map(|pose| searched.to_unit(pose))));
            feasible = least(found.into_iter().zip(values));
        }
        starts.sort_by(|a, b| a.0.total_cmp(&b.0));
        starts.truncate(planning.polished.max(1));
        domain.search.get_or_insert(search);
        // What is in view may be too small as well.
        let familiar = domain.familiar.clone();
        let polished = starts.into_iter().map(|(_, start)| start).chain(familiar);
        let best = least(polished.map(|start| domain.polish(&mixture, &plan.poses, &start, planning.polish)));
        let best = best.map(|(point, value)| (searched.from_unit(&point), value));
        Ok(least(best.into_iter().chain(feasible)).map(|(pose, _)| pose))
    }
}

impl Policy for Planner {
    fn select(&self, situation: &Situation<'_>, rng: &mut ChaCha8Rng) -> Result<Selection, SelectionError> {
        let scope = Scope::of(situation)?;
        if let Actions::Sockets(sockets) = situation.actions {
            return match sockets.beginning(&scope) {
                Some(beginning) => Ok(Selection::of(beginning.clone())),
                None => self.select_in_sockets(situation.belief, sockets, &scope, rng),
            };
        }
        if let Some(beginning) = Watch::beginning(self.watch.as_ref(), situation.history, &scope)? {
            return Ok(beginning);
        }
        let represents = situation.belief.model_error_prevails(&self.workspace);
        match &scope.domain {
            Domain::Box { searched, joints } if represents => self.represent(situation, joints, &scope, searched, rng),
            Domain::Box { searched, joints } => self.select_in_box(situation, joints, &scope, searched),
            Domain::List { movements, .. } if represents => {
                let listed = movements.iter().map(|movement| movement.configuration.as_slice());
                let made = situation.history.made();
                let candidates: Vec<&[f64]> = listed.clone().collect();
                let wanted: Vec<&[f64]> = match self.workspace.places.is_empty() {
                    true => listed.chain(made.iter().map(AsRef::as_ref)).collect(),
                    // What is asked about is elsewhere.
                    false => self.workspace.configurations.iter().map(Vec::as_slice).collect(),
                };
                let index = herd(&candidates, &wanted, made).ok_or(SelectionError::Exhausted)?;
                Ok(Selection::of(movements[index].clone()))
            }
            Domain::List { movements, joints: Some(joints) } => {
                let scene = Scene::new(self, situation, joints);
                let mixture = scene.mixture(&scene.now)?;
                let candidates: Vec<&[f64]> =
                    movements.iter().map(|movement| movement.configuration.as_slice()).collect();
                let (values, before) = (mixture.evaluate(&candidates), mixture.before());
                Selection::of_list(self.watch.as_ref(), &scope, movements, values, before)
            }
            Domain::List { movements, joints: None } => {
                let mut belief = situation.belief.clone();
                belief.truncate(self.planning.considered);
                let (before, held) = (self.mixture(&belief)?.before(), held_by(&belief, movements));
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
        let scene = Scene::new(self, situation, limits);
        scene.mixture(&scene.now)?.appraise(configuration)
    }

    fn explain(&self, situation: &Situation<'_>, limits: &JointBox) -> Result<Option<Search>, SelectionError> {
        let scene = Scene::new(self, situation, limits);
        let Some((scope, searched)) = Scope::around(situation, limits)? else { return Ok(None) };
        let mut domain = SearchDomain::new(situation, limits, &scope, &searched, self.planning.polished);
        let mixture = scene.mixture(&scene.now)?;
        Ok(Some(domain.search(&mixture, &[], self.search)?))
    }
}
