//! The program is asked to end while its clients hold on.
#![cfg(unix)]

use std::{
    path::Path,
    time::{Duration, Instant},
};

use tokio::{
    io::{AsyncReadExt, AsyncWriteExt},
    net::TcpStream,
};

use crate::{
    cli::heard::is_heard,
    http::{program::Program, streams::steps_of_recording},
};

/// Ending takes five seconds at most; the machine that runs this may be busy.
const SOON: Duration = Duration::from_secs(8);

/// Clients that would hold up an end that waits for them.
async fn stubborn(program: &Program, session: &str) -> Vec<TcpStream> {
    let host = program.api.address;
    let socket = format!(
        "GET {session}/live HTTP/1.1\r\nHost: {host}\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n\
         Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AQIDBAUGBwgJCgsMDQ4PEA==\r\n\r\n"
    );
    let unread = format!("GET /viewer/re_viewer_bg.wasm HTTP/1.1\r\nHost: {host}\r\n\r\n");
    let unfinished = format!(
        "POST {session}/steps HTTP/1.1\r\nHost: {host}\r\nContent-Type: application/json\r\nContent-Length: 99\r\n\r\n{{"
    );
    let mut clients = Vec::new();
    for text in ["", "GET /heal", &socket, &unread, &unfinished] {
        let mut client = TcpStream::connect(host).await.expect("a connection");
        client.write_all(text.as_bytes()).await.expect("written");
        clients.push(client);
    }
    // Those that are answered have been.
    for client in &mut clients[2..4] {
        client.read_u8().await.expect("an answer");
    }
    clients
}

/// Whether a recording is complete.
fn has_footer(file: &Path) -> bool {
    std::fs::read(file).is_ok_and(|recording| recording.windows(4).rev().take(64).any(|tail| tail == b"FOOT"))
}

#[tokio::test]
async fn any_signal_ends_the_server_soon_and_well_whatever_its_clients_do() {
    for signal in ["TERM", "INT", "HUP"].into_iter().filter(|signal| is_heard(signal)) {
        let folder = tempfile::tempdir().expect("a folder");
        let program = Program::keeping(folder.path());
        let session = program.api.open_quick(1).await;
        program.api.step(&session, 300).await;
        let file = program.api.get_json(&session).await["file"].as_str().expect("a file").to_owned();
        let clients = stubborn(&program, &session).await;
        let begun = Instant::now();
        program.signal(signal);
        let (code, said) = program.end();
        assert!(begun.elapsed() < SOON, "{signal}: {:?}", begun.elapsed());
        assert_eq!((code, said.as_str()), (Some(0), "ended; every recording is complete\n"), "{signal}");
        drop(clients);
        let file = folder.path().join(file);
        assert_eq!(steps_of_recording(&std::fs::read(&file).expect("the file")), (0..=300).collect());
        assert!(has_footer(&file), "{signal}: a footer");
    }
}

#[tokio::test]
async fn a_second_signal_ends_it_at_once() {
    let folder = tempfile::tempdir().expect("a folder");
    let program = Program::keeping(folder.path());
    let session = program.api.open_quick(1).await;
    program.api.step(&session, 3).await;
    let file = program.api.get_json(&session).await["file"].as_str().expect("a file").to_owned();
    let clients = stubborn(&program, &session).await;
    program.signal("TERM");
    // The first has been heard once the recording is complete; what is waited for from then on are the clients.
    let file = folder.path().join(file);
    let asked = Instant::now();
    while !has_footer(&file) && asked.elapsed() < SOON {
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    let begun = Instant::now();
    program.signal("INT");
    assert_eq!(program.end().0, Some(130));
    assert!(begun.elapsed() < Duration::from_secs(2), "{:?}", begun.elapsed());
    drop(clients);
    assert!(has_footer(&file));
}
