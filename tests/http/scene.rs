//! What a page shows of a session beside the reports: arrangements of the viewer, and postures between steps.

use std::{collections::BTreeSet, io::Cursor};

use re_chunk::Chunk;
use re_log_encoding::DecoderApp;
use re_log_types::LogMsg;
use serde_json::json;

use crate::http::support::{Server, problem, steps};

/// The times of an entity's rows in a recording.
fn times(recording: &[u8], entity: &str, timeline: &'static str) -> BTreeSet<i64> {
    let messages = DecoderApp::decode_eager(Cursor::new(recording)).expect("a stream");
    let mut times = BTreeSet::new();
    for message in messages {
        let LogMsg::ArrowMsg(_, message) = message.expect("a message") else { continue };
        let chunk = Chunk::from_arrow_msg(&message).expect("a chunk");
        if chunk.entity_path().to_string() == entity {
            times.extend(chunk.iter_indices(&timeline.into()).map(|(time, _)| time.as_i64()));
        }
    }
    times
}

/// The live recording up to the first part by which an entity has a row at each of these times.
async fn live_until<const N: usize>(server: &Server, session: &str, entity: &str, wanted: [i64; N]) -> Vec<u8> {
    let mut live = server.get(&format!("{session}/live.rrd")).await;
    let mut bytes = Vec::new();
    while bytes.len() < 13 || !times(&bytes, entity, "motion").is_superset(&wanted.into()) {
        let more = tokio::time::timeout(crate::http::support::SOON, live.chunk()).await.expect("soon");
        bytes.extend(more.expect("a connection").expect("more"));
    }
    bytes
}

#[tokio::test]
async fn postures_between_steps_are_drawn_for_those_who_ask() {
    let server = Server::start().await;
    let session = server.open_quick(1).await;
    let made = server.post(&format!("{session}/steps"), json!({ "count": 2, "frames": 3 })).await;
    let made: serde_json::Value = made.json().await.expect("JSON");
    assert_eq!(steps(&made["reports"]), [1, 2], "reports are made for steps alone");
    server.step(&session, 1).await;
    let arm = "/random/arm/estimate";
    let live = live_until(&server, &session, arm, [56, 96]).await;
    assert_eq!(times(&live, arm, "motion"), [0, 8, 16, 24, 32, 40, 48, 56, 64, 96].into());
    let file = server.get(&format!("{session}/recording.rrd")).await.bytes().await.expect("bytes");
    assert_eq!(times(&file, arm, "step"), [0, 1, 2, 3].into());
    assert!(times(&file, arm, "motion").is_empty());

    for body in [json!({ "frames": 31 }), json!({ "count": 101, "frames": 10 }), json!({ "frames": -1 })] {
        problem(server.post(&format!("{session}/steps"), body).await, 422, Some("frames")).await;
    }
    server.stop().await;
}

#[tokio::test]
async fn a_page_arranges_the_viewer_for_its_shape_and_colours() {
    let server = Server::start().await;
    let session = server.open_quick(1).await;
    let get = async |query: &str| server.get(&format!("{session}/blueprint.rbl{query}")).await;
    for query in [
        "",
        "?theme=dark",
        "?shape=tall&theme=light",
        "?aspect=0.8",
        "?theme=dark&shape=wide&aspect=1",
        "?learner=random",
    ] {
        let response = get(query).await;
        assert_eq!(response.status(), 200, "{query}");
        let bytes = response.bytes().await.expect("bytes");
        let messages = DecoderApp::decode_eager(Cursor::new(&bytes[..])).expect("a stream");
        let messages: Vec<LogMsg> = messages.map(|message| message.expect("a message")).collect();
        assert!(messages.iter().all(|message| message.store_id().is_blueprint()), "nothing of the recording");
        assert!(matches!(messages.last(), Some(LogMsg::BlueprintActivationCommand(_))));
    }
    for (query, field) in [
        ("?theme=blue", "theme"),
        ("?shape=", "shape"),
        ("?aspect=0", "aspect"),
        ("?aspect=NaN", "aspect"),
        ("?colour=red", "colour"),
    ] {
        problem(get(query).await, 400, Some(field)).await;
    }
    for name in ["nobody", ""] {
        problem(get(&format!("?learner={name}")).await, 404, Some("learner")).await;
    }
    problem(server.get("/v1/sessions/1/blueprint.rbl").await, 404, Some("id")).await;
    server.stop().await;
}

#[tokio::test]
async fn a_posture_that_a_person_tries_out_is_shown_at_once() {
    let server = Server::start().await;
    let session = server.open(json!({ "scenario": "arm-6dof", "learners": ["human", "random"] })).await;
    let posture = [0.1, 0.2, -0.3, -1.0, 0.4, 0.5];
    let configuration = json!({ "configuration": posture });
    let set = server.post(&format!("{session}/learners/human/configuration"), configuration).await;
    assert_eq!(set.status(), 200);
    live_until(&server, &session, "/human/arm/ghost", [0]).await;
    server.step(&session, 1).await;
    // Gone with the step: the entities of a step come in any order.
    let live = live_until(&server, &session, "/human/arm/ghost", [1]).await;
    assert_eq!(times(&live, "/human/arm/ghost", "motion"), [0, 1].into());
    // One that is asked about is shown where that is wanted, and only there.
    let evaluations = format!("{session}/learners/human/evaluations");
    for (asked, shown) in [(json!({}), 1), (json!({ "show": true }), 32)] {
        let mut asked = asked;
        asked["configuration"] = json!(posture);
        assert_eq!(server.post(&evaluations, asked).await.status(), 200);
        let live = live_until(&server, &session, "/human/arm/ghost", [shown]).await;
        assert_eq!(times(&live, "/human/arm/ghost", "motion").last(), Some(&shown));
    }
    server.stop().await;
}
