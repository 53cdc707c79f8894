//! Sessions with robots elsewhere when the server dies.

use std::{
    collections::BTreeMap,
    process::Command,
    time::{Duration, SystemTime},
};

use reqwest::{Method, StatusCode};
use serde_json::{Value, json};

use crate::http::{program::Program, robot, support::Api};

/// So many observations are posted while the server is killed.
const OBSERVATIONS: usize = 50;

async fn post(api: &Api, session: &str, number: usize) -> reqwest::Result<reqwest::Response> {
    let request = api.request(Method::POST, &format!("{session}/observations"));
    let request = request.header("idempotency-key", format!("observation {number}"));
    request.json(&robot::told(&robot::posture(number))).send().await
}

/// Killed at a random moment, again and again: `BODY_SCHEMA_KILLS` says how often, 2 unless it does.
#[tokio::test]
async fn a_killed_server_loses_no_observation_and_counts_none_twice() {
    let kills = std::env::var("BODY_SCHEMA_KILLS").ok().and_then(|kills| kills.parse().ok()).unwrap_or(2);
    let folder = tempfile::tempdir().expect("a folder");
    for _ in 0..kills {
        let program = Program::keeping(folder.path());
        let session = program.api.open(robot::opening()).await;
        let suggestions = format!("{session}/suggestions");
        let asked = program.api.post(&suggestions, json!({ "client": "arm", "count": 2 })).await;
        assert_eq!(asked.status(), StatusCode::OK);
        let pending = program.api.get_json(&suggestions).await["suggestions"].clone();
        let clock = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).expect("a time").subsec_nanos();
        let (last, moment) = (clock as usize % OBSERVATIONS, Duration::from_micros(u64::from(clock) % 7_000));
        let mut answers = BTreeMap::new();
        for number in 0..last {
            let answer = post(&program.api, &session, number).await.expect("an answer");
            assert_eq!(answer.status(), StatusCode::CREATED);
            answers.insert(number, answer.json::<Value>().await.expect("JSON"));
        }
        // The next one is under way.
        let api = Api::at(program.api.address);
        let path = session.clone();
        let under_way = tokio::spawn(async move {
            let answer = post(&api, &path, last).await.ok()?;
            answer.json::<Value>().await.ok()
        });
        tokio::time::sleep(moment).await;
        program.kill();
        answers.extend(under_way.await.expect("no panic").map(|answer| (last, answer)));

        let program = Program::keeping(folder.path());
        let moment = format!("killed {moment:?} after observation {last} was sent");
        assert_eq!(program.api.get_json(&suggestions).await["suggestions"], pending, "{moment}");
        let told = program.api.get_json(&format!("{session}/observations")).await;
        let told = told["observations"].as_array().expect("a list").clone();
        assert!((answers.len()..=last + 1).contains(&told.len()), "{moment}: {} of {}", told.len(), answers.len());
        for (number, told) in told.iter().enumerate() {
            assert_eq!(told["told"], robot::told(&robot::posture(number)), "{moment}");
            assert!(answers.get(&number).is_none_or(|answer| *answer == told["answer"]), "{moment}");
        }
        // Whoever sends them all again has each once.
        for number in 0..OBSERVATIONS {
            let again = post(&program.api, &session, number).await.expect("an answer");
            let expected = if number < told.len() { StatusCode::OK } else { StatusCode::CREATED };
            assert_eq!(again.status(), expected, "{moment}");
        }
        let resource = program.api.get_json(&session).await;
        assert_eq!(resource["status"]["observations"], OBSERVATIONS, "{moment}");
        program.kill();
    }
    let program = Program::keeping(folder.path());
    let sessions = program.api.get_json("/v1/sessions").await;
    assert_eq!(sessions["sessions"].as_array().expect("a list").len(), kills);
}

#[test]
fn a_second_server_leaves_the_first_ones_sessions_alone() {
    let folder = tempfile::tempdir().expect("a folder");
    let first = Program::keeping(folder.path());
    assert!(first.said.contains(folder.path().to_str().expect("text")), "{}", first.said);
    let second = Command::new(env!("CARGO_BIN_EXE_body-schema"))
        .args(["serve", "--bind", "127.0.0.1:0", "--data-dir"])
        .arg(folder.path())
        .output()
        .expect("the program");
    let told = String::from_utf8_lossy(&second.stderr);
    assert!(!second.status.success() && second.stdout.is_empty(), "{second:?}");
    assert!(told.contains("another body-schema server") && told.contains("--data-dir"), "{told}");
    assert!(told.contains("--ephemeral"), "{told}");
    first.kill();
    Program::keeping(folder.path()).kill();
}

#[test]
fn a_folder_that_cannot_be_written_is_told_at_the_start() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("file");
    std::fs::write(&file, "").expect("written");
    let program = || Command::new(env!("CARGO_BIN_EXE_body-schema"));
    let refused = program().args(["serve", "--bind", "127.0.0.1:0", "--data-dir"]).arg(file.join("below")).output();
    let refused = refused.expect("the program");
    let told = String::from_utf8_lossy(&refused.stderr);
    assert!(!refused.status.success() && told.contains("--data-dir") && told.contains("--ephemeral"), "{told}");
    // The platform's folder, unless one is named; it says which.
    let home = folder.path().to_str().expect("text");
    let environment = [("HOME", home), ("XDG_DATA_HOME", home), ("APPDATA", home), ("LOCALAPPDATA", home)];
    let own = Program::start(program().args(["serve", "--bind", "127.0.0.1:0"]).envs(environment));
    assert!(own.said.contains("are kept in") && own.said.contains(home), "{}", own.said);
    own.kill();
}
