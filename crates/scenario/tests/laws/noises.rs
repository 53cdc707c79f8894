//! Whatever a file says of noise, it is refused, or learned by: nothing hangs, panics or is silently wrong.

use body_schema_scenario::{Scenario, builtin};

/// A number for every value of a key; what remains is the file's.
fn with(text: &str, section: &str, key: &str, value: &str) -> Option<String> {
    let mut found = false;
    let mut inside = section.is_empty();
    let lines = text.lines().map(|line| {
        if line.starts_with('[') {
            inside = line.trim_matches(['[', ']']) == section;
        }
        if inside && line.split('=').next().is_some_and(|name| name.trim() == key) {
            found = true;
            return format!("{key} = {value}");
        }
        line.to_owned()
    });
    let text = lines.collect::<Vec<_>>().join("\n");
    found.then_some(text)
}

/// Whether the file was refused; learners that it names, and one that explains all at once, take a few steps otherwise.
fn is_refused(text: &str, what: &str) -> bool {
    let Ok(scenario) = Scenario::parse("noise.toml", text, &|_| Err("no data".to_owned())) else { return true };
    let mut experiment = scenario.experiment(1001, None).unwrap_or_else(|error| panic!("{what}: {error}"));
    for _ in 0..3 {
        if let Err(error) = experiment.step() {
            // As where so much noise moves a socket out of reach: it is said, and no step is half made.
            assert!(!error.to_string().is_empty(), "{what}");
            break;
        }
    }
    for learner in &experiment.latest().learners {
        let metrics = &learner.metrics;
        assert!(metrics.trace.is_none_or(f64::is_finite) && metrics.nees.is_none_or(f64::is_finite), "{what}");
    }
    false
}

#[test]
fn whatever_is_said_of_noise_is_refused_or_learned_by() {
    let keys = [
        ("arm-6dof", "sensor", "sigma_m"),
        ("arm-6dof", "filter", "measurement_variance_m2"),
        ("arm-6dof-pose-gears", "sensor", "sigma_m"),
        ("arm-6dof-pose-gears", "sensor", "sigma_deg"),
        ("arm-6dof-camera", "sensor", "sigma_px"),
        ("arm-7dof-socket", "socket", "sigma_m"),
    ];
    for (name, section, key) in keys {
        let text = &builtin(name).expect("built in").source;
        for value in ["-1.0", "nan", "inf", "-inf", "1e-310", "1e300", "-0.001"] {
            let what = format!("{name}: [{section}] {key} = {value}");
            let text = with(text, section, key, value).unwrap_or_else(|| panic!("{what}: there is no such key"));
            assert!(is_refused(&text, &what), "{what}");
        }
        // Nothing, next to nothing, and very much.
        for value in ["0.0", "1e-12", "1e6"] {
            let what = format!("{name}: [{section}] {key} = {value}");
            let refused = is_refused(&with(text, section, key, value).expect("the key"), &what);
            let wanted = value == "0.0" && key != "sigma_m" && key != "sigma_px";
            assert!(refused || !wanted, "{what} is not refused");
        }
    }
    let pose = &builtin("arm-6dof-pose-gears").expect("built in").source;
    let without = with(&with(pose, "sensor", "sigma_m", "0.0").expect("the key"), "sensor", "sigma_deg", "0.0");
    assert!(!is_refused(&without.expect("the key"), "no noise at all"), "a world without noise is one");
    let arm = &builtin("arm-6dof").expect("built in").source;
    for (bad, covariance) in [
        (false, "[[1e-4, 0.0, 0.0], [0.0, 4e-4, 1e-5], [0.0, 1e-5, 1e-4]]"),
        (true, "[[1e-4, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 1e-4]]"),
        (true, "[[1e-4, 0.0, 0.0], [0.0, -4e-4, 0.0], [0.0, 0.0, 1e-4]]"),
        (true, "[[1e-4, 0.0, 0.0], [0.0, nan, 0.0], [0.0, 0.0, 1e-4]]"),
        (true, "[[1e-4, 0.0, 0.0], [0.0, inf, 0.0], [0.0, 0.0, 1e-4]]"),
        (true, "[[1e-4, 0.0, 0.0], [0.0, 1e-310, 0.0], [0.0, 0.0, 1e-4]]"),
        (true, "[[1e-4, 1e-4, 0.0], [1e-4, 1e-4, 0.0], [0.0, 0.0, 1e-4]]"),
        (true, "[[1e-4, 1e-5, 0.0], [0.0, 1e-4, 0.0], [0.0, 0.0, 1e-4]]"),
    ] {
        let text = arm.replacen("sigma_m = 0.01", &format!("covariance_m2 = {covariance}"), 1);
        assert_eq!(is_refused(&text, covariance), bad, "{covariance}");
    }
}
