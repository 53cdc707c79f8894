//! Why this posture: the search behind a movement, and postures proposed by whoever looks on.

use body_schema::{
    experiment::{AppraisalReport, Choice},
    scenario::builtin,
};
use serde_json::json;

use crate::http::support::{Server, problem};

#[tokio::test]
async fn a_choice_can_be_looked_into_and_questioned() {
    let server = Server::start().await;
    let session = server.open(json!({ "scenario": "head-fov", "seed": 2 })).await;
    let of = |learner: &str, what: &str| format!("{session}/learners/{learner}/{what}");
    problem(server.get(&of("active", "selection")).await, 409, None).await;
    server.step(&session, 4).await;

    let mut experiment = builtin("head-fov").and_then(|s| s.experiment(2, None)).expect("starts");
    for _ in 0..4 {
        experiment.step().expect("a step");
    }
    let choice: Choice = server.get(&of("active", "selection")).await.json().await.expect("a choice");
    assert_eq!(choice, Choice::of(&experiment, "active").expect("searched"));
    assert_eq!((choice.step, choice.joints[3].name.as_str()), (4, "elbow"));

    let proposed = json!({ "configuration": [0.1, 0.2, -0.3, -1.0] });
    let answer = server.post(&of("active", "evaluations"), proposed).await;
    let appraisal: AppraisalReport = answer.json().await.expect("an appraisal");
    let appraised = experiment.appraise("active", &[0.1, 0.2, -0.3, -1.0]).expect("an appraisal");
    assert_eq!(appraisal, AppraisalReport::from(&appraised));
    assert!((0.0..=1.0).contains(&appraisal.chance_of_being_seen));

    problem(server.get(&of("random", "selection")).await, 409, None).await;
    problem(server.get(&of("nobody", "selection")).await, 404, Some("name")).await;
    let short = server.post(&of("active", "evaluations"), json!({ "configuration": [0.1] })).await;
    problem(short, 422, Some("configuration")).await;
    let far = server.post(&of("active", "evaluations"), json!({ "configuration": [9.0, 0.0, 0.0, 0.0] })).await;
    problem(far, 422, Some("configuration")).await;
    let still = server.post(&of("gradient", "evaluations"), json!({ "configuration": [0.0, 0.0, 0.0, 0.0] })).await;
    problem(still, 409, None).await;
    server.stop().await;
}

#[tokio::test]
async fn a_person_sets_each_movement_before_its_step() {
    let server = Server::start().await;
    let session = server.open(json!({ "scenario": "arm-6dof", "learners": ["active", "human"] })).await;
    let of = |learner: &str| format!("{session}/learners/{learner}/configuration");
    let pose = json!([0.1, 0.2, -0.3, -1.0, 0.4, 0.5]);

    // Until a configuration is set nobody moves, and the problem says what to post.
    let waiting = problem(server.post(&format!("{session}/steps"), json!({ "count": 1 })).await, 409, None).await;
    assert_eq!(
        (waiting["type"].as_str(), waiting["step"].as_u64()),
        (Some("urn:body-schema:problem:no-configuration"), Some(0))
    );
    let detail = waiting["detail"].as_str().expect("text");
    assert!(detail.contains("learners/human/configuration") && detail.contains("\"configuration\""), "{detail}");
    assert_eq!(server.get_json(&of("human")).await, json!({ "configuration": null }));
    let many = server.post(&format!("{session}/steps"), json!({ "count": 2 })).await;
    problem(many, 422, Some("count")).await;
    assert_eq!(server.get_json(&session).await["step"], 0);

    let answer = server.post(&of("human"), json!({ "configuration": pose })).await;
    let expected: AppraisalReport = answer.json().await.expect("an appraisal");
    assert!((0.0..=1.0).contains(&expected.share.expect("DIRECT's best is known")), "{expected:?}");
    let marker = expected.estimated_skeleton_m.last().expect("the marker");
    assert!(marker.iter().zip(expected.predicted_marker_m).all(|(drawn, told)| (drawn - told).abs() < 1e-12));
    assert_eq!(server.get_json(&of("human")).await, json!({ "configuration": pose }));

    let made = server.step(&session, 1).await;
    let human = &made["reports"][0]["learners"][1];
    assert_eq!((&human["name"], &human["movement"]["configuration"]), (&json!("human"), &pose));
    assert_eq!(server.get_json(&of("human")).await, json!({ "configuration": null }), "it was for one step");
    problem(server.post(&format!("{session}/steps"), json!({})).await, 409, None).await;

    // What was set is of its learner and of its robot.
    let set = |learner: &str, pose: &[f64]| (of(learner), json!({ "configuration": pose }));
    for (status, field, (path, body)) in [
        (404, "name", set("nobody", &[0.0; 6])),
        (409, "name", set("active", &[0.0; 6])),
        (422, "configuration", set("human", &[0.0; 5])),
        (422, "configuration", set("human", &[9.0; 6])),
        (422, "configuration", (of("human"), json!({}))),
        (422, "configuration[5]", (of("human"), json!({ "configuration": [0, 0, 0, 0, 0, null] }))),
    ] {
        problem(server.post(&path, body).await, status, Some(field)).await;
    }
    problem(server.get(&of("nobody")).await, 404, Some("name")).await;
    let recorded = json!({ "scenario": "tiago-mocap", "learners": ["human"] });
    problem(server.post("/v1/sessions", recorded).await, 422, Some("learners")).await;
    server.stop().await;
}
