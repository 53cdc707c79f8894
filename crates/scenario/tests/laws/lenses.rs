//! A camera with a lens that sees a tag point by point: what learners make of it.

use body_schema_scenario::{Scenario, builtin};

/// The tag is close before a wide lens, so that it is often seen in part, and never by its fourth corner, which faces away.
#[test]
fn a_tag_is_learned_from_what_is_seen_of_it() {
    let shipped = builtin("arm-6dof-camera").expect("built in");
    let text = shipped
        .source
        .replacen(
            "facing = [0.0, 0.0, 1.0]\nfacing_within_deg = 80.0\n",
            "partly_seen = true\nleast_points = 2\nfacing_within_deg = 80.0\n\
             points_facing = [[0, 0, 1], [0, 0, 1], [0, 0, 1], [0, 0, -1]]\n",
            1,
        )
        .replacen(
            "focal_px = [500.0, 500.0]",
            "focal_px = 500\ndistortion = [-0.25, 0.05, 0.001, 0.0]\nlearn_distortion_to = [0.1, 0, 0, 0]",
            1,
        );
    let scenario =
        Scenario::parse("seen.toml", &text, &|_| Err("no data".to_owned())).unwrap_or_else(|e| panic!("{e}"));
    let mut experiment = scenario.experiment(1001, Some(&["global".to_owned()])).expect("an experiment");
    let (mut whole, mut partly, mut first, mut last) = (0, 0, None, 0.0);
    for _ in 0..25 {
        let outcome = experiment.step().expect("a step");
        let learner = &outcome.learners[0];
        let movement = learner.movement.as_ref().expect("a movement");
        let reading = movement.observation.readings[0].as_ref();
        if let Some(reading) = reading {
            let absent = reading.iter().filter(|x| x.is_nan()).count() / 2;
            assert!((1..=2).contains(&absent) && reading[6].is_nan(), "{reading:?}");
            *(if absent == 1 { &mut whole } else { &mut partly }) += 1;
        }
        last = learner.metrics.prediction_mean_m.expect("a truth");
        let is_seen = reading.is_some();
        let told = experiment.readings(0);
        assert_eq!(told[0].residual_sigmas.is_some(), is_seen);
        assert!(told[0].residual_sigmas.is_none_or(f64::is_finite));
        first.get_or_insert(last);
    }
    let first = first.expect("steps");
    assert!(whole + partly > 12, "{whole} {partly}");
    assert!(last < 0.3 * first, "{first} {last}");
}
