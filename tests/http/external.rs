//! Robots elsewhere: asked where to move, and told what was seen.

use std::time::Duration;

use body_schema::{
    ask_tell::{Ask, Session, Setup},
    server::{Limits, Options},
};
use reqwest::{Method, StatusCode};
use serde_json::{Value, json};

use crate::http::{
    robot::{self, JOINTS},
    streams::steps_of_recording,
    support::{Api, SOON, Server, problem},
};

/// Tells so many observations that nobody asked for.
pub async fn tell(api: &Api, session: &str, numbers: std::ops::Range<usize>) {
    for number in numbers {
        let told = api.post(&format!("{session}/observations"), robot::told(&robot::posture(number))).await;
        assert_eq!(told.status(), StatusCode::CREATED);
    }
}

/// A session's resource, and the id of its recording apart: it is another each time that it is recorded anew.
async fn resource(api: &Api, session: &str) -> (Value, String) {
    let mut resource = api.get_json(session).await;
    let recording = resource["recording"].take().as_str().expect("an id").to_owned();
    (resource, recording)
}

async fn posted(api: &Api, path: &str, body: Value) -> Value {
    let response = api.post(path, body).await;
    assert!(response.status().is_success(), "{path}: {}", response.text().await.expect("text"));
    response.json().await.expect("JSON")
}

#[tokio::test]
async fn a_robot_asks_moves_and_tells_until_it_is_enough() {
    let server = Server::start().await;
    let opened = server.post("/v1/sessions", robot::opening()).await;
    assert_eq!(opened.status(), StatusCode::CREATED);
    let session = opened.headers()["location"].to_str().expect("text").to_owned();
    let resource: Value = opened.json().await.expect("JSON");
    assert_eq!((&resource["world"], &resource["step"]), (&json!("outside"), &json!(0)));
    let status = &resource["status"];
    assert_eq!((&status["observations"], &status["pending"]), (&json!(0), &json!(0)));
    assert!(status["expected_error_mm"].as_f64().is_some_and(|mm| mm > 2.0), "{status}");
    assert_eq!(resource["channels"], json!([{ "name": "marker", "channel": "position" }]));

    // The engine, asked and told the same, says the same.
    let mut engine = Session::open(Setup::new(robot::calibration())).expect("a session");
    let (suggestions, observations) = (format!("{session}/suggestions"), format!("{session}/observations"));
    let mut enough = None;
    for number in 1..=40_u64 {
        let asked = posted(&server, &suggestions, json!({})).await;
        let suggestion = &asked["suggestions"][0];
        assert_eq!((&suggestion["id"], &suggestion["state"]), (&json!(number), &json!("pending")));
        let own = engine.suggest(&Ask::default(), None).expect("a suggestion");
        assert_eq!(suggestion, &serde_json::to_value(&own.suggestions[0]).expect("JSON"));
        let told = robot::carried_out(suggestion);
        let answer = posted(&server, &observations, told.clone()).await;
        let own = engine.observe(serde_json::from_value(told).expect("an observation"), None).expect("an answer");
        assert_eq!(answer, serde_json::to_value(&own).expect("JSON"));
        enough = asked.get("enough").cloned();
        if enough.is_some() {
            break;
        }
    }
    let enough = enough.expect("it is enough at last");
    assert!(enough["expected_error_mm"].as_f64() <= enough["wanted_mm"].as_f64(), "{enough}");

    let told = server.get_json(&observations).await;
    let count = told["observations"].as_array().expect("a list").len();
    assert_eq!(told["observations"][0], server.get_json(&format!("{observations}/1")).await);
    assert_eq!((&told["observations"][0]["number"], &told["observations"][0]["excluded"]), (&json!(1), &json!(false)));
    let all = server.get_json(&suggestions).await;
    assert!(all["suggestions"].as_array().expect("a list").iter().all(|suggestion| suggestion["state"] == "observed"));
    let resource = server.get_json(&session).await;
    assert_eq!((&resource["step"], &resource["status"]["observations"]), (&json!(count), &json!(count)));
    assert_eq!(server.get_json("/v1/sessions").await, json!({ "sessions": [resource] }));
    server.delete(&session).await;
    problem(server.get(&session).await, 404, Some("id")).await;
    problem(server.post(&suggestions, json!({})).await, 404, Some("id")).await;
    server.stop().await;
}

#[tokio::test]
async fn each_client_has_suggestions_of_its_own() {
    let server = Server::start().await;
    let session = server.open(robot::opening()).await;
    let suggestions = format!("{session}/suggestions");
    let [one, other] = ["left", "right"].map(|client| json!({ "client": client, "count": 2 }));
    let first = posted(&server, &suggestions, one.clone()).await;
    let second = posted(&server, &suggestions, other).await;
    assert_eq!(posted(&server, &suggestions, one.clone()).await, first, "asking again changes nothing");
    let all: Vec<&Value> =
        [&first, &second].iter().flat_map(|asked| asked["suggestions"].as_array().expect("a list")).collect();
    assert_eq!(all.len(), 4);
    for (index, suggestion) in all.iter().enumerate() {
        assert_eq!(suggestion["client"], if index < 2 { "left" } else { "right" });
        assert!(all[..index].iter().all(|other| other["configuration"] != suggestion["configuration"]));
    }
    // One is refused, another left out; they are replaced, and the other client's stay.
    let outcome = |id: u64| format!("{suggestions}/{id}/outcome");
    let refused = posted(&server, &outcome(1), json!({ "state": "infeasible", "reason": "the table" })).await;
    assert_eq!((&refused["id"], &refused["state"]), (&json!(1), &json!("infeasible")));
    assert_eq!(posted(&server, &outcome(2), json!({ "state": "abandoned" })).await["state"], "abandoned");
    let again = posted(&server, &suggestions, one).await;
    assert_eq!(again["suggestions"].as_array().expect("a list").len(), 2);
    assert!(
        again["suggestions"].as_array().expect("a list").iter().all(|suggestion| suggestion["id"].as_u64() > Some(4))
    );
    let state_of = |all: &Value, id: usize| all["suggestions"][id - 1]["state"].clone();
    let all = server.get_json(&suggestions).await;
    assert_eq!([1, 2, 3, 4].map(|id| state_of(&all, id)), ["infeasible", "abandoned", "pending", "pending"]);
    let replanned = posted(&server, &suggestions, json!({ "client": "right", "replan": true })).await;
    assert_eq!(replanned["suggestions"].as_array().expect("a list").len(), 1);
    let all = server.get_json(&suggestions).await;
    assert_eq!([3, 4].map(|id| state_of(&all, id)), ["superseded", "superseded"]);

    problem(server.post(&outcome(1), json!({ "state": "abandoned" })).await, 409, None).await;
    problem(server.post(&outcome(99), json!({ "state": "abandoned" })).await, 404, Some("sid")).await;
    problem(server.post(&outcome(5), json!({ "state": "observed" })).await, 422, Some("state")).await;
    problem(server.post(&outcome(5), json!({ "state": "abandoned", "why": "" })).await, 422, Some("why")).await;
    problem(server.post(&format!("{suggestions}/x/outcome"), json!({ "state": "abandoned" })).await, 400, None).await;
    // One that runs out.
    let soon = posted(&server, &suggestions, json!({ "client": "late", "expires_s": 0.05 })).await;
    let id = soon["suggestions"][0]["id"].as_u64().expect("an id") as usize;
    tokio::time::sleep(Duration::from_millis(60)).await;
    assert_eq!(state_of(&server.get_json(&suggestions).await, id), "expired");
    let late = posted(&server, &format!("{session}/observations"), robot::carried_out(&soon["suggestions"][0])).await;
    assert_eq!(late["observation"], 1, "what comes late is accepted");
    server.stop().await;
}

#[tokio::test]
async fn an_observation_counts_once_however_often_it_is_sent() {
    let server = Server::start().await;
    let session = server.open(robot::opening()).await;
    let path = format!("{session}/observations");
    let send = async |key: &str, number: usize| {
        let body = robot::told(&robot::posture(number));
        let request = server.request(Method::POST, &path).header("idempotency-key", key).json(&body);
        request.send().await.expect("an answer")
    };
    let first = send("one", 1).await;
    assert_eq!(first.status(), StatusCode::CREATED);
    assert_eq!(first.headers()["location"], format!("{path}/1"));
    let first: Value = first.json().await.expect("JSON");
    assert_eq!(send("two", 2).await.status(), StatusCode::CREATED);
    let again = send("one", 1).await;
    assert_eq!(again.status(), StatusCode::OK);
    assert_eq!(again.headers()["location"], format!("{path}/1"));
    assert_eq!(again.json::<Value>().await.expect("JSON"), first);
    problem(send("one", 3).await, 409, Some("Idempotency-Key")).await;
    problem(send("", 3).await, 400, Some("Idempotency-Key")).await;
    problem(send(&"x".repeat(201), 3).await, 400, Some("Idempotency-Key")).await;
    assert_eq!(send("three", 1).await.status(), StatusCode::CREATED, "the same may be seen twice");
    assert_eq!(server.get_json(&session).await["status"]["observations"], 3);

    // The same numbers in other words are the same, under one key.
    let raw = async |keys: &[&str], body: &str| {
        let request = server.request(Method::POST, &path).header("content-type", "application/json");
        let request = keys.iter().fold(request, |request, key| request.header("idempotency-key", *key));
        request.body(body.to_owned()).send().await.expect("an answer")
    };
    let one = r#"{"configuration":{"pan":1,"lift":0.5,"elbow":-1},"measurements":{"marker":[0.4,0,1]}}"#;
    let same = r#"{"measurements":{"marker":[4e-1,0.0,1.0]},"configuration":{"elbow":-1.0,"lift":5e-1,"pan":1.0}}"#;
    let other = one.replace("0.4", "0.41");
    assert_eq!(raw(&["four"], one).await.status(), StatusCode::CREATED);
    assert_eq!(raw(&["four"], same).await.status(), StatusCode::OK);
    problem(raw(&["four"], &other).await, 409, Some("Idempotency-Key")).await;
    problem(raw(&["five", "five"], one).await, 400, Some("Idempotency-Key")).await;
    problem(raw(&["five", "six"], one).await, 400, Some("Idempotency-Key")).await;
    assert_eq!(server.get_json(&session).await["status"]["observations"], 4);
    server.stop().await;
}

/// What is wrong, and what to write instead, each by itself.
#[tokio::test]
async fn a_wrong_value_is_named_with_a_hint() {
    let server = Server::start().await;
    let session = server.open(robot::opening()).await;
    let observations = format!("{session}/observations");
    let sent = async |path: &str, body: &str| {
        let request = server.request(Method::POST, path).header("content-type", "application/json");
        request.body(body.to_owned()).send().await.expect("an answer")
    };
    let opening = |from: &str, to: &str| {
        let text = robot::opening().to_string();
        assert!(text.contains(from), "{text}");
        text.replace(from, to)
    };
    let sensor = r#""sensor":{"channel":"position""#;
    let (sessions, at) = ("/v1/sessions", r#""pan":0,"lift":0,"elbow":0"#);
    for (path, body, field, hint) in [
        (&*observations, r#"{"configuration":[0,0,0]}"#.to_owned(), "configuration", ""),
        (&observations, format!(r#"{{"configuration":{{{at},"pan":1}}}}"#), "configuration.pan", "once"),
        (
            &observations,
            format!(r#"{{"configuration":{{{at}}},"measurements":{{"marker":[0,0,0],"marker":null}}}}"#),
            "measurements.marker",
            "once",
        ),
        (
            &observations,
            r#"{"configuration":{"pan":200,"lift":0,"elbow":0}}"#.to_owned(),
            "configuration.pan",
            "radians",
        ),
        (&observations, format!(r#"{{"configuration":{{{at}}},"suggestion_id":9}}"#), "suggestion_id", ""),
        (sessions, opening(r#""name":"three""#, r#""name":"three","name":"four""#), "calibration.name", "once"),
        (sessions, opening(r#""world":"outside""#, r#""world":"outside","seed":1,"seed":1"#), "seed", "once"),
        (sessions, opening(r#""hypotheses":2"#, r#""hypotheses":5000"#), "calibration.smoother.hypotheses", "1000"),
        (sessions, opening(r#""ahead":2"#, r#""ahead":500"#), "calibration.selection.ahead", "100"),
        (
            sessions,
            opening(sensor, &format!(r#"{sensor},"columns":["pan","y","z"]"#)),
            "calibration.sensor.columns",
            "columns",
        ),
    ] {
        let found = problem(sent(path, &body).await, 422, Some(field)).await;
        let detail = found["detail"].as_str().expect("text");
        if field != "suggestion_id" {
            let [what, told] = ["what", "hint"].map(|part| found[part].as_str().unwrap_or_else(|| panic!("{found}")));
            assert!(!what.is_empty() && detail.contains(what) && detail.contains(told), "{found}");
            assert!(!told.is_empty() && told.contains(hint), "{found}");
        } else {
            assert_eq!(found["type"], "urn:body-schema:problem:unknown-suggestion");
        }
    }
    assert_eq!(server.get_json(&session).await["status"]["observations"], 0);
    server.stop().await;
}

#[tokio::test]
async fn an_excluded_observation_is_as_if_it_had_never_been_told() {
    let server = Server::start().await;
    let session = server.open(robot::opening()).await;
    tell(&server, &session, 0..6).await;
    let mut live = server.get(&format!("{session}/live.rrd")).await;
    let (before, recorded) = resource(&server, &session).await;
    let number = format!("{session}/observations/3");
    let excluded = server.request(Method::DELETE, &number).send().await.expect("an answer");
    assert_eq!(excluded.status(), StatusCode::OK);
    let status: Value = excluded.json().await.expect("JSON");
    assert_eq!((&status["excluded"], &status["observations"]), (&json!([3]), &json!(6)));
    // Whoever follows begins anew: what was sent is not what is now.
    while live.chunk().await.expect("a clean end").is_some() {}
    assert_eq!(crate::http::streams::steps_of_events(&server, &session, 5).await, [0, 1, 2, 3, 4, 5]);
    let recording = server.get(&format!("{session}/recording.rrd")).await.bytes().await.expect("a recording");
    assert_eq!(steps_of_recording(&recording), (0..=5).collect());

    // The belief is that of the others.
    let without = server.open(robot::opening()).await;
    tell(&server, &without, 0..2).await;
    tell(&server, &without, 3..6).await;
    let result = async |session: &str| server.get_json(&format!("{session}/result.json")).await["learners"].clone();
    assert_eq!(result(&session).await, result(&without).await);
    assert_eq!(server.get_json(&session).await["status"]["expected_error_mm"], status["expected_error_mm"]);
    let told = server.get_json(&number).await;
    assert_eq!((&told["excluded"], &told["number"]), (&json!(true), &json!(3)));

    let included = server.request(Method::PUT, &format!("{number}/included")).send().await.expect("an answer");
    assert_eq!(included.status(), StatusCode::OK);
    let (mut after, recorded_anew) = resource(&server, &session).await;
    assert_eq!(after["status"]["revision"], 8);
    after["status"]["revision"] = before["status"]["revision"].clone();
    assert_eq!(after, before);
    assert_ne!(recorded_anew, recorded, "viewers begin anew");
    let again = server.request(Method::PUT, &format!("{number}/included")).send().await.expect("an answer");
    assert_eq!(again.json::<Value>().await.expect("JSON")["revision"], 8, "it counts already");
    let path = format!("{session}/observations/7");
    problem(server.request(Method::DELETE, &path).send().await.expect("an answer"), 404, Some("n")).await;
    problem(server.get(&path).await, 404, Some("n")).await;
    server.stop().await;
}

/// Whoever watches a session sees that nothing is waited for any more, though nobody asks.
#[tokio::test]
async fn a_suggestion_whose_time_has_run_out_is_told_to_be() {
    let server = Server::start().await;
    let session = server.open(robot::opening()).await;
    posted(&server, &format!("{session}/suggestions"), json!({ "expires_s": 3.0 })).await;
    let pending = async || server.get_json(&session).await["status"]["pending"].clone();
    assert_eq!(pending().await, 1);
    for _ in 0..100 {
        if pending().await == 0 {
            break;
        }
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
    assert_eq!(pending().await, 0);
    // What is said of one that has just run out is refused, and ends it.
    let soon = posted(&server, &format!("{session}/suggestions"), json!({ "expires_s": 0.05 })).await;
    tokio::time::sleep(Duration::from_millis(100)).await;
    let outcome = format!("{session}/suggestions/{}/outcome", soon["suggestions"][0]["id"]);
    problem(server.post(&outcome, json!({ "state": "abandoned" })).await, 409, None).await;
    assert_eq!(pending().await, 0);
    server.stop().await;
}

#[tokio::test]
async fn what_is_wrong_is_named() {
    let server = Server::start().await;
    let with = |key: &str, value: Value| {
        let mut opening = robot::opening();
        opening[key] = value;
        opening
    };
    let calibration = |key: &str, value: Value| {
        let mut calibration = robot::calibration();
        calibration[key] = value;
        with("calibration", calibration)
    };
    let joints: String = (0..41).map(|index| {
        format!("<joint name=\"j{index}\" type=\"continuous\"><parent link=\"l{index}\"/><child link=\"l{}\"/><axis xyz=\"0 0 1\"/></joint>", index + 1)
    }).collect();
    let links: String = (0..42).map(|index| format!("<link name=\"l{index}\"/>")).collect();
    let long = format!("<robot name=\"long\">{links}{joints}</robot>");
    let wide = format!("<robot><!-- {} --></robot>", "x".repeat(9 << 20));
    for (body, status, field) in [
        (json!({ "world": "outside" }), 422, "calibration"),
        (json!({ "calibration": robot::calibration() }), 422, "world"),
        (json!({ "world": "outside", "calibration": 3 }), 422, "calibration"),
        (json!({ "world": "outside", "calibration": {} }), 422, "calibration.robot"),
        (with("world", json!("mars")), 422, "world"),
        (with("scenario", json!("arm-6dof")), 422, "scenario"),
        (with("seed", json!("one")), 422, "seed"),
        (with("agent", json!("nobody")), 422, "agent"),
        (calibration("robot", json!({ "urdf": "robot.urdf" })), 422, "calibration.robot.urdf"),
        (calibration("robot", json!({ "urdf": long })), 422, "calibration.robot.urdf"),
        (calibration("robot", json!({ "urdf": wide })), 413, "calibration"),
        (calibration("smother", json!({})), 422, "calibration.smother"),
    ] {
        problem(server.post("/v1/sessions", body).await, status, Some(field)).await;
    }
    let size = body_schema::ask_tell::MOST_SETUP_BYTES;
    let body = calibration("robot", json!({ "urdf": format!("<robot><!-- {} --></robot>", "x".repeat(size - 40)) }));
    problem(server.post("/v1/sessions", body).await, 422, Some("calibration")).await;

    let session = server.open(robot::opening()).await;
    let observations = format!("{session}/observations");
    let told = |key: &str, value: Value| {
        let mut told = robot::told(&robot::posture(1));
        told[key] = value;
        told
    };
    for (body, field) in [
        (json!({}), "configuration"),
        (told("configuration", json!({ "pan": 0, "lift": 0 })), "configuration.elbow"),
        (told("configuration", json!({ "pan": 0, "lift": 0, "elbow": 0, "wrist": 0 })), "configuration.wrist"),
        (told("configuration", json!({ "pan": 90, "lift": 0, "elbow": 0 })), "configuration.pan"),
        (told("configuration", json!({ "pan": "0", "lift": 0, "elbow": 0 })), "configuration.pan"),
        (told("measurements", json!({ "marker": [0, 1] })), "measurements.marker"),
        (told("measurements", json!({ "markr": [0, 1, 2] })), "measurements.markr"),
        (told("suggestion_id", json!(7)), "suggestion_id"),
        (told("suggested", json!(7)), "suggested"),
    ] {
        problem(server.post(&observations, body).await, 422, Some(field)).await;
    }
    for (body, field) in [
        (json!({ "count": 0 }), "count"),
        (json!({ "count": 21 }), "count"),
        (json!({ "client": "" }), "client"),
        (json!({ "expires_s": -1 }), "expires_s"),
        (json!({ "replan": 1 }), "replan"),
    ] {
        problem(server.post(&format!("{session}/suggestions"), body).await, 422, Some(field)).await;
    }
    assert_eq!(server.get_json(&session).await["status"]["revision"], 0, "nothing of it has happened");

    // It never steps by itself, and others neither ask nor tell.
    let steps = problem(server.post(&format!("{session}/steps"), json!({})).await, 409, None).await;
    assert!(steps["detail"].as_str().expect("text").contains("suggestions"), "{steps}");
    let configuration = format!("{session}/learners/global/configuration");
    problem(server.post(&configuration, json!({ "configuration": [0, 0, 0] })).await, 409, None).await;
    let simulated = server.open_quick(1).await;
    for path in ["suggestions", "observations", "observations/1", "model.urdf", "report.json", "observations.csv"] {
        problem(server.get(&format!("{simulated}/{path}")).await, 409, None).await;
    }
    problem(server.post(&format!("{simulated}/suggestions"), json!({})).await, 409, None).await;
    let told = robot::told(&robot::posture(1));
    problem(server.post(&format!("{simulated}/observations"), told).await, 409, None).await;
    server.stop().await;
}

#[tokio::test]
async fn streams_show_it_as_they_show_a_simulated_one() {
    let server = Server::start().await;
    let session = server.open(robot::opening()).await;
    posted(&server, &format!("{session}/suggestions"), json!({ "client": "arm" })).await;
    tell(&server, &session, 0..3).await;
    assert_eq!(
        crate::http::streams::steps_of_events(&server, &session, 3).await,
        [0, 1, 2, 3],
        "a late one sees it all"
    );
    let live = crate::http::streams::first_messages(&server, &session, 3).await;
    let statuses: Vec<&Value> = live.iter().filter(|event| event["type"] == "status").collect();
    assert_eq!(statuses[0]["data"]["status"]["observations"], 3);
    assert_eq!(statuses[0]["data"]["pending"][0]["client"], "arm");
    let recording = server.get(&format!("{session}/recording.rrd")).await.bytes().await.expect("a recording");
    assert_eq!(steps_of_recording(&recording), (0..=3).collect());
    let table = server.get(&format!("{session}/steps.csv")).await.text().await.expect("a table");
    assert_eq!(table.lines().count(), 5, "a header, step 0 and three more");
    let appraisal = json!({ "configuration": [0.1, 0.2, -0.3] });
    let appraised = posted(&server, &format!("{session}/learners/global/evaluations"), appraisal).await;
    assert_eq!(appraised["estimated_skeleton_m"].as_array().expect("points").len(), JOINTS.len() + 1);
    assert!(server.get(&format!("{session}/blueprint.rbl")).await.status().is_success());
    server.stop().await;
}

/// Planning takes long, and is of one session: here far longer than the rest of the test, whatever else the machine does.
#[tokio::test]
async fn nobody_waits_for_the_planning_of_another() {
    let server = Server::start().await;
    let mut slow = robot::opening();
    slow["calibration"]["selection"] = json!({ "evaluations": 100_000, "ahead": 6 });
    let [slow, quick] = [server.open(slow).await, server.open(robot::opening()).await];
    tell(&server, &slow, 0..4).await;
    let path = format!("{slow}/suggestions");
    let planning = posted(&server, &path, json!({ "count": 20 }));
    let telling = async {
        tell(&server, &quick, 0..4).await;
        // What there is of the other can be read meanwhile.
        server.get_json(&path).await
    };
    tokio::select! {
        biased;
        told = telling => assert_eq!(told, json!({ "suggestions": [] })),
        planned = planning => panic!("the quick one waited for {planned}"),
    }
    // Nor does whoever ends it wait for its planning.
    server.delete(&slow).await;
    server.stop().await;
}

#[tokio::test]
async fn sessions_outlive_the_server_and_leave_memory_meanwhile() {
    let folder = tempfile::tempdir().expect("a folder");
    let options = |limits| Options { data_dir: Some(folder.path().to_owned()), limits, ..Options::default() };
    let brief = Limits { idle_after: Duration::from_millis(30), ..Limits::default() };
    let server = Server::with(options(brief)).await;
    let session = server.open(robot::opening()).await;
    let asked = posted(&server, &format!("{session}/suggestions"), json!({ "count": 2 })).await;
    tell(&server, &session, 0..3).await;
    let (before, recording) = resource(&server, &session).await;
    // It leaves memory, and comes back as it was, for whatever is asked first.
    for path in ["", "/observations", "/suggestions", "/result.json", "/observations.csv"] {
        tokio::time::sleep(Duration::from_millis(150)).await;
        assert!(server.get(&format!("{session}{path}")).await.status().is_success());
        assert_eq!(resource(&server, &session).await.0, before);
    }
    let recorded_anew = async {
        while resource(&server, &session).await.1 == recording {
            tokio::time::sleep(Duration::from_millis(150)).await;
        }
    };
    tokio::time::timeout(SOON, recorded_anew).await.expect("it leaves memory, and is recorded anew");
    let simulated = server.open_quick(1).await;
    server.stop().await;

    let server = Server::with(options(Limits::default())).await;
    let listed = server.get_json("/v1/sessions").await;
    assert_eq!(listed["sessions"].as_array().expect("a list").len(), 1);
    assert_eq!((&listed["sessions"][0]["id"], &listed["sessions"][0]["step"]), (&before["id"], &json!(3)));
    assert_eq!(listed["sessions"][0]["status"], Value::Null, "nobody has asked for it yet");
    problem(server.get(&simulated).await, 404, Some("id")).await;
    assert_eq!(resource(&server, &session).await.0, before);
    assert_eq!(posted(&server, &format!("{session}/suggestions"), json!({ "count": 2 })).await, asked);
    tell(&server, &session, 3..4).await;
    server.delete(&session).await;
    server.stop().await;

    let server = Server::with(options(Limits::default())).await;
    assert_eq!(server.get_json("/v1/sessions").await, json!({ "sessions": [] }));
    server.stop().await;
}
