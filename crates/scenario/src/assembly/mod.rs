//! Assembling an experiment from a scenario and a seed. All random draws happen here.

mod guess;
mod learners;
mod observability;
mod sockets;

use std::sync::Arc;

use nalgebra::DMatrix;
use rand::seq::SliceRandom;

use crate::{HeldOut, LearnerSpec, Measurements, Scenario, ScenarioError, WorldSpec};
use body_schema_engine::{
    design::{Problem, Stretch, movements_by_counting},
    kinematics::JointBox,
    model::{Block, Layout, State, Workspace},
    selection::{Actions, Movement, Watch, Weights},
    sensing::{InView, Observation},
};
use body_schema_experiment::{Agent, Change, Evaluation, Experiment, Setting, Stream, World, channels};

/// The number of configurations over which the prediction error is judged in a simulated world.
const EVALUATION_SIZE: usize = 200;
/// The number of configurations over which a learner judges itself, and by which criterion I chooses. With few of them it learns what
/// predicts these few best: with 32 a Panda of 31 parameters ends with errors a twentieth greater than with 64, and with more than
/// that no smaller ones.
const WORKSPACE_SIZE: usize = 64;

/// The information that learners are given at the start. The truth enters it only through the drawn initial estimate.
struct Briefing {
    initial: State,
    /// The learned parameters.
    layout: Arc<Layout>,
    /// W.
    weights: Weights,
    /// P₀ of recursive least squares and of a smoother with a guess.
    covariance: DMatrix<f64>,
    actions: Actions,
    workspace: Workspace,
    watch: Option<Watch>,
    /// The readings known before any movement, with their error.
    beforehand: Option<Observation>,
}

impl Briefing {
    /// This briefing for a learner that takes the axes from the description.
    fn holding_axes(&self, scenario: &Scenario) -> Self {
        let others = self.layout.blocks().map(|(block, _)| block).filter(|block| !matches!(block, Block::Axis(_)));
        let layout = Layout::new(&self.initial, others);
        Self {
            initial: self.initial.clone(),
            weights: scenario.weights_of(&layout),
            covariance: scenario.prior_covariance(&layout),
            layout: Arc::new(layout),
            actions: self.actions.clone(),
            workspace: self.workspace.clone(),
            watch: self.watch.clone(),
            beforehand: self.beforehand.clone(),
        }
    }
}

impl Scenario {
    /// The experiment of a seed with the named learners; with the scenario's default learners if none are named.
    ///
    /// # Errors
    ///
    /// [`ScenarioError`] if the names do not choose learners (see [`chosen`](Scenario::chosen)), or if the prior of one
    /// is not positive definite.
    pub fn experiment(&self, seed: u64, learners: Option<&[String]>) -> Result<Experiment, ScenarioError> {
        let (world, evaluation, briefing) = self.draw(seed);
        self.assemble(seed, &self.chosen(learners)?, world, evaluation, &briefing)
    }

    /// The agent of a learner, with the same briefing as the learners of this seed, but without a world: for a robot of
    /// its own.
    ///
    /// # Errors
    ///
    /// [`ScenarioError`] if the prior is not positive definite.
    pub fn agent(&self, learner: &LearnerSpec, seed: u64) -> Result<Agent, ScenarioError> {
        let (.., briefing) = self.draw(seed);
        self.agent_of(learner, seed, &briefing)
    }

    /// The design problem of this scenario; `None` where no truth is known, a sensor has no noise or targets are held
    /// in sockets.
    pub fn design_problem(&self) -> Option<Problem> {
        self.design_problem_of(self.robot.layout.clone())
    }

    /// The design problem of a learner that learns these parameters and knows all others.
    fn design_problem_of(&self, layout: Layout) -> Option<Problem> {
        let WorldSpec::Simulated { watch, .. } = &self.world else { return None };
        // Designs are sought for in the joint box, of which sockets leave a part without a volume.
        if !self.robot.sockets.is_empty() || self.measurement_model.sensors().iter().any(|sensor| sensor.sigma() <= 0.0)
        {
            return None;
        }
        let watch = watch.as_ref();
        Some(Problem {
            truth: self.robot.state.clone(),
            measurement_model: self.measurement_model.clone(),
            limits: self.robot.limits.clone(),
            head: watch.and_then(|watch| watch.head),
            visible_pose: watch.map(|watch| watch.visible_pose.clone()),
            prior: self.information(&layout),
            weights: self.weights_of(&layout),
            layout,
        })
    }

    /// Λ₀ of these parameters, the information of the prior.
    fn information(&self, layout: &Layout) -> DMatrix<f64> {
        DMatrix::from_diagonal(&self.prior.standard_deviations(layout).map(|sd| sd.powi(-2)))
    }

    /// W of these parameters, the weights of the criterion.
    fn weights_of(&self, layout: &Layout) -> Weights {
        Weights::new(self.selection.units, layout, &self.prior.standard_deviations(layout))
    }

    /// The design problems along a run of so many steps: one stretch before a change of the body and one after it;
    /// empty where no truth is known or a sensor has no noise.
    pub fn design_stretches(&self, steps: u64) -> Vec<Stretch> {
        let Some(problem) = self.design_problem() else { return Vec::new() };
        let change = match &self.world {
            WorldSpec::Simulated { change: Some(change), .. } if change.step < steps => change,
            _ => return vec![Stretch { problem, from: 0, to: steps }],
        };
        let changed = Problem { truth: change.truth.clone(), ..problem.clone() };
        vec![Stretch { problem, from: 0, to: change.step }, Stretch { problem: changed, from: change.step, to: steps }]
    }

    fn draw(&self, seed: u64) -> (World, Evaluation, Briefing) {
        match &self.world {
            WorldSpec::Simulated { initial_error, watch, change, outliers } => {
                let truth = self.robot.state.clone();
                let limits = &self.robot.limits;
                let initial = self.perturbed(initial_error, &mut Stream::InitialEstimate.rng(seed));
                let briefing = Briefing {
                    layout: Arc::new(self.robot.layout.clone()),
                    weights: self.weights(),
                    // Uniform in the joint box, seen or not: what a head can see depends on the truth.
                    workspace: self.workspace(self.aimed(&initial, seed)),
                    initial,
                    covariance: self.prior_covariance(&self.robot.layout),
                    actions: self.actions(),
                    watch: watch.clone(),
                    beforehand: self.beforehand(seed),
                };
                let head = watch.as_ref().and_then(|watch| watch.head);
                let aims = self.measurement_model.servo().is_some();
                // What a robot that aims its camera cannot see, it does not ask about.
                let is_seen =
                    |theta: &[f64]| !aims || self.measurement_model.visible(None, &truth, theta).contains(&true);
                let seen = |theta: &[f64]| {
                    head.is_none_or(|head| head.sees(&truth.marker_at(theta)))
                        && is_seen(&self.measurement_model.aimed(&truth, theta))
                };
                let mut configurations = drawn(limits, EVALUATION_SIZE, Stream::Evaluation, seed, seen);
                configurations
                    .iter_mut()
                    .for_each(|theta| *theta = self.measurement_model.aimed(&truth, theta).into_owned());
                if configurations.is_empty() {
                    configurations.extend(watch.as_ref().map(|watch| watch.visible_pose.clone()));
                }
                let evaluation = Evaluation::of_truth(self.workspace(configurations), &truth, self.marker_sigma())
                    .with_sockets(self.held_out(seed));
                let change = change.as_ref();
                let change = change.map(|change| Box::new(Change { step: change.step, truth: change.truth.clone() }));
                let (truth, measurement_model, outliers) = (Box::new(truth), self.measurement_model.clone(), *outliers);
                let limits = limits.clone();
                (World::Simulated { truth, measurement_model, limits, head, change, outliers }, evaluation, briefing)
            }
            WorldSpec::Measured { measurements, held_out } => self.draw_measured(seed, measurements, held_out),
            WorldSpec::External { watch, beforehand } => {
                let briefing = Briefing {
                    layout: Arc::new(self.robot.layout.clone()),
                    weights: self.weights(),
                    initial: self.robot.state.clone(),
                    covariance: self.prior_covariance(&self.robot.layout),
                    actions: self.actions(),
                    workspace: self.workspace(self.within_reach(&self.robot.state, seed)),
                    watch: watch.clone(),
                    beforehand: beforehand.clone(),
                };
                let nothing = Evaluation::of_measurements(self.workspace(Vec::new()), Vec::new());
                (World::External, nothing, briefing)
            }
        }
    }

    /// The configurations over which learners of a seed judge themselves, uniform in the joint box; a camera that is aimed is aimed as
    /// `guess` has it.
    fn aimed(&self, guess: &State, seed: u64) -> Vec<Vec<f64>> {
        let drawn = drawn(&self.robot.limits, WORKSPACE_SIZE, Stream::Workspace, seed, |_| true);
        drawn.into_iter().map(|theta| self.measurement_model.aimed(guess, &theta).into_owned()).collect()
    }

    /// The same of a robot that is held to a list of postures: of that list. What it will never be asked to do it needs not predict, and
    /// movements that teach that teach less of the rest.
    fn within_reach(&self, guess: &State, seed: u64) -> Vec<Vec<f64>> {
        let Some((constraints, allowed)) = self.constraints.as_ref().and_then(|it| Some((it, it.allowed.as_ref()?)))
        else {
            return self.aimed(guess, seed);
        };
        // Where nothing is left, whoever asks for a movement is told which constraint it is.
        let Ok(mut left) = constraints.of(None, allowed.iter(), |theta| theta) else { return self.aimed(guess, seed) };
        left.shuffle(&mut Stream::Workspace.rng(seed));
        left.into_iter()
            .take(WORKSPACE_SIZE)
            .map(|theta| self.measurement_model.aimed(guess, theta).into_owned())
            .collect()
    }

    fn prior_covariance(&self, layout: &Layout) -> DMatrix<f64> {
        DMatrix::from_diagonal(&self.prior.standard_deviations(layout).map(|sd| sd * sd))
    }

    fn workspace(&self, configurations: Vec<Vec<f64>>) -> Workspace {
        Workspace { configurations, up_to_motion: self.robot.up_to_motion, ..Workspace::default() }
    }

    /// σ of a measurement of the marker, metres: of the tracker, or if nothing measures the marker of the first sensor.
    fn marker_sigma(&self) -> f64 {
        self.measurement_model
            .marker_channel()
            .map_or(self.measurement_model.sigma(), |_| self.measurement_model.marker_sigma())
    }

    /// Holds rows out. Learners begin with the robot's description, and learn from the rows that they choose where it
    /// stands.
    fn draw_measured(
        &self,
        seed: u64,
        measurements: &Measurements,
        held_out: &HeldOut,
    ) -> (World, Evaluation, Briefing) {
        let (training, test) = held_out.split(seed);
        let configurations =
            |rows: &[usize]| rows.iter().map(|row| measurements.configurations[*row].clone()).collect::<Vec<_>>();
        let movement = |row: &usize| Movement {
            configuration: measurements.configurations[*row].clone(),
            row: Some(*row),
            socket: measurements.sockets.get(*row).copied().flatten(),
        };
        let mut pool: Vec<Movement> = training.iter().map(movement).collect();
        if let Some(constraints) = &self.constraints {
            // What no movement can reach does not count as left. Where that is all, whoever chooses names the constraint.
            let feasible = constraints.of(None, pool.clone(), |movement| &movement.configuration);
            pool = feasible.unwrap_or(pool);
        }
        let briefing = Briefing {
            initial: self.robot.state.clone(),
            weights: self.weights(),
            layout: Arc::new(self.robot.layout.clone()),
            covariance: self.prior_covariance(&self.robot.layout),
            actions: Actions::Pool(pool),
            workspace: self
                .asked_about(measurements, &test)
                .unwrap_or_else(|| self.workspace(configurations(&training))),
            watch: None,
            beforehand: measurements.beforehand.clone(),
        };
        let seen = test.iter().map(|row| measurements.observations[*row].clone()).collect();
        let evaluation = Evaluation::of_measurements(self.workspace(configurations(&test)), seen)
            .with_sockets(self.held_out_rows(measurements, &test));
        (World::Measured { observations: measurements.observations.clone() }, evaluation, briefing)
    }

    fn assemble(
        &self,
        seed: u64,
        specs: &[LearnerSpec],
        world: World,
        evaluation: Evaluation,
        briefing: &Briefing,
    ) -> Result<Experiment, ScenarioError> {
        let robot = &self.robot;
        let layout = &briefing.layout;
        let learners =
            specs.iter().map(|spec| self.learner(spec, seed, briefing)).collect::<Result<Vec<_>, ScenarioError>>()?;
        let setting = Setting {
            scenario: self.name.clone(),
            replaced: self.replaced.clone(),
            title: self.title.clone(),
            seed,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            joints: robot.joint_settings(),
            parameters: layout.dimension(),
            movements_by_counting: movements_by_counting(
                &robot.state,
                layout,
                &self.measurement_model.assuming(1.0),
                world.truth().map_or(InView::Unknown, |_| InView::By(world.head())),
                &robot.limits,
            ),
            learners: specs.iter().map(|spec| self.learner_setting(spec)).collect(),
            units: self.selection.units,
            thresholds: self.thresholds,
            movements_available: briefing.actions.remaining(),
            truth: world.truth().cloned(),
            change_at: world.change().map(|change| change.step),
            head: briefing.watch.as_ref().and_then(|watch| watch.head),
            channels: channels(&self.measurement_model, &robot.equipment),
            equipment: robot.equipment.clone(),
            base_learned: layout.block(Block::Base).is_some(),
            sockets: robot.socket_settings(world.truth().is_some()),
            body: robot.body,
        };
        // Of what each learns itself; all or none.
        let problems = learners.iter().map(|learner| self.design_problem_of((*learner.belief().layout).clone()));
        let problems = problems.collect::<Option<_>>().unwrap_or_default();
        Ok(Experiment::new(setting, world, learners, evaluation, problems))
    }
}

/// The number of draws after which the search for more wanted configurations ends.
const PATIENCE: usize = 100_000;

/// Up to `count` configurations, uniform among those in the box that are `wanted`.
fn drawn(limits: &JointBox, count: usize, stream: Stream, seed: u64, wanted: impl Fn(&[f64]) -> bool) -> Vec<Vec<f64>> {
    let mut rng = stream.rng(seed);
    let draws = std::iter::repeat_with(|| limits.draw(&mut rng)).take(PATIENCE);
    draws.filter(|theta| wanted(theta)).take(count).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ErrorDraw, InitialError, builtin};
    use body_schema_engine::{kinematics::Joint, selection::Constraints};
    use body_schema_experiment::{Draw, Executed};

    /// A robot that is held to a list of postures, and measured movement by movement, plans by what it predicts there.
    #[test]
    fn what_a_robot_is_asked_about_lies_in_the_list_that_it_is_held_to() {
        let mut scenario = builtin("panda-sockets").expect("a built-in scenario");
        scenario.world = WorldSpec::External { watch: None, beforehand: None };
        let asked = |scenario: &Scenario| scenario.draw(1001).2.workspace.configurations;
        let everywhere = asked(&scenario);
        assert_eq!(everywhere.len(), WORKSPACE_SIZE);

        let limits = scenario.robot.limits.clone();
        let list = drawn(&limits, 100, Stream::Evaluation, 1001, |_| true);
        let held_to = |list: &[Vec<f64>]| {
            let mut constraints = Constraints::none(limits.clone());
            constraints.allowed = Some(list.to_vec());
            constraints
        };
        scenario.constraints = Some(held_to(&list[..20]));
        let short = asked(&scenario);
        assert!(short.len() == 20 && short.iter().all(|theta| list[..20].contains(theta)), "all of a short list");
        scenario.constraints = Some(held_to(&list));
        let long = asked(&scenario);
        assert!(long.len() == WORKSPACE_SIZE && long.iter().all(|theta| list.contains(theta)), "some of a long one");

        // What another constraint forbids is not asked about, and where it forbids all there is something to judge by.
        let mut half = held_to(&list);
        let mut sides = limits.joints().to_vec();
        sides[0].0 = 0.0;
        half.tightened = JointBox::new(sides).expect("a box");
        scenario.constraints = Some(half);
        assert!(asked(&scenario).iter().all(|theta| theta[0] >= 0.0 && list.contains(theta)));
        scenario.constraints = Some(held_to(&[]));
        assert_eq!(asked(&scenario), everywhere);
    }

    /// Judges look only where the head can see, by the truth.
    #[test]
    fn the_evaluation_set_lies_in_view() {
        let scenario = builtin("head-fov").expect("a built-in scenario");
        let (world, evaluation, briefing) = scenario.draw(5);
        let head = world.head().expect("a head");
        assert_eq!(evaluation.targets().len(), EVALUATION_SIZE);
        assert!(evaluation.targets().all(|(_, marker)| head.sees(marker)));
        let truth = world.truth().expect("simulated");
        assert!(
            briefing.workspace.configurations.iter().any(|theta| !head.sees(&truth.marker_at(theta))),
            "without truth"
        );
    }

    /// What of an axis is held is known: in a simulated world the guess has it from the truth.
    #[test]
    fn what_is_held_of_an_axis_is_not_guessed() {
        let plain = builtin("arm-6dof").expect("built in");
        let names = &plain.robot.names;
        let hold = format!("[robot]\nhold = [\"{}.direction\", \"{}.point\"]", names[1], names[2]);
        let text = plain.source.replacen("[robot]", &hold, 1);
        let scenario = Scenario::parse("held.toml", &text, &|_| Err("no data".to_owned())).expect("valid");
        let (world, _, briefing) = scenario.draw(1003);
        let truth = world.truth().expect("simulated");
        let lines = |joint: usize| match (&truth.joints[joint], &briefing.initial.joints[joint]) {
            (Joint::Revolute(truth), Joint::Revolute(guess)) => {
                ((truth.point - guess.point).norm(), truth.direction.angle(&guess.direction))
            }
            _ => unreachable!("revolute"),
        };
        let is_off = |x: f64| x > 0.01;
        for (joint, point, direction) in [(0, true, true), (1, true, false), (2, false, true), (3, true, true)] {
            let (apart, angle) = lines(joint);
            assert_eq!((is_off(apart), is_off(angle)), (point, direction), "joint {joint}: {apart} m, {angle} rad");
        }
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
                let (mut world, mut evaluation, briefing) = scenario.draw(11);
                if let (true, World::Simulated { truth, .. }) = (swap, &mut world) {
                    **truth = scenario.perturbed(
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
                    let chosen = |learner: &body_schema_experiment::LearnerOutcome| {
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

    /// A marker that is known stays where it is told to be on the hand, while base and axes are learned; one that is not is
    /// found.
    #[test]
    fn a_known_marker_stays_and_an_unknown_one_is_found() {
        let nominal = builtin("tiago-mocap").expect("built in");
        for is_known in [true, false] {
            let learned = format!("learn_marker = {}", !is_known);
            let text = nominal.source.replacen("learn_marker = true", &learned, 1);
            let scenario = Scenario::parse("marker.toml", &text, &|file| nominal.data_file(file)).expect("still valid");
            let spec = scenario.chosen(Some(&["global".to_owned()])).expect("offered").remove(0);
            let (mut agent, world) = (scenario.agent(&spec, 3).expect("an agent"), scenario.draw(3).0);
            for _ in 0..8 {
                let movement = agent.propose(1).expect("a proposal")[0].selection.movement.clone();
                let observation = world.observe(&movement, &Draw::default()).expect("a row");
                agent.absorb(&[Executed { proposal: None, movement, observation }]).expect("absorbed");
            }
            let found = &agent.belief().state;
            assert_eq!(found.marker() == scenario.robot.state.marker(), is_known);
            assert!(found.base != scenario.robot.state.base);
        }
    }
}
