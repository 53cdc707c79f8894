//! The end of the server.

use std::time::{Duration, Instant};

use reqwest::{Method, StatusCode};
use serde_json::json;

use crate::http::{
    streams::steps_of_recording,
    support::{SOON, Server},
};

#[tokio::test]
async fn shutdown_ends_streams_and_finishes_recordings() {
    let directory = tempfile::tempdir().expect("a directory");
    let data = directory.path().join("made/by/the/server");
    let server = Server::with_data_dir(Some(data.clone())).await;
    let [first, second] = [server.open_quick(1).await, server.open_quick(2).await];
    server.step(&first, 3).await;
    let file = server.get_json(&first).await["file"].as_str().expect("a file").to_owned();
    let id = first.rsplit('/').next().expect("an id");
    assert_eq!(file, format!("arm-6dof-seed1-{id}.rrd"));
    let mut events = server.get(&format!("{first}/events")).await;
    let mut live = server.get(&format!("{first}/live.rrd")).await;
    // A request is under way as well.
    let slow = server.request(Method::POST, &format!("{second}/steps")).json(&json!({ "count": 1000 }));
    let slow = tokio::spawn(slow.send());
    tokio::time::sleep(Duration::from_millis(200)).await;

    let begun = Instant::now();
    server.stop().await;
    assert!(begun.elapsed() < Duration::from_secs(10), "{:?}", begun.elapsed());
    for stream in [&mut events, &mut live] {
        while tokio::time::timeout(SOON, stream.chunk()).await.expect("the end, soon").expect("a clean end").is_some() {
        }
    }
    if let Ok(response) = slow.await.expect("no panic") {
        assert!(matches!(response.status(), StatusCode::OK | StatusCode::SERVICE_UNAVAILABLE));
    }
    let recording = std::fs::read(data.join(file)).expect("the file");
    assert_eq!(steps_of_recording(&recording), (0..=3).collect());
    assert!(
        recording.ends_with(b"FOOT") || recording.windows(4).rev().take(64).any(|tail| tail == b"FOOT"),
        "a footer"
    );
    let files = std::fs::read_dir(&data).expect("the directory").map(|file| file.expect("a file").path());
    assert_eq!(files.filter(|file| file.extension().is_some_and(|extension| extension == "rrd")).count(), 2);
}

#[tokio::test]
async fn deleting_a_session_finishes_its_file() {
    let directory = tempfile::tempdir().expect("a directory");
    let server = Server::with_data_dir(Some(directory.path().to_owned())).await;
    let session = server.open_quick(1).await;
    server.step(&session, 70).await;
    let file = server.get_json(&session).await["file"].as_str().expect("a file").to_owned();
    server.delete(&session).await;
    let recording = std::fs::read(directory.path().join(file)).expect("the file");
    assert_eq!(steps_of_recording(&recording), (0..=70).collect());
    server.stop().await;
}
