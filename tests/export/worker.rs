//! The engine in a real browser's worker beside the server: the same bytes.

use reqwest::Method;
use serde_json::{Value, json};

use super::{exported, in_browser};
use crate::{
    browser::driver::Browser,
    http::{local::assert_same, support::Server},
};

/// The engine's script, but that it draws these bytes for the ids of sessions: they are to be the server's.
const WITH_ID: &str = "import init from './engine.js';
crypto.getRandomValues = (bytes) => {
    const id = new URL(import.meta.url).searchParams.get('id').replaceAll('-', '');
    bytes.set(id.match(/../g).map((pair) => parseInt(pair, 16)).slice(0, bytes.length));
    return bytes;
};
export * from './engine.js';
export default init;";

/// A worker of the page's own script, and what asks it: its answer is the status and the bytes, a character each.
const BEGIN: &str = "(async () => {
    const at = (id) => new URL(document.getElementById(id).dataset.address, document.baseURI).href;
    globalThis.beside?.terminate();
    const worker = (globalThis.beside = new Worker(at('engine-worker'), { type: 'module' }));
    const answered = () => new Promise((resolve, reject) => {
        worker.onmessage = ({ data }) => resolve(data);
        worker.onerror = (event) => reject(new Error(event.message));
    });
    globalThis.askBeside = async (method, path, body) => {
        worker.postMessage({ is: 'ask', number: 1, method, path, body });
        const { status, body: bytes } = await answered();
        return [status, Array.from(new Uint8Array(bytes), (byte) => String.fromCharCode(byte)).join('')];
    };
    const script = new URL('engine/with-id.js?id=ID', document.baseURI).href;
    worker.postMessage({ is: 'begin', script, wasm: at('engine-wasm'), bytes: 0, shapes: at('engine-meshes'), scenarios: [], sessions: [] });
    return (await answered()).failure ?? 'ready';
})()";

/// A session in the browser and one of the same id in the server.
struct Both<'a> {
    page: &'a Browser,
    server: Server,
    session: String,
}

impl<'a> Both<'a> {
    async fn open(page: &'a Browser, opening: Value) -> Self {
        let server = Server::start().await;
        let there = server.post("/v1/sessions", opening.clone()).await.bytes().await.expect("a body");
        let id = serde_json::from_slice::<Value>(&there).expect("JSON")["id"].as_str().expect("an id").to_owned();
        assert_eq!(page.evaluate_later(&BEGIN.replace("ID", &id)).await, "ready");
        let both = Self { page, server, session: format!("/v1/sessions/{id}") };
        let (status, here) = both.ask(&Method::POST, "/v1/sessions", &opening.to_string()).await;
        assert_eq!((status, String::from_utf8_lossy(&here)), (201, String::from_utf8_lossy(&there)));
        both
    }

    /// What the browser answers.
    async fn ask(&self, method: &Method, path: &str, body: &str) -> (u16, Vec<u8>) {
        let asked = json!([method.as_str(), path, body]);
        let answer = self.page.evaluate_later(&format!("askBeside(...{asked})")).await;
        let status = answer[0].as_u64().unwrap_or_else(|| panic!("{method} {path}: {answer}"));
        let bytes =
            answer[1].as_str().expect("bytes").chars().map(|byte| u8::try_from(u32::from(byte)).expect("a byte"));
        (status as u16, bytes.collect())
    }

    /// Both answer the same.
    async fn same(&self, method: Method, path: &str, body: Option<Value>) {
        let path = format!("{}{path}", self.session);
        let request = self.server.request(method.clone(), &path);
        let request = body.iter().fold(request, |request, body| request.json(body));
        let there = request.send().await.expect("an answer");
        let status = there.status().as_u16();
        let there = there.bytes().await.expect("a body");
        let here = self.ask(&method, &path, &body.map(|body| body.to_string()).unwrap_or_default()).await;
        assert_same(&format!("{method} {path}"), (here.0, &here.1), (status, &there));
    }
}

/// Makes steps in both, so many at a time, and asks both for everything.
async fn hold(page: &Browser, scenario: &str, steps: u64, at_once: u64) {
    let both = Both::open(page, json!({ "scenario": scenario, "seed": 4711 })).await;
    for made in (0..steps).step_by(at_once as usize) {
        let body = json!({ "count": at_once.min(steps - made), "expected_step": made, "frames": 2 });
        both.same(Method::POST, "/steps", Some(body)).await;
        if made == 0 {
            both.same(Method::GET, "/recording.rrd", None).await;
        }
    }
    let description = both.server.get_json(&both.session).await["description"].clone();
    let learner = description["learners"][0]["name"].as_str().expect("a name").to_owned();
    let joints = description["joints"].as_array().expect("joints").len();
    let posture = json!({ "configuration": vec![0.1; joints], "show": true });
    both.same(Method::GET, "", None).await;
    both.same(Method::GET, &format!("/learners/{learner}/selection"), None).await;
    both.same(Method::POST, &format!("/learners/{learner}/evaluations"), Some(posture)).await;
    for file in ["/result.json", "/steps.csv", "/blueprint.rbl?theme=dark&aspect=1.250"] {
        both.same(Method::GET, file, None).await;
    }
    both.same(Method::GET, &format!("/blueprint.rbl?learner={learner}"), None).await;
    both.server.stop().await;
}

async fn in_both(scenarios: &'static [(&'static str, u64)], at_once: u64) {
    let folder = exported(&[]);
    std::fs::write(folder.path().join("engine/with-id.js"), WITH_ID).expect("written");
    in_browser(folder.path(), "/demo/", move |page, host| async move {
        page.open(&host.at("?scenario=positioner&learners=random")).await;
        page.wait_for_state("the page's own run", "state.phase === 'ready' && state.step === '1'").await;
        for (scenario, steps) in scenarios {
            hold(&page, scenario, *steps, at_once).await;
        }
    })
    .await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_browsers_worker_answers_as_the_server_does() {
    let scenarios = &[
        ("arm-6dof", 5),
        ("arm-12dof", 2),
        ("head-fov", 5),
        ("body-change", 3),
        ("arm-6dof-camera", 2),
        ("arm-7dof-socket", 2),
        ("arm-6dof-outliers", 2),
        ("panda-sockets", 2),
        ("tiago-mocap", 3),
    ];
    in_both(scenarios, 3).await;
}

/// Two hundred steps of six scenarios: for the program in release mode, in which the server is no slower than the browser.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
#[ignore = "a minute, .ci/nightly bits: cargo test --test all -- --ignored the_browsers_worker_answers_for_long"]
async fn the_browsers_worker_answers_for_long_as_the_server_does() {
    let scenarios = &[
        ("arm-6dof", 200),
        ("arm-12dof", 200),
        ("head-fov", 200),
        ("arm-6dof-camera", 200),
        ("tiago-mocap", 37),
        ("body-change", 200),
    ];
    in_both(scenarios, 10).await;
}
