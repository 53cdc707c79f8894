//! The page in a real browser: Chromium, driven by chromedriver.
//!
//! Without the two this is skipped, unless the environment has `CI` or `BODY_SCHEMA_REQUIRE_BROWSER=1`. They are looked
//! for in `PATH`, or where `CHROMEDRIVER` and `CHROMIUM` say.

mod axe;
pub(crate) mod devtools;
pub(crate) mod driver;
mod keyboard;
mod newcomer;
pub(crate) mod pixels;
pub(crate) mod pointer;
mod robot;
pub(crate) mod scene;
mod screens;
mod sharing;
pub(crate) mod visits;
mod watch;

use std::net::SocketAddr;

use body_schema::server::{Options, serve};
use driver::Browser;
use tokio::{net::TcpListener, task::JoinHandle};
use tokio_util::sync::CancellationToken;

pub(crate) struct Server {
    address: SocketAddr,
    shutdown: CancellationToken,
    serving: JoinHandle<()>,
}

impl Server {
    pub(crate) async fn start(address: SocketAddr) -> Self {
        let listener = TcpListener::bind(address).await.expect("a port");
        let (address, shutdown) = (listener.local_addr().expect("an address"), CancellationToken::new());
        // Another build of the panel than the embedded one may be tested.
        let panel_dir = std::env::var_os("BODY_SCHEMA_PANEL_DIR").map(Into::into);
        let serving = serve(listener, Options { panel_dir, ..Options::default() }, shutdown.clone());
        let serving = tokio::spawn(async { serving.await.expect("no error") });
        Self { address, shutdown, serving }
    }

    /// The address of the page with this query, or of another file.
    fn at(&self, query: &str) -> String {
        format!("http://{}/{query}", self.address)
    }

    pub(crate) async fn stop(self) {
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
    let (console, hosts) = (browser.console().await, browser.hosts().await);
    browser.stop().await;
    if let Err(panic) = outcome {
        eprintln!("in the console: {console:#?}");
        std::panic::resume_unwind(panic.into_panic());
    }
    // While the server was away, requests had to fail, but none for the content security policy.
    assert!(!console.iter().any(|line| line.contains("Content Security Policy")), "{console:#?}");
    assert_eq!(hosts, [address.to_string()], "every request goes to this host");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_page_steps_and_shows() {
    in_browser(&[], |page, server| async move { visits::steps(&page, server).await }).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn two_tabs_do_not_mix_and_late_visitors_see_everything() {
    in_browser(&[], |page, server| async move { visits::in_tabs(&page, server).await }).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_keyboard_alone_compares_two_learners_on_another_seed() {
    in_browser(&[], |page, server| async move { keyboard::visit(&page, server).await }).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn links_and_pictures_are_copied_for_others() {
    in_browser(&[], |page, server| async move { sharing::visit(&page, server).await }).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn small_screens_and_fingers_have_all_that_matters() {
    in_browser(&[], |page, server| async move { screens::visit(&page, server).await }).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_newcomer_is_told_the_first_story() {
    in_browser(&[], |page, server| async move { newcomer::visit(&page, server).await }).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_robot_elsewhere_is_watched_and_answered_for() {
    in_browser(&[], |page, server| async move { robot::visit(&page, server).await }).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn without_webgl_the_page_says_what_to_do() {
    in_browser(NO_WEBGL, |page, server| async move {
        page.open(&server.at("")).await;
        page.wait_for_state("the end", "state.phase === 'failed'").await;
        let text = page.evaluate("document.getElementById('panel-cover').innerText").await;
        for word in ["cannot be shown", "WebGL 2", "/v1/openapi.json"] {
            assert!(text.as_str().expect("text").contains(word), "{word} is in: {text}");
        }
        // The page's own words are legible: what covers the panel and the scene is seen here alone.
        for scheme in ["light", "dark"] {
            page.scheme(scheme).await;
            assert_eq!(axe::serious_findings(&page).await, Vec::<String>::new(), "{scheme}");
        }
        server.stop().await;
    })
    .await;
}
