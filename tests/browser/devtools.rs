//! Chromedriver's own commands: logs, connections, screens, fingers.

use std::time::Duration;

use fantoccini::wd::WebDriverCompatibleCommand;
use reqwest::{Method, Url};
use serde_json::{Value, json};

use crate::browser::driver::Browser;

impl Browser {
    /// Gives the tab a screen of this size, pixels.
    pub async fn screen(&self, width: u32, height: u32, touch: bool) {
        let size = json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": touch });
        self.tell("Emulation.setDeviceMetricsOverride", size).await;
        self.tell("Emulation.setTouchEmulationEnabled", json!({ "enabled": touch })).await;
    }

    /// Prefers `light` or `dark`.
    pub async fn scheme(&self, scheme: &str) {
        let features = json!({ "features": [{ "name": "prefers-color-scheme", "value": scheme }] });
        self.tell("Emulation.setEmulatedMedia", features).await;
    }

    /// Wants nothing to move by itself.
    pub async fn reduced_motion(&self) {
        let features = json!({ "features": [{ "name": "prefers-reduced-motion", "value": "reduce" }] });
        self.tell("Emulation.setEmulatedMedia", features).await;
    }

    /// Lets pages read the clipboard.
    pub async fn open_clipboard(&self) {
        let permissions = json!({ "permissions": ["clipboardReadWrite", "clipboardSanitizedWrite"] });
        self.tell("Browser.grantPermissions", permissions).await;
    }

    /// Moves the pointer to a point of the page, pixels from its upper left corner.
    pub async fn point(&self, x: f64, y: f64) {
        self.mouse("mouseMoved", "none", [x, y]).await;
    }

    /// Clicks on a point of the page.
    pub async fn click(&self, x: f64, y: f64) {
        self.point(x, y).await;
        self.mouse("mousePressed", "left", [x, y]).await;
        self.mouse("mouseReleased", "left", [x, y]).await;
    }

    /// Presses on a point of the page, moves the pointer so far and releases it.
    pub async fn drag(&self, [x, y]: [f64; 2], [right, down]: [f64; 2]) {
        const MOVES: u32 = 4;
        self.point(x, y).await;
        self.mouse("mousePressed", "left", [x, y]).await;
        for step in 1..=MOVES {
            let part = f64::from(step) / f64::from(MOVES);
            self.mouse("mouseMoved", "left", [x + part * right, y + part * down]).await;
        }
        self.mouse("mouseReleased", "left", [x + right, y + down]).await;
    }

    async fn mouse(&self, kind: &str, button: &str, [x, y]: [f64; 2]) {
        // What is held down during a movement has to be said once more.
        let buttons = u8::from(kind != "mouseReleased" && button == "left");
        let event = json!({ "type": kind, "x": x, "y": y, "button": button, "buttons": buttons, "clickCount": 1 });
        self.tell("Input.dispatchMouseEvent", event).await;
        // Canvases look at the pointer once a frame.
        tokio::time::sleep(Duration::from_millis(300)).await;
    }

    /// Puts a finger on a point and moves it up or down.
    pub async fn swipe(&self, [x, y]: [f64; 2], down: f64) {
        const MOVES: u32 = 10;
        let touch = |kind: &str, points: Value| json!({ "type": kind, "touchPoints": points });
        self.tell("Input.dispatchTouchEvent", touch("touchStart", json!([{ "x": x, "y": y }]))).await;
        for step in 1..=MOVES {
            let y = y + down * f64::from(step) / f64::from(MOVES);
            self.tell("Input.dispatchTouchEvent", touch("touchMove", json!([{ "x": x, "y": y }]))).await;
            tokio::time::sleep(Duration::from_millis(30)).await;
        }
        self.tell("Input.dispatchTouchEvent", touch("touchEnd", json!([]))).await;
    }

    /// Runs a script before those of every page that is opened from now on, under this name.
    pub async fn before_scripts(&self, script: &str) -> String {
        let answer = self.tell("Page.addScriptToEvaluateOnNewDocument", json!({ "source": script })).await;
        answer["identifier"].as_str().expect("a name").to_owned()
    }

    /// Runs that script no more.
    pub async fn without(&self, script: &str) {
        self.tell("Page.removeScriptToEvaluateOnNewDocument", json!({ "identifier": script })).await;
    }

    async fn tell(&self, command: &'static str, parameters: Value) -> Value {
        self.client().issue_cmd(DevTools(command, parameters)).await.expect(command)
    }
}

/// Chromedriver's own command for logs.
#[derive(Debug)]
pub(crate) struct Log(pub(crate) &'static str);

impl WebDriverCompatibleCommand for Log {
    fn endpoint(&self, base: &Url, session: Option<&str>) -> Result<Url, <Url as std::str::FromStr>::Err> {
        base.join(&format!("session/{}/se/log", session.unwrap_or_default()))
    }

    fn method_and_body(&self, _: &Url) -> (Method, Option<String>) {
        (Method::POST, Some(json!({ "type": self.0 }).to_string()))
    }
}

/// A command of the developer tools, by way of chromedriver.
#[derive(Debug)]
struct DevTools(&'static str, Value);

impl WebDriverCompatibleCommand for DevTools {
    fn endpoint(&self, base: &Url, session: Option<&str>) -> Result<Url, <Url as std::str::FromStr>::Err> {
        base.join(&format!("session/{}/goog/cdp/execute", session.unwrap_or_default()))
    }

    fn method_and_body(&self, _: &Url) -> (Method, Option<String>) {
        (Method::POST, Some(json!({ "cmd": self.0, "params": self.1 }).to_string()))
    }
}

/// Chromedriver's own command for the connection: latency (ms) and throughput (bytes a second).
#[derive(Debug)]
pub(crate) struct Network(pub(crate) Option<(u64, u64)>);

impl WebDriverCompatibleCommand for Network {
    fn endpoint(&self, base: &Url, session: Option<&str>) -> Result<Url, <Url as std::str::FromStr>::Err> {
        base.join(&format!("session/{}/chromium/network_conditions", session.unwrap_or_default()))
    }

    fn method_and_body(&self, _: &Url) -> (Method, Option<String>) {
        let Some((latency, throughput)) = self.0 else { return (Method::DELETE, None) };
        let conditions = json!({ "offline": false, "latency": latency, "throughput": throughput });
        (Method::POST, Some(json!({ "network_conditions": conditions }).to_string()))
    }
}
