//! Clients that keep the server waiting: they send nothing, or slowly, or too much, or do not read.

use std::time::{Duration, Instant};

use body_schema::server::{Limits, Options};
use serde_json::Value;
use tokio::{
    io::{AsyncReadExt, AsyncWriteExt},
    net::TcpStream,
    time::{sleep, timeout},
};

use crate::http::support::{SOON, Server};

/// A time that is over soon.
const BRIEF: Duration = Duration::from_millis(300);

async fn server(limits: Limits) -> Server {
    Server::with(Options { limits, ..Options::default() }).await
}

async fn connect(server: &Server) -> TcpStream {
    TcpStream::connect(server.address).await.expect("a connection")
}

/// A connection on which this was sent.
async fn sent(server: &Server, text: &str) -> TcpStream {
    let mut stream = connect(server).await;
    stream.write_all(text.as_bytes()).await.expect("written");
    stream
}

/// All that comes until the server closes the connection, or breaks it off.
async fn rest(stream: &mut TcpStream) -> String {
    let mut bytes = Vec::new();
    drop(timeout(SOON, stream.read_to_end(&mut bytes)).await.expect("the server ends it"));
    String::from_utf8(bytes).expect("text")
}

/// What comes up to the end of a head.
async fn head(stream: &mut TcpStream) -> String {
    let mut text = String::new();
    while !text.contains("\r\n\r\n") {
        let byte = timeout(SOON, stream.read_u8()).await.expect("soon").expect("a byte");
        text.push(byte.into());
    }
    text
}

fn healthz(server: &Server) -> String {
    format!("GET /healthz HTTP/1.1\r\nHost: {}\r\n\r\n", server.address)
}

/// Whether somebody who comes now is served.
async fn is_served(server: &Server) -> bool {
    let request = healthz(server).replace("\r\n\r\n", "\r\nConnection: close\r\n\r\n");
    rest(&mut sent(server, &request).await).await.starts_with("HTTP/1.1 200 ")
}

/// Waits until somebody who comes is served.
async fn room(server: &Server) {
    let room = async {
        while !is_served(server).await {
            sleep(Duration::from_millis(10)).await;
        }
    };
    timeout(SOON, room).await.expect("room");
}

#[tokio::test]
async fn a_head_that_does_not_come_in_time_ends_the_connection() {
    let server = server(Limits { header_timeout: BRIEF, ..Limits::default() }).await;
    for begun in ["", "GET /healthz HTTP/1.1\r\n", "GET /healthz HTTP/1.1\r\nHost: localhost\r\n"] {
        let mut stream = sent(&server, begun).await;
        assert_eq!(rest(&mut stream).await, "", "{begun:?}");
    }
    // However many small pieces it comes in.
    let (mut reading, mut writing) = connect(&server).await.into_split();
    let writing = tokio::spawn(async move {
        for byte in b"GET /healthz HTTP/1.1\r\nX: ".iter().chain([b'a'; 1000].iter()) {
            if writing.write_u8(*byte).await.is_err() {
                return;
            }
            sleep(BRIEF / 10).await;
        }
        panic!("it may go on for ever");
    });
    let mut bytes = Vec::new();
    drop(timeout(SOON, reading.read_to_end(&mut bytes)).await.expect("the server ends it"));
    assert!(bytes.is_empty());
    drop(reading);
    writing.await.expect("it was ended");
    server.stop().await;
}

#[tokio::test]
async fn a_connection_is_kept_between_requests_but_not_for_ever() {
    let limits = Limits { header_timeout: BRIEF, idle_timeout: 20 * BRIEF, ..Limits::default() };
    let server = server(limits).await;
    let mut stream = connect(&server).await;
    for pause in [Duration::ZERO, 2 * BRIEF, 2 * BRIEF] {
        sleep(pause).await;
        stream.write_all(healthz(&server).as_bytes()).await.expect("it is still open");
        assert!(head(&mut stream).await.starts_with("HTTP/1.1 200"), "after {pause:?}");
        let mut body = [0; 1];
        while body[0] != b'}' {
            stream.read_exact(&mut body).await.expect("the body");
        }
    }
    assert_eq!(rest(&mut stream).await, "");
    server.stop().await;
}

#[tokio::test]
async fn a_body_that_does_not_come_in_time_is_told() {
    let server = server(Limits { body_timeout: BRIEF, ..Limits::default() }).await;
    let begun = format!(
        "POST /v1/sessions HTTP/1.1\r\nHost: {}\r\nContent-Type: application/json\r\nContent-Length: 100\r\n\r\n{{",
        server.address
    );
    let answer = rest(&mut sent(&server, &begun).await).await;
    assert!(answer.starts_with("HTTP/1.1 408 "), "{answer}");
    let (head, body) = answer.split_once("\r\n\r\n").expect("a body");
    assert!(head.contains("content-type: application/problem+json") && head.contains("connection: close"), "{head}");
    let problem: Value = serde_json::from_str(body).expect("JSON");
    assert_eq!(problem["type"], "urn:body-schema:problem:body-too-slow");
    server.stop().await;
}

#[tokio::test]
async fn a_head_that_is_too_large_is_told() {
    let server = server(Limits::default()).await;
    let long = format!(
        "GET /healthz HTTP/1.1\r\nHost: {}\r\nConnection: close\r\nX: {}\r\n\r\n",
        server.address,
        "a".repeat(40_000)
    );
    let many = format!(
        "GET /healthz HTTP/1.1\r\nHost: {}\r\nConnection: close\r\n{}\r\n",
        server.address,
        "X: a\r\n".repeat(200)
    );
    for (head, names) in [(long, "32768 bytes"), (many, "100 header fields")] {
        let answer = rest(&mut sent(&server, &head).await).await;
        let (head, body) = answer.split_once("\r\n\r\n").expect("a body");
        assert!(head.starts_with("HTTP/1.1 431 ") && head.contains("x-request-id: "), "{head}");
        let problem: Value = serde_json::from_str(body).expect("JSON");
        assert_eq!(problem["type"], "urn:body-schema:problem:head-too-large");
        assert!(problem["detail"].as_str().is_some_and(|detail| detail.contains(names)), "{problem}");
    }
    // Not even read, and counted all the same.
    let endless = format!("GET /healthz HTTP/1.1\r\nHost: {}\r\nX: {}\r\n\r\n", server.address, "a".repeat(400_000));
    let mut stream = connect(&server).await;
    // It is closed in the midst of this.
    drop(stream.write_all(endless.as_bytes()).await);
    let answer = rest(&mut stream).await;
    assert!(answer.is_empty() || answer.starts_with("HTTP/1.1 431 "), "{answer}");
    let figures = server.get("/metrics").await.text().await.expect("figures");
    assert!(figures.contains("body_schema_heads_refused_total 1\n"), "{figures}");
    server.stop().await;
}

#[tokio::test]
async fn requests_without_a_host_or_with_two_are_malformed() {
    let server = server(Limits::default()).await;
    for hosts in ["", "Host: localhost\r\nHost: localhost\r\n"] {
        for version in ["1.1", "1.0"] {
            let request = format!("GET /healthz HTTP/{version}\r\n{hosts}Connection: close\r\n\r\n");
            let answer = rest(&mut sent(&server, &request).await).await;
            assert!(answer.starts_with(&format!("HTTP/{version} 400 ")), "{answer}");
            let (_, body) = answer.split_once("\r\n\r\n").expect("a body");
            let problem: Value = serde_json::from_str(body).expect("JSON");
            assert_eq!((&problem["status"], &problem["field"]), (&400.into(), &"Host".into()));
        }
    }
    server.stop().await;
}

#[tokio::test]
async fn another_protocol_is_not_spoken() {
    let server = server(Limits::default()).await;
    // HTTP/2 as it is begun by those who know that it is spoken, and as it is asked for.
    let mut stream = sent(&server, "PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n").await;
    let answer = rest(&mut stream).await;
    assert!(answer.is_empty() || answer.starts_with("HTTP/1.1 400 "), "{answer}");
    let asked = format!(
        "GET /healthz HTTP/1.1\r\nHost: {}\r\nConnection: Upgrade, HTTP2-Settings, close\r\nUpgrade: h2c\r\n\
         HTTP2-Settings: AAMAAABkAAQAAP__\r\n\r\n",
        server.address
    );
    assert!(rest(&mut sent(&server, &asked).await).await.starts_with("HTTP/1.1 200 "));
    let hello = rest(&mut sent(&server, "\u{16}\u{3}\u{1}\u{2}\u{0}\u{1}\r\n\r\n").await).await;
    assert!(hello.starts_with("HTTP/1.1 400 "), "{hello}");
    server.stop().await;
}

#[tokio::test]
async fn who_waits_longest_makes_room_for_who_asks() {
    let server = server(Limits { connections: 8, ..Limits::default() }).await;
    let mut half_open = Vec::new();
    for _ in 0..60 {
        half_open.push(sent(&server, "GET /healthz HTTP/1.1\r\n").await);
    }
    let begun = Instant::now();
    assert!(is_served(&server).await);
    // Long before anybody's time is over.
    assert!(begun.elapsed() < Limits::default().header_timeout, "{:?}", begun.elapsed());
    assert_eq!(rest(&mut half_open[0]).await, "", "the first had waited longest");
    server.stop().await;
}

#[tokio::test]
async fn where_all_are_busy_a_newcomer_is_told_so() {
    let server = server(Limits { connections: 3, ..Limits::default() }).await;
    let session = server.open_quick(1).await;
    let follow = format!("GET {session}/live.rrd HTTP/1.1\r\nHost: {}\r\n\r\n", server.address);
    let mut following = Vec::new();
    for _ in 0..3 {
        let mut stream = sent(&server, &follow).await;
        assert!(head(&mut stream).await.starts_with("HTTP/1.1 200 "));
        following.push(stream);
    }
    let answer = rest(&mut connect(&server).await).await;
    assert!(answer.starts_with("HTTP/1.1 503 Service Unavailable\r\n"), "{answer}");
    let (head, body) = answer.split_once("\r\n\r\n").expect("a body");
    assert!(head.contains("retry-after: ") && head.contains("connection: close"), "{head}");
    let problem: Value = serde_json::from_str(body).expect("JSON");
    assert_eq!(problem["type"], "urn:body-schema:problem:server-full");
    // As soon as one goes there is room.
    following.pop();
    room(&server).await;
    server.stop().await;
}

#[tokio::test]
async fn who_takes_nothing_of_a_long_answer_is_given_up() {
    let limits = Limits { connections: 2, write_timeout: BRIEF, ..Limits::default() };
    let server = server(limits).await;
    let viewer = format!("GET /viewer/re_viewer_bg.wasm HTTP/1.1\r\nHost: {}\r\n\r\n", server.address);
    let mut slow = Vec::new();
    for _ in 0..2 {
        let mut stream = sent(&server, &viewer).await;
        assert!(head(&mut stream).await.starts_with("HTTP/1.1 200 "));
        slow.push(stream);
    }
    room(&server).await;
    server.stop().await;
}
