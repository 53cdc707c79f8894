//! What a server tells of itself in figures.

use std::collections::BTreeMap;

use body_schema::server::{Limits, Options};
use serde_json::json;

use crate::http::{
    robot,
    support::{Server, problem},
};

const TOKEN: &str = "a-token-of-a-test-0123456789";

/// All samples, by their names with their labels.
async fn figures(server: &Server) -> BTreeMap<String, f64> {
    let response = server.get("/metrics").await;
    assert_eq!(response.status(), 200);
    let kind = response.headers()["content-type"].to_str().expect("text").to_owned();
    assert_eq!(kind, "application/openmetrics-text; version=1.0.0; charset=utf-8");
    let text = response.text().await.expect("text");
    assert!(text.ends_with("# EOF\n"), "{text}");
    let samples = text.lines().filter(|line| !line.starts_with('#')).map(|line| {
        let (name, value) = line.rsplit_once(' ').expect("a name and a value");
        (name.to_owned(), value.parse().unwrap_or_else(|_| panic!("{line}")))
    });
    samples.collect()
}

#[tokio::test]
async fn what_happens_is_counted_and_what_there_is_told() {
    let limits = Limits { streams_per_session: 1, steps_per_session: 10, ..Limits::default() };
    let server = Server::with(Options { limits, ..Options::default() }).await;
    let session = server.open_quick(1).await;
    server.step(&session, 3).await;
    let elsewhere = server.open(robot::opening()).await;
    server.post(&format!("{elsewhere}/observations"), robot::told(&robot::posture(0))).await;
    let mut events = server.get(&format!("{session}/events")).await;
    events.chunk().await.expect("no error").expect("an event");
    problem(server.get(&format!("{session}/events")).await, 429, None).await;
    problem(server.post(&format!("{session}/steps"), json!({ "count": 100 })).await, 422, Some("count")).await;
    problem(server.post(&format!("{session}/steps"), json!({ "x": "y".repeat(100_000) })).await, 413, None).await;
    server.get("/nothing/of/the/kind").await;

    let figures = figures(&server).await;
    let figure = |name: &str| *figures.get(name).unwrap_or_else(|| panic!("no {name} in {figures:#?}"));
    for (name, value) in [
        ("body_schema_steps_total", 3.0),
        ("body_schema_observations_total", 1.0),
        ("body_schema_sessions{world=\"simulated\"}", 1.0),
        ("body_schema_sessions{world=\"measured\"}", 0.0),
        ("body_schema_sessions{world=\"outside\"}", 1.0),
        ("body_schema_sessions_stored", 1.0),
        ("body_schema_sessions_failed_total", 0.0),
        ("body_schema_streams", 1.0),
        ("body_schema_connections_refused_total", 0.0),
        ("body_schema_connections_evicted_total", 0.0),
        ("body_schema_memory_limit_bytes", f64::from(2u32 << 30)),
        ("body_schema_problems_total{kind=\"too-many-streams\",status=\"429\"}", 1.0),
        ("body_schema_problems_total{kind=\"too-few-steps-left\",status=\"422\"}", 1.0),
        ("body_schema_problems_total{kind=\"body-too-large\",status=\"413\"}", 1.0),
        ("body_schema_requests_total{method=\"POST\",route=\"/v1/sessions/{id}/steps\",status=\"200\"}", 1.0),
        ("body_schema_requests_total{method=\"POST\",route=\"/v1/sessions/{id}/steps\",status=\"422\"}", 1.0),
        ("body_schema_requests_total{method=\"GET\",route=\"none\",status=\"404\"}", 1.0),
        ("body_schema_request_duration_seconds_count{method=\"POST\",route=\"/v1/sessions/{id}/steps\"}", 3.0),
        ("body_schema_request_duration_seconds_bucket{le=\"+Inf\",method=\"POST\",route=\"/v1/sessions\"}", 2.0),
    ] {
        assert_eq!(figure(name), value, "{name}");
    }
    assert!(figure("body_schema_memory_bytes") > 10_000.0);
    assert!((1.0..=512.0).contains(&figure("body_schema_connections")));
    assert!(figure("body_schema_connections_limit") <= 512.0);
    assert!(figure("process_start_time_seconds") > 1.7e9);
    let build = format!("body_schema_build_info{{version=\"{}\"", env!("CARGO_PKG_VERSION"));
    assert!(figures.keys().any(|name| name.starts_with(&build)), "{build}");
    let paths = figures.keys().any(|name| name.contains(session.rsplit('/').next().expect("an id")));
    assert!(!paths, "what clients ask for makes no series of its own");
    drop(events);
    server.stop().await;
}

#[tokio::test]
async fn figures_are_for_those_who_may_ask() {
    let token = Some(TOKEN.parse().expect("a token"));
    let server = Server::with(Options { token, ..Options::default() }).await;
    problem(server.get("/metrics").await, 401, Some("Authorization")).await;
    let asked = server.request(reqwest::Method::GET, "/metrics").bearer_auth(TOKEN).send().await.expect("an answer");
    let text = asked.text().await.expect("text");
    assert!(text.contains("{kind=\"no-token\",status=\"401\"} 1"), "{text}");
    server.stop().await;
}
