//! From a scenario and a seed to an experiment: everything that is drawn is drawn here.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector, Rotation3, UnitVector3, Vector3};
use rand::{RngExt, seq::SliceRandom};
use rand_chacha::ChaCha8Rng;

use super::{
    ErrorDraw, EstimatorKind, Filter, InitialError, LearnerSpec, PolicyKind, Prior, Recording, Scenario, ScenarioError,
    SmootherSpec, WorldSpec,
};
use crate::{
    estimation::{self, Belief, Estimator, Gradient, Rls, SixNumbers, Smoother, UnscentedRls, anywhere},
    experiment::{
        Change, Description, Evaluation, Experiment, HeadDescription, Learner, ModelReport, Record, Stream, World,
        movements_by_counting,
    },
    kinematics::{Chain, Joint, registration::register},
    optimize::{Settings, Variant},
    selection::{Actions, Active, Movement, Planner, Policy, Random, Search, Watch, Weights, draw_configuration},
    sensing::MarkerTracker,
};

/// Configurations over which the prediction error is judged in a simulated world.
const EVALUATION_SIZE: usize = 200;
/// Configurations over which a learner judges itself.
const WORKSPACE_SIZE: usize = 32;

/// What learners are told at the start. Nothing in it comes from the truth but through the drawn initial estimate.
struct Briefing {
    initial: Chain,
    actions: Actions,
    workspace: Vec<Vec<f64>>,
    watch: Option<Watch>,
}

impl Scenario {
    /// The experiment of a seed with the named learners; with all of the scenario's if none are named.
    pub fn experiment(&self, seed: u64, learners: Option<&[String]>) -> Result<Experiment, ScenarioError> {
        let (world, evaluation, briefing) = self.draw(seed)?;
        self.assemble(seed, &self.chosen(learners)?, world, evaluation, &briefing)
    }

    fn draw(&self, seed: u64) -> Result<(World, Evaluation, Briefing), ScenarioError> {
        match &self.world {
            WorldSpec::Simulated { sigma_m, initial_error, watch, change } => {
                let truth = self.robot.chain.clone();
                let limits = &self.robot.limits;
                let briefing = Briefing {
                    initial: self.perturbed(initial_error, &mut Stream::InitialEstimate.rng(seed)),
                    actions: Actions::Box(limits.clone()),
                    // Uniform in the joint box, seen or not: what a head can see depends on the truth.
                    workspace: drawn(limits, WORKSPACE_SIZE, Stream::Workspace, seed, |_| true),
                    watch: watch.clone(),
                };
                let head = watch.as_ref().map(|watch| watch.head);
                let seen = |theta: &[f64]| head.is_none_or(|head| head.sees(&truth.marker_at(theta)));
                let mut configurations = drawn(limits, EVALUATION_SIZE, Stream::Evaluation, seed, seen);
                if configurations.is_empty() {
                    configurations.extend(watch.as_ref().map(|watch| watch.visible_pose.clone()));
                }
                let evaluation = Evaluation::of_truth(configurations, &truth, *sigma_m);
                let world = World::Simulated {
                    truth,
                    tracker: MarkerTracker { sigma_m: *sigma_m },
                    head,
                    change: change.as_ref().map(|change| Change { step: change.step, truth: change.truth.clone() }),
                };
                Ok((world, evaluation, briefing))
            }
            WorldSpec::Measured { recording, held_out } => self.draw_measured(seed, recording, *held_out),
        }
    }

    /// Holds rows out, and registers the nominal chain to the others.
    fn draw_measured(
        &self,
        seed: u64,
        recording: &Recording,
        held_out: usize,
    ) -> Result<(World, Evaluation, Briefing), ScenarioError> {
        let mut rows: Vec<usize> = (0..recording.markers_m.len()).collect();
        rows.shuffle(&mut Stream::HeldOut.rng(seed));
        let (test, training) = rows.split_at_mut(held_out);
        training.sort_unstable();
        let pair = |row: &usize| (recording.configurations[*row].clone(), recording.markers_m[*row]);
        let data: Vec<_> = training.iter().map(pair).collect();
        let registration = register(&self.robot.chain, &data).map_err(|source| ScenarioError::Registration {
            scenario: self.name.clone(),
            seed,
            source,
        })?;
        let movement =
            |row: &usize| Movement { configuration: recording.configurations[*row].clone(), row: Some(*row) };
        let briefing = Briefing {
            initial: registration.chain,
            actions: Actions::Pool(training.iter().map(movement).collect()),
            workspace: data.into_iter().map(|(theta, _)| theta).collect(),
            watch: None,
        };
        let evaluation = Evaluation::of_measurements(test.iter().map(pair).collect());
        Ok((World::Measured { markers_m: recording.markers_m.clone() }, evaluation, briefing))
    }

    /// The true chain with the error of the initial estimate: for each learned joint three Euler angles, then for a
    /// revolute one three coordinates; at last the marker.
    fn perturbed(&self, error: &InitialError, rng: &mut ChaCha8Rng) -> Chain {
        let mut chain = self.robot.chain.clone();
        let layout = &self.robot.layout;
        for (index, joint) in chain.joints.iter_mut().enumerate().filter(|(index, _)| layout.is_learned(*index)) {
            debug_assert!(layout.direction(index).is_some());
            if error.draw == ErrorDraw::Anywhere {
                *joint = anywhere(joint, error.point_m, rng);
                continue;
            }
            let angles = error.draw(error.angle_rad, rng);
            let turn = Rotation3::from_euler_angles(angles.x, angles.y, angles.z);
            let turned = |w: &UnitVector3<f64>| UnitVector3::new_normalize(turn * w.into_inner());
            match joint {
                Joint::Revolute(line) => {
                    line.direction = turned(&line.direction);
                    line.point += error.draw(error.point_m, rng);
                }
                Joint::Prismatic(direction) => *direction = turned(direction),
            }
        }
        if layout.marker().is_some() {
            chain.marker += error.draw(error.marker_m, rng);
        }
        chain
    }

    fn assemble(
        &self,
        seed: u64,
        specs: &[LearnerSpec],
        world: World,
        evaluation: Evaluation,
        briefing: &Briefing,
    ) -> Result<Experiment, ScenarioError> {
        let layout = Arc::new(self.robot.layout.clone());
        let prior_sd = self.prior.standard_deviations(&layout);
        let weights = Weights::new(self.selection.units, &layout, &prior_sd);
        let learners = specs
            .iter()
            .map(|spec| {
                let belief = Belief {
                    chain: briefing.initial.clone(),
                    layout: layout.clone(),
                    covariance: None,
                    noise_m2: self.filter.noise_m2,
                    alternatives: Vec::new(),
                };
                let estimator: Box<dyn Estimator> = match spec.estimator {
                    EstimatorKind::Rls => {
                        let prior = DMatrix::from_diagonal(&prior_sd.map(|sd| sd * sd));
                        Box::new(Rls::new(belief, prior, self.filter.stabilising.filter(|_| spec.stabilising)))
                    }
                    EstimatorKind::Unscented => {
                        let prior = DMatrix::from_diagonal(&prior_sd.map(|sd| sd * sd));
                        let Filter { noise_m2, stabilising } = self.unscented;
                        let belief = Belief { noise_m2, ..belief };
                        Box::new(UnscentedRls::new(belief, prior, stabilising.filter(|_| spec.stabilising)))
                    }
                    EstimatorKind::RlsSixNumbers => {
                        let Prior { direction_rad, point_m, .. } = self.prior;
                        let stabilising = self.filter.stabilising.filter(|_| spec.stabilising);
                        Box::new(SixNumbers::new(belief, direction_rad, point_m, stabilising))
                    }
                    EstimatorKind::Smoother => {
                        let SmootherSpec { noise_m2, hypotheses } = self.smoother;
                        let prior = self.smoother_prior(&briefing.initial, &prior_sd);
                        let rng = Stream::Hypotheses.rng(seed);
                        Box::new(Smoother::new(prior, layout.clone(), noise_m2, hypotheses, rng))
                    }
                    EstimatorKind::Gradient => Box::new(Gradient::new(belief, self.gradient_rate)),
                };
                let before = estimator.belief().clone();
                let policy = self.policy(spec, &weights, briefing);
                Learner {
                    description: spec.description(),
                    estimator,
                    policy,
                    actions: briefing.actions.clone(),
                    weights: weights.clone(),
                    workspace: briefing.workspace.clone(),
                    settled_below_m: self.settled_below_m,
                    before,
                    rng: Stream::Policy.rng(seed),
                    record: Record::default(),
                }
            })
            .collect();
        let description = Description {
            scenario: self.name.clone(),
            title: self.title.clone(),
            seed,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            joints: self.robot.joint_descriptions(),
            parameters: layout.dimension(),
            movements_by_counting: movements_by_counting(layout.dimension()),
            learners: specs.iter().map(LearnerSpec::description).collect(),
            thresholds: self.thresholds,
            movements_available: briefing.actions.remaining(),
            truth: world.truth().map(ModelReport::of_chain),
            change_at: world.change().map(|change| change.step),
            head: briefing.watch.as_ref().map(|watch| HeadDescription::of(&watch.head)),
        };
        let experiment = Experiment::new(description, world, learners, evaluation);
        Ok(match self.limits() {
            Some(limits) => experiment.bounded(limits),
            None => experiment,
        })
    }
}

impl Scenario {
    /// What a smoother is told: the initial estimate and how wrong it may be, or bounds alone.
    fn smoother_prior(&self, initial: &Chain, deviations: &DVector<f64>) -> estimation::Prior {
        match &self.world {
            WorldSpec::Simulated { initial_error: InitialError { draw: ErrorDraw::Anywhere, point_m, .. }, .. } => {
                let (frame, bound_m) = (initial.clone(), *point_m);
                estimation::Prior::Within { frame, bound_m, marker_m: self.prior.marker_m }
            }
            _ => estimation::Prior::Around { guess: initial.clone(), deviations: deviations.clone() },
        }
    }
}

/// Chains drawn from the posterior for one Monte Carlo evaluation of (7).
const MONTE_CARLO_SAMPLES: usize = 16;

impl Scenario {
    fn policy(&self, spec: &LearnerSpec, weights: &Weights, briefing: &Briefing) -> Box<dyn Policy> {
        let watch = briefing.watch.clone();
        let kind = spec.policy;
        let settings = self.selection.search;
        let evaluations = settings.max_evaluations;
        let search = match kind {
            PolicyKind::Random => return Box::new(Random),
            PolicyKind::Active | PolicyKind::ActivePlanned | PolicyKind::ActiveNaive | PolicyKind::ActiveMonteCarlo => {
                Search::Direct(settings)
            }
            PolicyKind::ActiveDirect => Search::Direct(Settings { variant: Variant::Original, ..settings }),
            PolicyKind::ActiveRandomSearch => Search::Random { evaluations },
            PolicyKind::ActiveBayesian => Search::Bayesian { evaluations },
        };
        let samples = if kind == PolicyKind::ActiveMonteCarlo { MONTE_CARLO_SAMPLES } else { 0 };
        let plans = kind == PolicyKind::ActivePlanned
            || (kind == PolicyKind::Active && spec.estimator == EstimatorKind::Smoother);
        if plans {
            let planner = Planner::new(weights.clone(), settings, self.selection.planning, briefing.workspace.clone());
            return Box::new(match watch {
                Some(watch) => planner.watched(watch),
                None => planner,
            });
        }
        let active = Active::new(weights.clone(), search).sampled(samples);
        Box::new(match watch {
            Some(watch) if kind == PolicyKind::ActiveNaive => active.watched_naively(watch),
            Some(watch) => active.watched(watch),
            None => active,
        })
    }
}

/// Draws before giving up on finding more configurations that are wanted.
const PATIENCE: usize = 100_000;

/// Up to `count` configurations, uniform among those in the box that are `wanted`.
fn drawn(
    limits: &[(f64, f64)],
    count: usize,
    stream: Stream,
    seed: u64,
    wanted: impl Fn(&[f64]) -> bool,
) -> Vec<Vec<f64>> {
    let mut rng = stream.rng(seed);
    let draws = std::iter::repeat_with(|| draw_configuration(limits, &mut rng)).take(PATIENCE);
    draws.filter(|theta| wanted(theta)).take(count).collect()
}

impl InitialError {
    fn draw(&self, size: f64, rng: &mut ChaCha8Rng) -> Vector3<f64> {
        Vector3::from_fn(|_, _| match self.draw {
            ErrorDraw::UpTo | ErrorDraw::Anywhere => size * rng.random_range(-1.0..=1.0),
            ErrorDraw::Exactly => size * if rng.random::<bool>() { 1.0 } else { -1.0 },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::builtin;

    /// Judges look only where the head can see, by the truth.
    #[test]
    fn the_evaluation_set_lies_in_view() {
        let scenario = builtin("head-fov").expect("a built-in scenario");
        let (world, evaluation, briefing) = scenario.draw(5).expect("a world");
        let head = world.head().expect("a head");
        assert_eq!(evaluation.targets().len(), EVALUATION_SIZE);
        assert!(evaluation.targets().iter().all(|(_, marker)| head.sees(marker)));
        let truth = world.truth().expect("simulated");
        assert!(briefing.workspace.iter().any(|theta| !head.sees(&truth.marker_at(theta))), "without truth");
    }

    /// No truth leaks: with the truth swapped behind the learners' backs, their first choices stay as they were, and
    /// the choices after the first measurement do not.
    #[test]
    fn swapping_the_truth_changes_no_first_selection() {
        for (name, learner) in [
            ("arm-6dof", None),
            ("arm-12dof", None),
            ("head-fov", None),
            ("arm-6dof", Some("global")),
            ("arm-6dof-no-prior", Some("global")),
            ("head-fov", Some("global")),
        ] {
            let scenario = builtin(name).expect("a built-in scenario");
            let selections = |swap: bool| {
                let (mut world, mut evaluation, briefing) = scenario.draw(11).expect("a world");
                if let (true, World::Simulated { truth, .. }) = (swap, &mut world) {
                    *truth = scenario.perturbed(
                        &InitialError { draw: ErrorDraw::Exactly, angle_rad: 0.7, point_m: 0.3, marker_m: 0.1 },
                        &mut Stream::InitialEstimate.rng(99),
                    );
                    evaluation.follow(truth);
                }
                let names = learner.map(|learner| [learner.to_owned()]);
                let specs = scenario.chosen(names.as_ref().map(<[_; 1]>::as_slice)).expect("learners");
                let mut experiment =
                    scenario.assemble(11, &specs, world, evaluation, &briefing).expect("an experiment");
                [(); 3].map(|()| {
                    let report = experiment.step().expect("a step");
                    let chosen = |learner: &crate::experiment::LearnerReport| {
                        learner.movement.as_ref().expect("a movement").configuration.clone()
                    };
                    report.learners.iter().map(chosen).collect::<Vec<_>>()
                })
            };
            let ([first, .., last], [first_swapped, .., last_swapped]) = (selections(false), selections(true));
            assert_eq!(first, first_swapped, "{name}");
            assert_ne!(last[0], last_swapped[0], "{name}: the active learner must have seen another marker");
        }
    }
}
