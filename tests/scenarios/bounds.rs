//! What movements may be bound to: constraints and sockets, each mistake with its key and how to mend it.

use super::{ARM, TIAGO, TIAGO_CSV, one, problems};

/// What constraints may say, each mistake on its line.
#[test]
fn constraints_are_held_to_the_robot() {
    const TABLE: &str = include_str!("../../scenarios/arm-6dof-table.toml");
    let height = "minimum_height_m = -0.45";
    let travel = "greatest_travel_deg = 120.0";
    for (from, to, key, what, hint) in [
        (height, "limits_deg = { elbo = [-80.0, 0.0] }", "constraints.limits_deg.elbo", "no such joint", "`elbow`"),
        (height, "limits_m = { elbow = [-0.1, 0.0] }", "constraints.limits_m.elbow", "does not fit", "`limits_deg`"),
        (
            height,
            "limits_deg = { elbow = [-10.0, -80.0] }",
            "constraints.limits_deg.elbow",
            "not below",
            "lower one first",
        ),
        (height, "limits_deg = { elbow = [-130.0, 0.0] }", "constraints.limits_deg.elbow", "-120.0000", "within them"),
        (height, "minimum_height_m = nan", "constraints.minimum_height_m", "out of range", "metres"),
        (height, "minimum_height = -0.45", "constraints.minimum_height", "unknown key", "`minimum_height_m`"),
        (height, "allowed_deg = []", "constraints.allowed_deg", "nothing is allowed", "add a posture"),
        (height, "allowed_deg = [[0.0, 0.0]]", "constraints.allowed_deg[0]", "2 positions", "one position per joint"),
        (travel, "greatest_travel_deg = 0.0", "constraints.greatest_travel_deg", "out of range", "above 0"),
        (travel, "greatest_travel_m = 0.1", "constraints.greatest_travel_m", "no joint", "remove it"),
        (travel, "travel_price = -1.0", "constraints.travel_price", "out of range", "0 or more"),
        (
            "upper_m = [1.0, 0.8, -0.25]",
            "upper_m = [1.0, 0.8, -0.5]",
            "constraints.box[0].upper_m",
            "along z",
            "lower_m",
        ),
        ("name = \"pillar\"", "name = \"table\"", "constraints.box[1].name", "taken", "a name of its own"),
        (
            "start_deg = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0]",
            "start_deg = [0.0, 50.0, 0.0, 0.0, 0.0, 0.0]",
            "constraints.start_deg",
            "the box `table`",
            "that the constraints allow",
        ),
    ] {
        let (problem, line) = one(TABLE, from, to);
        assert_eq!((problem.key.as_str(), problem.line), (key, line), "{problem}");
        assert!(problem.what.contains(what) && problem.hint.contains(hint), "{problem}");
    }
    // What leaves nothing to do is told with the constraint that does.
    for (text, nothing, named) in [
        (ARM, "minimum_height_m = 2.0", "all 20000 postures tried are excluded by the minimum height"),
        (
            ARM,
            "allowed_deg = [[0.0, 0.0, 0.0, 0.0, 0.0, 0.0]]\nminimum_height_m = 0.1",
            "the only posture tried is excluded by the minimum height",
        ),
        (
            TIAGO,
            "limits_deg = { arm_1_joint = [150.0, 157.0] }",
            "all 74 postures tried are excluded by the limits of `arm_1_joint`",
        ),
    ] {
        let found =
            problems(&text.replacen("[filter]", &format!("[constraints]\n{nothing}\n[filter]"), 1), Ok(TIAGO_CSV));
        assert!(found.len() == 1 && found[0].key == "constraints" && found[0].what.contains(named), "{found:?}");
    }
    // A pose that must be reached must be allowed.
    let fov = include_str!("../../scenarios/head-fov.toml");
    let found =
        problems(&fov.replacen("[filter]", "[constraints]\nminimum_height_m = 0.3\n[filter]", 1), Err("no data"));
    assert!(found.iter().any(|problem| problem.what.contains("known to be in view")), "{found:?}");
}

/// What is wrong with a socket is said with its key, and how to mend it.
#[test]
fn sockets_that_hold_nothing_are_refused() {
    const SOCKETS: &str = include_str!("../../scenarios/arm-7dof-socket.toml");
    let left = "posture_deg = [3.0, 2.3, 0.1, -128.2, 0.0, 122.1, 44.9]";
    for (from, to, key, hint) in [
        ("to = \"right\"", "to = \"rihgt\"", "socket[0].to", "write one of right"),
        ("to = \"right\"", "to = \"left\"", "socket[0].to", "write one of right"),
        ("distance_m = 0.05\n", "distance_m = 0.06\n", "socket[0].distance_m", "correct it"),
        ("distance_m = 0.05\n", "distance_m = -0.05\n", "socket[0].distance_m", "above 0"),
        ("sigma_distance_m = 0.00005\n", "", "socket[0].distance_m", "sigma_distance_m"),
        ("sigma_m = 0.0002\n", "", "socket[0].sigma_m", "add `sigma_m"),
        ("sigma_m = 0.0002\n", "sigma_m = 0.0\n", "socket[0].sigma_m", "above 0"),
        (left, "posture_deg = [3.0, 2.3]", "socket[0].posture_deg", "one position per joint"),
        (left, "posture_deg = [3.0, 2.3, 0.1, 30.0, 0.0, 122.1, 44.9]", "socket[0].posture_deg", "for this joint"),
        (left, "posture_deg = [30.0, 2.3, 0.1, -128.2, 0.0, 122.1, 44.9]", "socket[0].posture_deg", "leave `at_m` out"),
        (left, "", "socket[0].posture_deg", "add `posture_deg"),
        ("place = \"front\"\n", "place = \"front\"\ntarget = \"cube\"\n", "socket[0].target", "write one of ball"),
        ("name = \"right\"", "name = \"left\"", "socket[1].name", "a name of its own"),
        ("place = \"high\"\n", "place = \"high\"\nsigma_m = 0.001\n", "socket[4].sigma_m", "remove it"),
        ("policy = \"active-planned\"", "policy = \"active-bayesian\"", "learner[0].policy", "`policy = \"active\"`"),
    ] {
        assert!(SOCKETS.contains(from), "the test's own premise: {from}");
        let found = problems(&SOCKETS.replacen(from, to, 1), Err("has no data"));
        assert_eq!(found[0].key, key, "{to}: {found:?}");
        assert!(found[0].hint.contains(hint), "{to}: {found:?}");
    }
    // Rows of a table are at no socket.
    let text = TIAGO.replacen(
        "[measurements]",
        "[[socket]]\nname = \"cup\"\nposture_deg = [0.0]\nsigma_m = 0.001\n\n[measurements]",
        1,
    );
    assert_eq!(problems(&text, Ok(TIAGO_CSV))[0].key, "socket");
}
