//! A newcomer's first look at a folder: it moves before the engine and the viewer are there.

use super::{exported, host::Host, in_browser};
use crate::browser::{
    driver::Browser,
    pointer::{CONTROLS, reads},
};

/// What may be loaded before the first motion, bytes.
const MOST_BYTES: u64 = 2_500_000;

/// Neither the engine nor the viewer is ever there: the story begins all the same, drawn lightly, by little.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_first_motion_waits_for_neither_engine_nor_viewer() {
    let folder = exported(&[]);
    for part in ["engine/engine_bg.wasm.gz", "viewer/re_viewer_bg.wasm.gz"] {
        std::fs::remove_file(folder.path().join(part)).expect("a file");
    }
    let Some(page) = Browser::start(&[]).await else { return };
    let host = Host::start(folder.path(), "/demo/");
    let address = host.at("");
    let visit = tokio::spawn({
        let page = page.clone();
        async move {
            page.open(&address).await;
            page.wait_for_state("motion", "Number(state.step) >= 5").await;
            page.wait_for("the drawing", "!document.getElementById('sketch').hidden").await;
            page.wait_for("its words", "document.getElementById('sketch-text').textContent.startsWith('global, step')")
                .await;
            reads(&page, "its true arm is grey").await;
            let sizes = "performance.getEntriesByType('resource').reduce((sum, { encodedBodySize }) => sum + encodedBodySize, 0)";
            page.evaluate(sizes).await.as_u64().expect("bytes")
        }
    });
    let bytes = visit.await;
    page.stop().await;
    let bytes = bytes.expect("no panic");
    assert!(bytes < MOST_BYTES, "{bytes} bytes before the first motion");
}

/// The engine goes on from the steps that were there before it, to the end of the story.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_engine_goes_on_from_the_first_steps() {
    let folder = exported(&[]);
    in_browser(folder.path(), "/demo/", |page, host| async move {
        page.open(&host.at("")).await;
        page.wait_for_state("motion", "state.phase === 'playing'").await;
        page.wait_for_state("the end", "state.phase === 'stopped' && Number(state.step) > 20").await;
        page.wait_for("the figures", &format!("/global needed 10 movements, active [0-9]+, random/.test({CONTROLS})"))
            .await;
        page.wait_for("the scene", "document.getElementById('cover').hidden").await;
        crate::browser::scene::drawn(&page, |_| true).await;
    })
    .await;
}
