//! The engine in a visitor's browser beside the same engine natively, on one thread: steps of two learners and a calibration. Ratios within
//! one run are what counts.
//!
//! `cargo bench --bench browser`; Chromium and chromedriver are found on the path, or by the variables `CHROMIUM` and `CHROMEDRIVER`.

use std::{
    io::{BufRead, BufReader},
    process::{Child, Command, Stdio},
    time::Instant,
};

use body_schema_backend::{Answer, Local, Meshes, Workbench};
use body_schema_calibration::Silent;
use body_schema_engine::{Instructions, use_at_most};
use fantoccini::{Client, ClientBuilder};
use hyper_util::client::legacy::connect::HttpConnector;
use serde_json::{Value, json};

/// Scenarios, learners and how many steps are timed together.
const RUNS: [(&str, &str, u64); 4] =
    [("arm-6dof", "active", 60), ("arm-6dof", "global", 20), ("arm-12dof", "active", 30), ("arm-12dof", "global", 20)];
const CALIBRATED: &str = "panda-sockets";
/// Everything is done so often, in turn.
const ROUNDS: usize = 5;
/// How many threads the native engine uses is read where it starts.
const THREADS: &str = "RAYON_NUM_THREADS";
/// The page's workers, and what asks them for an answer and the milliseconds that it took.
const BEGIN: &str = "(async () => {
    const at = (id) => new URL(document.getElementById(id).dataset.address, document.baseURI).href;
    const worker = new Worker(new URL('worker.js', document.baseURI), { type: 'module' });
    const answered = () => new Promise((resolve, reject) => {
        worker.onmessage = ({ data }) => resolve(data);
        worker.onerror = (event) => reject(new Error(event.message));
    });
    worker.postMessage({ is: 'begin', script: at('engine-script'), wasm: at('engine-wasm'), bytes: 0, scenarios: [], sessions: [] });
    await answered();
    globalThis.timed = async (method, path, body) => {
        const begin = performance.now();
        worker.postMessage({ is: 'ask', number: 1, method, path, body });
        const { status, body: bytes } = await answered();
        return [status, new TextDecoder().decode(bytes), performance.now() - begin];
    };
    const { Bench } = await import(new URL('bench.js', document.baseURI).href);
    const bench = new Bench();
    await bench.ask({}, { examples: {} });
    globalThis.worked = async (files, ask) => {
        const begin = performance.now();
        const { answer } = await bench.ask(files, ask);
        return [200, JSON.stringify(answer), performance.now() - begin];
    };
    return 'ready';
})()";

/// A program that ends with the bench.
struct Program(Child);

impl Drop for Program {
    fn drop(&mut self) {
        drop(self.0.kill());
        drop(self.0.wait());
    }
}

/// Starts a program and waits for a line that has the word; the rest of the line after it.
fn started(mut command: Command, word: &'static str) -> (Program, String) {
    let mut program = Program(command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().expect("a program"));
    let lines = BufReader::new(program.0.stdout.take().expect("its output")).lines();
    let mut found = lines.map_while(Result::ok).filter_map(move |line| Some(line.split_once(word)?.1.to_owned()));
    let rest = found.next().expect("it starts");
    // What it says from now on is read by nobody, and must not stop it.
    std::thread::spawn(move || found.for_each(drop));
    (program, rest)
}

/// The native engine.
struct Native(Local);

impl Native {
    fn ask(&mut self, method: &str, path: &str, body: &Value) -> Value {
        let Answer { status, body } = self.0.answered(method, path, body.to_string().as_bytes());
        assert!(status < 300, "{method} {path}: {}", String::from_utf8_lossy(&body));
        serde_json::from_slice(&body).unwrap_or(Value::Null)
    }

    /// The milliseconds that so many steps of a new session take.
    fn steps(&mut self, scenario: &str, learner: &str, count: u64) -> f64 {
        let session = self.ask("POST", "/v1/sessions", &opening(scenario, learner));
        let path = format!("/v1/sessions/{}", session["id"].as_str().expect("an id"));
        let began = Instant::now();
        self.ask("POST", &format!("{path}/steps"), &json!({ "count": count, "reports": false }));
        let took = began.elapsed().as_secs_f64() * 1e3;
        self.ask("DELETE", &path, &Value::Null);
        took
    }
}

fn opening(scenario: &str, learner: &str) -> Value {
    json!({ "scenario": scenario, "seed": 4711, "learners": [learner] })
}

/// What the native workbench answers, and the milliseconds that it takes.
fn work(files: &Value, ask: &Value) -> (Value, f64) {
    let request = json!({ "files": files, "ask": ask, "recording": "native" }).to_string();
    let began = Instant::now();
    let worked = Workbench::default().work(request.as_bytes(), &Meshes::new(), &Silent);
    let took = began.elapsed().as_secs_f64() * 1e3;
    (serde_json::from_slice(&worked.answer.body).expect("JSON"), took)
}

/// The value of a promise in the page that has a status, a text and milliseconds.
async fn asked(page: &Client, promise: &str) -> (Value, f64) {
    let script = format!("const done = arguments[0]; ({promise}).then(done, (error) => done(String(error)));");
    let answer = page.execute_async(&script, Vec::new()).await.expect("a value");
    let status = answer[0].as_u64().unwrap_or_else(|| panic!("{promise}: {answer}"));
    assert!(status < 300, "{promise}: {answer}");
    (
        serde_json::from_str(answer[1].as_str().unwrap_or_default()).unwrap_or(Value::Null),
        answer[2].as_f64().expect("ms"),
    )
}

async fn browser_steps(page: &Client, scenario: &str, learner: &str, count: u64) -> f64 {
    let ask = |method: &str, path: &str, body: &Value| format!("timed(...{})", json!([method, path, body.to_string()]));
    let (session, _) = asked(page, &ask("POST", "/v1/sessions", &opening(scenario, learner))).await;
    let path = format!("/v1/sessions/{}", session["id"].as_str().expect("an id"));
    let body = json!({ "count": count, "reports": false });
    let (_, took) = asked(page, &ask("POST", &format!("{path}/steps"), &body)).await;
    asked(page, &ask("DELETE", &path, &Value::Null)).await;
    took
}

fn median(mut all: Vec<f64>) -> f64 {
    all.sort_by(f64::total_cmp);
    all[all.len() / 2]
}

/// A row of the table: the native times of each round with SSE2 alone and with all there is, and the browser's.
fn row(what: &str, unit: f64, rounds: &[[f64; 3]]) {
    let of = |place: usize| median(rounds.iter().map(|round| round[place] / unit).collect());
    let ratio = |place: usize| median(rounds.iter().map(|round| round[2] / round[place]).collect());
    println!("| {what} | {:.2} | {:.2} | {:.2} | {:.2} | {:.2} |", of(0), of(1), of(2), ratio(0), ratio(1));
}

async fn compared(page: &Client) {
    let mut ids = 0_u128;
    let mut native = Native(Local::new(move || {
        ids += 1;
        format!("00000000-0000-4000-8000-{ids:012x}")
    }));
    println!("| ms | native, SSE2 | native | Chromium | beside SSE2 | beside native |");
    println!("| --- | --- | --- | --- | --- | --- |");
    let baseline = [Instructions::Baseline, Instructions::Widest];
    for (scenario, learner, count) in RUNS {
        let mut rounds = Vec::new();
        // The first round warms all up.
        for round in 0..=ROUNDS {
            let [plain, wide] = baseline.map(|instructions| {
                use_at_most(instructions);
                native.steps(scenario, learner, count)
            });
            let there = browser_steps(page, scenario, learner, count).await;
            rounds.extend((round > 0).then_some([plain, wide, there]));
        }
        row(&format!("a step of `{learner}`, `{scenario}`, the first {count}"), count as f64, &rounds);
    }
    let (example, _) = work(&json!({}), &json!({ "example": { "name": CALIBRATED } }));
    let ask = json!({ "calibrate": { "file": example["file"], "text": example["text"] } });
    let mut rounds = Vec::new();
    for round in 0..ROUNDS {
        let [plain, wide] = baseline.map(|instructions| {
            use_at_most(instructions);
            work(&example["files"], &ask).1
        });
        let (_, there) = asked(page, &format!("worked(...{})", json!([example["files"], ask]))).await;
        rounds.extend((round > 0).then_some([plain, wide, there]));
    }
    row(&format!("`calibrate {CALIBRATED}`"), 1.0, &rounds);
}

fn program(variable: &str, usual: &str) -> Command {
    Command::new(std::env::var_os(variable).unwrap_or_else(|| usual.into()))
}

#[tokio::main(flavor = "current_thread")]
async fn main() {
    if std::env::var_os(THREADS).is_none_or(|threads| threads != "1") {
        let this = std::env::current_exe().expect("this program");
        let ended = Command::new(this).env(THREADS, "1").status().expect("this program");
        std::process::exit(ended.code().unwrap_or(1));
    }
    let mut serve = Command::new(env!("CARGO_BIN_EXE_body-schema"));
    serve.args(["serve", "--bind", "127.0.0.1:0", "--ephemeral"]);
    let (_server, rest) = started(serve, "http://127.0.0.1:");
    let port: String = rest.chars().take_while(char::is_ascii_digit).collect();
    let mut driver = program("CHROMEDRIVER", "chromedriver");
    driver.arg("--port=0");
    let (_driver, rest) = started(driver, "successfully on port ");
    let driver: String = rest.chars().take_while(char::is_ascii_digit).collect();
    let mut options = json!({ "args": ["--headless=new", "--no-sandbox", "--no-first-run", "--disable-gpu"] });
    if let Ok(binary) = std::env::var("CHROMIUM") {
        options["binary"] = binary.into();
    }
    // Calibrating takes longer than scripts usually may.
    let wanted = json!({ "goog:chromeOptions": options, "timeouts": { "script": 600_000 } });
    let page = ClientBuilder::new(HttpConnector::new())
        .capabilities(wanted.as_object().expect("an object").clone())
        .connect(&format!("http://127.0.0.1:{driver}"))
        .await
        .expect("Chromium starts");
    page.goto(&format!("http://127.0.0.1:{port}/calibrate.html")).await.expect("the page");
    let script = format!("const done = arguments[0]; ({BEGIN}).then(done, (error) => done(String(error)));");
    let ready = page.execute_async(&script, Vec::new()).await.expect("a value");
    assert_eq!(ready, "ready");
    compared(&page).await;
    drop(page.close().await);
}
