//! The sockets of a scenario as actions, prior observations, and held-out postures.

use rand::RngExt;

use crate::{Measurements, Robot, Scenario, SocketSpec};
use body_schema_engine::{
    model::{Manifold, Workspace},
    normal::StandardNormal,
    selection::{Actions, Sockets},
    sensing::{Observation, Occasion},
};
use body_schema_experiment::{HeldInSocket, Stream};

/// Postures of every held-out socket.
const HELD_OUT_SIZE: usize = 30;

impl Scenario {
    /// The movements that learners may make in a simulated world.
    pub(super) fn actions(&self) -> Actions {
        let Robot { limits, sockets, .. } = &self.robot;
        if sockets.is_empty() {
            return Actions::Box(limits.clone());
        }
        Actions::Sockets(Sockets::new(limits.clone(), sockets.iter().map(|socket| socket.posture.clone()).collect()))
    }

    /// An observation of a simulated robot's equipment before any movement, with an error drawn by its σ.
    pub(super) fn beforehand(&self, seed: u64) -> Option<Observation> {
        let mut rng = Stream::Beforehand.rng(seed);
        let v: Vec<f64> = (0..self.measurement_model.equations()).map(|_| rng.sample(StandardNormal)).collect();
        self.measurement_model.beforehand(&self.robot.state, &v)
    }

    /// Postures that truly hold the target in every held-out socket, anywhere within the limits.
    pub(super) fn held_out(&self, seed: u64) -> Vec<HeldInSocket> {
        let mut rng = Stream::HeldOutSockets.rng(seed);
        let Robot { state, limits, held_out_sockets, .. } = &self.robot;
        let of = |socket: &SocketSpec| {
            let manifold = Manifold::new(state, socket.target, socket.at, limits);
            let postures = (0..HELD_OUT_SIZE).filter_map(|_| manifold.draw(&mut rng)).collect();
            HeldInSocket { target: socket.target, postures }
        };
        held_out_sockets.iter().map(of).collect()
    }

    /// The held-out rows of a table in which a target was held in one socket. A socket with a single row is left out:
    /// there is nothing to compare.
    pub(super) fn held_out_rows(&self, measurements: &Measurements, rows: &[usize]) -> Vec<HeldInSocket> {
        let Robot { sockets, held_out_sockets, .. } = &self.robot;
        let of = |(number, socket): (usize, &SocketSpec)| {
            let is_there = |row: &&usize| measurements.sockets.get(**row) == Some(&Some(number));
            let postures: Vec<Vec<f64>> =
                rows.iter().filter(is_there).map(|row| measurements.configurations[*row].clone()).collect();
            (postures.len() > 1).then_some(HeldInSocket { target: socket.target, postures })
        };
        sockets.iter().chain(held_out_sockets).enumerate().filter_map(of).collect()
    }

    /// The workspace of learners whose only measurement is that targets meet themselves: how far the predicted target scatters in the
    /// sockets of held-out rows, given their postures alone. `None` where something else is measured, or there are no such rows.
    pub(super) fn asked_about(&self, measurements: &Measurements, rows: &[usize]) -> Option<Workspace> {
        if self.measurement_model.sensors().iter().any(|sensor| sensor.subject().occasion == Occasion::Always) {
            return None;
        }
        let held = rows.iter().filter_map(|row| {
            let socket = measurements.sockets.get(*row).copied().flatten()?;
            Some((socket, measurements.configurations[*row].as_slice()))
        });
        Some(Workspace::at_places(held)).filter(|asked| !asked.configurations.is_empty())
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Vector3};

    use crate::{Robot, Scenario, builtin};
    use body_schema_engine::{
        design::movements_by_counting,
        model::State,
        selection::Movement,
        sensing::{InView, MeasurementModel, Occasion},
    };
    use body_schema_experiment::{Agent, Event, Executed, Gauge, NoiseSequence, World, location_m};

    fn scenario() -> Scenario {
        builtin("arm-7dof-socket").expect("built in")
    }

    fn agent(scenario: &Scenario, name: &str) -> Agent {
        let spec = scenario.chosen(Some(&[name.to_owned()])).expect("offered").remove(0);
        scenario.agent(&spec, 1003).expect("an agent")
    }

    fn carried_out(world: &World, noise: &mut NoiseSequence, proposal: Option<u64>, movement: &Movement) -> Executed {
        let draw = noise.draw(world);
        let movement = world.execute(movement, &draw).expect("in reach");
        let observation = world.observe(&movement, &draw).expect("held");
        Executed { proposal, movement, observation }
    }

    /// The first movements are those that are given; all that follow name a socket and bring the target there, as believed.
    /// Asking twice changes nothing, and neither does restoring.
    #[test]
    fn proposals_lie_on_the_believed_manifolds() {
        let scenario = scenario();
        let (world, ..) = scenario.draw(1003);
        for name in ["global", "random", "rls:active", "unscented:random"] {
            let (mut agent, mut restored) = (agent(&scenario, name), agent(&scenario, name));
            let mut noise = NoiseSequence::new(1003);
            for step in 0..5 {
                let known = agent.pending().len();
                let proposals = agent.propose(2).expect("proposals").to_vec();
                assert_eq!(proposals, agent.propose(2).expect("proposals"), "{name}: asked twice");
                proposals[known..].iter().for_each(|proposal| {
                    restored.restore(&Event::Proposed(proposal.clone())).expect("restored");
                });
                if step == 0 {
                    for (proposal, socket) in proposals.iter().zip(&scenario.robot.sockets) {
                        assert_eq!(proposal.selection.movement.configuration, socket.posture, "{name}");
                    }
                    assert_eq!(proposals[1].selection.movement.socket, Some(1), "{name}");
                } else {
                    // The newest was chosen by what is believed now.
                    let Movement { configuration, socket, .. } = &proposals[1].selection.movement;
                    let (state, socket) = (&agent.belief().state, socket.expect("a socket"));
                    assert!(scenario.robot.limits.contains(configuration), "{name}");
                    let away = (state.target_at(0, configuration) - state.sockets[socket]).norm();
                    assert!(away < 1e-9, "{name}: {away} m");
                }
                let Movement { configuration, .. } = &proposals[0].selection.movement;
                let executed = carried_out(&world, &mut noise, Some(proposals[0].id), &proposals[0].selection.movement);
                assert_ne!(&executed.movement.configuration, configuration, "{name}: it was pushed in");
                agent.absorb(std::slice::from_ref(&executed)).expect("a measurement");
                restored.restore(&Event::Executed(executed)).expect("restored");
            }
            assert_eq!(agent.belief().state, restored.belief().state, "{name}");
            let [a, b] = [&mut agent, &mut restored].map(|agent| agent.propose(3).expect("proposals").to_vec());
            let chosen = |proposal: &body_schema_experiment::Proposal| proposal.selection.clone();
            assert_eq!(a.iter().map(chosen).collect::<Vec<_>>(), b.iter().map(chosen).collect::<Vec<_>>(), "{name}");
        }
    }

    /// Whoever sets a posture of their own has it pushed into the socket that it is nearest to.
    #[test]
    fn a_posture_that_somebody_sets_goes_into_the_nearest_socket() {
        let scenario = scenario();
        let mut experiment = scenario.experiment(1003, Some(&["smoother:human".to_owned()])).expect("offered");
        for (socket, label) in [(1, "front/right"), (0, "front/left"), (1, "front/right")] {
            let posture = scenario.robot.sockets[socket].posture.clone();
            experiment.set_configuration("smoother:human", &posture).expect("within limits");
            let movement = experiment.step().expect("a step").learners[0].movement.clone().expect("made");
            let held = movement.socket.map(|socket| experiment.setting().sockets[socket].label());
            assert_eq!(held.as_deref(), Some(label));
            let truth = experiment.world().truth().expect("simulated");
            let away = truth.marker_at(&movement.configuration) - truth.sockets[socket];
            assert!((1e-6..2e-3).contains(&away.norm()), "there, but for the noise: {away}");
        }
    }

    /// Two learners of one seed are told one distance, which is another for another seed and wrong by its σ.
    #[test]
    fn the_distance_is_told_with_its_error() {
        let scenario = scenario();
        let mut squares = 0.0;
        for seed in 0..200 {
            let known = scenario.beforehand(seed).expect("a distance");
            let told = known.readings.iter().flatten().flatten().copied().collect::<Vec<f64>>();
            assert_eq!(told.len(), 1);
            squares += ((told[0] - 0.05) / 5e-5).powi(2) / 200.0;
        }
        assert!((0.7..1.4).contains(&squares), "{squares}");
        assert_eq!(scenario.beforehand(3), scenario.beforehand(3));
        assert_eq!(builtin("arm-6dof").expect("built in").beforehand(3), None);
    }

    /// Where the robot stands nobody can tell: moved with its sockets it is no error. How large it is the known distance tells alone.
    #[test]
    fn where_the_whole_stands_is_a_gauge_and_its_size_is_none() {
        let scenario = scenario();
        let Robot { state, layout, limits, .. } = &scenario.robot;
        let gauge = Gauge::new(state, layout, &scenario.measurement_model, InView::Unknown, limits);
        let motion = Isometry3::new(Vector3::new(0.02, -0.01, 0.03), Vector3::new(0.05, 0.02, -0.04));
        let mut moved = State { base: motion, ..state.clone() }.measured().into_owned();
        moved.sockets.iter_mut().for_each(|socket| *socket = motion * *socket);
        let aligned = gauge.aligned(state, &moved);
        let error = |truth: &State| location_m(&moved, truth, layout).expect("lines");
        assert!(error(state) > 1e-2 && error(&aligned) < 1e-6, "{} {}", error(state), error(&aligned));
        assert!(gauge.undetermined() >= 6);
        let sensors = scenario.measurement_model.sensors().iter();
        let without: Vec<_> = sensors.filter(|it| it.subject().occasion != Occasion::Beforehand).cloned().collect();
        let blind = Gauge::new(state, layout, &MeasurementModel::new(without), InView::Unknown, limits);
        assert_eq!(blind.undetermined(), gauge.undetermined() + 1, "its size");
        let counted = movements_by_counting(state, layout, &scenario.measurement_model, InView::Unknown, limits);
        assert_eq!(counted, (gauge.rank() - 1).div_ceil(3), "three equations each, and the distance");
    }

    /// Nothing moves what is in a held-out socket, by the truth.
    #[test]
    fn the_truth_does_not_scatter() {
        let scenario = scenario();
        let (world, evaluation, briefing) = scenario.draw(1003);
        let truth = world.truth().expect("simulated");
        assert!(evaluation.scatter_m(truth).expect("held out") < 1e-9);
        assert!(evaluation.scatter_m(&briefing.initial).expect("held out") > 1e-3);
    }
}
