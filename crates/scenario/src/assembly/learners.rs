//! Assembling a learner as a scenario specifies it: its estimator, its policy, and its prior.

use std::sync::Arc;

use super::Briefing;
use crate::{
    ErrorDraw, EstimatorKind, Filter, InitialError, Known, LearnerSpec, PolicyKind, Scenario, ScenarioError,
    SmootherSpec, WorldSpec,
};
use body_schema_engine::{
    estimation::{Begin, Belief, Estimator, Gradient, OverparameterisedRls, Rls, Smoother, UnscentedRls, WarmStart},
    model::{Block, Layout, Prior},
    optimize::{Settings, Variant},
    selection::{Active, Human, Minimiser, Planner, Policy, Random},
    sensing::{JointNoise, Loss, MeasurementModel, Noise, Occasion},
};
use body_schema_experiment::{Agent, Learner, Stream};

/// States drawn from the posterior for one Monte Carlo evaluation of (7).
const MONTE_CARLO_SAMPLES: usize = 16;

impl Scenario {
    pub(super) fn learner(&self, spec: &LearnerSpec, seed: u64, briefing: &Briefing) -> Result<Learner, ScenarioError> {
        let agent = self.agent_of(spec, seed, briefing)?;
        let workspace = briefing.workspace.clone();
        let weights = match spec.holds_axes {
            true => briefing.holding_axes(self).weights,
            false => briefing.weights.clone(),
        };
        Ok(Learner::new(self.learner_setting(spec), agent, weights, workspace, self.settled_below_m))
    }

    pub(super) fn agent_of(&self, spec: &LearnerSpec, seed: u64, briefing: &Briefing) -> Result<Agent, ScenarioError> {
        let held = spec.holds_axes.then(|| briefing.holding_axes(self));
        let briefing = held.as_ref().unwrap_or(briefing);
        let estimator = self.estimator(spec, seed, briefing)?;
        let (actions, limits) = (briefing.actions.clone(), self.robot.limits.clone());
        let agent = Agent::new(estimator, self.policy(spec, briefing), actions, limits, seed);
        Ok(match &self.constraints {
            Some(constraints) => agent.bound_to(constraints.clone()),
            None => agent,
        })
    }

    fn estimator(
        &self,
        spec: &LearnerSpec,
        seed: u64,
        briefing: &Briefing,
    ) -> Result<Box<dyn Estimator>, ScenarioError> {
        let stabilising = |filter: Filter| filter.stabilising.filter(|_| spec.stabilising);
        let (sigma, begin): (f64, Begin) = match spec.estimator {
            EstimatorKind::Smoother => {
                let (sigma, unknown) = (self.smoother.sigma, self.smoother.noise_unknown);
                return Ok(Box::new(self.smoother(spec, seed, briefing, sigma, unknown)?));
            }
            EstimatorKind::Rls => {
                let (noise, share) = (stabilising(self.filter), self.filter.underweighting);
                let begin: Begin = Arc::new(move |belief, covariance| {
                    Box::new(Rls::new(belief, covariance, noise).underweighting(share))
                });
                (self.filter.sigma(), begin)
            }
            EstimatorKind::Unscented => {
                let noise = stabilising(self.unscented);
                let begin: Begin =
                    Arc::new(move |belief, covariance| Box::new(UnscentedRls::new(belief, covariance, noise)));
                (self.unscented.sigma(), begin)
            }
            EstimatorKind::OverparameterisedRls => {
                let (noise, direction, point) =
                    (stabilising(self.filter), self.prior.direction_rad, self.prior.point_m);
                let begin: Begin =
                    Arc::new(move |belief, _| Box::new(OverparameterisedRls::new(belief, direction, point, noise)));
                (self.filter.sigma(), begin)
            }
            EstimatorKind::Gradient => {
                let rate = self.gradient_rate;
                (1.0, Arc::new(move |belief, _| Box::new(Gradient::new(belief, rate))))
            }
        };
        let measurement_model = Arc::new(self.measurement_model.assuming(sigma));
        let unknown = self.unknown_places(&briefing.layout);
        if !unknown.is_empty() {
            return Ok(Box::new(WarmStart::new(
                self.smoother(spec, seed, briefing, self.filter.sigma(), false)?,
                unknown,
                measurement_model,
                begin,
            )));
        }
        let belief = Belief::new(briefing.initial.clone(), briefing.layout.clone(), measurement_model);
        let mut estimator = begin(belief, briefing.covariance.clone());
        if let Some(known) = &briefing.beforehand {
            // Whatever the posture.
            let anywhere = vec![0.0; self.robot.names.len()];
            let told = estimator.correct(&anywhere, known);
            told.map_err(|source| ScenarioError::Beforehand { scenario: self.name.clone(), source })?;
        }
        Ok(estimator)
    }

    /// The learned places of which next to nothing is known, so that a filter cannot begin at the guess: everything that an
    /// unknown base carries, or that may be anywhere.
    fn unknown_places(&self, layout: &Layout) -> Vec<Block> {
        let has_base = layout.block(Block::Base).is_some();
        let is_unknown = |block: &Block| match block {
            Block::Base => true,
            Block::Target(_) | Block::Device(_) => {
                has_base || matches!(self.prior.of(*block), Some(Known::Anywhere { .. }))
            }
            _ => false,
        };
        layout.blocks().map(|(block, _)| block).filter(is_unknown).collect()
    }

    /// A smoother that takes `sigma` for σ of the first channel, or only as a unit if the noise is unknown.
    fn smoother(
        &self,
        spec: &LearnerSpec,
        seed: u64,
        briefing: &Briefing,
        sigma: f64,
        noise_unknown: bool,
    ) -> Result<Smoother, ScenarioError> {
        let (layout, covariance) = (&briefing.layout, briefing.covariance.clone());
        let SmootherSpec { hypotheses, loss, .. } = self.smoother;
        let bound = match &self.world {
            WorldSpec::Simulated { initial_error: InitialError { draw: ErrorDraw::Anywhere, point_m, .. }, .. } => {
                Some(*point_m)
            }
            _ => None,
        };
        // Without a guess axes may be anywhere; a marker is known as well as the prior says.
        let within = |block| match self.prior.of(block) {
            Some(Known::Anywhere { within_m }) => Some(within_m),
            _ => bound.filter(|_| matches!(block, Block::Axis(_))),
        };
        let prior = Prior::new(briefing.initial.clone(), layout, covariance, within)
            .map_err(|source| ScenarioError::Prior { scenario: self.name.clone(), source })?;
        let (measurement_model, rng) = (Arc::new(self.smoother_measurement_model(sigma)), Stream::Hypotheses.rng(seed));
        // What is known beforehand is one equation: its own σ says how well.
        let sensors = self.measurement_model.sensors();
        let is_measured = |noise: &Noise| sensors[noise.channel].subject().occasion != Occasion::Beforehand;
        let unknown = self.measurement_model.noises().iter().map(|noise| noise_unknown && is_measured(noise)).collect();
        let smoother = Smoother::new(prior, layout.clone(), measurement_model, hypotheses, rng)
            .with_loss(if spec.robust { loss } else { Loss::None })
            .with_unknown_noise(unknown)
            .with_unknown_joint_noise(self.smoother.joints_unknown);
        let smoother = match &briefing.beforehand {
            Some(known) => smoother.with_prior_observation(known.clone()),
            None => smoother,
        };
        // What people tell of a robot elsewhere is a guess.
        let is_external = matches!(self.world, WorldSpec::External { .. });
        let smoother = if is_external { smoother.doubting_prior() } else { smoother };
        // Recorded bodies do not change: what looks like it is an outlier or a model that does not hold.
        let is_recorded = matches!(self.world, WorldSpec::Measured { .. });
        Ok(if is_recorded { smoother.never_forgetting() } else { smoother })
    }

    /// The measurement model that the smoother assumes, with `sigma` for σ of the first sensor. Where it learns the noise of the
    /// joints' readings, it begins with the usual one.
    pub fn smoother_measurement_model(&self, sigma: f64) -> MeasurementModel {
        let measurement_model = self.measurement_model.assuming(sigma);
        if !self.smoother.joints_unknown {
            return measurement_model;
        }
        measurement_model.with_joint_noise(JointNoise::usual(&self.robot.state).map(Arc::new))
    }

    fn policy(&self, spec: &LearnerSpec, briefing: &Briefing) -> Box<dyn Policy> {
        let (weights, watch) = (briefing.weights.clone(), briefing.watch.clone());
        let kind = spec.policy;
        let settings = self.selection.search;
        let evaluations = settings.max_evaluations;
        let minimiser = match kind {
            PolicyKind::Random => return Box::new(Random::new(weights, watch)),
            PolicyKind::Active
            | PolicyKind::ActivePlanned
            | PolicyKind::ActiveNaive
            | PolicyKind::ActiveMonteCarlo
            | PolicyKind::Human => Minimiser::Direct(settings),
            PolicyKind::ActiveDirect => Minimiser::Direct(Settings { variant: Variant::Original, ..settings }),
            PolicyKind::ActiveRandomSearch => Minimiser::Random { evaluations },
            PolicyKind::ActiveBayesian => Minimiser::Bayesian { evaluations },
        };
        let samples = if kind == PolicyKind::ActiveMonteCarlo { MONTE_CARLO_SAMPLES } else { 0 };
        let plans = kind == PolicyKind::ActivePlanned
            || (kind == PolicyKind::Active && spec.estimator == EstimatorKind::Smoother);
        if plans {
            let planner = Planner::new(weights, settings, self.selection.planning, briefing.workspace.clone());
            return Box::new(match watch {
                Some(watch) => planner.watched(watch),
                None => planner,
            });
        }
        let active = Active::new(weights, minimiser).sampled(samples);
        let active = match watch {
            Some(watch) if kind == PolicyKind::ActiveNaive => active.watched_naively(watch),
            Some(watch) => active.watched(watch),
            None => active,
        };
        if kind == PolicyKind::Human { Box::new(Human::new(active)) } else { Box::new(active) }
    }
}
