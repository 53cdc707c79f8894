//! What is observable of shipped scenarios.

use body_schema_engine::{
    design::observability::{Observability, Prospect},
    model::Block,
};
use body_schema_scenario::{Scenario, builtin};

fn found(prospect: &Prospect, postures: usize) -> Observability {
    prospect.observability(postures, 1e-3, &|| {}).expect("movements")
}

/// What constraints exclude is not proposed, and a joint that may hardly move tells little of its axis.
#[test]
fn constraints_are_kept_and_tell_less() {
    let scenario = builtin("arm-6dof-table").expect("built in");
    let bound = scenario.prospect().expect("a prospect");
    let report = found(&bound, 6);
    let constraints = bound.constraints.as_ref().expect("bound");
    let mut from = constraints.start.clone();
    for movement in &report.best {
        assert_eq!(constraints.violation(from.as_deref(), &movement.configuration), None);
        from = Some(movement.configuration.clone());
    }
    let held = "[constraints]\nlimits_deg = { elbow = [-10.1, -10.0] }\n";
    let text = builtin("arm-6dof").expect("built in").source + "\n" + held;
    let stiffened = Scenario::parse("stiff.toml", &text, &|_| Err(String::new())).expect("valid");
    let free = found(&builtin("arm-6dof").expect("built in").prospect().expect("a prospect"), 20);
    let stiff = found(&stiffened.prospect().expect("a prospect"), 20);
    let elbow = stiffened.robot.names.iter().position(|name| name == "elbow").expect("an elbow");
    assert!(
        free.weak.is_empty() && stiff.weak[0].blocks.contains(&Block::Axis(elbow)),
        "{:?} {:?}",
        free.weak,
        stiff.weak
    );
    let of_elbow = stiffened.robot.layout.block(Block::Axis(elbow)).expect("learned").start;
    let (stiff, free) = (stiff.deviations[of_elbow], free.deviations[of_elbow]);
    assert!(stiff.best > 3.0 * free.best, "{stiff:?} {free:?}");
}
