//! What is refused says which field is wrong and how to mend it, and has changed nothing.

use std::collections::BTreeMap;

use body_schema::ask_tell::{
    Ask, Document, Event, Fault, Happened, Observation, Outcome, Refusal, ReplayError, Session, Setup, SetupError,
    Suggestion,
};
use serde_json::{Value, json};

use crate::ask_tell::robot::{Robot, open, quick};

#[test]
fn setups() {
    let changed = |pointer: &str, value: Value| {
        let mut calibration = quick();
        let (parent, key) = pointer.rsplit_once('/').expect("a path");
        calibration
            .pointer_mut(parent)
            .expect("there")
            .as_object_mut()
            .expect("an object")
            .insert(key.to_owned(), value);
        calibration
    };
    for (calibration, field, hint) in [
        (json!([]), "calibration", "keys of a calibration file"),
        (json!({}), "robot", "add"),
        (json!({ "robot": {} }), "robot.urdf", "the text of the robot's URDF"),
        (changed("/robot/urdf", json!("robot.urdf")), "robot.urdf", "the text of the file"),
        (changed("/robot/urdf", json!("<robot>")), "robot.urdf", ""),
        (changed("/robot/tip", json!("hand")), "robot.urdf", "its links are base, a, b, tip"),
        (changed("/robot/tipp", json!("tip")), "robot.tipp", "did you mean `tip`"),
        (changed("/prior/point_m", json!(-1)), "prior.point_m", "above 0"),
        (changed("/measurements", json!({ "file": "a.csv" })), "measurements", "told, observation by observation"),
        (
            changed("/initial_error", json!({ "draw": "up_to", "angle_deg": 1, "point_m": 1 })),
            "initial_error",
            "remove it",
        ),
        (
            changed("/sensor", json!({ "channel": "position", "target": "hand" })),
            "sensor.target",
            "write one of marker",
        ),
        (changed("/sensor", json!([null])), "sensor[0]", "write a number, a text, a list or an object"),
        (changed("/constraints", json!({ "start_deg": [0, 0] })), "constraints.start_deg", "one position per joint"),
        (changed("/sockets", json!({ "sigma_m": 0.001 })), "socket", "add `[[socket]]`s"),
    ] {
        let Err(SetupError::Invalid(faults)) = Session::open(Setup::new(calibration)).map(drop) else {
            panic!("{field}")
        };
        let Fault { field: named, hint: told, .. } = &faults[0];
        assert!(named == field && told.contains(hint), "{field}: {faults:?}");
    }
    for (agent, what) in [("glbal", "did you mean `global`"), ("smoother:human", "a person does not answer")] {
        let setup = Setup { agent: Some(agent.to_owned()), ..Setup::new(quick()) };
        let error = Session::open(setup).map(drop).expect_err("no agent").to_string();
        assert!(error.starts_with("`agent`: ") && error.contains(what), "{error}");
    }
    let other = Setup { agent: Some("smoother:random".to_owned()), seed: 3, ..Setup::new(quick()) };
    assert_eq!(Session::open(other).expect("another agent").description().learners[0].policy, "random");
}

#[test]
fn observations() {
    let mut session = open(quick());
    let robot = Robot::of(&session, 11);
    session.suggest(&Ask::default(), None).expect("one");
    let good = robot.sees(&session.suggestions()[0], 0.0);
    let before = session.to_json();
    let configuration = |name: &str, q: Option<f64>| {
        let mut told = good.clone();
        match q {
            Some(q) => drop(told.configuration.insert(name.to_owned(), q)),
            None => drop(told.configuration.remove(name)),
        }
        told
    };
    let marker = |reading: Value| {
        let mut told = good.clone();
        told.measurements.insert("marker".to_owned(), reading);
        told
    };
    let mut misspelt = good.clone();
    misspelt.measurements = BTreeMap::from([("maker".to_owned(), Value::Null)]);
    for (told, field, hint) in [
        (configuration("lift", None), "configuration.lift", "tell where every joint was"),
        (configuration("left", Some(0.0)), "configuration.left", "did you mean `lift`"),
        (configuration("lift", Some(f64::NAN)), "configuration.lift", "in rad or m"),
        (configuration("lift", Some(45.0)), "configuration.lift", "write radians"),
        (misspelt, "measurements.maker", "did you mean `marker`"),
        (marker(json!([1, 2])), "measurements.marker", "[x, y, z] in metres"),
        (marker(json!({ "position": [1, 2, 3] })), "measurements.marker", "[x, y, z] in metres"),
        (marker(json!([1e200, 0, 0])), "measurements.marker", "[x, y, z] in metres"),
    ] {
        let Err(Refusal::Field(fault)) = session.observe(told, None) else { panic!("{field}") };
        assert!(fault.field == field && fault.hint.contains(hint), "{fault:?}");
    }
    let mut unasked = good;
    unasked.suggestion_id = Some(2);
    assert!(matches!(session.observe(unasked, None), Err(Refusal::UnknownSuggestion { id: 2, count: 1 })));
    let outcome = session.outcome(2, Outcome::Abandoned, None, None);
    assert!(matches!(outcome, Err(Refusal::UnknownSuggestion { id: 2, count: 1 })));
    let long = "x".repeat(2000);
    let Err(Refusal::Field(fault)) = session.outcome(1, Outcome::Abandoned, Some(&long), None) else { panic!("long") };
    assert_eq!(fault.field, "reason");
    for (asked, field) in [
        (Ask { count: Some(21), ..Ask::default() }, "count"),
        (Ask { client: Some(String::new()), ..Ask::default() }, "client"),
        (Ask { expires_s: Some(-1.0), ..Ask::default() }, "expires_s"),
    ] {
        let Err(Refusal::Field(fault)) = session.suggest(&asked, Some(0.0)) else { panic!("{field}") };
        assert_eq!(fault.field, field);
    }
    assert_eq!(session.to_json(), before, "nothing has changed");
}

/// Where the constraints leave nothing to choose, the refusal names the constraint.
#[test]
fn nothing_to_suggest() {
    let mut calibration = quick();
    calibration["constraints"] = json!({ "allowed_deg": [[10, 20, 30]], "start_deg": [10, 20, 30] });
    let mut session = open(calibration);
    let only = session.suggest(&Ask::default(), None).expect("the one").suggestions.remove(0);
    session.outcome(only.id, Outcome::Infeasible, None, None).expect("pending");
    let Err(Refusal::Selection(why)) = session.suggest(&Ask::default(), None) else { panic!("nothing is left") };
    assert!(why.to_string().contains("no configuration is feasible"), "{why}");
}

#[test]
fn stored_sessions() {
    let mut session = open(quick());
    session.suggest(&Ask::default(), None).expect("one");
    let document: Document = serde_json::from_str(&session.to_json()).expect("its own");
    let reread = |document: &Document| Session::from_json(&serde_json::to_string(document).expect("JSON")).map(drop);
    assert!(reread(&document).is_ok());
    let later = Document { version: 2, ..document.clone() };
    assert!(matches!(reread(&later), Err(ReplayError::Version { found: 2, known: 1 })));
    let excluded = Event { at_s: None, happened: Happened::Excluded { observation: 1 } };
    let events = document.events.iter().cloned().chain([excluded]).collect();
    let Err(ReplayError::Event { index: 2, what }) = reread(&Document { events, ..document }) else {
        panic!("event 2")
    };
    assert!(what.contains("there is no observation 1"), "{what}");
    assert!(matches!(Session::from_json("{}").map(drop), Err(ReplayError::NotASession(_))));
}

/// The quick arm, its joints of this type and with this limit, under a camera that sees a tag on it.
fn watched(limit: &str, camera: Value) -> Value {
    let mut calibration = quick();
    let urdf = calibration["robot"]["urdf"].as_str().expect("a text");
    let kind = if limit.is_empty() { "continuous" } else { "revolute" };
    let urdf = urdf
        .replace("type=\"revolute\"", &format!("type=\"{kind}\""))
        .replace("<limit lower=\"-1.5\" upper=\"1.5\" effort=\"1\" velocity=\"1\"/>", limit);
    calibration["robot"]["urdf"] = json!(urdf);
    calibration["target"] = json!([{ "name": "tag", "at_m": [0.3, 0.0, 0.05], "known": { "to_m": 0.05 } }]);
    calibration["camera"] = json!([camera]);
    calibration["sensor"] = json!({ "channel": "pixels", "camera": "cam", "target": "tag", "sigma_px": 0.3 });
    calibration["prediction"] = json!({ "of": "tag" });
    calibration
}

fn camera() -> Value {
    json!({ "name": "cam", "at_m": [2.5, 0.0, 0.5], "looks_at_m": [0, 0, 0.5], "size_px": [640, 480], "focal_px": [300, 300] })
}

fn looked(lift: f64, point: [f64; 2]) -> Observation {
    let configuration = [("pan", 0.1), ("lift", lift), ("elbow", 0.2)].map(|(name, q)| (name.to_owned(), q)).into();
    let measurements = BTreeMap::from([("cam_tag".to_owned(), json!([point]))]);
    Observation { suggestion_id: None, configuration, measurements }
}

/// Degrees and millimetres are far beyond what a joint that turns, with whatever limits, and a picture have.
#[test]
fn nothing_is_told_that_can_hardly_be() {
    let limit = |most: f64| format!("<limit lower=\"-{most}\" upper=\"{most}\" effort=\"1\" velocity=\"1\"/>");
    for (limit, least, most) in [
        (String::new(), 15.0, 16.0),
        (limit(1e16), 15.0, 16.0),
        (limit(999.0), 18.0, 19.0),
        (limit(360.0), 18.0, 19.0),
        (limit(20.0), 18.0, 19.0),
        (limit(6.2), 7.0, 8.0),
        (limit(1.5), 1.7, 1.9),
        ("<limit lower=\"-1e16\" upper=\"1.0\" effort=\"1\" velocity=\"1\"/>".to_owned(), 1.6, 1.7),
    ] {
        let session = open(watched(&limit, camera()));
        let tell = |q: f64| session.prepare_observe(looked(q, [320.0, 240.0]), None).map(drop);
        tell(least).unwrap_or_else(|error| panic!("{limit}: {error}"));
        for q in [most, 200.0, 1e6] {
            let Err(Refusal::Field(fault)) = tell(q) else { panic!("{limit}: {q} rad") };
            assert!(fault.field == "configuration.lift" && fault.hint.contains("radians"), "{fault:?}");
        }
    }
    let session = open(watched("", camera()));
    let tell = |point: [f64; 2]| session.prepare_observe(looked(0.3, point), None).map(drop);
    for point in [[0.0, 0.0], [640.0, 480.0], [-60.0, -40.0], [700.0, 520.0]] {
        tell(point).unwrap_or_else(|error| panic!("{point:?}: {error}"));
    }
    for point in [[9000.0, 100.0], [100.0, 9000.0], [-70.0, 100.0], [100.0, -50.0], [710.0, 10.0], [10.0, 530.0]] {
        let Err(Refusal::Field(fault)) = tell(point) else { panic!("{point:?} px") };
        assert!(fault.field == "measurements.cam_tag" && fault.what.contains("640 x 480"), "{fault:?}");
    }
}

/// What was told before it was refused is replayed.
#[test]
fn what_was_kept_is_taken_up_again() {
    let mut session = open(watched("", camera()));
    session.observe(looked(0.3, [320.0, 240.0]), None).expect("seen");
    let kept = session.to_json().replace("[[320.0,240.0]]", "[[9000.0,240.0]]");
    assert_eq!(Session::from_json(&kept).expect("kept").observations().len(), 1);
}

/// A list says nothing of its order, whatever reads it; a suggestion says its own.
#[test]
fn positions_are_told_by_name() {
    let told = json!({ "configuration": [0.1, 0.2, 0.3], "measurements": {} });
    let error = serde_json::from_value::<Observation>(told).expect_err("whose positions?").to_string();
    assert!(error.contains("a list does not say which joint is which"), "{error}");
    let mut session = open(quick());
    let suggested = session.suggest(&Ask::default(), None).expect("one").suggestions.remove(0);
    assert_eq!(suggested.joints, ["pan", "lift", "elbow"]);
    let text = serde_json::to_string(&suggested).expect("JSON");
    let place = |name: &str| text.find(&format!("\"{name}\":")).expect("named");
    assert!(place("pan") < place("lift") && place("lift") < place("elbow"), "{text}");
    assert_eq!(serde_json::from_str::<Suggestion>(&text).expect("its own"), suggested);
    let older = text.replace("\"joints\":[\"pan\",\"lift\",\"elbow\"],", "");
    assert!(older.len() < text.len());
    let kept = session.to_json().replace("\"joints\":[\"pan\",\"lift\",\"elbow\"],", "");
    let taken_up = Session::from_json(&kept).expect("an older one");
    assert_eq!(*taken_up.suggestions()[0], suggested);
    assert_eq!(serde_json::from_str::<Suggestion>(&older).expect("older").joints, Vec::<String>::new());
}

/// What is in view is judged by how well it is known where things are.
#[test]
fn a_visible_pose_is_judged_with_what_is_known() {
    let turned = |known: Option<Value>| {
        // It looks beside the arm, by some 25 degrees.
        let mut camera = camera();
        camera["looks_at_m"] = json!([0.0, 1.6, 0.5]);
        known.into_iter().for_each(|known| camera["known"] = known);
        let mut calibration = watched("", camera);
        calibration["view"] = json!({ "visible_pose_deg": [0, 0, 0] });
        calibration
    };
    let mut narrow = turned(None);
    narrow["camera"][0]["focal_px"] = json!([900, 900]);
    let refused = |calibration: Value| {
        let Err(SetupError::Invalid(faults)) = Session::open(Setup::new(calibration)).map(drop) else {
            panic!("out of view")
        };
        assert_eq!(faults[0].field, "view.visible_pose_deg");
        faults[0].clone()
    };
    assert!(refused(narrow.clone()).what.contains("degrees outside"));
    // To a degree is not enough, to twenty it is, and so is a base that is known to a metre or anywhere.
    let known = |known: Value| {
        let mut calibration = narrow.clone();
        calibration["camera"][0]["known"] = known;
        calibration
    };
    assert!(refused(known(json!({ "to_m": 0.01, "to_deg": 1 }))).hint.contains("known"));
    let based = |known: Value| {
        let mut calibration = narrow.clone();
        calibration["base"]["known"] = known;
        calibration
    };
    for calibration in [
        known(json!({ "to_m": 0.01, "to_deg": 20 })),
        known(json!({ "anywhere_m": 3.0 })),
        based(json!({ "to_m": 1.0, "to_deg": 60 })),
        based(json!({ "anywhere_m": 3.0 })),
    ] {
        let mut session = open(calibration);
        let first = session.suggest(&Ask::default(), None).expect("one").suggestions.remove(0);
        assert!(first.configuration.values().all(|q| q.abs() < 1e-6), "where it is known to be seen: {first:?}");
        session.observe(looked(0.0, [320.0, 240.0]), None).expect("seen");
        session.suggest(&Ask::default(), None).expect("another");
    }
}

/// A number is the same however it is written.
#[test]
fn the_same_is_told_in_other_words() {
    let told = |text: &str| serde_json::from_str::<Observation>(text).expect("an observation");
    let one = told(r#"{"configuration":{"pan":1,"lift":0.5},"measurements":{"a":[1,2.0,{"b":3}],"c":null}}"#);
    let same = told(r#"{"measurements":{"c":null,"a":[1.0,2,{"b":3e0}]},"configuration":{"lift":5e-1,"pan":1.0}}"#);
    assert!(one != same && one.tells_the_same(&same) && same.tells_the_same(&one));
    for other in [
        r#"{"configuration":{"pan":1,"lift":0.5},"measurements":{"a":[1,2.5,{"b":3}],"c":null}}"#,
        r#"{"configuration":{"pan":1,"lift":0.5},"measurements":{"a":[1,2.0,{"b":3}]}}"#,
        r#"{"configuration":{"pan":1,"lift":0.6},"measurements":{"a":[1,2.0,{"b":3}],"c":null}}"#,
        r#"{"suggestion_id":1,"configuration":{"pan":1,"lift":0.5},"measurements":{"a":[1,2.0,{"b":3}],"c":null}}"#,
        r#"{"configuration":{"pan":1,"lift":0.5},"measurements":{"a":[1,2.0,{"b":true}],"c":null}}"#,
    ] {
        assert!(!one.tells_the_same(&told(other)) && !told(other).tells_the_same(&one), "{other}");
    }
}
