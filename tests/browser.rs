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
use serde_json::Value;
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
        // Another build of the panel than the embedded one may be tested.
        let panel_dir = std::env::var_os("BODY_SCHEMA_PANEL_DIR").map(Into::into);
        let serving = serve(listener, Options { panel_dir, ..Options::default() }, shutdown.clone());
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

const SPACE: char = ' ';
const LEFT: char = '\u{e012}';
const RIGHT: char = '\u{e014}';
const ESCAPE: char = '\u{e00c}';

async fn visit(page: &Browser, server: Server) {
    let address = server.address;
    page.open(&format!("http://{address}/")).await;

    // The first movement is shown without anybody's doing.
    page.wait_for_state("step 1", "state.phase === 'ready' && state.step === '1'").await;
    page.wait_for("the scene", "document.getElementById('cover').hidden").await;
    page.press(ESCAPE).await;
    let first = drawn(page, |_| true).await;

    // Keys drive the server; going back makes nothing new.
    page.press('s').await;
    page.wait_for_state("step 2", "state.step === '2' && state.phase === 'ready'").await;
    drawn(page, |picture| picture.differs_from(&first)).await;
    page.press(LEFT).await;
    page.wait_for_state("one step back", "state.step === '1' && state.latest === '2'").await;
    page.press(RIGHT).await;
    page.wait_for_state("one step on", "state.step === '2' && state.latest === '2'").await;
    page.press(SPACE).await;
    page.wait_for_state("some steps", "Number(state.latest) >= 6").await;
    page.press(SPACE).await;
    page.wait_for_state("the pause", "state.phase === 'ready'").await;
    let words = page.evaluate("document.getElementById('mirror').textContent").await;
    assert!(words.as_str().expect("text").contains("active: not converged"), "{words}");

    // A reload keeps session and step.
    page.wait_for(
        "the address",
        "new URLSearchParams(location.search).get('step') === document.getElementById('mirror').dataset.step",
    )
    .await;
    let before = page.evaluate("[location.search, document.getElementById('mirror').dataset.step]").await;
    page.open(&format!("http://{address}/{}", before[0].as_str().expect("text"))).await;
    page.wait_for_state("the same step", &format!("state.phase === 'ready' && state.step === {}", before[1])).await;
    assert_eq!(page.evaluate("location.search").await, before[0]);

    // What an address gets wrong is told.
    page.open(&format!("http://{address}/?v=1&scenario=tiago-mocap&seed=-1&step=3")).await;
    page.wait_for_state("step 3", "state.phase === 'ready' && state.step === '3'").await;
    page.wait_for("the notice", "document.getElementById('mirror').textContent.includes('seed=-1')").await;

    assert_eq!(page.errors().await, Vec::<String>::new(), "errors in the console");

    // A server that goes away and comes back without the session: the run is computed again.
    server.stop().await;
    page.wait_for_state("the loss", "state.phase === 'lost'").await;
    let server = Server::start(address).await;
    page.wait_for_state("the run", "state.phase === 'ready' && state.step === '3'").await;
    server.stop().await;
}

/// A picture in which all learners are drawn and that is as asked.
async fn drawn(page: &Browser, is_it: impl Fn(&Picture) -> bool) -> Picture {
    let place: Value = page
        .evaluate("(({ left, top }) => [left, top])(document.getElementById('viewer').getBoundingClientRect())")
        .await;
    let [left, top] = [0, 1].map(|index| place[index].as_f64().expect("a number") as usize);
    let deadline = tokio::time::Instant::now() + DRAWN_WITHIN;
    loop {
        let picture = Picture::of_scene(&page.screenshot().await, left, top);
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
