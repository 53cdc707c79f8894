//! The page on a session with a robot elsewhere, whose program asks and tells over HTTP meanwhile.

use serde_json::{Value, json};

use crate::{
    browser::{
        Server,
        driver::Browser,
        pointer::{click, reads},
        scene,
    },
    http::robot::{carried_out, opening},
};

/// What the robot's program asks the server.
struct Program<'a> {
    server: &'a Server,
    http: reqwest::Client,
}

impl Program<'_> {
    async fn ask(&self, request: reqwest::RequestBuilder) -> Value {
        let response = request.send().await.expect("an answer");
        assert!(response.status().is_success(), "{}", response.text().await.unwrap_or_default());
        response.json().await.expect("JSON")
    }

    async fn post(&self, path: &str, body: &Value) -> Value {
        self.ask(self.http.post(self.server.at(path)).json(body)).await
    }

    /// Asks for a movement, and carries it out.
    async fn moves(&self, session: &str) {
        let asked = self.post(&format!("{session}/suggestions"), &json!({})).await;
        self.post(&format!("{session}/observations"), &carried_out(&asked["suggestions"][0])).await;
    }
}

pub async fn visit(page: &Browser, server: Server) {
    let program = Program { server: &server, http: reqwest::Client::new() };
    let opened = program.post("v1/sessions", &opening()).await;
    let id = opened["id"].as_str().expect("an id").to_owned();
    let session = format!("v1/sessions/{id}");
    for _ in 0..4 {
        program.moves(&session).await;
    }

    // What has happened is there.
    page.open(&server.at(&format!("?v=1&session={id}"))).await;
    page.wait_for_state("the latest observation", "state.phase === 'ready' && state.step === '4'").await;
    page.wait_for("the scene", "document.getElementById('cover').hidden").await;
    reads(page, "Waiting for the robot to ask where to move.").await;

    // Suggested from here, the robot's program is told the same; the scene shows where it is to go.
    let before = scene::once(page, |picture| picture.shows("global")).await;
    click(page, "Suggest a movement").await;
    reads(page, "Next movement: suggestion 5").await;
    page.wait_for("the legend", "document.querySelector('#legend [data-line=suggested]') !== null").await;
    scene::once(page, |picture| picture.differs_from(&before)).await;
    let asked = program.post(&format!("{session}/suggestions"), &json!({})).await;
    assert_eq!(asked["suggestions"][0]["id"], 5, "asking again gives the same");

    // What is said here reaches the session.
    click(page, "Not reachable").await;
    reads(page, "Waiting for the robot to ask where to move.").await;
    click(page, "Suggest a movement").await;
    reads(page, "suggestion 6").await;
    click(page, "Skip").await;
    click(page, "Suggest a movement").await;
    reads(page, "suggestion 7").await;
    click(page, "Not seen").await;
    page.wait_for_state("the observation", "state.step === '5'").await;
    reads(page, "5 observations, 1 of which saw nothing.").await;
    let all = program.ask(program.http.get(server.at(&format!("{session}/suggestions")))).await;
    let states: Vec<&Value> = all["suggestions"].as_array().expect("all").iter().map(|one| &one["state"]).collect();
    assert_eq!(states[4..], ["infeasible", "abandoned", "not_seen"].map(Value::from).each_ref());

    // The robot goes on, and the page with it.
    program.moves(&session).await;
    page.wait_for_state("the next observation", "state.step === '6'").await;

    // What was told counts otherwise: all is shown anew.
    let excluded = program.ask(program.http.delete(server.at(&format!("{session}/observations/5")))).await;
    assert_eq!(excluded["excluded"], json!([5]));
    page.wait_for_state("the history without it", "state.phase === 'ready' && state.step === '5'").await;
    reads(page, "6 observations, without 5, which count for nothing.").await;
    let shown = scene::once(page, |picture| picture.shows("global")).await;
    click(page, "Suggest a movement").await;
    scene::once(page, |picture| picture.differs_from(&shown)).await;

    let address = page.evaluate("location.search").await;
    assert_eq!(address, format!("?v=1&session={id}"), "it names the session and nothing else");
    // The report is a page of its own, with its style.
    for _ in 0..4 {
        program.moves(&session).await;
    }
    page.open(&server.at(&format!("{session}/report.html"))).await;
    let width = page.evaluate("getComputedStyle(document.querySelector('main')).maxWidth").await;
    assert_eq!(width, "960px", "as its style sheet says");
    page.open(&server.at(&format!("?v=1&session={id}"))).await;
    page.wait_for_state("the session again", "state.phase === 'ready'").await;
    // It was deleted by somebody else.
    program.http.delete(server.at(&session)).send().await.expect("an answer");
    reads(page, "This session was deleted.").await;
    // Either there has been a scene, or it is said that there is none: not what the viewer shows by itself.
    let cover = "document.getElementById('cover')";
    let told = format!("{cover}.hidden || {cover}.innerText.includes('There is no scene')");
    page.wait_for("a scene, or why there is none", &told).await;
    if page.evaluate(&format!("{cover}.hidden")).await == true {
        scene::once(page, |picture| picture.shows("global")).await;
    }
    click(page, "Explorer").await;
    page.wait_for_state("a session of the explorer", "state.phase === 'ready' && state.step === '1'").await;
    server.stop().await;
}
