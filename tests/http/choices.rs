//! Why this posture: the search behind a movement, and postures proposed by whoever looks on.

use body_schema::{
    experiment::{AppraisalReport, Choice},
    scenario::builtin,
};
use serde_json::json;

use crate::support::{Server, problem};

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
    assert_eq!(choice, experiment.choice("active").expect("searched"));
    assert_eq!((choice.step, choice.joints[3].name.as_str()), (4, "elbow"));

    let proposed = json!({ "configuration": [0.1, 0.2, -0.3, -1.0] });
    let answer = server.post(&of("active", "evaluations"), proposed).await;
    let appraisal: AppraisalReport = answer.json().await.expect("an appraisal");
    assert_eq!(appraisal, experiment.appraise("active", &[0.1, 0.2, -0.3, -1.0]).expect("an appraisal"));
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
