//! Visitors who step, reload, go back and come back late.

use serde_json::Value;

use crate::browser::{
    Server,
    driver::Browser,
    scene::{at_rest, drawn, stays_as_it_is, turns_and_is_restored},
};

pub const SPACE: char = ' ';
pub const LEFT: char = '\u{e012}';
pub const RIGHT: char = '\u{e014}';
pub const ESCAPE: char = '\u{e00c}';
pub const SHIFT: char = '\u{e008}';

const SESSION: &str = "document.getElementById('mirror').dataset.session";

/// What is shown, in words.
async fn words(page: &Browser) -> String {
    page.evaluate("document.getElementById('mirror').textContent").await.as_str().expect("text").to_owned()
}

async fn wait_for_words(page: &Browser, words: &str) {
    page.wait_for(words, &format!("document.getElementById('mirror').textContent.includes('{words}')")).await;
}

pub async fn steps(page: &Browser, server: Server) {
    page.open(&server.at("?v=1&scenario=arm-6dof&seed=1")).await;

    // The first movement is shown without anybody's doing.
    page.wait_for_state("step 1", "state.phase === 'ready' && state.step === '1'").await;
    page.wait_for("the scene", "document.getElementById('cover').hidden").await;
    page.press(ESCAPE).await;
    let first = at_rest(page).await;
    let legend = page.evaluate("document.getElementById('legend').innerText").await;
    for words in ["active", "random", "global", "may be (1σ)", "true arm"] {
        assert!(legend.as_str().expect("text").contains(words), "{legend}");
    }
    stays_as_it_is(page, &first).await;
    turns_and_is_restored(page, &first).await;

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
    assert!(words(page).await.contains("active: not accurate yet"), "{}", words(page).await);

    // The view is restored without losing the run.
    let before: Value = page.evaluate(SESSION).await;
    page.press('r').await;
    page.wait_for_state("the run", &format!("state.session === {before} && Number(state.latest) >= 6")).await;
    page.press(LEFT).await;

    // A reload keeps session and step.
    page.wait_for(
        "the address",
        "new URLSearchParams(location.search).get('step') === document.getElementById('mirror').dataset.step",
    )
    .await;
    let before = page.evaluate("[location.search, document.getElementById('mirror').dataset.step]").await;
    page.open(&server.at(before[0].as_str().expect("text"))).await;
    page.wait_for_state("the same step", &format!("state.phase === 'ready' && state.step === {}", before[1])).await;
    assert_eq!(page.evaluate("location.search").await, before[0]);

    // Another run is a page of the browser's history.
    page.press('n').await;
    page.wait_for("another seed", "!location.search.includes('seed=1&')").await;
    page.wait_for_state("another seed", "state.phase === 'ready'").await;
    page.go(-1).await;
    wait_for_words(page, "seed 1,").await;
    page.wait_for_state("the first seed", "state.phase === 'ready'").await;
    page.go(1).await;
    page.wait_for("the other seed", "!document.getElementById('mirror').textContent.includes('seed 1,')").await;

    // What an address gets wrong is told.
    page.open(&server.at("?v=1&scenario=tiago-mocap&seed=-1&step=3")).await;
    page.wait_for_state("step 3", "state.phase === 'ready' && state.step === '3'").await;
    wait_for_words(page, "seed=-1").await;

    assert_eq!(page.console().await, Vec::<String>::new(), "in the console");
    comes_back(page, server).await;
}

/// A server that goes away and comes back without its sessions: runs are computed again.
async fn comes_back(page: &Browser, server: Server) {
    let address = server.address;
    let before = page.evaluate(SESSION).await;
    server.stop().await;
    page.wait_for_state("the loss", "state.phase === 'lost'").await;
    let server = Server::start(address).await;
    page.wait_for_state(
        "the run",
        &format!("state.session !== {before} && state.phase === 'ready' && state.step === '3'"),
    )
    .await;

    // The same for an address of which nobody knows the session any more.
    page.wait_for("the address", &format!("location.search.includes({SESSION})")).await;
    let link = page.evaluate("location.search").await;
    server.stop().await;
    let server = Server::start(address).await;
    page.open(&server.at(link.as_str().expect("text"))).await;
    page.wait_for_state("the run", "state.phase === 'ready' && state.step === '3'").await;
    assert_ne!(page.evaluate("location.search").await, link);
    server.stop().await;
}

pub async fn in_tabs(page: &Browser, server: Server) {
    page.open(&server.at("?v=1&scenario=arm-6dof&seed=1&learners=random")).await;
    page.wait_for_state("the first tab", "state.phase === 'ready' && state.step === '1'").await;
    page.press(ESCAPE).await;
    let first = page.evaluate(SESSION).await;

    // Another tab has a session of its own.
    let one = page.tab().await;
    let other = page.new_tab().await;
    page.open(&server.at("?v=1&scenario=arm-6dof&seed=2&learners=random")).await;
    page.wait_for_state("the second tab", "state.phase === 'ready' && state.step === '1'").await;
    assert_ne!(page.evaluate(SESSION).await, first);
    for step in 2..=4 {
        page.press('s').await;
        page.wait_for_state("a step", &format!("state.phase === 'ready' && state.step === '{step}'")).await;
    }
    assert!(words(page).await.contains("seed 2"));
    page.switch_to(&one).await;
    page.wait_for_state("the first tab as it was", "state.latest === '1'").await;
    assert_eq!(page.evaluate(SESSION).await, first);
    assert!(words(page).await.contains("seed 1"));

    // Whoever comes late to the second session sees it from its first step on …
    page.switch_to(&other).await;
    let second = page.evaluate(SESSION).await;
    page.wait_for("the address", "new URLSearchParams(location.search).get('step') === '4'").await;
    let link = page.evaluate("location.search").await;
    page.switch_to(&one).await;
    page.open(&server.at(link.as_str().expect("text"))).await;
    page.wait_for_state("all steps", "state.phase === 'ready' && state.step === '4' && state.latest === '4'").await;
    assert_eq!(page.evaluate(SESSION).await, second);
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
    page.press_with(SHIFT, 'r').await;
    page.wait_for_state("a session of its own", &format!("state.phase === 'ready' && state.session !== {second}"))
        .await;
    page.switch_to(&other).await;
    page.wait_for_state("the other's steps", "state.phase === 'ready' && Number(state.latest) >= 15").await;
    assert_eq!(page.evaluate(SESSION).await, second);
    page.press('s').await;
    page.wait_for_state("one more", "Number(state.latest) >= 16 && state.phase === 'ready'").await;
    server.stop().await;
}
