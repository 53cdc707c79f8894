//! What somebody tried who meant no good.

use std::{
    net::{Shutdown, TcpStream as Blocking},
    time::{Duration, Instant},
};

use body_schema::server::{Limits, Options};
use reqwest::{Method, StatusCode};
use serde_json::{Value, json};
use tokio::{
    io::{AsyncReadExt, AsyncWriteExt},
    net::TcpStream,
    time::{sleep, timeout},
};

use crate::http::{
    robot,
    support::{Server, problem},
};

async fn told(server: &Server, session: &str, numbers: std::ops::Range<usize>) {
    for number in numbers {
        let observed = server.post(&format!("{session}/observations"), robot::told(&robot::posture(number))).await;
        assert_eq!(observed.status(), StatusCode::CREATED);
    }
}

async fn excluded(server: &Server, session: &str, number: usize) {
    let excluded = server.request(Method::DELETE, &format!("{session}/observations/{number}")).send().await;
    assert_eq!(excluded.expect("an answer").status(), StatusCode::OK);
}

/// A session whose history was rewritten has left memory: it neither is in the way of those that need its place nor of itself.
#[tokio::test]
async fn a_rewritten_session_makes_room_and_comes_back() {
    let limits = Limits { sessions: 3, ..Limits::default() };
    let server = Server::with(Options { limits, ..Options::default() }).await;
    let first = server.open(robot::opening()).await;
    told(&server, &first, 0..1).await;
    excluded(&server, &first, 1).await;
    let mut others = Vec::new();
    for _ in 0..3 {
        others.push(server.open(robot::opening()).await);
    }
    // Each of them wants the place of another, all at once.
    let all: Vec<&String> = others.iter().chain([&first]).collect();
    let asked = all.iter().cycle().take(40).map(|session| server.get(session));
    for answer in futures_util::future::join_all(asked).await {
        assert!(matches!(answer.status(), StatusCode::OK | StatusCode::SERVICE_UNAVAILABLE), "{}", answer.status());
    }
    assert_eq!(server.get_json(&first).await["status"]["excluded"], json!([1]));
    for session in others {
        server.delete(&session).await;
    }
    server.open(robot::opening()).await;
    server.stop().await;
}

/// Forty joints, for which a suggestion takes a while.
fn many_joints() -> Value {
    let joint = |k: usize| {
        format!(
            "<link name=\"l{}\"/><joint name=\"j{k}\" type=\"revolute\"><origin xyz=\"0.1 0 0.05\"/><parent link=\"l{k}\"/>\
             <child link=\"l{}\"/><axis xyz=\"{}\"/><limit lower=\"-1\" upper=\"1\" effort=\"1\" velocity=\"1\"/></joint>",
            k + 1,
            k + 1,
            ["1 0 0", "0 1 0", "0 0 1"][k % 3]
        )
    };
    let urdf = format!("<robot name=\"many\"><link name=\"l0\"/>{}</robot>", (0..20).map(joint).collect::<String>());
    json!({ "world": "outside", "calibration": { "robot": { "urdf": urdf }, "selection": { "evaluations": 20_000 } } })
}

/// What nobody waits for any longer ends, and meanwhile its session is in nobody's way.
#[tokio::test]
async fn suggestions_that_were_given_up_hold_up_nobody() {
    let limits = Limits { sessions: 1, ..Limits::default() };
    let server = Server::with(Options { limits, ..Options::default() }).await;
    let busy = server.open(many_joints()).await;
    let path = format!("{busy}/suggestions");
    let ask = server.request(Method::POST, &path).json(&json!({ "count": 20, "replan": true })).send();
    assert!(timeout(Duration::from_millis(300), ask).await.is_err(), "it takes longer");
    let begun = Instant::now();
    let refused = server.post("/v1/sessions", robot::opening()).await;
    assert!(begun.elapsed() < Duration::from_secs(20), "nobody waits for a session that is busy");
    if refused.status() != StatusCode::CREATED {
        problem(refused, 503, None).await;
    }
    // It soon hears of it, and lets others in.
    let opened = async {
        while server.post("/v1/sessions", robot::opening()).await.status() != StatusCode::CREATED {
            sleep(Duration::from_millis(100)).await;
        }
    };
    timeout(Duration::from_secs(50), opened).await.expect("room");
    server.stop().await;
}

/// An element with many attributes, names and titles without end: refused before anything is done with them.
#[tokio::test]
async fn what_grows_without_end_is_refused() {
    let server = Server::start().await;
    let many: String = (0..100_000).map(|k| format!(" a{k}=\"\"")).collect();
    let long = "n".repeat(1 << 20);
    let with = |key: &str, value: Value| {
        let mut opening = robot::opening();
        opening["calibration"][key] = value;
        opening
    };
    let urdf = robot::urdf();
    let cases = [
        (
            with("robot", json!({ "urdf": urdf.replacen("<link ", &format!("<link{many} "), 1) })),
            "calibration.robot.urdf",
        ),
        (with("robot", json!({ "urdf": urdf.replace("elbow", &long) })), "calibration.robot.urdf"),
        (with("robot", json!({ "urdf": urdf.replace("\"tip\"", &format!("\"{long}\"")) })), "calibration.robot.urdf"),
        (with("title", json!(long)), "calibration.title"),
        (with("name", json!(long)), "calibration.name"),
        (with("sensor", json!({ "channel": long })), "calibration.sensor.channel"),
    ];
    for (opening, field) in cases {
        let begun = Instant::now();
        let refused = server.post("/v1/sessions", opening).await;
        let refusal = problem(refused, 422, Some(field)).await;
        assert!(refusal.to_string().len() < 4000, "{field}: {}", refusal.to_string().len());
        assert!(begun.elapsed() < Duration::from_secs(20), "{field}: {:?}", begun.elapsed());
    }
    server.stop().await;
}

/// A list is there whatever it holds, and page by page.
#[tokio::test]
async fn sessions_are_listed_by_pages() {
    let folder = tempfile::tempdir().expect("a folder");
    let options = || Options { data_dir: Some(folder.path().to_owned()), ..Options::default() };
    let server = Server::with(options()).await;
    let mut opened = Vec::new();
    for _ in 0..5 {
        opened.push(server.open(robot::opening()).await.trim_start_matches("/v1/sessions/").to_owned());
    }
    told(&server, &format!("/v1/sessions/{}", opened[1]), 0..2).await;
    excluded(&server, &format!("/v1/sessions/{}", opened[1]), 1).await;
    server.stop().await;

    let newer = rusqlite::Connection::open(folder.path().join("sessions.sqlite")).expect("the store");
    newer.execute("UPDATE session SET form = 99 WHERE id = ?1", [&opened[3]]).expect("from another time");
    drop(newer);
    let server = Server::with(options()).await;
    let (mut listed, mut damaged, mut after) = (Vec::new(), Vec::new(), String::new());
    for page in 0.. {
        let found = server.get_json(&format!("/v1/sessions?limit=2{after}")).await;
        for session in found["sessions"].as_array().expect("a list") {
            listed
                .push((session["id"].as_str().expect("text").to_owned(), session["step"].as_u64().expect("a number")));
        }
        damaged.extend(found["damaged"].as_array().into_iter().flatten().cloned());
        let Some(next) = found["next"].as_str() else { break };
        after = format!("&after={next}");
        assert!(page < 4);
    }
    let wanted: Vec<(String, u64)> = [0, 1, 2, 4].map(|k| (opened[k].clone(), u64::from(k == 1))).to_vec();
    assert_eq!(listed, wanted);
    assert!(damaged.len() == 1 && damaged[0]["id"] == json!(opened[3]), "{damaged:?}");
    assert!(damaged[0]["detail"].as_str().is_some_and(|why| why.contains("update body-schema")), "{damaged:?}");
    for (query, field) in [("limit=0", "limit"), ("limit=1001", "limit"), ("after=x", "after"), ("before=x", "before")]
    {
        problem(server.get(&format!("/v1/sessions?{query}")).await, 400, Some(field)).await;
    }
    problem(server.get(&format!("/v1/sessions?after={}", uuid_of_nobody())).await, 404, Some("after")).await;
    server.stop().await;
}

/// However many there are: none is replayed, and none taken apart, to be listed.
#[tokio::test]
async fn ten_thousand_sessions_are_listed_soon_after_a_start() {
    let folder = tempfile::tempdir().expect("a folder");
    let options = || Options { data_dir: Some(folder.path().to_owned()), ..Options::default() };
    let server = Server::with(options()).await;
    let session = server.open(robot::opening()).await;
    told(&server, &session, 0..3).await;
    server.stop().await;
    let mut store = rusqlite::Connection::open(folder.path().join("sessions.sqlite")).expect("the store");
    let many = store.transaction().expect("a transaction");
    for number in 2..=10_000 {
        let copy = "INSERT INTO session (number, id, made_s, form, setup, shown, checksum, summary, counted)
                    SELECT ?1, ?2, made_s + ?1, form, setup, shown, checksum, summary, counted FROM session WHERE number = 1";
        let id = format!("{number:08x}-0000-4000-8000-000000000000");
        many.execute(copy, rusqlite::params![number, id]).expect("copied");
    }
    many.commit().expect("kept");
    drop(store);
    let server = Server::with(options()).await;
    let (begun, mut after, mut count, mut slowest) = (Instant::now(), String::new(), 0, Duration::ZERO);
    loop {
        let asked = Instant::now();
        let page = server.get_json(&format!("/v1/sessions{after}")).await;
        slowest = slowest.max(asked.elapsed());
        count += page["sessions"].as_array().expect("a list").len();
        let Some(next) = page["next"].as_str() else { break };
        after = format!("?after={next}");
    }
    println!("listed in {:?}, a page in {slowest:?}", begun.elapsed());
    assert_eq!(count, 10_000);
    // A tenth of this on a machine with nothing else to do.
    assert!(slowest < Duration::from_secs(10), "{slowest:?}");
    server.stop().await;
}

fn uuid_of_nobody() -> &'static str {
    "00000000-0000-4000-8000-000000000000"
}

/// A page deletes only what nobody else watches.
#[tokio::test]
async fn what_is_followed_is_not_deleted_by_who_asks_for_that() {
    let server = Server::start().await;
    let session = server.open_quick(1).await;
    let path = format!("{session}?if=unwatched");
    let delete = async |path: &str| server.request(Method::DELETE, path).send().await.expect("an answer");
    let following = server.get(&format!("{session}/events")).await;
    problem(delete(&path).await, 409, Some("if")).await;
    problem(delete(&format!("{session}?if=never")).await, 400, Some("if")).await;
    drop(following);
    let deleted = async {
        while delete(&path).await.status() != StatusCode::NO_CONTENT {
            sleep(Duration::from_millis(20)).await;
        }
    };
    timeout(Duration::from_secs(20), deleted).await.expect("nobody watches it any longer");
    server.stop().await;
}

/// Whoever sends a large body that is refused hears why.
#[tokio::test]
async fn a_large_refusal_is_read() {
    let server = Server::start().await;
    let address = server.address;
    let body = "x".repeat(24 << 20);
    let head = |path: &str, bytes: usize| {
        format!(
            "POST {path} HTTP/1.1\r\nhost: {address}\r\ncontent-type: application/json\r\ncontent-length: {bytes}\r\n\r\n"
        )
    };
    for (path, status) in
        [("/v1/sessions", 413); 5].into_iter().chain([("/v1/nowhere", 404), ("/v1/openapi.json", 405)])
    {
        let mut stream = TcpStream::connect(address).await.expect("a connection");
        stream.write_all(head(path, body.len()).as_bytes()).await.expect("sent");
        // All of it first, as simple clients do.
        timeout(Duration::from_secs(20), stream.write_all(body.as_bytes())).await.expect("taken").expect("no reset");
        let mut answer = String::new();
        timeout(Duration::from_secs(20), stream.read_to_string(&mut answer)).await.expect("soon").expect("no reset");
        assert!(answer.starts_with(&format!("HTTP/1.1 {status}")), "{answer}");
    }
    // One who goes on for ever does not hold the connection.
    let mut stream = Blocking::connect(address).expect("a connection");
    let head = head("/v1/sessions", 99_999_999_999);
    let forever = tokio::task::spawn_blocking(move || {
        use std::io::Write;
        let begun = Instant::now();
        drop(stream.write_all(head.as_bytes()));
        while stream.write_all(&[b'x'; 1 << 16]).is_ok() && begun.elapsed() < Duration::from_secs(30) {}
        drop(stream.shutdown(Shutdown::Both));
        begun.elapsed()
    });
    assert!(forever.await.expect("it ends") < Duration::from_secs(20));
    server.stop().await;
}

#[cfg(target_os = "linux")]
mod memory {
    use std::sync::Arc;

    use futures_util::future::join_all;
    use tokio_tungstenite::client_async;

    use super::*;
    use crate::http::program::Program;

    /// The memory stays within bounds whoever takes nothing of what is sent, and small requests are answered throughout.
    #[tokio::test]
    async fn memory_is_bounded_whoever_reads_slowly() {
        let most = if std::env::var_os("BODY_SCHEMA_LONGEST").is_some() { 256 } else { 64 };
        let program = Program::with(&["--max-memory", &most.to_string(), "--max-streams-per-session", "200"]);
        let session = program.api.open(json!({ "scenario": "arm-6dof" })).await;
        // As long as it may be.
        let step = json!({ "count": 500, "frames": 2, "reports": false });
        while program.api.post(&format!("{session}/steps"), step.clone()).await.status() == StatusCode::OK {}
        let address = program.api.address;
        let (mut slow, mut sockets) = (Vec::new(), Vec::new());
        for number in 0..60 {
            let mut stream = TcpStream::connect(address).await.expect("a connection");
            let path = ["recording.rrd", "live.rrd", "steps.csv"][number % 3];
            let request = format!("GET {session}/{path} HTTP/1.1\r\nhost: {address}\r\n\r\n");
            stream.write_all(request.as_bytes()).await.expect("sent");
            slow.push(stream);
            let stream = TcpStream::connect(address).await.expect("a connection");
            let url = format!("ws://{address}{session}/live?from=1000000&step=1000000");
            let (mut socket, _) = client_async(url, stream).await.expect("a WebSocket");
            // The head of a frame of 16 MiB, and less than that.
            let head = [0x82, 0xff, 0, 0, 0, 0, 1, 0, 0, 0, 1, 2, 3, 4];
            drop(socket.get_mut().write_all(&head).await);
            drop(timeout(Duration::from_millis(200), socket.get_mut().write_all(&vec![7; 1 << 20])).await);
            sockets.push(socket);
        }
        let api = Arc::new(program);
        let downloads = (0..8).map(|_| {
            let (api, path) = (api.clone(), format!("{session}/recording.rrd"));
            tokio::spawn(async move {
                let mut response = api.api.request(Method::GET, &path).send().await.expect("an answer");
                let status = response.status();
                let mut bytes = 0;
                while let Ok(Some(piece)) = response.chunk().await {
                    bytes += piece.len();
                }
                (status, bytes)
            })
        });
        let downloads: Vec<_> = downloads.collect();
        let (mut peak, mut slowest) = (0, Duration::ZERO);
        while !downloads.iter().all(tokio::task::JoinHandle::is_finished) {
            peak = peak.max(api.memory());
            let begun = Instant::now();
            assert_eq!(api.api.get("/healthz").await.status(), StatusCode::OK);
            slowest = slowest.max(begun.elapsed());
            sleep(Duration::from_millis(20)).await;
        }
        let outcomes: Vec<(StatusCode, usize)> =
            join_all(downloads).await.into_iter().map(|outcome| outcome.expect("no panic")).collect();
        let finished = outcomes.iter().filter(|(status, bytes)| *status == StatusCode::OK && *bytes > 1 << 20).count();
        assert!(finished >= 4, "{outcomes:?}");
        assert!(outcomes.iter().all(|(status, _)| matches!(status.as_u16(), 200 | 503)), "{outcomes:?}");
        println!("peak {} MiB, slowest {slowest:?}, {outcomes:?}", peak >> 20);
        let allowed = if most == 256 { 600 } else { 400 };
        assert!(peak >> 20 <= allowed, "{} MiB", peak >> 20);
        assert!(slowest < Duration::from_secs(5), "{slowest:?}");
        drop((slow, sockets));
    }
}
