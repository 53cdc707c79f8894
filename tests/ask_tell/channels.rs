//! Every channel in the shape that is documented, and back through a table into `calibrate`.

use std::collections::BTreeMap;

use body_schema::{
    ask_tell::{Ask, Observation, Refusal, Session, Setup, Shape},
    calibration::{Case, Silent, calibrate},
    scenario::Scenario,
};
use nalgebra::{Isometry3, Vector3};
use serde_json::{Value, json};

use crate::{
    ask_tell::robot::{Robot, open, quick},
    calibrate::axes_alone,
};

/// What `calibrate` makes of the files that a session writes, from their texts.
fn read_back(session: &Session) -> String {
    let (toml, csv) = (session.calibration_toml(), session.observations_csv());
    let open = |file: &str| match file {
        "observations.csv" => Ok(csv.clone()),
        "robot.urdf" => Ok(session.setup().urdf().to_owned()),
        _ => Err("is not there".to_owned()),
    };
    let scenario = Scenario::parse("calibration.toml", &toml, &open).unwrap_or_else(|error| panic!("{error}\n{toml}"));
    let case = Case::new(&scenario).expect("a table");
    let calibration = calibrate(&case, &axes_alone(), &Silent).expect("calibrated");
    let files = calibration.files(&case).expect("files");
    files.into_iter().find(|file| file.path == "calibrated.urdf").expect("a URDF").text
}

/// A session of these keys beside those of the quick arm, that has told so many of what `measured` makes of a posture.
fn told(keys: Value, count: usize, measured: impl Fn(&Robot, &[f64]) -> Value) -> (Session, Robot) {
    let mut calibration = quick();
    let object = calibration.as_object_mut().expect("an object");
    object.extend(keys.as_object().expect("an object").clone());
    let mut session = open(calibration);
    let robot = Robot::of(&session, 12);
    for _ in 0..count {
        let next = session.suggest(&Ask::default(), None).expect("one").suggestions.remove(0);
        let theta: Vec<f64> = robot.names.iter().map(|name| next.configuration[name]).collect();
        let measurements = serde_json::from_value(measured(&robot, &theta)).expect("channels");
        let told = Observation { suggestion_id: Some(next.id), configuration: next.configuration, measurements };
        session.observe(told, None).unwrap_or_else(|error| panic!("{error}"));
    }
    (session, robot)
}

fn hand(robot: &Robot, theta: &[f64]) -> Isometry3<f64> {
    robot.truth.links(theta).pop().expect("links") * robot.truth.targets[0].place.frame()
}

/// What the results say is what `calibrate` says of what was written, without what was excluded or saw nothing.
pub fn agrees(session: &Session) {
    let description = session.results().and_then(|results| results.description()).expect("results");
    assert_eq!(description[0].path, "calibrated.urdf");
    assert_eq!(description[0].text, read_back(session));
    assert_ne!(description[0].text, session.setup().urdf());
    let (calibration, files) = session.calibrate(&axes_alone(), &Silent).expect("calibrated");
    assert_eq!(files[0].text, description[0].text);
    assert_eq!(calibration.report.rows, session.observations_csv().lines().count() - 1);
}

#[test]
fn positions() {
    let keys = json!({ "sensor": { "channel": "position", "sigma_m": 0.0005, "columns": ["x_mm", "y_mm", "z_mm"] } });
    let (mut session, robot) = told(keys, 9, |robot, theta| {
        let at = robot.truth.marker_at(theta);
        json!({ "marker": [at.x, at.y, at.z] })
    });
    let posture: BTreeMap<String, f64> = robot.names.iter().map(|name| (name.clone(), 0.3)).collect();
    session.observe(robot.observation(None, posture.clone(), 0.2), None).expect("far off");
    session.exclude(10, None).expect("there");
    let unseen = Observation { measurements: BTreeMap::new(), ..robot.observation(None, posture, 0.0) };
    session.observe(unseen, None).expect("nothing was seen");
    let csv = session.observations_csv();
    assert!(csv.starts_with("pan,lift,elbow,x_mm,y_mm,z_mm\n"), "{csv}");
    assert_eq!(csv.lines().count(), 10);
    agrees(&session);
    (1..=9).for_each(|number| session.exclude(number, None).expect("there"));
    let Err(none) = session.results().map(drop) else { panic!("nothing counts") };
    assert!(none.to_string().contains("10 of 11 are excluded"), "{none}");
    assert!(
        matches!(open(quick()).results().map(drop), Err(error) if error.to_string().contains("nothing was observed"))
    );
}

#[test]
fn poses_and_distances() {
    let keys = json!({
        "target": [{ "name": "hand", "at_m": [0.3, 0.0, 0.05], "rpy_deg": [0, 0, 0], "known": { "to_m": 0.1, "to_deg": 5 } }],
        "sensor": [
            { "channel": "pose", "target": "hand", "sigma_m": 0.0005, "sigma_deg": 0.05 },
            { "channel": "distance", "target": "hand", "to_m": [1, 0, 0], "sigma_m": 0.0005 },
            { "channel": "position", "target": "hand", "sigma_m": 0.001 },
        ],
    });
    let (mut session, robot) = told(keys, 6, |robot, theta| {
        let pose = hand(robot, theta);
        let (t, q) = (pose.translation.vector, pose.rotation.coords);
        json!({
            "hand": { "position": [t.x, t.y, t.z], "quaternion": [q.x, q.y, q.z, q.w] },
            "hand_distance": (t - Vector3::x()).norm(),
            "hand_2": null,
        })
    });
    let titles = session.observations_csv().lines().next().map(str::to_owned);
    let wanted = "pan,lift,elbow,hand_x,hand_y,hand_z,hand_rx,hand_ry,hand_rz,hand_distance,hand_2_x,hand_2_y,hand_2_z";
    assert_eq!(titles.as_deref(), Some(wanted));
    agrees(&session);
    let mut wrong = robot.observation(None, session.suggestions()[0].configuration.clone(), 0.0);
    wrong.measurements =
        BTreeMap::from([("hand".to_owned(), json!({ "position": [0, 0, 0], "quaternion": [0, 0, 0, 2] }))]);
    let Err(Refusal::Field(fault)) = session.observe(wrong, None) else { panic!("no rotation") };
    assert_eq!(fault.field, "measurements.hand.quaternion");
}

/// Whatever columns the calibration names, in any order and with any rotation, the table has in them what was told.
#[test]
fn what_is_written_is_titled_as_what_it_is() {
    for columns in [
        ["x", "y", "z", "Roll", "Pitch", "Yaw"].as_slice(),
        &["Yaw_deg", "z_mm", "x_in", "roll (deg)", "y", "PITCH"],
        &["x_tool", "y_tool", "z_tool", "qw_tool", "qx_tool", "qy_tool", "qz_tool"],
        &["tx", "ty", "tz", "rot_x", "rot_y", "rot_z"],
        &["a", "b", "c", "d", "e", "f", "g"],
    ] {
        let keys = json!({
            "target": [{ "name": "hand", "at_m": [0.3, 0.0, 0.05], "rpy_deg": [0, 0, 0], "known": { "to_m": 0.1, "to_deg": 5 } }],
            "sensor": { "channel": "pose", "sigma_m": 0.0005, "sigma_deg": 0.05, "columns": columns },
        });
        let (session, robot) = told(keys, 4, |robot, theta| {
            let pose = hand(robot, theta);
            let (t, q) = (pose.translation.vector, pose.rotation.coords);
            json!({ "hand": { "position": [t.x, t.y, t.z], "quaternion": [q.x, q.y, q.z, q.w] } })
        });
        let csv = session.observations_csv();
        let open = |file: &str| Ok(if file == "robot.urdf" { session.setup().urdf().to_owned() } else { csv.clone() });
        let scenario = Scenario::parse("calibration.toml", &session.calibration_toml(), &open);
        let scenario = scenario.unwrap_or_else(|error| panic!("{columns:?}: {error}"));
        for row in Case::new(&scenario).expect("a table").rows {
            let reading = row.observation.readings[0].clone().expect("seen");
            let pose = hand(&robot, &row.positions);
            let turned = (pose.rotation.scaled_axis() - Vector3::from_column_slice(&reading[3..])).norm();
            let moved = (pose.translation.vector - Vector3::from_column_slice(&reading[..3])).norm();
            assert!(turned < 1e-9 && moved < 1e-9, "{columns:?}: {turned}, {moved}\n{csv}");
        }
    }
    let mut calibration = quick();
    calibration["sensor"] = json!({ "channel": "position", "columns": ["x", "y", "x_mm"], "sigma_m": 0.001 });
    let error = Session::open(Setup::new(calibration)).map(drop).expect_err("no z").to_string();
    assert!(error.contains("both taken for x, and none is z"), "{error}");
}

#[test]
fn pixels() {
    let keys = json!({
        "target": [{ "name": "tag", "at_m": [0.3, 0.0, 0.05], "known": { "to_m": 0.05 } }],
        "camera": [{ "name": "cam", "at_m": [2.5, 0.0, 0.5], "looks_at_m": [0, 0, 0.5], "size_px": [2000, 2000], "focal_px": [900, 900] }],
        "sensor": { "channel": "pixels", "camera": "cam", "target": "tag", "sigma_px": 0.3 },
        "view": { "visible_pose_deg": [0, 0, 0] },
        "prediction": { "of": "tag" },
    });
    // x points to the right of the picture, which is −y, and y down.
    let (session, _) = told(keys, 10, |robot, theta| {
        let at = robot.truth.marker_at(theta);
        let (ahead, right, down) = (2.5 - at.x, at.y, 0.5 - at.z);
        json!({ "cam_tag": [[1000.0 + 900.0 * right / ahead, 1000.0 + 900.0 * down / ahead]] })
    });
    assert_eq!(session.channels()[0].shape, Shape::Pixels { points: 1, least_points: None });
    assert!(session.status().expected_error_mm < Some(20.0), "{:?}", session.status());
    agrees(&session);
}

/// A real Panda, as if a person followed the prompts as well as the rows of a table allow.
#[test]
fn sockets() {
    let text = std::fs::read_to_string("scenarios/panda-sockets.csv").expect("a table");
    let mut rows: Vec<(String, Vec<f64>)> = text
        .lines()
        .skip(1)
        .filter(|line| line.starts_with("front_center"))
        .map(|line| {
            let cells: Vec<&str> = line.split(',').collect();
            (
                format!("{}/{}", cells[0], cells[1]),
                cells[2..].iter().map(|cell| cell.parse().expect("a number")).collect(),
            )
        })
        .collect();
    let socket = |name: &str| {
        let (_, posture) = rows.iter().find(|(label, _)| label.ends_with(name)).expect("a row");
        let degrees: Vec<f64> = posture.iter().map(|q| q.to_degrees()).collect();
        json!({ "name": name, "place": "front_center", "posture_deg": degrees })
    };
    let mut setup = Setup::new(json!({
        "robot": { "urdf": std::fs::read_to_string("scenarios/panda.urdf").expect("a description"), "base": "panda_link0", "tip": "panda_link8" },
        "socket": [socket("0"), socket("1")],
        "sockets": { "sigma_m": 0.0002, "distance_m": 0.05, "sigma_distance_m": 0.0001 },
        "smoother": { "hypotheses": 2, "spawned": 1 },
        "selection": { "criterion": "d", "evaluations": 100 },
    }));
    setup.seed = 3;
    let mut session = Session::open(setup).unwrap_or_else(|error| panic!("{error}"));
    let names: Vec<String> = (1..=7).map(|joint| format!("panda_joint{joint}")).collect();
    for count in 0..10 {
        let next = session.suggest(&Ask::default(), None).expect("one").suggestions.remove(0);
        let wanted = next.socket.clone().expect("a socket");
        let theta: Vec<f64> = names.iter().map(|name| next.configuration[name]).collect();
        let away = |row: &Vec<f64>| row.iter().zip(&theta).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let nearest = (0..rows.len())
            .filter(|row| rows[*row].0 == wanted)
            .min_by(|a, b| away(&rows[*a].1).total_cmp(&away(&rows[*b].1)));
        let (label, posture) = rows.remove(nearest.expect("a row is left"));
        assert!(count > 1 || away(&posture) < 1e-9, "the first of each is what was told in advance");
        let measurements = BTreeMap::from([if count % 2 == 0 {
            ("socket".to_owned(), json!(label))
        } else {
            ("ball".to_owned(), json!({ "socket": label }))
        }]);
        let configuration = names.iter().cloned().zip(posture).collect();
        let told = Observation { suggestion_id: Some(next.id), configuration, measurements };
        session.observe(told, None).unwrap_or_else(|error| panic!("{error}"));
    }
    assert!(session.observations_csv().starts_with("place,socket,panda_joint1,"));
    agrees(&session);
    let replayed = Session::from_json(&session.to_json()).expect("its own");
    assert_eq!(replayed.belief().map(|it| &it.state), session.belief().map(|it| &it.state));
    let mut elsewhere = session.observations()[0].observation.clone();
    elsewhere.measurements = BTreeMap::from([("socket".to_owned(), json!("front_center/2"))]);
    let mut twice = elsewhere.clone();
    let both = [("ball", "front_center/0"), ("socket", "front_center/1")];
    twice.measurements = both.map(|(name, label)| (name.to_owned(), json!({ "socket": label }))).into();
    let Err(Refusal::Field(fault)) = session.observe(twice, None) else { panic!("one target in two sockets") };
    assert!(fault.field == "measurements.socket" && fault.what.contains("one socket at a time"), "{fault:?}");
    let Err(Refusal::Field(fault)) = session.observe(elsewhere, None) else { panic!("no such socket") };
    assert!(fault.field == "measurements.socket" && fault.hint.contains("front_center/0, front_center/1"), "{fault:?}");
}

/// Motors that were homed by eye: the axes are right, the zeros are not. They go into the description and into the report.
#[test]
fn offsets_of_readings() {
    let mut keys = quick();
    keys["robot"]["hold"] = json!(["pan", "lift", "elbow"]);
    keys["robot"]["offsets"] = json!(["lift", "elbow"]);
    let (session, _) = told(json!({ "robot": keys["robot"] }), 8, |robot, theta| {
        let nominal = body_schema::robot::Urdf::parse(keys["robot"]["urdf"].as_str().expect("a text"));
        let mut state = nominal.and_then(|urdf| urdf.chain("base", "tip")).expect("a chain").state();
        state.targets[0] = robot.truth.targets[0].clone();
        let at = state.marker_at(&[theta[0], theta[1] + 0.04, theta[2] - 0.03]);
        json!({ "marker": [at.x, at.y, at.z] })
    });
    let (calibration, _) = session.calibrate(&axes_alone(), &Silent).expect("calibrated");
    let offset = |index: usize| calibration.report.joints[index].offset.map(|offset| offset.value);
    assert_eq!(offset(0), None);
    let found = offset(1).expect("learned");
    assert!((found - 0.04_f64.to_degrees()).abs() < 0.1, "{found} degrees");
    // Behind the last joint the marker may be anywhere: its zero cannot be told, and that is said.
    let undetermined = calibration.report.parameters.undetermined.concat();
    assert!(undetermined.contains("the zero of elbow cannot be separated from where"), "{undetermined}");
    agrees(&session);
    let mut wrong = keys.clone();
    wrong["robot"]["offsets"] = json!(["elbw"]);
    let error = Session::open(Setup::new(wrong)).map(drop).expect_err("no such joint").to_string();
    assert!(error.contains("`robot.offsets`: the URDF has no joint `elbw`; did you mean `elbow`"), "{error}");
}
