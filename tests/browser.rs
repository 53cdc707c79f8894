//! The page in a real browser: Chromium, driven by chromedriver.
//!
//! Without the two this is skipped, unless the environment has `CI` or `BODY_SCHEMA_REQUIRE_BROWSER=1`. They are looked
//! for in `PATH`, or where `CHROMEDRIVER` and `CHROMIUM` say.
#![cfg(feature = "app")]

#[path = "browser/driver.rs"]
mod driver;
#[path = "browser/pixels.rs"]
mod pixels;

use std::{net::SocketAddr, time::Duration};

use body_schema::server::{Options, serve};
use driver::Browser;
use pixels::Picture;
use serde_json::{Value, json};
use tokio::{net::TcpListener, task::JoinHandle};
use tokio_util::sync::CancellationToken;

/// Long, because the pictures are computed without a graphics card.
const DRAWN_WITHIN: Duration = Duration::from_secs(120);

struct Server {
    address: SocketAddr,
    shutdown: CancellationToken,
    serving: JoinHandle<()>,
}

impl Server {
    async fn start(address: SocketAddr) -> Self {
        let listener = TcpListener::bind(address).await.expect("a port");
        let (address, shutdown) = (listener.local_addr().expect("an address"), CancellationToken::new());
        let serving = serve(listener, Options::default(), shutdown.clone());
        let serving = tokio::spawn(async { serving.await.expect("no error") });
        Self { address, shutdown, serving }
    }

    async fn stop(self) {
        self.shutdown.cancel();
        self.serving.await.expect("no panic");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_page_steps_and_shows() {
    let Some(browser) = Browser::start().await else { return };
    let server = Server::start(([127, 0, 0, 1], 0).into()).await;
    let address = server.address;
    // In a task of its own, so that the browser is closed whatever becomes of it.
    let page = browser.clone();
    let outcome = tokio::spawn(async move { visit(&page, server).await }).await;
    let (errors, hosts) = (browser.errors().await, browser.hosts().await);
    browser.stop().await;
    if let Err(panic) = outcome {
        eprintln!("errors in the console: {errors:#?}");
        std::panic::resume_unwind(panic.into_panic());
    }
    // While the server was away, requests had to fail, but none for the content security policy.
    assert!(!errors.iter().any(|error| error.contains("Content Security Policy")), "{errors:#?}");
    assert_eq!(hosts, [address.to_string()], "every request goes to this host");
}

async fn visit(page: &Browser, server: Server) {
    let address = server.address;
    page.open(&format!("http://{address}/")).await;

    // The first movement is shown without anybody's doing.
    page.wait_for("the viewer", "document.getElementById('cover').hidden").await;
    page.wait_for("step 1", "document.getElementById('counter').textContent === 'step 1'").await;
    let first = drawn(page, |_| true).await;

    // Stepping changes the scene, and counts.
    page.press("step").await;
    page.wait_for("step 2", "document.getElementById('counter').textContent === 'step 2'").await;
    let second = drawn(page, |picture| picture.differs_from(&first)).await;
    let rows = page.evaluate("[...document.querySelectorAll('#learners tr')].map((row) => row.innerText)").await;
    assert_eq!(rows.as_array().expect("rows").len(), 3, "{rows}");
    assert!(rows.to_string().contains("not converged yet"), "{rows}");

    // A run goes on until it is paused.
    page.press("run").await;
    page.wait_for("some steps", "Number(document.getElementById('counter').textContent.split(' ')[1]) >= 4").await;
    assert_eq!(page.evaluate("document.getElementById('run').textContent").await, "Pause");
    page.press("run").await;
    page.wait_for("the pause", "!document.getElementById('step').disabled").await;
    drawn(page, |picture| picture.differs_from(&second)).await;

    // Reset opens another session; a reload keeps it.
    let session = page.evaluate("location.search").await;
    page.press("reset").await;
    page.wait_for("another session", &format!("location.search !== {session}")).await;
    page.wait_for("step 1", "document.getElementById('counter').textContent === 'step 1'").await;
    let session = page.evaluate("location.search").await;
    page.open(&format!("http://{address}/{}", session.as_str().expect("text"))).await;
    page.wait_for("step 1", "document.getElementById('counter').textContent === 'step 1'").await;
    assert_eq!(page.evaluate("location.search").await, session);

    recorded_data_end(page, address).await;

    assert_eq!(page.errors().await, Vec::<String>::new(), "errors in the console");

    // A server that goes away and comes back without the session.
    server.stop().await;
    page.wait_for("the loss", "document.getElementById('status').textContent.includes('connection is lost')").await;
    let server = Server::start(address).await;
    page.wait_for("the news", "document.getElementById('status').textContent.includes('session is gone')").await;
    page.press("reset").await;
    page.wait_for("a new session", "document.getElementById('counter').textContent.startsWith('step 1')").await;
    server.stop().await;
}

/// A session of recorded data that is stepped from elsewhere until one movement is left.
async fn recorded_data_end(page: &Browser, address: SocketAddr) {
    page.evaluate(
        "(() => { const choice = document.getElementById('scenario'); choice.value = 'tiago-mocap';
            choice.dispatchEvent(new Event('change')); })()",
    )
    .await;
    page.wait_for("26 left", "document.getElementById('counter').textContent === 'step 1, 26 left'").await;
    let session = page.evaluate("new URLSearchParams(location.search).get('session')").await;
    let steps = format!("http://{address}/v1/sessions/{}/steps", session.as_str().expect("an id"));
    let client = reqwest::Client::builder().no_proxy().build().expect("a client");
    client.post(steps).json(&json!({ "count": 25 })).send().await.expect("an answer").error_for_status().expect("done");
    page.wait_for("1 left", "document.getElementById('counter').textContent === 'step 26, 1 left'").await;
    page.press("run").await;
    page.wait_for("the end", "document.getElementById('status').textContent.includes('end of the recorded data')")
        .await;
    let state = page.evaluate("['step', 'run'].map((id) => document.getElementById(id).disabled)").await;
    assert_eq!(state, json!([true, true]), "there is nothing left to do");
    let text = page.evaluate("document.querySelector('.learners').innerText").await;
    let text = text.as_str().expect("text");
    assert!(text.contains('–') && text.contains("no known truth"), "{text}");
}

/// A picture in which all learners are drawn and that is as asked.
async fn drawn(page: &Browser, is_it: impl Fn(&Picture) -> bool) -> Picture {
    let top: Value = page.evaluate("document.getElementById('viewer').getBoundingClientRect().top").await;
    let top = top.as_f64().expect("a number") as usize;
    let deadline = tokio::time::Instant::now() + DRAWN_WITHIN;
    loop {
        let picture = Picture::of_scene(&page.screenshot().await, top);
        if picture.shows_all_learners() && is_it(&picture) {
            return picture;
        }
        if tokio::time::Instant::now() > deadline {
            let file = std::env::temp_dir().join("body-schema-page.png");
            drop(std::fs::write(&file, page.screenshot().await));
            panic!("the scene is not drawn: {:?}; see {}", picture.counts(), file.display());
        }
        tokio::time::sleep(Duration::from_millis(500)).await;
    }
}
