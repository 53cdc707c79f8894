//! What answers in the visitor's browser, beside the server: the same bytes.

use body_schema_backend::Local;
use re_chunk::Chunk;
use re_log_encoding::{Encodable, EncodingOptions, ToTransport};
use re_log_types::LogMsg;
use reqwest::Method;
use serde_json::{Value, json};

use crate::{http::support::Server, recording::reading::messages};

/// A text without what differs from one time to another: how long choices took, and the ids of requests.
fn timeless(bytes: &[u8]) -> String {
    fn strip(value: &mut Value) {
        match value {
            Value::Object(members) => {
                members.retain(|name, _| !matches!(name.as_str(), "selection_ms" | "request_id"));
                members.values_mut().for_each(strip);
            }
            Value::Array(values) => values.iter_mut().for_each(strip),
            _ => {}
        }
    }
    match serde_json::from_slice::<Value>(bytes) {
        // The order of members counts too, which a `Value` does not keep: see below.
        Ok(mut value) => {
            strip(&mut value);
            value.to_string()
        }
        // A table: without the column of times.
        Err(_) => {
            let text = String::from_utf8_lossy(bytes);
            let time = text.lines().next().and_then(|head| head.split(',').position(|name| name == "selection_ms"));
            let kept = |line: &str| {
                let cells = line.split(',').enumerate().filter(|(index, _)| Some(*index) != time);
                cells.map(|(_, cell)| cell).collect::<Vec<_>>().join(",")
            };
            text.lines().map(kept).collect::<Vec<_>>().join("\n")
        }
    }
}

/// The names of all members, in the order in which they are written.
fn members(bytes: &[u8]) -> Vec<String> {
    let text = String::from_utf8_lossy(bytes).into_owned();
    let names = text.split('"').collect::<Vec<_>>();
    let names = names.windows(2).filter(|pair| pair[1].starts_with(':')).map(|pair| pair[0].to_owned());
    names.filter(|name| name != "request_id").collect()
}

/// All messages of a recording but for the series of times, with what each is about.
fn recorded(bytes: &[u8]) -> Vec<(String, Vec<u8>)> {
    let said = messages(bytes).into_iter().filter(|message: &LogMsg| match message {
        LogMsg::ArrowMsg(_, message) => {
            let chunk = Chunk::from_arrow_msg(message).expect("a chunk");
            !chunk.entity_path().to_string().ends_with("selection_ms")
        }
        _ => true,
    });
    said.map(|message| {
        let entity = match &message {
            LogMsg::ArrowMsg(_, message) => Chunk::from_arrow_msg(message).expect("a chunk").entity_path().to_string(),
            other => format!("{other:?}"),
        };
        let mut bytes = Vec::new();
        let compression = EncodingOptions::PROTOBUF_COMPRESSED.compression;
        let message = message.to_transport(compression).expect("a message");
        message.to_rrd_bytes(&mut bytes).expect("memory");
        (entity, bytes)
    })
    .collect()
}

/// Two answers, each a status and a body, are the same but for times.
pub(crate) fn assert_same(asked: &str, here: (u16, &[u8]), there: (u16, &[u8])) {
    assert_eq!(here.0, there.0, "{asked}: {}", String::from_utf8_lossy(here.1));
    if there.0 < 400 && asked.contains(".rbl") {
        assert!(here.1 == there.1, "{asked}: {} bytes here, {} there", here.1.len(), there.1.len());
    } else if there.0 < 400 && asked.contains(".rrd") {
        let (here, there) = (recorded(here.1), recorded(there.1));
        let other = here.iter().zip(&there).find(|(here, there)| here != there);
        assert_eq!((here.len(), other.map(|((entity, _), _)| entity)), (there.len(), None), "{asked}");
    } else {
        assert_eq!(timeless(here.1), timeless(there.1), "{asked}");
        assert_eq!(members(here.1), members(there.1), "{asked}");
    }
}

struct Both {
    server: Server,
    local: Local,
    session: String,
}

impl Both {
    /// A session on either side, of one id.
    async fn open(opening: Value) -> Self {
        let server = Server::start().await;
        let answer = server.post("/v1/sessions", opening.clone()).await;
        let told = answer.bytes().await.expect("a body");
        let id = serde_json::from_slice::<Value>(&told).expect("JSON");
        let id = id["id"].as_str().unwrap_or_else(|| panic!("{}", String::from_utf8_lossy(&told))).to_owned();
        let session = format!("/v1/sessions/{id}");
        let mut local = Local::new(move || id.clone());
        let here = local.answered("POST", "/v1/sessions", opening.to_string().as_bytes());
        assert_eq!(here.status, 201, "{}", String::from_utf8_lossy(&here.body));
        assert_eq!(String::from_utf8_lossy(&here.body), String::from_utf8_lossy(&told));
        Self { server, local, session }
    }

    /// Both answer the same.
    async fn same(&mut self, method: Method, path: &str, body: Option<Value>) -> (u16, Vec<u8>) {
        let path = match path.starts_with("/v1") {
            true => path.to_owned(),
            false => format!("{}{path}", self.session),
        };
        let request = self.server.request(method.clone(), &path);
        let request = body.iter().fold(request, |request, body| request.json(body));
        let there = request.send().await.expect("an answer");
        let status = there.status().as_u16();
        let there = there.bytes().await.expect("a body").to_vec();
        let text = body.map(|body| body.to_string()).unwrap_or_default();
        let here = self.local.answered(method.as_str(), &path, text.as_bytes());
        assert_same(&format!("{method} {path}"), (here.status, &here.body), (status, &there));
        (status, there)
    }
}

/// Six scenarios, two hundred steps together, and everything that can be asked of them.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_browser_answers_as_the_server_does() {
    let scenarios = [
        ("arm-6dof", 60, "active"),
        ("arm-12dof", 20, "active"),
        ("head-fov", 40, "active"),
        ("arm-6dof-camera", 10, "global"),
        ("tiago-mocap", 30, "global"),
        ("arm-7dof-socket", 40, "random"),
    ];
    for (scenario, steps, learner) in scenarios {
        let mut both = Both::open(json!({ "scenario": scenario, "seed": 4711, "ellipsoids": "95-percent" })).await;
        let learners = both.server.get_json(&both.session).await["description"]["learners"].clone();
        let names: Vec<&str> =
            learners.as_array().expect("learners").iter().filter_map(|it| it["name"].as_str()).collect();
        let learner = if names.contains(&learner) { learner } else { names[0] };
        let mut made = 0;
        while made < steps {
            let body = json!({ "count": 10, "expected_step": made, "frames": 2 });
            both.same(Method::POST, "/steps", Some(body)).await;
            made += 10;
            // Of a longer one the chunks depend on how it was written: it is put together by 4 MB at a time.
            if made == 10 {
                both.same(Method::GET, "/recording.rrd", None).await;
            }
        }
        both.same(Method::GET, "", None).await;
        both.same(Method::GET, &format!("/learners/{learner}/selection"), None).await;
        let joints =
            both.server.get_json(&both.session).await["description"]["joints"].as_array().expect("joints").len();
        let posture = json!({ "configuration": vec![0.1; joints] });
        both.same(Method::POST, &format!("/learners/{learner}/evaluations"), Some(posture)).await;
        both.same(Method::GET, "/result.json", None).await;
        both.same(Method::GET, "/steps.csv", None).await;
        both.same(Method::GET, "/blueprint.rbl?theme=dark&aspect=1.250", None).await;
        both.same(Method::GET, "/blueprint.rbl?theme=light&aspect=0.700&learner=%72andom", None).await;
        both.same(Method::GET, "/blueprint.rbl?learner=nobody", None).await;
        let (_, reports) = both.local.news(both.session.rsplit('/').next().expect("an id"), 0, 0).expect("a session");
        assert_eq!(reports.len() as u64, steps + 1);
        both.server.stop().await;
    }
}

/// A scenario with other values: its runs are others, and the same on either side.
#[tokio::test]
async fn what_is_turned_is_turned_in_both() {
    let set = [
        "sensor.sigma_m=0.05",
        "change={ step = 3, tilt = { joint = \"elbow\", angle_deg = 20.0, towards = [0.6, 0.48, 0.64] } }",
    ];
    let mut both = Both::open(json!({ "scenario": "arm-6dof", "learners": ["random"], "set": set })).await;
    both.same(Method::POST, "/steps", Some(json!({ "count": 6 }))).await;
    both.same(Method::GET, "/result.json", None).await;
    let described = both.server.get_json(&both.session).await["description"].clone();
    assert_eq!((&described["scenario"], &described["change_at"]), (&json!("arm-6dof"), &json!(3)));
    assert_eq!(described["set"].as_array().map(Vec::len), Some(2), "{described}");
    assert_eq!(described["set"][0], "sensor.sigma_m=0.05");
    both.server.stop().await;
}

#[tokio::test]
async fn what_is_wrong_is_told_in_the_same_words() {
    let mut both = Both::open(json!({ "scenario": "arm-6dof", "seed": 1, "learners": ["human", "random"] })).await;
    for (path, body) in [
        ("/steps", json!({ "count": 0 })),
        ("/steps", json!({ "count": 2 })),
        ("/steps", json!({ "count": 1 })),
        ("/steps", json!({ "count": 1, "expected_step": 7 })),
        ("/steps", json!({ "count": 1, "frames": 31 })),
        ("/steps", json!({ "counts": 1 })),
        ("/learners/nobody/evaluations", json!({ "configuration": [0, 0, 0, 0, 0, 0] })),
        ("/learners/human/evaluations", json!({ "configuration": [0] })),
        ("/learners/human/configuration", json!({ "configuration": [9, 0, 0, 0, 0, 0] })),
        ("/learners/random/configuration", json!({ "configuration": [0, 0, 0, 0, 0, 0] })),
        ("/v1/sessions/00000000-0000-4000-8000-000000000000/steps", json!({})),
        ("/v1/sessions", json!({ "scenario": "arm-6dofx" })),
        ("/v1/sessions", json!({ "scenario": "arm-6dof", "learners": ["clever"] })),
        ("/v1/sessions", json!({ "scenario": "arm-6dof", "seed": -1 })),
        ("/v1/sessions", json!({ "scenario": "arm-6dof", "set": ["sensor.sigma_m"] })),
        ("/v1/sessions", json!({ "scenario": "arm-6dof", "set": ["sensor.sigma_m=-1"] })),
        ("/v1/sessions", json!({ "scenario": "arm-6dof", "set": ["sensor.sigma_m=1e12"] })),
        ("/v1/sessions", json!({ "scenario": "arm-6dof", "set": "sensor.sigma_m=1" })),
    ] {
        let (status, said) = both.same(Method::POST, path, Some(body)).await;
        assert!(status >= 400, "{path}: {}", String::from_utf8_lossy(&said));
    }
    both.same(Method::POST, "/learners/human/configuration", Some(json!({ "configuration": [0.1, 0, 0, 0, 0, 0] })))
        .await;
    both.same(Method::GET, "/learners/human/configuration", None).await;
    both.same(Method::POST, "/steps", Some(json!({}))).await;
    both.same(Method::GET, "/learners/random/selection", None).await;
    both.same(Method::GET, "/blueprint.rbl?aspect=9", None).await;
    both.same(Method::GET, "/v1/scenarios", None).await;
    both.same(Method::GET, "/v1/scenarios/head-fov", None).await;
    both.same(Method::GET, "/v1/scenarios/head-fovx", None).await;
    both.same(Method::DELETE, "", None).await;
    both.same(Method::GET, "", None).await;
    both.server.stop().await;
}

#[test]
fn a_scenario_of_ones_own_runs_as_the_built_in_one_that_it_copies() {
    let read = |file: &str| {
        std::fs::read_to_string(format!("{}/scenarios/{file}", env!("CARGO_MANIFEST_DIR"))).expect("a file")
    };
    let source = read("positioner.toml").replacen("name = \"positioner\"", "name = \"mine\"", 1);
    let data = ["positioner.urdf", "positioner.csv"].map(|file| (file.to_owned(), read(file)));
    let mut local = Local::new(|| "one".to_owned());
    let missing = local.add("mine.toml", &source, &data[..1]).expect_err("a file is missing");
    assert!(missing.detail.contains("positioner.csv") && missing.detail.contains("mine.toml"), "{}", missing.detail);
    local.add("mine.toml", &source, &data).expect("a scenario");
    let listed: Value = serde_json::from_slice(&local.answered("GET", "/v1/scenarios", b"").body).expect("JSON");
    assert_eq!(listed["scenarios"][0]["name"], "mine");
    let of = |local: &mut Local, scenario: &str| {
        let opening = json!({ "scenario": scenario, "seed": 3, "learners": ["random"] }).to_string();
        let opened = local.answered("POST", "/v1/sessions", opening.as_bytes());
        assert_eq!(opened.status, 201, "{}", String::from_utf8_lossy(&opened.body));
        local.answered("POST", "/v1/sessions/one/steps", b"{\"count\":5}");
        let table = local.answered("GET", "/v1/sessions/one/steps.csv", b"").body;
        local.answered("DELETE", "/v1/sessions/one", b"");
        timeless(&table)
    };
    assert_eq!(of(&mut local, "mine"), of(&mut local, "positioner"));

    // One of a built-in name takes its place, and is listed once.
    local
        .add("positioner.toml", &read("positioner.toml").replacen("title = ", "title = \"My own\" # ", 1), &data)
        .expect("a scenario");
    let listed: Value = serde_json::from_slice(&local.answered("GET", "/v1/scenarios", b"").body).expect("JSON");
    let titles: Vec<&Value> = (listed["scenarios"].as_array().expect("a list").iter())
        .filter(|one| one["name"] == "positioner")
        .map(|one| &one["title"])
        .collect();
    assert_eq!(titles, ["My own"]);
}

/// A viewer takes up so many messages a frame, however much is in them: with those of every step alone it falls behind.
#[test]
fn steps_that_are_asked_for_together_are_shown_together() {
    let parts = |requests: u64, count: u64| {
        let mut local = Local::new(|| "one".to_owned());
        let opening = json!({ "scenario": "arm-6dof", "seed": 3, "learners": ["random"] }).to_string();
        assert_eq!(local.answered("POST", "/v1/sessions", opening.as_bytes()).status, 201);
        let (begun, _) = local.news("one", 0, 0).expect("a session");
        for _ in 0..requests {
            let made =
                local.answered("POST", "/v1/sessions/one/steps", json!({ "count": count }).to_string().as_bytes());
            assert_eq!(made.status, 200);
        }
        let (parts, reports) = local.news("one", begun.len(), 0).expect("a session");
        assert_eq!(reports.len() as u64, requests * count + 1);
        parts.len()
    };
    let (together, alone) = (parts(1, 25), parts(25, 1));
    assert!(2 * together < alone, "{together} parts, {alone} for one step after another");
}
