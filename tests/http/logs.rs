//! What the program tells of its requests and sessions.
#![cfg(unix)]

use std::{collections::BTreeSet, process::Command, time::Duration};

use reqwest::{Client, Method, StatusCode, redirect::Policy};
use serde_json::{Value, json};

use crate::http::{
    program::{LOG, Program},
    support::problem,
};

const TOKEN: &str = "a-token-of-a-test-9876543210";

/// The lines of a program that writes JSON, after it has ended.
fn lines(program: Program) -> Vec<Value> {
    let (code, said) = program.terminate();
    assert_eq!(code, Some(0), "{said}");
    let lines = said.lines().filter(|line| !line.starts_with("ended"));
    lines.map(|line| serde_json::from_str(line).unwrap_or_else(|error| panic!("{error}: {line}"))).collect()
}

fn of<'a>(lines: &'a [Value], request: &str) -> &'a Value {
    let mut answered = lines.iter().filter(|line| line["request"] == request && line["message"] == "answered");
    let line = answered.next().unwrap_or_else(|| panic!("no line of {request} in {lines:#?}"));
    assert!(answered.next().is_none(), "one line for {request}");
    line
}

#[tokio::test]
async fn every_request_has_an_id_and_a_line() {
    let program = Program::serve(&[(LOG, "info")], &["--log-format", "json"]);
    let asked = async |method: Method, path: &str, id: &str| {
        program.api.request(method, path).header("x-request-id", id).send().await.expect("an answer")
    };
    let health = asked(Method::GET, "/healthz?q=1", "health-1").await;
    assert_eq!(health.headers()["x-request-id"], "health-1");
    health.bytes().await.expect("a body");
    let missing = asked(Method::GET, "/v1/sessions/nobody", "missing.2").await;
    assert_eq!(problem(missing, 404, Some("id")).await["request_id"], "missing.2");
    problem(asked(Method::GET, "/secret/path", "nothing_3").await, 404, None).await;
    problem(asked(Method::DELETE, "/healthz", "wrong-4").await, 405, None).await;
    let invented = asked(Method::GET, "/healthz", "not a plain id").await;
    let invented = invented.headers()["x-request-id"].to_str().expect("text").to_owned();
    assert_eq!(invented.len(), 32, "{invented}");
    let session = program.api.open_quick(1).await;
    program.api.step(&session, 2).await;
    let mut events = asked(Method::GET, &format!("{session}/events"), "events-5").await;
    let first = events.chunk().await.expect("no error").expect("an event");
    drop(events);
    // Until the server has noticed.
    while !program.api.get("/metrics").await.text().await.expect("text").contains("body_schema_streams 0\n") {
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    program.api.delete(&session).await;
    let lines = lines(program);

    let health = of(&lines, "health-1");
    let told = ["method", "route", "status", "bytes"].map(|key| health[key].clone());
    assert_eq!(told.to_vec(), [json!("GET"), json!("/healthz"), json!(200), health["bytes"].clone()]);
    assert!(health["bytes"].as_u64() > Some(10) && health["duration_ms"].is_f64(), "{health}");
    assert!(health["timestamp"].is_string() && health["level"] == "INFO", "{health}");
    let missing = of(&lines, "missing.2");
    assert_eq!((&missing["route"], &missing["problem"]), (&json!("/v1/sessions/{id}"), &json!("unknown-session")));
    let nothing = of(&lines, "nothing_3");
    assert!(nothing["route"].is_null() && nothing["problem"] == "unknown-route", "{nothing}");
    let wrong = of(&lines, "wrong-4");
    assert_eq!((&wrong["route"], &wrong["status"]), (&json!("/healthz"), &json!(405)));
    of(&lines, &invented);
    let events = of(&lines, "events-5");
    assert!(events["cut_off"] == true && events["bytes"].as_u64() >= Some(first.len() as u64), "{events}");
    let messages: BTreeSet<&str> = lines.iter().filter_map(|line| line["message"].as_str()).collect();
    for message in ["listening", "a session was opened", "a session was deleted", "asked to end", "ended"] {
        assert!(messages.contains(message), "{message}: {messages:?}");
    }
    let opened = lines.iter().find(|line| line["message"] == "a session was opened").expect("a line");
    assert!(session.ends_with(opened["session"].as_str().expect("an id")), "{opened}");
    let asked_for = of(&lines, opened["request"].as_str().expect("the request that opened it"));
    assert_eq!(asked_for["status"], 201);
}

#[tokio::test]
async fn no_token_and_no_body_comes_into_the_log() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("token");
    std::fs::write(&file, TOKEN).expect("written");
    for format in ["text", "json"] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_body-schema"));
        command.args(["serve", "--bind", "127.0.0.1:0", "--ephemeral", "--log", "trace", "--log-format", format]);
        let program = Program::start(command.arg("--token-file").arg(&file).env(LOG, "off"));
        let browser = Client::builder().no_proxy().redirect(Policy::none()).build().expect("a client");
        let cookie = format!("body-schema-{}={TOKEN}", program.api.address.port());
        for path in
            ["/", "/healthz", "/nothing", "/v1/sessions", &format!("/{TOKEN}"), &format!("/v1/sessions/{TOKEN}")]
        {
            let url = format!("http://{}{path}?seed=1&token={TOKEN}", program.api.address);
            let body = json!({ "scenario": TOKEN, TOKEN: "swordfish" });
            for request in [
                browser.get(&url),
                browser.get(&url).bearer_auth(TOKEN).header("referer", &url),
                browser.get(&url).bearer_auth(format!("{TOKEN}-")),
                browser.get(&url).basic_auth("someone", Some(TOKEN)),
                browser
                    .get(&url)
                    .header("cookie", &cookie)
                    .header("user-agent", TOKEN)
                    .header("x-forwarded-for", TOKEN),
                browser.post(&url).bearer_auth(TOKEN).json(&body),
                browser.post(&url).header("origin", format!("http://{TOKEN}")).bearer_auth(TOKEN).json(&body),
                browser.request(Method::from_bytes(b"SWORDFISH").expect("a method"), &url).bearer_auth(TOKEN),
            ] {
                request.send().await.expect("an answer");
            }
        }
        let (code, said) = program.terminate();
        assert_eq!(code, Some(0), "{said}");
        assert!(said.lines().count() > 48, "there is a log: {said}");
        for secret in [TOKEN, "swordfish", "SWORDFISH", "someone", "seed=1"] {
            assert!(!said.contains(secret), "{secret} in the log: {said}");
        }
    }
}

#[tokio::test]
async fn the_log_has_levels_and_the_argument_goes_before_the_variable() {
    for (variable, arguments, expected) in [
        ("off", &[][..], [false, false]),
        ("warn", &[], [false, true]),
        ("info", &["--log", "warn"], [false, true]),
        ("", &[], [true, true]),
    ] {
        let program = Program::serve(&[(LOG, variable)], &[&["--max-sessions", "1"], arguments].concat());
        program.api.open_quick(1).await;
        let refused = program.api.post("/v1/sessions", json!({ "scenario": "arm-6dof" })).await;
        assert_eq!(refused.status(), StatusCode::SERVICE_UNAVAILABLE);
        let (_, said) = program.terminate();
        let told = ["INFO", "server-full"].map(|word| said.contains(word));
        assert_eq!(told, expected, "{variable} {arguments:?}: {said}");
        assert!(!said.contains('\x1b'), "no colours where no terminal is: {said}");
    }
    let wrong =
        Command::new(env!("CARGO_BIN_EXE_body-schema")).args(["serve", "--ephemeral"]).env(LOG, "loud").output();
    let wrong = wrong.expect("the program starts");
    let said = String::from_utf8_lossy(&wrong.stderr).into_owned();
    assert!(wrong.status.code() == Some(2) && said.contains("BODY_SCHEMA_LOG: `loud`"), "{said}");
}

#[tokio::test]
async fn a_log_that_nobody_reads_holds_up_nobody() {
    /// More than a pipe holds.
    const REQUESTS: usize = 1000;
    let program = Program::serve(&[(LOG, "info")], &[]);
    for _ in 0..REQUESTS {
        assert_eq!(program.api.get("/healthz").await.status(), StatusCode::OK);
    }
    let (code, said) = program.terminate();
    assert_eq!(code, Some(0));
    assert!(said.len() > 32 << 10, "{} bytes", said.len());
}
