//! What is refused says which field is wrong and how to mend it, and has changed nothing.

use std::collections::BTreeMap;

use body_schema::ask_tell::{
    Ask, Document, Event, Fault, Happened, Outcome, Refusal, ReplayError, Session, Setup, SetupError,
};
use serde_json::{Value, json};

use crate::robot::{Robot, open, quick};

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
    for (calibration, field, mend) in [
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
        let Fault { field: named, mend: told, .. } = &faults[0];
        assert!(named == field && told.contains(mend), "{field}: {faults:?}");
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
    for (told, field, mend) in [
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
        assert!(fault.field == field && fault.mend.contains(mend), "{fault:?}");
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
