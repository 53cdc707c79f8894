//! A server on a port of its own, and a client for it.

use std::{
    net::{Ipv4Addr, SocketAddr},
    ops::Deref,
    path::PathBuf,
    time::Duration,
};

use body_schema::server::{Options, ServerError, serve};
use reqwest::{Client, Method, RequestBuilder, Response, StatusCode};
use serde_json::{Value, json};
use tokio::{net::TcpListener, task::JoinHandle, time::timeout};
use tokio_util::sync::CancellationToken;

/// Whatever takes longer than this hangs.
pub const SOON: Duration = Duration::from_secs(60);

/// A server within the test's own process.
pub struct Server {
    api: Api,
    shutdown: CancellationToken,
    serving: JoinHandle<Result<(), ServerError>>,
}

impl Server {
    pub async fn start() -> Self {
        Self::with_data_dir(None).await
    }

    pub async fn with_data_dir(data_dir: Option<PathBuf>) -> Self {
        Self::with(Options { keep_recordings: data_dir.is_some(), data_dir, ..Options::default() }).await
    }

    pub async fn with(options: Options) -> Self {
        Self::at("127.0.0.1:0", options).await
    }

    /// A server that listens on an address, and is asked from this machine.
    pub async fn at(address: &str, options: Options) -> Self {
        let listener = TcpListener::bind(address).await.expect("a free port");
        let address = (Ipv4Addr::LOCALHOST, listener.local_addr().expect("an address").port()).into();
        let shutdown = CancellationToken::new();
        let serving = tokio::spawn(serve(listener, options, shutdown.clone()));
        Self { api: Api::at(address), shutdown, serving }
    }

    /// Shuts the server down and waits for it.
    pub async fn stop(self) {
        self.shutdown.cancel();
        let ended = timeout(SOON, self.serving).await.expect("the server ends");
        ended.expect("no panic").expect("no error");
    }
}

impl Deref for Server {
    type Target = Api;

    fn deref(&self) -> &Api {
        &self.api
    }
}

/// What a server can be asked.
pub struct Api {
    pub address: SocketAddr,
    pub client: Client,
}

impl Api {
    pub fn at(address: SocketAddr) -> Self {
        Self { address, client: Client::builder().no_proxy().build().expect("a client") }
    }

    pub fn request(&self, method: Method, path: &str) -> RequestBuilder {
        self.client.request(method, format!("http://{}{path}", self.address))
    }

    pub async fn get(&self, path: &str) -> Response {
        timeout(SOON, self.request(Method::GET, path).send()).await.expect("an answer soon").expect("an answer")
    }

    pub async fn get_json(&self, path: &str) -> Value {
        let response = self.get(path).await;
        assert_eq!(response.status(), StatusCode::OK, "{path}");
        response.json().await.expect("JSON")
    }

    pub async fn post(&self, path: &str, body: Value) -> Response {
        let request = self.request(Method::POST, path).json(&body).send();
        timeout(SOON, request).await.expect("an answer soon").expect("an answer")
    }

    /// Opens a session and returns its path.
    pub async fn open(&self, body: Value) -> String {
        let response = self.post("/v1/sessions", body).await;
        assert_eq!(response.status(), StatusCode::CREATED);
        response.headers()["location"].to_str().expect("text").to_owned()
    }

    /// A session of two quick learners.
    pub async fn open_quick(&self, seed: u64) -> String {
        self.open(json!({ "scenario": "arm-6dof", "seed": seed, "learners": ["random", "gradient"] })).await
    }

    /// Makes steps and returns what the server says of them.
    pub async fn step(&self, session: &str, count: u64) -> Value {
        let response = self.post(&format!("{session}/steps"), json!({ "count": count })).await;
        assert_eq!(response.status(), StatusCode::OK);
        response.json().await.expect("JSON")
    }

    pub async fn delete(&self, session: &str) {
        let response = self.request(Method::DELETE, session).send().await.expect("an answer");
        assert_eq!(response.status(), StatusCode::NO_CONTENT);
    }
}

/// An error as every error must be.
pub async fn problem(response: Response, status: u16, field: Option<&str>) -> Value {
    let url = response.url().clone();
    assert_eq!(response.status().as_u16(), status, "{url}");
    assert_eq!(response.headers()["content-type"], "application/problem+json", "{url}");
    let problem: Value = response.json().await.expect("JSON");
    assert_eq!(problem["status"], status, "{url}: {problem}");
    for member in ["type", "title", "detail"] {
        assert!(problem[member].as_str().is_some_and(|text| !text.is_empty()), "{url}: no {member} in {problem}");
    }
    assert_eq!(problem.get("field").and_then(Value::as_str), field, "{url}: {problem}");
    problem
}

/// Steps of the reports in an answer.
pub fn steps(reports: &Value) -> Vec<u64> {
    let reports = reports.as_array().expect("reports");
    reports.iter().map(|report| report["step"].as_u64().expect("a step")).collect()
}

/// A report without the wall times, which differ from run to run.
pub fn timeless(report: &Value) -> Value {
    let mut report = report.clone();
    for learner in report["learners"].as_array_mut().expect("learners") {
        if let Some(movement) = learner["movement"].as_object_mut() {
            movement.remove("selection_ms");
        }
    }
    report
}
