//! A visitor without a pointer, who may not see the panel's canvas either.

use crate::browser::{
    Server,
    axe::serious_findings,
    driver::Browser,
    pointer::CONTROLS,
    visits::{ESCAPE, SHIFT, SPACE},
};

const TAB: char = '\u{e004}';
pub const ENTER: char = '\u{e007}';
const F6: char = '\u{e036}';
/// A link to a run's start, where newcomers are offered the cards.
pub const TOLD: &str = "?v=1&scenario=arm-6dof&seed=3";
/// More presses of Tab than the panel has controls.
const MANY: usize = 200;

/// Goes on with Tab until what is called so has the focus.
pub async fn tab_to(page: &Browser, name: &str) {
    let mut passed = Vec::new();
    for _ in 0..MANY {
        page.press(TAB).await;
        let focus = page.focus().await;
        if focus == name {
            return;
        }
        passed.push(focus);
    }
    panic!("Tab does not reach {name}: {passed:?}");
}

/// The same backwards.
async fn back_to(page: &Browser, name: &str) {
    for _ in 0..MANY {
        page.press_with(SHIFT, TAB).await;
        if page.focus().await == name {
            return;
        }
    }
    panic!("Shift and Tab do not reach {name}");
}

pub async fn visit(page: &Browser, server: Server) {
    page.open(&server.at(TOLD)).await;
    page.wait_for_state("step 1", "state.phase === 'ready' && state.step === '1'").await;
    page.wait_for("the scene", "document.getElementById('cover').hidden").await;
    page.wait_for("the mirrored table", "document.querySelectorAll('#controls tr').length === 4").await;
    assert_eq!(page.focus().await, "controls", "the focus begins on the panel");

    // What vanishes under the focus leaves it to its neighbour, so that Tab goes on from there either way.
    tab_to(page, "Close").await;
    page.press(ENTER).await;
    let gone = "![...document.querySelectorAll('#controls button')].some((one) => one.textContent === 'Close')";
    page.wait_for("the closed card", gone).await;
    let focus = page.evaluate("document.activeElement.dataset.kind ?? ''").await;
    assert!(focus.as_str().is_some_and(|kind| !kind.is_empty()), "a control has the focus: {focus}");

    // Another seed, without one of the learners.
    tab_to(page, "Seed").await;
    page.press('7').await;
    page.press(ENTER).await;
    page.wait_for("seed 7", "document.getElementById('mirror').textContent.includes('seed 7,')").await;
    tab_to(page, "random").await;
    page.press(SPACE).await;
    page.wait_for("two learners", "document.querySelectorAll('#controls tr').length === 3").await;
    page.wait_for_state("the session", "state.phase === 'ready' && state.step === '1'").await;

    // They play; only what happens is read out.
    page.run(
        "window.heard = []; new MutationObserver(() => heard.push(document.getElementById('news').textContent))
        .observe(document.getElementById('news'), { childList: true, characterData: true, subtree: true })",
    )
    .await;
    back_to(page, "Play").await;
    page.press(SPACE).await;
    page.wait_for_state("some steps", "state.phase === 'playing' && Number(state.latest) >= 15").await;
    assert_eq!(page.focus().await, "Pause", "what was pressed keeps the focus");
    page.press(SPACE).await;
    page.wait_for_state("the pause", "state.phase === 'ready'").await;
    page.wait_for("the news", "document.getElementById('news').textContent.includes('Paused at step')").await;
    let heard = page.evaluate("heard").await;
    assert!(heard.as_array().expect("texts").len() <= 5, "few sentences: {heard}");

    // The comparison, as a table.
    let row =
        "[...document.querySelectorAll('#controls tr')].map((row) => [...row.cells].map((cell) => cell.textContent))";
    let table = page.evaluate(row).await;
    assert_eq!((table[0][0].as_str(), table[0][4].as_str()), (Some("Learner"), Some("State")), "{table}");
    assert_eq!((table[1][0].as_str(), table[2][0].as_str()), (Some("active"), Some("global")), "{table}");
    for learner in [1, 2] {
        let error = table[learner][2].as_str().and_then(|text| text.parse::<f64>().ok());
        assert!(error.is_some_and(|error| error > 0.0), "a location error: {table}");
    }

    // No trap: Tab comes to the scene and leaves it, Esc and F6 change between the two.
    tab_to(page, "viewer").await;
    page.press(TAB).await;
    assert_ne!(page.focus().await, "viewer");
    page.press(F6).await;
    assert_eq!(page.focus().await, "viewer");
    page.press(ESCAPE).await;
    assert_ne!(page.focus().await, "viewer");

    for scheme in ["light", "dark"] {
        page.scheme(scheme).await;
        assert_eq!(serious_findings(page).await, Vec::<String>::new(), "{scheme}");
    }
    closes_the_card_while_the_scene_starts(page, &server).await;
    server.stop().await;
}

/// The viewer has the focus as long as it starts, which nobody gave it: Escape closes the card all the same.
async fn closes_the_card_while_the_scene_starts(page: &Browser, server: &Server) {
    page.run("localStorage.clear()").await;
    page.open(&server.at(TOLD)).await;
    // Its WebAssembly never comes.
    page.run(
        "const fetched = fetch; const held = document.getElementById('viewer-wasm').dataset.address;
        window.fetch = (what, how) => String(what).includes(held) ? new Promise(() => {}) : fetched(what, how)",
    )
    .await;
    let has_card = format!("{CONTROLS}.includes('1 of 5')");
    page.wait_for("the card", &has_card).await;
    page.run("const viewer = document.getElementById('viewer'); viewer.tabIndex = 0; viewer.focus()").await;
    assert_eq!(
        (page.focus().await, page.evaluate("document.getElementById('cover').hidden").await),
        ("viewer".to_owned(), false.into())
    );
    page.press(ESCAPE).await;
    page.wait_for("no card", &format!("!{has_card}")).await;
}
