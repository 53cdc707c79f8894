//! Following sessions: events, recordings and the WebSocket.

use std::{collections::BTreeSet, io::Cursor};

use body_schema::server::{Limits, Options};
use futures_util::{SinkExt, StreamExt};
use re_chunk::Chunk;
use re_log_encoding::DecoderApp;
use re_log_types::LogMsg;
use reqwest::Method;
use serde_json::Value;
use tokio::{net::TcpStream, time::timeout};
use tokio_tungstenite::{
    WebSocketStream, client_async,
    tungstenite::{Message, protocol::frame::coding::CloseCode},
};

use crate::http::{
    robot,
    support::{SOON, Server, timeless},
};

/// The chunks of a recording, without those of its blueprint.
fn chunks_of_recording(bytes: &[u8]) -> impl Iterator<Item = Chunk> {
    let messages = DecoderApp::decode_eager(Cursor::new(bytes.to_vec())).expect("a recording");
    messages.filter_map(|message| match message.expect("a message") {
        LogMsg::ArrowMsg(store, message) if store.is_recording() => {
            Some(Chunk::from_arrow_msg(&message).expect("a chunk"))
        }
        _ => None,
    })
}

/// All steps for which a recording holds data.
pub fn steps_of_recording(bytes: &[u8]) -> BTreeSet<i64> {
    let moving = chunks_of_recording(bytes).filter(|chunk| !chunk.is_static());
    moving
        .flat_map(|chunk| {
            let steps = chunk.iter_indices(&"step".into()).map(|(step, _)| step.as_i64());
            steps.collect::<Vec<_>>()
        })
        .collect()
}

/// What a recording says of an experiment, row by row in an order of its own: without times, and without the ids that Rerun draws.
pub fn rows_of_recording(bytes: &[u8]) -> Vec<String> {
    let mut rows = Vec::new();
    for chunk in chunks_of_recording(bytes) {
        let entity = chunk.entity_path().to_string();
        if entity.ends_with("/selection_ms") {
            continue;
        }
        let steps = chunk.timelines().get(&"step".into()).map(|steps| steps.times_raw());
        for component in chunk.components_identifiers().filter(|one| !one.as_str().ends_with("start_time")) {
            for (row, id) in chunk.row_ids().enumerate() {
                if let Some(cell) = chunk.cell(id, component) {
                    let step = steps.map(|steps| steps[row]);
                    rows.push(format!("{entity} {step:?} {component} {cell:?}"));
                }
            }
        }
    }
    rows.sort();
    rows
}

/// The WebSocket of a session.
async fn follow(server: &Server, session: &str, query: &str) -> WebSocketStream<TcpStream> {
    let stream = TcpStream::connect(server.address).await.expect("a connection");
    let url = format!("ws://{}{session}/live{query}", server.address);
    client_async(url, stream).await.expect("a WebSocket").0
}

/// The text messages of a session's WebSocket, up to the report of a step and the status that goes with it.
pub async fn first_messages(server: &Server, session: &str, last: u64) -> Vec<Value> {
    let mut socket = follow(server, session, "").await;
    let mut messages: Vec<Value> = Vec::new();
    let is_last = |message: &Value| message["type"] == "step" && message["data"]["step"] == last;
    while !(messages.iter().any(is_last) && messages.iter().any(|message| message["type"] == "status")) {
        let message = timeout(SOON, socket.next()).await.expect("soon").expect("a message").expect("no error");
        if let Message::Text(text) = message {
            messages.push(serde_json::from_str(&text).expect("JSON"));
        }
    }
    messages
}

/// The events of a stream, as they come.
struct Events {
    response: reqwest::Response,
    text: String,
}

impl Events {
    async fn open(server: &Server, session: &str, last: Option<u64>) -> Self {
        Self::after(server, session, last.map(|last| last.to_string())).await
    }

    async fn after(server: &Server, session: &str, last: Option<String>) -> Self {
        let request = server.request(Method::GET, &format!("{session}/events"));
        let request = last.into_iter().fold(request, |request, last| request.header("last-event-id", last));
        let response = request.send().await.expect("an answer");
        assert_eq!(response.status(), 200);
        assert!(response.headers()["content-type"].to_str().expect("text").starts_with("text/event-stream"));
        Self { response, text: String::new() }
    }

    /// The next event: its id and its data; `None` at the end.
    async fn next(&mut self) -> Option<(u64, Value)> {
        loop {
            if let Some((event, rest)) = self.text.split_once("\n\n") {
                let line = |name: &str| event.lines().find_map(|line| line.strip_prefix(name)).map(str::trim);
                let event = line("id:").zip(line("data:")).map(|(id, data)| {
                    (
                        id.rsplit(':').next().and_then(|step| step.parse().ok()).expect("a step"),
                        serde_json::from_str(data).expect("JSON"),
                    )
                });
                self.text = rest.to_owned();
                if event.is_some() {
                    return event;
                }
                continue;
            }
            let more = timeout(SOON, self.response.chunk()).await.expect("an event soon").expect("a connection")?;
            self.text.push_str(std::str::from_utf8(&more).expect("text"));
        }
    }
}

/// The steps of a session's events, up to `last`.
pub async fn steps_of_events(server: &Server, session: &str, last: u64) -> Vec<u64> {
    let mut events = Events::open(server, session, None).await;
    let mut steps = Vec::new();
    while steps.last() != Some(&last) {
        steps.push(events.next().await.expect("an event").0);
    }
    steps
}

/// After an observation was excluded, steps count anew: whoever resumes in the old count is told so, and told all.
#[tokio::test]
async fn events_of_a_rewritten_history_begin_anew() {
    let server = Server::start().await;
    let session = server.open(robot::opening()).await;
    let observe = async |number: usize| {
        let told = robot::told(&robot::posture(number));
        assert_eq!(server.post(&format!("{session}/observations"), told).await.status(), 201);
    };
    for number in 0..5 {
        observe(number).await;
    }
    let excluded = server.request(Method::DELETE, &format!("{session}/observations/2")).send().await;
    assert_eq!(excluded.expect("an answer").status(), 200);
    observe(5).await;
    let lines = async |last: &str, count: usize| {
        let request = server.request(Method::GET, &format!("{session}/events")).header("last-event-id", last);
        let mut response = request.send().await.expect("an answer");
        let mut text = String::new();
        while text.matches("\n\n").count() < count {
            let more = timeout(SOON, response.chunk()).await.expect("an event soon").expect("a connection");
            text.push_str(std::str::from_utf8(&more.expect("more")).expect("text"));
        }
        let wanted = |line: &&str| line.starts_with("id:") || line.starts_with("event:") || line.contains("rewritten");
        text.lines().filter(wanted).map(|line| line.replace(": ", ":")).collect::<Vec<String>>()
    };
    let anew: Vec<String> = ["event:reset", "data:{\"rewritten\":1}"]
        .map(str::to_owned)
        .into_iter()
        .chain((0..=5).map(|step| format!("id:1:{step}")))
        .collect();
    assert_eq!(lines("5", 7).await, anew);
    assert_eq!(lines("1:3", 2).await, ["id:1:4", "id:1:5"]);
    assert_eq!(lines("2:3", 7).await, anew);
    server.stop().await;
}

#[tokio::test]
async fn events_tell_late_visitors_everything_and_resume() {
    let server = Server::start().await;
    let session = server.open_quick(1).await;
    let mut early = Events::open(&server, &session, None).await;
    assert_eq!(early.next().await.expect("step 0").0, 0);
    let made = server.step(&session, 4).await;
    let mut late = Events::open(&server, &session, None).await;
    assert_eq!(late.next().await.expect("step 0").0, 0);
    let mut resumed = Events::open(&server, &session, Some(2)).await;
    for step in 1..=4 {
        let report = &made["reports"][step - 1];
        for (events, first) in [(&mut early, 1), (&mut late, 1), (&mut resumed, 3)] {
            if step >= first {
                assert_eq!(&events.next().await.expect("an event"), &(step as u64, report.clone()));
            }
        }
    }
    assert!(early.next_is_later(&server, &session).await);
    server.delete(&session).await;
    for events in [&mut late, &mut resumed] {
        assert_eq!(events.next().await.expect("the fifth").0, 5);
        assert!(events.next().await.is_none(), "the stream ends with the session");
    }
    server.stop().await;
}

impl Events {
    /// Whether an event comes when, and only when, a step is made.
    async fn next_is_later(&mut self, server: &Server, session: &str) -> bool {
        assert!(timeout(std::time::Duration::from_millis(100), self.response.chunk()).await.is_err(), "nothing yet");
        let made = server.step(session, 1).await;
        let (step, report) = self.next().await.expect("an event");
        step == 5 && timeless(&report) == timeless(&made["reports"][0])
    }
}

#[tokio::test]
async fn the_live_recording_grows_and_ends_with_the_session() {
    let server = Server::start().await;
    let session = server.open_quick(1).await;
    server.step(&session, 2).await;
    let mut live = server.get(&format!("{session}/live.rrd")).await;
    let mut bytes = Vec::new();
    let until = async |live: &mut reqwest::Response, bytes: &mut Vec<u8>, last: i64| {
        while !steps_of_recording(bytes).contains(&last) {
            bytes.extend(timeout(SOON, live.chunk()).await.expect("soon").expect("a connection").expect("more"));
        }
    };
    bytes.extend(live.chunk().await.expect("a connection").expect("the header"));
    until(&mut live, &mut bytes, 2).await;
    server.step(&session, 3).await;
    until(&mut live, &mut bytes, 5).await;
    assert_eq!(steps_of_recording(&bytes), (0..=5).collect());
    server.delete(&session).await;
    while let Some(more) = timeout(SOON, live.chunk()).await.expect("the end, soon").expect("a connection") {
        bytes.extend(more);
    }
    assert_eq!(steps_of_recording(&bytes), (0..=5).collect());
    server.stop().await;
}

#[tokio::test]
async fn the_websocket_carries_reports_and_recording_and_resumes() {
    let server = Server::start().await;
    let session = server.open_quick(1).await;
    server.step(&session, 3).await;
    let mut whole = follow(&server, &session, "").await;
    let (mut parts, mut steps) = (Vec::new(), Vec::new());
    let first = timeout(SOON, whole.next()).await.expect("soon").expect("a message").expect("no error");
    let first: Value = serde_json::from_str(first.to_text().expect("text")).expect("JSON");
    assert_eq!((first["type"].as_str(), first["data"]["seed"].as_u64()), (Some("description"), Some(1)));
    while steps.last() != Some(&3) {
        match timeout(SOON, whole.next()).await.expect("soon").expect("a message").expect("no error") {
            Message::Binary(part) => parts.push(part),
            Message::Text(text) => {
                let event: Value = serde_json::from_str(&text).expect("JSON");
                assert_eq!(event["type"], "step");
                let step = event["data"]["step"].as_u64().expect("a step");
                assert!(steps_of_recording(&parts.concat()).contains(&(step as i64)), "its recording came before");
                steps.push(step);
            }
            other => panic!("unexpected: {other:?}"),
        }
    }
    assert_eq!(steps, [0, 1, 2, 3]);
    assert_eq!(parts[0].len(), 12);

    let mut resumed = follow(&server, &session, &format!("?from={}&step=4", parts.len())).await;
    resumed.next().await.expect("a message").expect("the description");
    server.step(&session, 1).await;
    let mut bytes = parts[0].to_vec();
    loop {
        match timeout(SOON, resumed.next()).await.expect("soon").expect("a message").expect("no error") {
            Message::Binary(part) => bytes.extend_from_slice(&part),
            Message::Text(text) => {
                let event: Value = serde_json::from_str(&text).expect("JSON");
                assert_eq!(event["data"]["step"], 4, "only what is new");
                break;
            }
            other => panic!("unexpected: {other:?}"),
        }
    }
    assert!(steps_of_recording(&bytes).contains(&4), "a later part stands by itself after the header");
    resumed.close(None).await.expect("closed");

    server.delete(&session).await;
    let mut last = None;
    while let Some(Ok(message)) = timeout(SOON, whole.next()).await.expect("the end, soon") {
        last = Some(message);
    }
    let Some(Message::Close(Some(frame))) = last else { panic!("no reason: {last:?}") };
    assert_eq!(frame.code, CloseCode::from(4404));
    drop(whole.flush().await);
    server.stop().await;
}

#[tokio::test]
async fn whoever_is_far_behind_gets_parts_put_together() {
    let server = Server::start().await;
    let session = server.open_quick(1).await;
    // Somebody watches, so that each step is written at once.
    let early = server.get(&format!("{session}/live.rrd")).await;
    for _ in 0..30 {
        server.step(&session, 1).await;
    }
    drop(early);
    // A download completes the recording: nothing is left for a quiet moment, which might be now.
    assert!(server.get(&format!("{session}/recording.rrd")).await.status().is_success());
    // A late visitor: header, one part, the index of the next, and then every report.
    let mut late = follow(&server, &session, "").await;
    let (mut parts, mut next, mut steps) = (Vec::new(), 0, Vec::new());
    while steps.last() != Some(&30) {
        match timeout(SOON, late.next()).await.expect("soon").expect("a message").expect("no error") {
            Message::Binary(part) => parts.push(part),
            Message::Text(text) => {
                let event: Value = serde_json::from_str(&text).expect("JSON");
                match event["type"].as_str() {
                    Some("parts") => next = event["data"]["next"].as_u64().expect("an index"),
                    Some("step") => steps.push(event["data"]["step"].as_u64().expect("a step")),
                    _ => {}
                }
            }
            other => panic!("unexpected: {other:?}"),
        }
    }
    assert_eq!(steps, (0..=30).collect::<Vec<_>>());
    assert!(parts.len() < 10, "{} parts", parts.len());
    assert_eq!(steps_of_recording(&parts.concat()), (0..=30).collect());
    // It resumes from there.
    let mut resumed = follow(&server, &session, &format!("?from={next}&step=31")).await;
    resumed.next().await.expect("a message").expect("the description");
    server.step(&session, 1).await;
    let mut bytes = parts[0].to_vec();
    while let Message::Binary(part) =
        timeout(SOON, resumed.next()).await.expect("soon").expect("one").expect("no error")
    {
        bytes.extend_from_slice(&part);
    }
    // What was left for a quiet moment may come with it; nothing is lost.
    assert!(steps_of_recording(&bytes).contains(&31));
    server.stop().await;
}

#[tokio::test]
async fn a_client_that_does_not_read_holds_nobody_up() {
    // However slow this machine is, it is not given up.
    let limits = Limits { write_timeout: 10 * SOON, ..Limits::default() };
    let server = Server::with(Options { limits, ..Options::default() }).await;
    let session = server.open_quick(1).await;
    let mut slow = follow(&server, &session, "").await;
    // More than the buffers between the two hold.
    for _ in 0..20 {
        timeout(SOON, server.step(&session, 50)).await.expect("steps are made all the same");
    }
    let (mut steps, mut bytes) = (Vec::new(), Vec::new());
    while steps.last() != Some(&1000) {
        match timeout(SOON, slow.next()).await.expect("soon").expect("a message").expect("no error") {
            Message::Binary(part) => bytes.extend_from_slice(&part),
            Message::Text(text) => {
                let event: Value = serde_json::from_str(&text).expect("JSON");
                if event["type"] == "step" {
                    steps.push(event["data"]["step"].as_u64().expect("a step"));
                }
            }
            other => panic!("unexpected: {other:?}"),
        }
    }
    assert_eq!(steps, (0..=1000).collect::<Vec<_>>(), "each report once");
    assert_eq!(steps_of_recording(&bytes), (0..=1000).collect());
    server.stop().await;
}
