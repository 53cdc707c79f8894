//! Long sessions with robots elsewhere: what they have learned is kept, and learned again where that cannot be used.

use std::{path::Path, time::Duration};

use body_schema::{
    ask_tell::{Session, Setup},
    server::{Limits, Options},
};
use reqwest::{Method, StatusCode};
use rusqlite::Connection;
use serde_json::{Value, json};

use crate::http::{
    external::tell,
    robot,
    streams::rows_of_recording,
    support::{Server, problem},
};

/// Observations of a session, a few more than two checkpoints.
const TOLD: usize = 120;

fn options(folder: &Path) -> Options {
    Options { data_dir: Some(folder.to_owned()), limits: Limits::default(), ..Options::default() }
}

/// How many observations a server has learned from once more.
async fn replayed(server: &Server) -> u64 {
    let text = server.get("/metrics").await.text().await.expect("text");
    let line = text.lines().find_map(|line| line.strip_prefix("body_schema_observations_replayed_total "));
    line.expect("a counter").parse().expect("a number")
}

/// All that a session shows, times and the id of its recording apart.
async fn shown(server: &Server, session: &str) -> Vec<Value> {
    let mut resource = server.get_json(session).await;
    resource["recording"].take();
    let steps = server.get(&format!("{session}/steps.csv")).await.text().await.expect("text");
    let next = server.post(&format!("{session}/suggestions"), json!({})).await;
    let mut next: Value = next.json().await.expect("JSON");
    // It is another each time that it is asked for, and one that is abandoned was never made.
    let outcome = format!("{session}/suggestions/{}/outcome", next["suggestions"][0]["id"]);
    assert!(server.post(&outcome, json!({ "state": "abandoned" })).await.status().is_success());
    for field in ["id", "revision"] {
        next["suggestions"][0][field].take();
    }
    resource["status"]["revision"].take();
    vec![resource, json!(steps), next]
}

async fn exclude(server: &Server, session: &str, number: u64) {
    let path = format!("{session}/observations/{number}");
    let excluded = server.request(Method::DELETE, &path).send().await.expect("an answer");
    assert_eq!(excluded.status(), StatusCode::OK);
}

/// What is done to the rows of a store while no server runs.
fn sql(folder: &Path, statement: &str) -> usize {
    let store = Connection::open(folder.join("sessions.sqlite")).expect("a store");
    store.execute(statement, []).expect("done")
}

#[tokio::test]
async fn a_long_session_comes_back_from_what_it_had_learned() {
    let folder = tempfile::tempdir().expect("a folder");
    let server = Server::with(options(folder.path())).await;
    let session = server.open(robot::opening()).await;
    tell(&server, &session, 0..TOLD).await;
    let before = shown(&server, &session).await;
    server.stop().await;
    let mut recorded = Vec::new();
    // As it is kept, and as it is where that is damaged, of another build, cut off, or lost.
    for (statement, most) in [
        ("UPDATE session SET damage = NULL", 20),
        ("UPDATE checkpoint SET reports = x'00' WHERE step = 100", 70),
        ("UPDATE checkpoint SET state = x'00' WHERE step = 100", 70),
        ("DELETE FROM checkpoint WHERE step = 50", TOLD as u64),
        ("UPDATE checkpoint SET build = 'another'", TOLD as u64),
        ("DELETE FROM checkpoint", TOLD as u64),
    ] {
        sql(folder.path(), statement);
        let server = Server::with(options(folder.path())).await;
        assert_eq!(shown(&server, &session).await, before, "{statement}");
        assert_eq!(replayed(&server).await, most, "{statement}");
        let recording = server.get(&format!("{session}/recording.rrd")).await.bytes().await.expect("a recording");
        recorded.push(rows_of_recording(&recording));
        server.stop().await;
    }
    assert!(recorded[0].len() > 10 * TOLD && recorded.iter().all(|rows| *rows == recorded[0]));
}

#[tokio::test]
async fn what_is_excluded_is_replayed_from_the_checkpoint_before_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let server = Server::with(options(folder.path())).await;
    let session = server.open(robot::opening()).await;
    tell(&server, &session, 0..TOLD).await;
    exclude(&server, &session, 110).await;
    let without = shown(&server, &session).await;
    // Once to find it out, and once more, from the checkpoint too, to have it in memory.
    assert_eq!(replayed(&server).await, 19 + 19);
    exclude(&server, &session, 60).await;
    let without_both = shown(&server, &session).await;
    assert_eq!(replayed(&server).await, 38 + 68 + 18, "its own checkpoint at 100 is another");
    server.stop().await;
    // The same where nothing was kept of it.
    sql(folder.path(), "DELETE FROM checkpoint");
    let server = Server::with(options(folder.path())).await;
    assert_eq!(shown(&server, &session).await, without_both);
    let path = format!("{session}/observations/60/included");
    let included = server.request(Method::PUT, &path).send().await.expect("an answer");
    assert_eq!(included.status(), StatusCode::OK);
    assert_eq!(shown(&server, &session).await, without);
    server.stop().await;
}

/// While much is replayed the session is read as before, and whoever asks anything of its engine is told to come back, at once.
#[tokio::test]
async fn a_long_replay_blocks_nobody() {
    let calibration = json!({
        "robot": { "urdf": include_str!("../../scenarios/panda.urdf"), "base": "panda_link0", "tip": "panda_link8" },
        "sensor": { "channel": "position", "sigma_m": 0.001 },
    });
    let mut robot = Session::open(Setup::new(calibration.clone())).expect("a session");
    let joints: Vec<String> = robot.description().joints.iter().map(|joint| joint.name.clone()).collect();
    let state = robot.belief().expect("an agent").state.clone();
    let limits = robot.experiment().agent().expect("an agent").limits().joints().to_vec();
    for number in 0..600_usize {
        let angle = |joint: usize| {
            let (lower, upper) = limits[joint];
            0.5 * (lower + upper) + 0.3 * (upper - lower) * ((number * (7 + 4 * joint) + 3 * joint) as f64 * 0.37).sin()
        };
        let configuration: Value =
            joints.iter().enumerate().map(|(joint, name)| (name.clone(), json!(angle(joint)))).collect();
        let posture: Vec<f64> = (0..joints.len()).map(angle).collect();
        let at = state.marker_at(&posture).coords;
        let off = 1e-3 * (number as f64 * 2.3).sin();
        let told =
            json!({ "configuration": configuration, "measurements": { "marker": [at.x + off, at.y, at.z - off] } });
        robot.observe(serde_json::from_value(told).expect("an observation"), None).expect("observed");
    }
    let events: Value = serde_json::from_str(&robot.to_json()).expect("JSON");
    let server = Server::start().await;
    let is_excluded = std::cell::Cell::new(false);
    let opening = json!({ "world": "outside", "calibration": calibration, "events": events["events"] });
    let session = server.open(opening).await;
    let excluding = async {
        exclude(&server, &session, 1).await;
        is_excluded.set(true);
    };
    let asking = async {
        let mut refused = 0;
        while refused == 0 {
            assert!(!is_excluded.get(), "it was over before anybody could be refused");
            tokio::time::sleep(Duration::from_millis(50)).await;
            assert_eq!(server.get_json(&session).await["status"]["observations"], 600, "it is read meanwhile");
            let asked = server.post(&format!("{session}/suggestions"), json!({})).await;
            if asked.status() == StatusCode::SERVICE_UNAVAILABLE {
                assert!(asked.headers().contains_key("retry-after"));
                let told = problem(asked, 503, None).await;
                let detail = told["detail"].as_str().expect("text");
                assert!(detail.contains(" of 601"), "{detail}");
                refused += 1;
            }
        }
    };
    tokio::join!(excluding, asking);
    let status = &server.get_json(&session).await["status"];
    assert_eq!((&status["excluded"], &status["observations"]), (&json!([1]), &json!(600)));
    let asked = server.post(&format!("{session}/suggestions"), json!({})).await;
    assert_eq!(asked.status(), StatusCode::OK);
    server.stop().await;
}
