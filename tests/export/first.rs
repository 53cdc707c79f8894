//! A newcomer's first look at a folder: it moves before the engine and the viewer are there.

use std::sync::Arc;

use super::{exported, host::Host, in_browser, visited};
use crate::browser::{
    driver::Browser,
    pointer::reads,
    scene::{drawn, once},
    visits::{LEFT, SPACE},
};

const ENGINE: &str = "engine/engine_bg.wasm.gz";
const VIEWER: &str = "viewer/re_viewer_bg.wasm.gz";
const FIRST: &str = "first.json.gz";
/// Whether the page has asked for the first steps; what keeps the folder asks for every file.
const ASKED: &str = "performance.getEntriesByType('resource').some(({ name }) => name.includes('first.json.gz'))";
/// What may be loaded before the first motion, bytes.
const MOST_BYTES: u64 = 2_500_000;

/// What the page says of what waits for the engine.
async fn waits(page: &Browser, what: &str) {
    let note = "document.getElementById('awaited')";
    let says = format!(
        "!{note}.hidden && {note}.textContent === 'The engine is still loading; {what} as soon as it is there.'"
    );
    page.wait_for(what, &says).await;
}

/// The light drawing, and that there is nothing else yet.
async fn is_sketched(page: &Browser) {
    page.wait_for("the drawing", "!document.getElementById('sketch').hidden").await;
    page.wait_for("its words", "document.getElementById('sketch-text').textContent.startsWith('global, step')").await;
    assert_eq!(page.evaluate("document.getElementById('cover').hidden").await, false);
}

/// Engine and viewer are on their way: the story begins all the same, drawn lightly, by little. They come: it goes on with them.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_first_motion_waits_for_neither_engine_nor_viewer() {
    let folder = exported(&[]);
    in_browser(folder.path(), "/demo/", |page, host| async move {
        host.hold(&[ENGINE, VIEWER]);
        page.open(&host.at("")).await;
        page.wait_for_state("motion", "state.phase === 'playing' && Number(state.step) >= 5").await;
        let bytes = host.bytes();
        assert!(bytes < MOST_BYTES, "{bytes} bytes before the first motion: {:#?}", host.sent());
        is_sketched(&page).await;
        reads(&page, "its true arm is grey").await;
        // All that is there has been played: what is missing is said.
        waits(&page, "the next movements follow").await;
        page.wait_for_state("the last of them", "state.step === '14' && state.latest === '14'").await;

        host.hold(&[VIEWER]);
        page.wait_for_state("the engine's steps", "Number(state.step) >= 20").await;
        page.wait_for("nothing that is missing", "document.getElementById('awaited').hidden").await;
        is_sketched(&page).await;

        host.hold(&[]);
        goes_on(&page).await;
    })
    .await;
}

/// The engine's steps follow, in the scene.
async fn goes_on(page: &Browser) {
    page.wait_for_state("the engine's steps", "Number(state.step) >= 20").await;
    page.wait_for("the scene", "document.getElementById('cover').hidden").await;
    drawn(page, |_| true).await;
}

/// The viewer is there before the engine: the drawing goes on, since there is nothing else to see.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_drawing_goes_on_until_the_engine_has_a_scene() {
    let folder = exported(&[]);
    in_browser(folder.path(), "/demo/", |page, host| async move {
        host.hold(&[ENGINE]);
        page.open(&host.at("")).await;
        page.wait_for("a viewer", "Number(document.getElementById('progress').value) === 1").await;
        waits(&page, "the next movements follow").await;
        is_sketched(&page).await;
        host.hold(&[]);
        goes_on(&page).await;
    })
    .await;
}

/// Nothing is held back: the engine comes while the first steps are played, or before.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_engine_goes_on_from_the_first_steps() {
    let folder = exported(&[]);
    in_browser(folder.path(), "/demo/", |page, host| async move {
        page.open(&host.at("")).await;
        page.wait_for_state("the third movement", "state.phase === 'playing' && Number(state.step) >= 3").await;
        goes_on(&page).await;
    })
    .await;
}

/// What a visitor does before the engine is there is done at once, or as soon as it is there.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_is_done_before_the_engine_is_there_is_not_lost() {
    let folder = exported(&[]);
    in_browser(folder.path(), "/demo/", |page, host| async move {
        host.hold(&[ENGINE, VIEWER]);
        page.open(&host.at("")).await;
        page.wait_for_state("motion", "state.phase === 'playing' && Number(state.step) >= 2").await;
        page.press(SPACE).await;
        page.wait_for_state("the pause", "state.phase === 'ready' && state.step === state.latest").await;
        let latest = page.evaluate("Number(document.getElementById('mirror').dataset.latest)").await;
        let latest = latest.as_u64().expect("a step");
        page.press('s').await;
        page.wait_for_state("one more", &format!("state.step === '{}' && state.phase === 'ready'", latest + 1)).await;
        page.press(LEFT).await;
        page.wait_for_state("one back", &format!("state.step === '{latest}' && state.phase === 'ready'")).await;

        // Another seed, which only the engine knows.
        page.press('n').await;
        waits(&page, "the run that was chosen begins").await;
        host.hold(&[]);
        page.wait_for_state("another run", "state.phase === 'ready' && state.step === '1'").await;
        page.wait_for("another seed", "!document.getElementById('mirror').textContent.includes('seed 4,')").await;
        page.wait_for("nothing that is missing", "document.getElementById('awaited').hidden").await;
        page.wait_for("the scene", "document.getElementById('cover').hidden").await;
        // It begins as the first one did: with one robot.
        once(&page, |picture| picture.shows("global") && !picture.shows("active") && !picture.shows("random")).await;
    })
    .await;
}

/// Addresses that show something else than the first story do without its steps.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn other_runs_than_the_first_story_do_without_its_steps() {
    let folder = exported(&[]);
    in_browser(folder.path(), "/demo/", |page, host| async move {
        for query in ["?embed=1", "?scenario=arm-6dof&seed=5", "?scenario=arm-6dof&seed=4&step=2"] {
            page.open(&host.at(query)).await;
            page.wait_for_state(query, "state.phase === 'ready' && Number(state.step) >= 1").await;
            page.wait_for("the scene", "document.getElementById('cover').hidden").await;
            assert_eq!(page.evaluate(ASKED).await, false, "{query}");
        }
        // Who knows the page begins with something else than the first story.
        page.run("localStorage.setItem('body-schema-known', 'yes')").await;
        page.open(&host.at("")).await;
        page.wait_for_state("seed 1", "state.phase === 'ready' && state.step === '1'").await;
        assert_eq!(page.evaluate(ASKED).await, false);
    })
    .await;
}

/// Who wants nothing to move by itself sees the first step, without the engine too.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn nothing_moves_by_itself_for_who_wants_that() {
    let folder = exported(&[]);
    in_browser(folder.path(), "/demo/", |page, host| async move {
        host.hold(&[ENGINE, VIEWER]);
        page.reduced_motion().await;
        page.open(&host.at("")).await;
        page.wait_for_state("the first step", "state.phase === 'ready' && state.step === '1'").await;
        is_sketched(&page).await;
        tokio::time::sleep(std::time::Duration::from_secs(2)).await;
        assert_eq!(page.evaluate("document.getElementById('mirror').dataset.latest").await, "1");
        page.press('s').await;
        page.wait_for_state("one more", "state.phase === 'ready' && state.step === '2'").await;
        host.hold(&[]);
        page.wait_for("the scene", "document.getElementById('cover').hidden").await;
        page.press('s').await;
        page.wait_for_state("one of the engine's", "state.phase === 'ready' && state.step === '3'").await;
    })
    .await;
}

/// A folder that lacks some files: requests fail there.
async fn without<Visit: Future<Output = ()> + Send + 'static>(
    files: &[&str],
    visit: impl FnOnce(Browser, Arc<Host>) -> Visit,
) {
    let folder = exported(&[]);
    for file in files {
        std::fs::remove_file(folder.path().join(file)).expect("a file");
    }
    if let Some(visit) = visited(folder.path(), "/demo/", visit).await {
        visit.outcome.expect("no panic");
    }
}

/// There is no engine: what was there is played, and then the page says why it goes no further.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn that_the_engine_is_missing_is_said_after_the_first_steps() {
    without(&[ENGINE], |page, host| async move {
        let says = |words: &str| format!("document.body.innerText.includes('{words}')");
        page.open(&host.at("")).await;
        page.wait_for_state("the last step", "state.latest === '14'").await;
        let why = "the engine cannot be started:";
        page.wait_for("why", &format!("document.getElementById('mirror').textContent.includes('{why}')")).await;
        page.wait_for_state("the failure", "state.phase === 'failed'").await;
        page.wait_for("no scene", &says("There is no 3-D scene: the engine cannot be started:")).await;
        assert_eq!(page.evaluate("document.getElementById('awaited').hidden").await, true);
        // The requests for the file, and nothing that a script threw.
        let errors = page.console().await;
        assert!(errors.iter().all(|error| error.contains(ENGINE)), "{errors:?}");
    })
    .await;
}

/// A folder without the first steps begins with its engine.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_folder_without_the_first_steps_begins_with_its_engine() {
    without(&[FIRST], |page, host| async move {
        host.hold(&[ENGINE]);
        page.open(&host.at("")).await;
        waits(&page, "the page begins").await;
        host.hold(&[]);
        page.wait_for_state("motion", "state.phase === 'playing' && Number(state.step) >= 5").await;
        assert!(host.missed().iter().all(|file| file.contains(FIRST)), "{:?}", host.missed());
    })
    .await;
}
