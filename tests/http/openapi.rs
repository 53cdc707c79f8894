//! The description of the server, held against the server.

use body_schema::server::{Limits, Options};
use reqwest::Method;
use serde_json::{Value, json};

use crate::http::support::{Server, timeless};

const ROUTES: [(&str, &str); 37] = [
    ("get", "/v1/scenarios"),
    ("get", "/v1/scenarios/{name}"),
    ("get", "/v1/sessions"),
    ("post", "/v1/sessions"),
    ("get", "/v1/sessions/{id}"),
    ("delete", "/v1/sessions/{id}"),
    ("post", "/v1/sessions/{id}/steps"),
    ("get", "/v1/sessions/{id}/learners/{name}/selection"),
    ("post", "/v1/sessions/{id}/learners/{name}/evaluations"),
    ("get", "/v1/sessions/{id}/learners/{name}/configuration"),
    ("post", "/v1/sessions/{id}/learners/{name}/configuration"),
    ("get", "/v1/sessions/{id}/suggestions"),
    ("post", "/v1/sessions/{id}/suggestions"),
    ("post", "/v1/sessions/{id}/suggestions/{sid}/outcome"),
    ("get", "/v1/sessions/{id}/observations"),
    ("post", "/v1/sessions/{id}/observations"),
    ("get", "/v1/sessions/{id}/observations/{n}"),
    ("delete", "/v1/sessions/{id}/observations/{n}"),
    ("put", "/v1/sessions/{id}/observations/{n}/included"),
    ("get", "/v1/sessions/{id}/model.urdf"),
    ("get", "/v1/sessions/{id}/kinematics.yaml"),
    ("get", "/v1/sessions/{id}/report.json"),
    ("get", "/v1/sessions/{id}/report.html"),
    ("get", "/v1/sessions/{id}/observations.csv"),
    ("get", "/v1/sessions/{id}/calibration.toml"),
    ("get", "/v1/sessions/{id}/robot.urdf"),
    ("get", "/v1/sessions/{id}/session.json"),
    ("get", "/v1/sessions/{id}/events"),
    ("get", "/v1/sessions/{id}/live"),
    ("get", "/v1/sessions/{id}/live.rrd"),
    ("get", "/v1/sessions/{id}/blueprint.rbl"),
    ("get", "/v1/sessions/{id}/recording.rrd"),
    ("get", "/v1/sessions/{id}/steps.csv"),
    ("get", "/v1/sessions/{id}/result.json"),
    ("get", "/v1/openapi.json"),
    ("get", "/healthz"),
    ("get", "/metrics"),
];

#[tokio::test]
async fn the_document_lists_every_route() {
    let server = Server::start().await;
    let document = server.get_json("/v1/openapi.json").await;
    assert_eq!(document["openapi"], "3.1.0");
    let paths = document["paths"].as_object().expect("paths");
    let mut listed: Vec<(&str, &str)> = paths
        .iter()
        .flat_map(|(path, item)| item.as_object().expect("an item").keys().map(move |m| (m.as_str(), path.as_str())))
        .collect();
    let mut expected = ROUTES.to_vec();
    listed.sort_unstable();
    expected.sort_unstable();
    assert_eq!(listed, expected);
    let mut ids = Vec::new();
    for (method, path) in ROUTES {
        let operation = &document["paths"][path][method];
        assert!(operation["summary"].is_string() && operation["operationId"].is_string(), "{method} {path}");
        ids.push(operation["operationId"].as_str().expect("an id"));
        for status in ["400", "401", "403"] {
            assert!(operation["responses"][status].is_object(), "{method} {path} {status}");
        }
        for (status, response) in operation["responses"].as_object().expect("responses") {
            assert!(response["description"].is_string());
            if status.starts_with(['4', '5']) {
                let schema = &response["content"]["application/problem+json"]["schema"]["$ref"];
                assert_eq!(schema, "#/components/schemas/Problem", "{method} {path} {status}");
            }
        }
    }
    let nowhere: Vec<&str> =
        references(&document).into_iter().filter(|at| document.pointer(&at[1..]).is_none()).collect();
    assert!(nowhere.is_empty(), "{nowhere:?} are referred to and not there");
    for (path, item) in paths {
        for (method, operation) in item.as_object().expect("an item") {
            for parameter in operation["parameters"].as_array().into_iter().flatten() {
                let schema = parameter["schema"].to_string();
                assert!(!schema.contains("null"), "{method} {path}: {parameter} cannot be null");
            }
        }
    }
    let events =
        &document["paths"]["/v1/sessions/{id}/events"]["get"]["responses"]["200"]["content"]["text/event-stream"];
    assert!(events["schema"].is_null() && events["x-itemSchema"]["properties"]["data"].is_object(), "{events}");
    ids.sort_unstable();
    ids.dedup();
    assert_eq!(ids.len(), ROUTES.len(), "every operation has an id of its own");
    server.stop().await;
}

/// All that a document refers to.
fn references(value: &Value) -> Vec<&str> {
    match value {
        Value::Array(values) => values.iter().flat_map(references).collect(),
        Value::Object(members) => {
            let at = members.get("$ref").and_then(Value::as_str);
            at.into_iter().chain(members.values().flat_map(references)).collect()
        }
        _ => Vec::new(),
    }
}

#[tokio::test]
async fn the_document_tells_the_limits_of_this_server() {
    let limits = Limits { steps_per_request: 7, ..Limits::default() };
    let server = Server::with(Options { limits, ..Options::default() }).await;
    let document = server.get_json("/v1/openapi.json").await;
    assert_eq!(document["components"]["schemas"]["StepRequest"]["properties"]["count"]["maximum"], 7);
    server.stop().await;
}

/// Validates against the schema that the document gives for a response.
struct Contract(Value);

impl Contract {
    fn check(&self, (method, path): (&str, &str), status: u16, body: &Value) {
        let content = &self.0["paths"][path][method]["responses"][status.to_string()]["content"];
        let content = content.as_object().unwrap_or_else(|| panic!("{method} {path} {status} is not described"));
        let (_, content) = content.iter().next().expect("a content");
        self.check_schema(&content["schema"], body);
    }

    fn check_schema(&self, schema: &Value, body: &Value) {
        let mut schema = schema.clone();
        schema["components"] = self.0["components"].clone();
        let validator = jsonschema::draft202012::new(&schema).expect("a schema");
        let errors: Vec<String> =
            validator.iter_errors(body).map(|error| format!("{}: {error}", error.instance_path())).collect();
        assert!(errors.is_empty(), "{errors:?}");
    }
}

#[tokio::test]
async fn responses_are_as_described() {
    let server = Server::start().await;
    let contract = Contract(server.get_json("/v1/openapi.json").await);
    let check = |route, status, body: Value| contract.check(route, status, &body);
    check(("get", "/healthz"), 200, server.get_json("/healthz").await);
    check(("get", "/v1/scenarios"), 200, server.get_json("/v1/scenarios").await);
    for scenario in ["arm-6dof", "arm-12dof", "tiago-mocap"] {
        let path = format!("/v1/scenarios/{scenario}");
        check(("get", "/v1/scenarios/{name}"), 200, server.get_json(&path).await);
        let created = server.post("/v1/sessions", json!({ "scenario": scenario, "seed": 3 })).await;
        let session = created.headers()["location"].to_str().expect("text").to_owned();
        check(("post", "/v1/sessions"), 201, created.json().await.expect("JSON"));
        let made = server.step(&session, 2).await;
        check(("post", "/v1/sessions/{id}/steps"), 200, made.clone());
        let event = json!({ "type": "step", "data": timeless(&made["reports"][1]) });
        let whole = json!({ "type": "step", "data": made["reports"][1] });
        let live = json!({ "$ref": "#/components/schemas/LiveEvent" });
        contract.check_schema(&live, &whole);
        let validates = std::panic::catch_unwind(|| contract.check_schema(&live, &event));
        assert!(validates.is_err(), "a schema that accepts a report without its times checks nothing");
        check(("get", "/v1/sessions/{id}"), 200, server.get_json(&session).await);
        check(("get", "/v1/sessions"), 200, server.get_json("/v1/sessions").await);
        let result = server.get_json(&format!("{session}/result.json")).await;
        check(("get", "/v1/sessions/{id}/result.json"), 200, result);
        let stale = server.post(&format!("{session}/steps"), json!({ "expected_step": 9 })).await;
        check(("post", "/v1/sessions/{id}/steps"), 409, stale.json().await.expect("JSON"));
    }
    let names = json!(["human", "random"]);
    let session = server.open(json!({ "scenario": "arm-6dof", "learners": names })).await;
    let path = format!("{session}/learners/human/configuration");
    let route = "/v1/sessions/{id}/learners/{name}/configuration";
    check(("get", route), 200, server.get_json(&path).await);
    let set = server.post(&path, json!({ "configuration": [0.1, 0.2, -0.3, -1.0, 0.4, 0.5] })).await;
    check(("post", route), 200, set.json().await.expect("JSON"));
    check(("get", route), 200, server.get_json(&path).await);
    let created = server.post("/v1/sessions", crate::http::robot::opening()).await;
    let session = created.headers()["location"].to_str().expect("text").to_owned();
    check(("post", "/v1/sessions"), 201, created.json().await.expect("JSON"));
    let suggestions = "/v1/sessions/{id}/suggestions";
    let asked = server.post(&format!("{session}/suggestions"), json!({ "count": 2 })).await;
    let asked: Value = asked.json().await.expect("JSON");
    check(("post", suggestions), 200, asked.clone());
    check(("get", suggestions), 200, server.get_json(&format!("{session}/suggestions")).await);
    let outcome = server.post(&format!("{session}/suggestions/2/outcome"), json!({ "state": "abandoned" })).await;
    check(("post", "/v1/sessions/{id}/suggestions/{sid}/outcome"), 200, outcome.json().await.expect("JSON"));
    let observations = "/v1/sessions/{id}/observations";
    let told = crate::http::robot::carried_out(&asked["suggestions"][0]);
    let told = server.post(&format!("{session}/observations"), told).await;
    check(("post", observations), 201, told.json().await.expect("JSON"));
    check(("get", observations), 200, server.get_json(&format!("{session}/observations")).await);
    let path = format!("{session}/observations/1");
    check(("get", "/v1/sessions/{id}/observations/{n}"), 200, server.get_json(&path).await);
    let excluded = server.request(Method::DELETE, &path).send().await.expect("an answer");
    check(("delete", "/v1/sessions/{id}/observations/{n}"), 200, excluded.json().await.expect("JSON"));
    let included = server.request(Method::PUT, &format!("{path}/included")).send().await.expect("an answer");
    check(("put", "/v1/sessions/{id}/observations/{n}/included"), 200, included.json().await.expect("JSON"));
    check(("get", "/v1/sessions/{id}"), 200, server.get_json(&session).await);
    let live = json!({ "$ref": "#/components/schemas/LiveEvent" });
    let path = format!("{session}/learners/global/configuration");
    let nobody = server.get(&path).await;
    check(("get", "/v1/sessions/{id}/learners/{name}/configuration"), 409, nobody.json().await.expect("JSON"));
    for event in crate::http::streams::first_messages(&server, &session, 1).await {
        contract.check_schema(&live, &event);
    }
    let steps = server.post(&format!("{session}/steps"), json!({})).await;
    check(("post", "/v1/sessions/{id}/steps"), 409, steps.json().await.expect("JSON"));
    let gone = server.request(Method::DELETE, "/v1/sessions/x").send().await.expect("an answer");
    check(("delete", "/v1/sessions/{id}"), 404, gone.json().await.expect("JSON"));
    server.stop().await;
}
