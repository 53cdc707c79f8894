//! Many who follow one session, and do not read.
#![cfg(target_os = "linux")]

use std::time::{Duration, Instant};

use body_schema::server::{Limits, Options};
use futures_util::StreamExt;
use reqwest::Method;
use serde_json::{Value, json};
use tokio::{
    net::{TcpSocket, TcpStream},
    time::{sleep, timeout},
};
use tokio_tungstenite::{WebSocketStream, client_async, tungstenite::Message};

use crate::http::{
    program::Program,
    support::{Api, SOON, Server, problem},
};

/// So many follow at a time, unless the variable `BODY_SCHEMA_CROWD` says otherwise.
const CROWD: usize = 40;
const MIB: u64 = 1 << 20;

/// The WebSocket of a session, over a connection that holds little on its way.
async fn follow(api: &Api, session: &str) -> WebSocketStream<TcpStream> {
    let socket = TcpSocket::new_v4().expect("a socket");
    socket.set_recv_buffer_size(4 << 10).expect("a small buffer");
    let stream = socket.connect(api.address).await.expect("a connection");
    client_async(format!("ws://{}{session}/live", api.address), stream).await.expect("a WebSocket").0
}

/// Reads until the report of a step; returns how many bytes of the recording came.
async fn read_to(socket: &mut WebSocketStream<TcpStream>, last: u64) -> usize {
    let mut bytes = 0;
    loop {
        match timeout(SOON, socket.next()).await.expect("soon").expect("a message").expect("no error") {
            Message::Binary(part) => bytes += part.len(),
            Message::Text(text) => {
                let event: Value = serde_json::from_str(&text).expect("JSON");
                if event["type"] == "step" && event["data"]["step"] == last {
                    return bytes;
                }
            }
            _ => {}
        }
    }
}

#[tokio::test]
async fn a_crowd_that_does_not_read_shares_one_recording_and_holds_up_nobody() {
    let crowd = std::env::var("BODY_SCHEMA_CROWD").map_or(CROWD, |text| text.parse().expect("a number"));
    // However slow this machine is, they are not given up.
    let most = crowd.max(64).to_string();
    let program = Program::with(&["--write-timeout", "600", "--max-streams-per-session", &most]);
    let api = &program.api;
    let session = api.open_quick(1001).await;
    for _ in 0..20 {
        api.step(&session, 50).await;
    }
    // What is put together is so now.
    let recording = read_to(&mut follow(api, &session).await, 1000).await as u64;
    assert!(recording > 2 * MIB, "each of its own would be seen: {recording} bytes");
    let (before, few) = (program.memory(), program.descriptors());

    let mut sockets = Vec::new();
    for _ in 0..crowd {
        sockets.push(follow(api, &session).await);
    }
    let begun = Instant::now();
    for _ in 0..10 {
        api.step(&session, 20).await;
    }
    let (after, took) = (program.memory(), begun.elapsed());
    let each = after.saturating_sub(before) / crowd as u64;
    println!("{crowd} sockets: {each} bytes each, of a recording of {recording}; 200 steps took {took:?}");
    assert!(each < MIB, "{each} bytes each, of a recording of {recording}");
    // Who reads after all gets everything.
    let mut late = sockets.pop().expect("one of them");
    read_to(&mut late, 1200).await;
    drop(late);

    let begun = Instant::now();
    api.delete(&session).await;
    while program.descriptors() > few + 2 {
        assert!(begun.elapsed() < SOON, "{} descriptors, {few} before", program.descriptors());
        sleep(Duration::from_millis(20)).await;
    }
    // Nobody waits for them to read, but a moment.
    assert!(begun.elapsed() < Duration::from_secs(20), "{:?}", begun.elapsed());
    drop(sockets);
}

#[tokio::test]
async fn no_more_follow_a_session_than_may() {
    let limits = Limits { streams_per_session: 3, ..Limits::default() };
    let server = Server::with(Options { limits, ..Options::default() }).await;
    let [session, other] = [server.open_quick(1).await, server.open_quick(2).await];
    let socket = follow(&server, &session).await;
    let events = server.get(&format!("{session}/events")).await;
    let recording = server.get(&format!("{session}/live.rrd")).await;
    for path in ["events", "live.rrd", "live"] {
        let request = server.request(Method::GET, &format!("{session}/{path}"));
        let request = request.header("connection", "upgrade").header("upgrade", "websocket");
        let request =
            request.header("sec-websocket-version", "13").header("sec-websocket-key", "AQIDBAUGBwgJCgsMDQ4PEA==");
        let refused = request.send().await.expect("an answer");
        assert!(refused.headers().contains_key("retry-after"), "{path}");
        problem(refused, 429, None).await;
    }
    // Others are followed, and steps are made.
    assert_eq!(server.get(&format!("{other}/events")).await.status(), 200);
    assert_eq!(server.step(&session, 1).await["step"], json!(1));
    drop((socket, events, recording));
    let room = async {
        while server.get(&format!("{session}/live.rrd")).await.status() != 200 {
            sleep(Duration::from_millis(10)).await;
        }
    };
    timeout(SOON, room).await.expect("room");
    server.stop().await;
}
