//! What visitors pass on.

use crate::browser::{
    Server,
    driver::Browser,
    keyboard::{ENTER, tab_to},
    visits::{ESCAPE, SPACE},
};

pub async fn visit(page: &Browser, server: Server) {
    page.open_clipboard().await;
    page.open(&server.at("?v=1&scenario=arm-6dof&seed=3&learners=active,random&step=4&tab=share")).await;
    page.wait_for_state("step 4", "state.phase === 'ready' && state.step === '4'").await;
    page.wait_for("the scene", "document.getElementById('cover').hidden").await;
    page.press(ESCAPE).await;

    // A link names no session, does not open the tab from which it was copied, and says whom it serves.
    tab_to(page, "Copy link").await;
    page.press(ENTER).await;
    page.wait_for("a caution", "document.getElementById('controls').textContent.includes('Only this machine')").await;
    let link = page.evaluate_later("navigator.clipboard.readText()").await;
    assert_eq!(link, server.at("?v=1&scenario=arm-6dof&seed=3&learners=active,random&step=4"));

    // A picture of the scene is on the clipboard, or saved where there is none for pictures.
    tab_to(page, "Copy picture").await;
    page.press(SPACE).await;
    page.wait_for(
        "the picture",
        "/picture (is on the clipboard|was saved)/.test(document.getElementById('controls').textContent)",
    )
    .await;
    let size = page
        .evaluate_later(
            "navigator.clipboard.read().then(([item]) => item.getType('image/png')).then(createImageBitmap)
                .then(({ width, height }) => [width, height])",
        )
        .await;
    assert!(size[0].as_f64().is_some_and(|width| width > 500.0), "a picture as wide as the scene: {size}");

    // In somebody else's page: the scene, transport and one chart.
    page.open(&server.at("?v=1&scenario=arm-6dof&seed=3&embed=1")).await;
    page.wait_for_state("step 1", "state.phase === 'ready' && state.step === '1'").await;
    page.wait_for("the controls", "document.querySelector('#controls button')?.textContent === 'Play'").await;
    let parts = page.evaluate("['[data-kind=image]', 'table', 'input[type=text]'].map((kind) => document.querySelectorAll(`#controls ${kind}`).length)").await;
    assert_eq!(parts, serde_json::json!([1, 0, 0]), "charts, tables, fields");

    // Previews of links take a picture from a whole address only.
    let image = page.evaluate("document.querySelector('meta[property=\"og:image\"]').content").await;
    let image = image.as_str().expect("text");
    assert!(image.starts_with(&server.at("preview.png?v=")), "{image}");
    server.stop().await;
}
