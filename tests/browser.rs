//! The page in a real browser: Chromium, driven by chromedriver.
//!
//! Without the two this is skipped, unless the environment has `CI` or `BODY_SCHEMA_REQUIRE_BROWSER=1`. They are looked
//! for in `PATH`, or where `CHROMEDRIVER` and `CHROMIUM` say.
#![cfg(feature = "app")]

#[path = "browser/driver.rs"]
mod driver;
#[path = "browser/newcomer.rs"]
mod newcomer;
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

/// What a browser is told by its flags when it may not draw at all.
const NO_WEBGL: &[&str] = &["--disable-3d-apis", "--disable-gpu", "--disable-software-rasterizer"];

/// Does something with a server in a browser of its own, and holds what must always hold: every request goes to the
/// server, and the content security policy refuses nothing.
async fn in_browser<Visit: Future<Output = ()> + Send + 'static>(
    flags: &[&str],
    visit: impl FnOnce(Browser, Server) -> Visit,
) {
    // One after the other: each draws without a graphics card, with all the processors there are.
    static TURN: tokio::sync::Mutex<()> = tokio::sync::Mutex::const_new(());
    let _turn = TURN.lock().await;
    let Some(browser) = Browser::start(flags).await else { return };
    let server = Server::start(([127, 0, 0, 1], 0).into()).await;
    let address = server.address;
    // In a task of its own, so that the browser is closed whatever becomes of it.
    let outcome = tokio::spawn(visit(browser.clone(), server)).await;
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

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_page_steps_and_shows() {
    in_browser(&[], |page, server| async move { visit(&page, server).await }).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn two_tabs_do_not_mix_and_late_visitors_see_everything() {
    in_browser(&[], |page, server| async move { visit_in_tabs(&page, server).await }).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_newcomer_is_told_the_first_story() {
    in_browser(&[], |page, server| async move { newcomer::visit(&page, server).await }).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn without_webgl_the_page_says_what_to_do() {
    in_browser(NO_WEBGL, |page, server| async move {
        page.open(&format!("http://{}/", server.address)).await;
        page.wait_for_state("the end", "state.phase === 'failed'").await;
        let text = page.evaluate("document.getElementById('panel-cover').innerText").await;
        for word in ["cannot be shown", "WebGL 2", "/v1/openapi.json"] {
            assert!(text.as_str().expect("text").contains(word), "{word} is in: {text}");
        }
        server.stop().await;
    })
    .await;
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

    // Moving the scene's time moves the panel: a click on the left end of its timeline.
    let scene = "(({ left, bottom, width }) => [left, bottom, width])\
        (document.getElementById('viewer').getBoundingClientRect())";
    let place = page.evaluate(scene).await;
    let [left, bottom, width] = [0, 1, 2].map(|index| place[index].as_f64().expect("a number"));
    let latest = page.evaluate("document.getElementById('mirror').dataset.latest").await;
    let moved = format!("document.getElementById('mirror').dataset.step !== {latest}");
    // While the scene is on its way to the latest step, clicks have no effect.
    for _ in 0..20 {
        page.click(left + 0.45 * width, bottom - 14.0).await;
        if page.evaluate(&moved).await == true {
            break;
        }
    }
    page.wait_for_state("an earlier step", &format!("state.step !== {latest} && state.latest === {latest}")).await;

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

async fn visit_in_tabs(page: &Browser, server: Server) {
    let address = server.address;
    let session = "document.getElementById('mirror').dataset.session";
    page.open(&format!("http://{address}/?v=1&scenario=arm-6dof&seed=1&learners=random")).await;
    page.wait_for_state("the first tab", "state.phase === 'ready' && state.step === '1'").await;
    page.press(ESCAPE).await;
    let first = page.evaluate(session).await;

    // Another tab has a session of its own.
    let one = page.tab().await;
    let other = page.new_tab().await;
    page.open(&format!("http://{address}/?v=1&scenario=arm-6dof&seed=2&learners=random")).await;
    page.wait_for_state("the second tab", "state.phase === 'ready' && state.step === '1'").await;
    assert_ne!(page.evaluate(session).await, first);
    for step in 2..=4 {
        page.press('s').await;
        page.wait_for_state("a step", &format!("state.phase === 'ready' && state.step === '{step}'")).await;
    }
    let words = page.evaluate("document.getElementById('mirror').textContent").await;
    assert!(words.as_str().expect("text").contains("seed 2"), "{words}");
    page.switch_to(&one).await;
    page.wait_for_state("the first tab as it was", "state.latest === '1'").await;
    assert_eq!(page.evaluate(session).await, first);
    let words = page.evaluate("document.getElementById('mirror').textContent").await;
    assert!(words.as_str().expect("text").contains("seed 1"), "{words}");

    // Whoever comes late to the second session sees it from its first step on …
    page.switch_to(&other).await;
    let second = page.evaluate(session).await;
    page.wait_for("the address", "new URLSearchParams(location.search).get('step') === '4'").await;
    let link = page.evaluate("location.search").await;
    page.switch_to(&one).await;
    page.open(&format!("http://{address}/{}", link.as_str().expect("text"))).await;
    page.wait_for_state("all steps", "state.phase === 'ready' && state.step === '4' && state.latest === '4'").await;
    assert_eq!(page.evaluate(session).await, second);
    for step in (0..4).rev() {
        page.press(LEFT).await;
        page.wait_for_state("an earlier step", &format!("state.step === '{step}' && state.latest === '4'")).await;
    }

    // … even over a slow connection, which neither loses a step nor holds up the server.
    page.slow_down(Some((400, 20_000))).await;
    page.press('s').await;
    page.wait_for_state("a slow step", "state.latest === '5' && state.phase === 'ready'").await;
    page.press(SPACE).await;
    page.wait_for_state("slow steps", "Number(state.latest) >= 15").await;
    page.press(SPACE).await;
    page.slow_down(None).await;
    page.wait_for_state("the pause", "state.phase === 'ready' && state.step === state.latest").await;

    // Leaving somebody else's session does not end it.
    page.press('r').await;
    page.wait_for_state("a session of its own", &format!("state.phase === 'ready' && state.session !== {second}"))
        .await;
    page.switch_to(&other).await;
    page.wait_for_state("the other's steps", "state.phase === 'ready' && Number(state.latest) >= 15").await;
    assert_eq!(page.evaluate(session).await, second);
    page.press('s').await;
    page.wait_for_state("one more", "Number(state.latest) >= 16 && state.phase === 'ready'").await;
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
