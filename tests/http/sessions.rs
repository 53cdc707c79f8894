//! The life of sessions.

use body_schema::{
    experiment::{Description, RunResult, StepReport},
    scenario::builtin,
};
use futures_util::future::join_all;
use reqwest::StatusCode;
use serde_json::{Value, json};

use crate::http::support::{Server, problem, steps, timeless};

#[tokio::test]
async fn a_whole_life() {
    let server = Server::start().await;
    let scenarios = server.get_json("/v1/scenarios").await;
    let names: Vec<&str> =
        scenarios["scenarios"].as_array().expect("a list").iter().flat_map(|s| s["name"].as_str()).collect();
    let known: Vec<&str> = body_schema::scenario::BUILTIN.iter().map(|builtin| builtin.name).collect();
    assert_eq!(names, known);
    let scenario = server.get_json("/v1/scenarios/arm-6dof").await;
    assert_eq!(scenario["world"], "simulated");
    assert!(scenario["source"].as_str().expect("TOML").contains("name = \"arm-6dof\""));

    let response = server.post("/v1/sessions", json!({ "scenario": "arm-6dof" })).await;
    assert_eq!(response.status(), StatusCode::CREATED);
    let session = response.headers()["location"].to_str().expect("text").to_owned();
    let resource: Value = response.json().await.expect("JSON");
    assert_eq!(session, format!("/v1/sessions/{}", resource["id"].as_str().expect("an id")));
    assert_eq!((&resource["step"], &resource["remaining"]), (&json!(0), &Value::Null));
    assert_eq!(resource["description"]["seed"], 1);
    assert_eq!(resource["description"]["learners"].as_array().expect("learners").len(), 3);
    assert_eq!(server.get_json(&session).await, resource);
    assert_eq!(server.get_json("/v1/sessions").await, json!({ "sessions": [resource] }));

    assert_eq!(steps(&server.step(&session, 1).await["reports"]), [1]);
    let made = server.step(&session, 3).await;
    assert_eq!((&made["step"], steps(&made["reports"])), (&json!(4), vec![2, 3, 4]));
    assert_eq!(server.get_json(&session).await["step"], 4);

    // The same as the library gives, but for wall times.
    let mut experiment = builtin("arm-6dof").and_then(|s| s.experiment(1, None)).expect("an experiment");
    let description: Description = serde_json::from_value(resource["description"].clone()).expect("a description");
    assert_eq!(description, Description::of(&experiment));
    for _ in 0..4 {
        experiment.step().expect("a step");
    }
    let report: StepReport = serde_json::from_value(made["reports"][2].clone()).expect("a report");
    let expected = serde_json::to_value(StepReport::of(&experiment)).expect("JSON");
    assert_eq!(timeless(&made["reports"][2]), timeless(&expected));

    let result: RunResult = server.get(&format!("{session}/result.json")).await.json().await.expect("a result");
    assert_eq!(result, RunResult::of(&experiment));
    assert_eq!(result.learners[0].metrics, report.learners[0].metrics);

    server.delete(&session).await;
    problem(server.get(&session).await, 404, Some("id")).await;
    assert_eq!(server.get_json("/v1/sessions").await, json!({ "sessions": [] }));
    server.stop().await;
}

#[tokio::test]
async fn who_follows_the_events_need_not_get_the_reports_twice() {
    let server = Server::start().await;
    let session = server.open_quick(1).await;
    let steps_of = |reports| json!({ "count": 2, "reports": reports });
    let made: Value = server.post(&format!("{session}/steps"), steps_of(false)).await.json().await.expect("JSON");
    assert_eq!(made, json!({ "step": 2, "remaining": null, "reports": [] }));
    let made: Value = server.post(&format!("{session}/steps"), steps_of(true)).await.json().await.expect("JSON");
    assert_eq!((&made["step"], steps(&made["reports"])), (&json!(4), vec![3, 4]));
    assert_eq!(crate::http::streams::steps_of_events(&server, &session, 4).await, [0, 1, 2, 3, 4]);
    let wrong = json!({ "reports": "none" });
    problem(server.post(&format!("{session}/steps"), wrong).await, 422, Some("reports")).await;
    server.stop().await;
}

#[tokio::test]
async fn downloads_agree_with_the_reports() {
    let server = Server::start().await;
    let session = server.open_quick(7).await;
    let made = server.step(&session, 5).await;

    let table = server.get(&format!("{session}/steps.csv")).await;
    assert_eq!(table.headers()["content-type"], "text/csv; charset=utf-8");
    assert_eq!(table.headers()["content-disposition"], "attachment; filename=\"arm-6dof-seed7-step5.csv\"");
    let table = table.bytes().await.expect("a table");
    let mut table = csv::Reader::from_reader(table.as_ref());
    let columns = table.headers().expect("a header").clone();
    let rows: Vec<csv::StringRecord> = table.records().collect::<Result<_, _>>().expect("rows");
    assert_eq!(rows.len(), 6 * 2, "step 0 and five more, for two learners");
    let value = |row: &csv::StringRecord, name: &str| {
        row.get(columns.iter().position(|column| column == name).expect("a column")).expect("a value").to_owned()
    };
    for row in &rows[2..] {
        let step: usize = value(row, "step").parse().expect("a step");
        let learners = made["reports"][step - 1]["learners"].as_array().expect("learners");
        let learner = learners.iter().find(|learner| learner["name"] == value(row, "learner")).expect("a learner");
        for metric in ["orientation_deg", "location_m", "prediction_m"] {
            assert_eq!(value(row, metric).parse::<f64>().ok(), learner["metrics"][metric].as_f64());
        }
    }

    let recording = server.get(&format!("{session}/recording.rrd")).await;
    assert_eq!(recording.headers()["content-disposition"], "attachment; filename=\"arm-6dof-seed7-step5.rrd\"");
    let recording = recording.bytes().await.expect("a recording");
    assert_eq!(crate::http::streams::steps_of_recording(&recording), (0..=5).collect());
    server.stop().await;
}

#[tokio::test]
async fn sessions_do_not_mix_and_requests_queue() {
    let server = Server::start().await;
    let [first, second] = [server.open_quick(1).await, server.open_quick(2).await];
    let requests = (0..10).map(|index| server.step(if index % 2 == 0 { &first } else { &second }, 10));
    let made = join_all(requests).await;
    for (session, parity) in [(&first, 0), (&second, 1)] {
        let of_session = made.iter().skip(parity).step_by(2);
        let mut seen: Vec<u64> = of_session.flat_map(|made| steps(&made["reports"])).collect();
        seen.sort_unstable();
        assert_eq!(seen, (1..=50).collect::<Vec<_>>(), "every step once");
        let seed = parity as u64 + 1;
        let learners = Some(["random", "gradient"].map(str::to_owned));
        let mut alone = builtin("arm-6dof")
            .and_then(|scenario| scenario.experiment(seed, learners.as_ref().map(<[String; 2]>::as_slice)))
            .expect("an experiment");
        for _ in 0..50 {
            alone.step().expect("a step");
        }
        let result: RunResult = server.get(&format!("{session}/result.json")).await.json().await.expect("a result");
        assert_eq!(result, RunResult::of(&alone));
    }
    server.stop().await;
}

#[tokio::test]
async fn a_recording_does_not_wait_for_the_steps_to_come() {
    let server = Server::start().await;
    let session = server.open(json!({ "scenario": "arm-12dof", "learners": ["global"] })).await;
    let path = format!("{session}/steps");
    let stepping = server.post(&path, json!({ "count": 1000, "reports": false }));
    let taking = async {
        while server.get_json(&session).await["step"] == 0 {
            tokio::time::sleep(std::time::Duration::from_millis(20)).await;
        }
        let recording = server.get(&format!("{session}/recording.rrd")).await.bytes().await.expect("a recording");
        let made = crate::http::streams::steps_of_recording(&recording).len();
        assert!((2..1001).contains(&made), "{made} steps");
        server.delete(&session).await;
    };
    let (stepped, ()) = tokio::join!(stepping, taking);
    let stepped = problem(stepped, 503, None).await;
    assert_eq!(stepped["type"], "urn:body-schema:problem:session-ending", "{stepped}");
    server.stop().await;
}
