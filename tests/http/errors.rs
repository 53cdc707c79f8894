//! Every error is a problem document that names what is to blame.

use reqwest::{Method, StatusCode};
use serde_json::{Value, json};

use crate::http::support::{Server, problem};

#[tokio::test]
async fn bodies() {
    let server = Server::start().await;
    let session = server.open_quick(1).await;
    let steps = format!("{session}/steps");
    let sessions = "/v1/sessions";
    for (path, body, status, field) in [
        (sessions, json!({}), 422, Some("scenario")),
        (sessions, json!({ "scenario": 3 }), 422, Some("scenario")),
        (sessions, json!({ "scenario": "arm-7dof" }), 422, Some("scenario")),
        (sessions, json!({ "scenario": "arm-6dof", "seed": "one" }), 422, Some("seed")),
        (sessions, json!({ "scenario": "arm-6dof", "seed": -1 }), 422, Some("seed")),
        (sessions, json!({ "scenario": "arm-6dof", "seed": 1_u64 << 63 }), 422, Some("seed")),
        (sessions, Value::Null, 422, Some("scenario")),
        (sessions, json!({ "scenario": "arm-6dof", "learners": ["activ"] }), 422, Some("learners")),
        (sessions, json!({ "scenario": "arm-6dof", "learners": [] }), 422, Some("learners")),
        (sessions, json!({ "scenario": "arm-6dof", "learners": ["random", "random"] }), 422, Some("learners")),
        (sessions, json!({ "scenario": "arm-6dof", "sead": 1 }), 422, Some("sead")),
        (sessions, json!([]), 422, None),
        (&steps, json!({ "count": 0 }), 422, Some("count")),
        (&steps, json!({ "count": 1001 }), 422, Some("count")),
        (&steps, json!({ "count": -1 }), 422, Some("count")),
        (&steps, json!({ "count": 1.5 }), 422, Some("count")),
        (&steps, json!({ "count": null }), 422, Some("count")),
        (&steps, json!({ "expected_step": "x" }), 422, Some("expected_step")),
        (&steps, json!({ "steps": 1 }), 422, Some("steps")),
    ] {
        let problem = problem(server.post(path, body).await, status, field).await;
        if field == Some("scenario") && problem["detail"].as_str().is_some_and(|detail| detail.contains("arm-7dof")) {
            assert!(problem["detail"].as_str().expect("text").contains("did you mean"), "{problem}");
        }
    }
    let raw = |body: &'static str, content_type: Option<&'static str>| {
        let request = server.request(Method::POST, sessions).body(body);
        let request = content_type.into_iter().fold(request, |request, value| request.header("content-type", value));
        async { request.send().await.expect("an answer") }
    };
    let valid = r#"{"scenario":"arm-6dof"}"#;
    problem(raw("{\"scenario\":", Some("application/json")).await, 400, None).await;
    problem(raw(valid, None).await, 415, Some("Content-Type")).await;
    problem(raw(valid, Some("text/plain")).await, 415, Some("Content-Type")).await;
    problem(raw("", Some("application/json")).await, 422, Some("scenario")).await;
    assert_eq!(raw(valid, Some("application/json; charset=utf-8")).await.status(), StatusCode::CREATED);
    let large = server.post(sessions, json!({ "scenario": "x".repeat(70_000) })).await;
    problem(large, 413, None).await;
    let none = server.request(Method::POST, &steps).send().await.expect("an answer");
    assert_eq!(none.status(), StatusCode::OK, "no body is one step");
    assert_eq!(none.json::<Value>().await.expect("JSON")["step"], 1);
    let null = server.post(&steps, Value::Null).await;
    assert_eq!(null.json::<Value>().await.expect("JSON")["step"], 2, "null is one step too");
    let whole = server.post(&steps, json!({ "count": 2.0, "expected_step": 2.0, "frames": 0.0 })).await;
    assert_eq!(whole.json::<Value>().await.expect("JSON")["step"], 4, "to JSON Schema 2.0 is whole");
    server.stop().await;
}

#[tokio::test]
async fn paths_methods_and_parameters() {
    let server = Server::start().await;
    let session = server.open_quick(1).await;
    for path in ["/nothing", "/v1", "/v1/", "/v1/nothing", "/v1/sessions/", "/viewer/", "/viewer/x.js", "/../x"] {
        problem(server.get(path).await, 404, None).await;
    }
    let posted = server.post("/nothing", json!({})).await;
    problem(posted, 404, None).await;
    let unknown = problem(server.get("/v1/scenarios/arm-6dog").await, 404, Some("name")).await;
    assert!(unknown["detail"].as_str().expect("text").contains("did you mean `arm-6dof`"), "{unknown}");
    problem(server.get("/v1/scenarios/%ff").await, 400, None).await;
    let missing = format!("/v1/sessions/{}", uuid::Uuid::new_v4());
    for session in ["/v1/sessions/1", "/v1/sessions/..%2f", &missing] {
        for route in ["", "/events", "/recording.rrd", "/live.rrd", "/steps.csv", "/result.json", "/live"] {
            problem(server.get(&format!("{session}{route}")).await, 404, Some("id")).await;
        }
        let step = server.post(&format!("{session}/steps"), json!({ "count": 1 })).await;
        problem(step, 404, Some("id")).await;
        let delete = server.request(Method::DELETE, session).send().await.expect("an answer");
        problem(delete, 404, Some("id")).await;
    }
    for (method, path, allowed) in [
        (Method::PUT, "/v1/sessions".to_owned(), ["GET", "POST"]),
        (Method::PATCH, session.clone(), ["GET", "DELETE"]),
        (Method::GET, format!("{session}/steps"), ["POST", "POST"]),
        (Method::POST, "/".to_owned(), ["GET", "HEAD"]),
        (Method::DELETE, "/v1/openapi.json".to_owned(), ["GET", "GET"]),
    ] {
        let response = server.request(method, &path).send().await.expect("an answer");
        let allow = response.headers()["allow"].to_str().expect("text").to_owned();
        assert!(allowed.iter().all(|method| allow.contains(method)), "{path}: {allow}");
        problem(response, 405, None).await;
    }
    for (path, field) in [("live?from=x", "from"), ("live?step=-1", "step"), ("live?form=1", "form")] {
        problem(server.get(&format!("{session}/{path}")).await, 400, Some(field)).await;
    }
    problem(server.get(&format!("{session}/live")).await, 400, None).await;
    let events =
        server.request(Method::GET, &format!("{session}/events")).header("last-event-id", "first").send().await;
    problem(events.expect("an answer"), 400, Some("Last-Event-ID")).await;
    server.stop().await;
}

#[tokio::test]
async fn steps_that_cannot_be_made() {
    let server = Server::start().await;
    let session = server.open_quick(1).await;
    server.step(&session, 3).await;
    let stale = server.post(&format!("{session}/steps"), json!({ "count": 2, "expected_step": 2 })).await;
    let stale = problem(stale, 409, Some("expected_step")).await;
    assert_eq!(stale["step"], 3);
    assert_eq!(server.get_json(&session).await["step"], 3, "nothing was stepped");
    let fresh = server.post(&format!("{session}/steps"), json!({ "expected_step": 3 })).await;
    assert_eq!(fresh.status(), StatusCode::OK);

    let recorded = server.open(json!({ "scenario": "tiago-mocap" })).await;
    assert_eq!(server.get_json(&recorded).await["remaining"], 37);
    server.step(&recorded, 30).await;
    let many = server.post(&format!("{recorded}/steps"), json!({ "count": 8 })).await;
    let many = problem(many, 422, Some("count")).await;
    assert_eq!((&many["remaining"], &many["step"]), (&json!(7), &json!(30)));
    assert!(many["detail"].as_str().expect("text").contains('7'));
    assert_eq!(server.step(&recorded, 7).await["remaining"], 0);
    let over = server.post(&format!("{recorded}/steps"), json!({})).await;
    assert_eq!(problem(over, 422, Some("count")).await["remaining"], 0);
    server.stop().await;
}

#[tokio::test]
async fn foreign_pages_and_host_names() {
    let server = Server::start().await;
    let session = server.open_quick(1).await;
    let steps = format!("{session}/steps");
    for origin in ["https://example.org", "null", "http://localhost:1"] {
        let post = server.request(Method::POST, &steps).header("origin", origin).send().await;
        problem(post.expect("an answer"), 403, Some("Origin")).await;
        let delete = server.request(Method::DELETE, &session).header("origin", origin).send().await;
        problem(delete.expect("an answer"), 403, Some("Origin")).await;
        let socket = server.request(Method::GET, &format!("{session}/live")).header("origin", origin);
        let socket = socket.header("upgrade", "websocket").header("connection", "upgrade").send().await;
        problem(socket.expect("an answer"), 403, Some("Origin")).await;
    }
    let own = server.request(Method::POST, &steps).header("origin", format!("http://{}", server.address)).send().await;
    assert_eq!(own.expect("an answer").status(), StatusCode::OK);
    let rebound = server.request(Method::GET, "/v1/sessions").header("host", "example.org").send().await;
    problem(rebound.expect("an answer"), 403, Some("Host")).await;
    server.stop().await;
}

#[tokio::test]
async fn too_many_sessions() {
    let server = Server::start().await;
    let mut sessions = Vec::new();
    for seed in 0..body_schema::server::Limits::default().sessions as u64 {
        sessions.push(server.open_quick(seed).await);
    }
    let one_more = json!({ "scenario": "arm-6dof", "learners": ["random"] });
    let refused = server.post("/v1/sessions", one_more.clone()).await;
    assert!(refused.headers().contains_key("retry-after"));
    problem(refused, 503, None).await;
    server.delete(&sessions[5]).await;
    server.open(one_more).await;
    server.stop().await;
}
