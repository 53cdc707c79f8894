//! What is observable of shipped scenarios.

use body_schema_engine::design::observability::{Observability, Prospect};
use body_schema_scenario::{Scenario, builtin};

fn found(prospect: &Prospect, postures: usize) -> Observability {
    prospect.observability(postures, 1e-3, &|| {}).expect("movements")
}

/// What constraints exclude is not proposed, and a joint that may hardly move tells little of its axis.
#[test]
fn constraints_are_kept_and_tell_less() {
    let scenario = builtin("arm-6dof-table").expect("built in");
    let bound = scenario.prospect();
    let report = found(&bound, 6);
    let constraints = bound.constraints.as_ref().expect("bound");
    let mut from = constraints.start.clone();
    for posture in &report.best {
        let posture: Vec<f64> = posture.joints.iter().map(|degrees| degrees.to_radians()).collect();
        assert_eq!(constraints.violation(from.as_deref(), &posture), None);
        from = Some(posture);
    }
    let held = "[constraints]\nlimits_deg = { elbow = [-10.1, -10.0] }\n";
    let text = builtin("arm-6dof").expect("built in").source + "\n" + held;
    let stiff = Scenario::parse("stiff.toml", &text, &|_| Err(String::new())).expect("valid");
    let free = found(&builtin("arm-6dof").expect("built in").prospect(), 20);
    let stiff = found(&stiff.prospect(), 20);
    assert!(
        free.weak.is_empty() && stiff.weak[0].said.contains("the axis of elbow"),
        "{:?} {:?}",
        free.weak,
        stiff.weak
    );
    let of_elbow = stiff.deviations.iter().zip(&free.deviations).find(|(it, _)| it.parameter.contains("elbow"));
    let (stiff, free) = of_elbow.expect("learned");
    assert!(stiff.best > 3.0 * free.best, "{stiff:?} {free:?}");
}
