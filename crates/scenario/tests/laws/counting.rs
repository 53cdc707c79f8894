//! How many movements are counted for shipped scenarios.

use body_schema_engine::{
    design::{General, general_movements, movements_by_counting},
    kinematics::JointBox,
    model::{Block, Layout, random::random_arm},
    sensing::{InView, MeasurementModel, Occasion, Sensor},
};
use body_schema_scenario::builtin;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// A socket that no channel reads is no place to hold anything, and shifts no other.
#[test]
fn sockets_that_nothing_reads_count_for_nothing() {
    let scenario = builtin("arm-7dof-socket").expect("built in");
    let (robot, measurement_model) = (&scenario.robot, &scenario.measurement_model);
    let is_other = |sensor: &&Sensor| !matches!(sensor.subject().occasion, Occasion::Held { socket: 0, .. });
    let measurement_model =
        MeasurementModel::new(measurement_model.sensors().iter().filter(is_other).cloned().collect());
    for General { measurement_model, posture } in
        general_movements(&robot.state, &robot.layout, &measurement_model, InView::Unknown, &robot.limits)
    {
        for sensor in measurement_model.sensors() {
            let Occasion::Held { socket, target } = sensor.subject().occasion else { continue };
            let away = robot.state.target_at(target, &posture) - robot.state.sockets[socket];
            assert!(away.norm() < 1e-6, "socket {socket}: {away}");
        }
    }
}

/// As PAPER.md's counting has it where every parameter can be determined; and by rank where some cannot.
#[test]
fn equations_are_counted_by_rank() {
    for (name, expected) in [("arm-6dof", 8), ("arm-12dof", 16), ("head-fov", 6)] {
        let scenario = builtin(name).expect("built in");
        let (robot, measurement_model) = (&scenario.robot, MeasurementModel::tracker(0.01));
        assert_eq!(
            movements_by_counting(&robot.state, &robot.layout, &measurement_model, InView::Unknown, &robot.limits),
            expected,
            "{name}"
        );
    }
    let arm = random_arm(&mut ChaCha8Rng::seed_from_u64(2), 4);
    let limits = JointBox::new(vec![(-1.0, 1.0); 4]).expect("limits");
    let measurement_model = MeasurementModel::tracker(0.01);
    let axes = Layout::of_arm(&arm, &[], true);
    let with_base = Layout::new(&arm, (0..4).map(Block::Axis).chain([Block::Base, Block::Target(0)]));
    assert_eq!(with_base.dimension(), axes.dimension() + 6);
    let alone = movements_by_counting(&arm, &axes, &measurement_model, InView::Unknown, &limits);
    assert_eq!(
        movements_by_counting(&arm, &with_base, &measurement_model, InView::Unknown, &limits),
        alone,
        "the base adds nothing"
    );
}
