//! Chromium and chromedriver.

use std::{
    collections::BTreeSet,
    io::{BufRead, BufReader, Read},
    path::{Path, PathBuf},
    process::{Child, ChildStdout, Command, Stdio},
    sync::Arc,
    time::Duration,
};

use fantoccini::{
    Client, ClientBuilder,
    actions::{InputSource, KeyAction, KeyActions},
    error::CmdError,
    wd::WindowHandle,
};
use hyper_util::client::legacy::connect::HttpConnector;
use reqwest::Url;
use serde_json::{Value, json};
use tokio::time::Instant;

use crate::browser::devtools::{Log, Network};

/// How long the page may take to do something: machines that draw without a graphics card, and do other things beside it, are slow.
const WAIT: Duration = Duration::from_secs(240);

/// A headless browser that draws without a graphics card and calls nobody by itself.
const FLAGS: &str = "--headless=new --no-sandbox --use-gl=angle --use-angle=swiftshader --enable-unsafe-swiftshader \
    --ignore-gpu-blocklist --disable-quic --no-first-run --disable-background-networking --disable-component-update \
    --disable-sync --window-size=1280,900";

/// A browser with one page.
#[derive(Clone)]
pub struct Browser {
    client: Client,
    _driver: Arc<Driver>,
    _profile: Arc<tempfile::TempDir>,
}

impl Browser {
    /// Starts a browser with these flags too; without one the test is skipped, unless it must not be.
    pub async fn start(more_flags: &[&str]) -> Option<Self> {
        let driver = find("CHROMEDRIVER", &["chromedriver"]);
        let chromium = find("CHROMIUM", &["chromium", "chromium-browser", "google-chrome"]);
        let (Some(driver), Some(chromium)) = (&driver, &chromium) else {
            let missing = if driver.is_none() { "chromedriver" } else { "chromium" };
            let set = |name: &str| std::env::var(name).is_ok_and(|value| !value.is_empty() && value != "0");
            let required = set("CI") || set("BODY_SCHEMA_REQUIRE_BROWSER");
            assert!(!required, "{missing} is not installed, and this test must not be skipped here");
            eprintln!("skipped: {missing} is not installed");
            return None;
        };
        let (driver, port) = Driver::start(driver);
        let profile = tempfile::tempdir().expect("a directory");
        let mut flags: Vec<String> = FLAGS.split(' ').map(str::to_owned).collect();
        flags.extend(more_flags.iter().map(|flag| (*flag).to_owned()));
        flags.push(format!("--user-data-dir={}", profile.path().display()));
        let capabilities = json!({
            "goog:chromeOptions": { "args": flags, "binary": chromium },
            "goog:loggingPrefs": { "browser": "ALL", "performance": "ALL" },
            "timeouts": { "script": WAIT.as_millis() as u64 },
        });
        let client = ClientBuilder::new(HttpConnector::new())
            .capabilities(capabilities.as_object().expect("an object").clone())
            .connect(&format!("http://127.0.0.1:{port}"))
            .await
            .expect("Chromium starts");
        Some(Self { client, _driver: Arc::new(driver), _profile: Arc::new(profile) })
    }

    pub async fn stop(self) {
        drop(self.client.close().await);
    }

    pub async fn open(&self, address: &str) {
        self.client.goto(address).await.expect("the page");
    }

    /// The tab that is in front.
    pub async fn tab(&self) -> WindowHandle {
        self.client.window().await.expect("a tab")
    }

    /// Opens a tab and puts it in front: in a window of its own, since those in the background are not drawn.
    pub async fn new_tab(&self) -> WindowHandle {
        let tab = self.client.new_window(false).await.expect("a tab").handle;
        self.switch_to(&tab).await;
        tab
    }

    pub async fn switch_to(&self, tab: &WindowHandle) {
        self.client.switch_to_window(tab.clone()).await.expect("the tab");
    }

    /// Gives the tab a connection with a latency (ms) and a throughput (bytes a second); `None` for the usual one.
    pub async fn slow_down(&self, conditions: Option<(u64, u64)>) {
        self.client.issue_cmd(Network(conditions)).await.expect("another connection");
    }

    /// The value of a JavaScript expression.
    pub async fn evaluate(&self, expression: &str) -> Value {
        self.client.execute(&format!("return {expression};"), Vec::new()).await.expect("a value")
    }

    /// Runs a script.
    pub async fn run(&self, script: &str) {
        self.client.execute(script, Vec::new()).await.expect("a script");
    }

    /// The value of a promise.
    pub async fn evaluate_later(&self, promise: &str) -> Value {
        self.promised(promise).await.expect("a value")
    }

    async fn promised(&self, promise: &str) -> Result<Value, CmdError> {
        let script = format!("const done = arguments[0]; ({promise}).then(done, (error) => done(String(error)));");
        self.client.execute_async(&script, Vec::new()).await
    }

    /// Waits until a condition holds. Between two pages of the browser's history it is an error for a moment: what it asks about is
    /// not there yet.
    pub async fn wait_for(&self, what: &str, condition: &str) {
        let (began, script) = (Instant::now(), format!("return [{condition}, performance.now() / 1e3];"));
        let deadline = began + WAIT;
        loop {
            let found = self.client.execute(&script, Vec::new()).await;
            if let Ok(Value::Array(found)) = &found
                && let [Value::Bool(true), age] = &found[..]
            {
                // Where a test fails, its output says how long each of what was waited for took.
                let age = age.as_f64().unwrap_or_default();
                let waited = began.elapsed().as_secs_f64();
                eprintln!("after {waited:.1} s, {age:.1} s after the page was asked for: {what}");
                return;
            }
            if Instant::now() > deadline {
                let file = std::env::temp_dir().join("body-schema-page.png");
                drop(std::fs::write(&file, self.screenshot().await));
                let says = self.evaluate("document.body.innerText").await;
                panic!("no {what}, but {found:?}; see {}; the page says: {says}", file.display());
            }
            tokio::time::sleep(Duration::from_millis(100)).await;
        }
    }

    /// Waits until a promise is of something that holds. While the page begins again it is an error for a moment.
    pub async fn wait_for_later(&self, what: &str, promise: &str) {
        let deadline = Instant::now() + WAIT;
        loop {
            let found = self.promised(promise).await;
            if matches!(found, Ok(Value::Bool(true))) {
                return;
            }
            assert!(Instant::now() < deadline, "no {what}, but {found:?}");
            tokio::time::sleep(Duration::from_millis(200)).await;
        }
    }

    /// Presses a key, wherever the focus is.
    pub async fn press(&self, key: char) {
        let keys = KeyActions::new("keyboard".to_owned());
        let keys = keys.then(KeyAction::Down { value: key }).then(KeyAction::Up { value: key });
        self.client.perform_actions(keys).await.expect("a key press");
    }

    /// Presses a key while another is held.
    pub async fn press_with(&self, held: char, key: char) {
        let keys = KeyActions::new("keyboard".to_owned()).then(KeyAction::Down { value: held });
        let keys = keys.then(KeyAction::Down { value: key }).then(KeyAction::Up { value: key });
        self.client.perform_actions(keys.then(KeyAction::Up { value: held })).await.expect("a key press");
    }

    /// What has the focus: its id, or how it is called.
    pub async fn focus(&self) -> String {
        let name = "((one) => one.id || one.getAttribute('aria-label') || one.textContent)(document.activeElement)";
        self.evaluate(name).await.as_str().expect("text").to_owned()
    }

    /// One page back in the browser's history, or one forth.
    pub async fn go(&self, pages: i32) {
        self.run(&format!("history.go({pages})")).await;
    }

    /// What the page tells assistive technology, and scripts.
    pub async fn wait_for_state(&self, what: &str, condition: &str) {
        let condition = format!("((state) => {condition})(document.getElementById('mirror').dataset)");
        self.wait_for(what, &condition).await;
    }

    pub async fn screenshot(&self) -> Vec<u8> {
        // A busy machine may draw for longer than chromedriver waits.
        for _ in 0..5 {
            if let Ok(picture) = self.client.screenshot().await {
                return picture;
            }
        }
        self.client.screenshot().await.expect("a picture")
    }

    /// The errors in the console, and what scripts have written to it.
    pub async fn console(&self) -> Vec<String> {
        let entries = self.log("browser").await;
        // What else is there comes from the browser itself, about its graphics.
        let ours = entries.iter().filter(|entry| entry["level"] == "SEVERE" || entry["source"] == "console-api");
        ours.map(|entry| entry["message"].to_string()).collect()
    }

    pub(crate) fn client(&self) -> &Client {
        &self.client
    }

    /// The hosts that the page has asked for anything.
    pub async fn hosts(&self) -> Vec<String> {
        let entries = self.log("performance").await;
        let addresses = entries.iter().filter_map(|entry| {
            let message: Value = serde_json::from_str(entry["message"].as_str()?).ok()?;
            let params = &message["message"]["params"];
            let address = match message["message"]["method"].as_str()? {
                "Network.requestWillBeSent" => &params["request"]["url"],
                "Network.webSocketCreated" => &params["url"],
                _ => return None,
            };
            Url::parse(address.as_str()?).ok()
        });
        let to_hosts = addresses.filter(|address| matches!(address.scheme(), "http" | "https" | "ws" | "wss"));
        let hosts: BTreeSet<String> = to_hosts.map(|address| address.authority().to_owned()).collect();
        hosts.into_iter().collect()
    }

    async fn log(&self, kind: &'static str) -> Vec<Value> {
        let entries = self.client.issue_cmd(Log(kind)).await.expect("a log");
        entries.as_array().expect("entries").clone()
    }
}

/// Chromedriver, as long as it is needed.
struct Driver {
    child: Child,
    /// Kept open: a driver that cannot write ends.
    _output: BufReader<ChildStdout>,
}

impl Driver {
    /// Starts it on a port of its choice.
    fn start(program: &Path) -> (Self, u16) {
        let command = Command::new(program).arg("--port=0").stdout(Stdio::piped()).stderr(Stdio::null()).spawn();
        let mut child = command.expect("chromedriver starts");
        let mut output = BufReader::new(child.stdout.take().expect("an output"));
        let mut lines = output.by_ref().lines().map_while(Result::ok);
        let port =
            lines.find_map(|line| Some(line.split_once("successfully on port ")?.1.trim_end_matches('.').parse()));
        drop(lines);
        (Self { child, _output: output }, port.and_then(Result::ok).expect("chromedriver names its port"))
    }
}

impl Drop for Driver {
    fn drop(&mut self) {
        drop(self.child.kill());
        drop(self.child.wait());
    }
}

fn find(variable: &str, names: &[&str]) -> Option<PathBuf> {
    if let Some(path) = std::env::var_os(variable) {
        return Some(path.into());
    }
    let paths: Vec<PathBuf> = std::env::var_os("PATH").iter().flat_map(std::env::split_paths).collect();
    names.iter().find_map(|name| paths.iter().map(|path| path.join(name)).find(|file| file.is_file()))
}
