//! A newcomer's two minutes: the first story from opening the page to its closing sentence, by the mouse alone.

use crate::browser::{
    Server,
    driver::Browser,
    pointer::{CONTROLS, click, place, reads},
};

pub async fn visit(page: &Browser, server: Server) {
    page.open(&format!("http://{}/", server.address)).await;
    page.wait_for_state("step 1", "state.phase === 'ready' && state.step === '1'").await;
    page.wait_for("the scene", "document.getElementById('cover').hidden").await;

    reads(page, "1 of 5").await;
    click(page, "Play to movement 10").await;
    page.wait_for_state("the pause", "state.phase === 'stopped' && state.step === '10'").await;

    // From here on, the same place goes on.
    let next = place(page, "Next").await;
    page.click(next[0], next[1]).await;
    reads(page, "2 of 5").await;
    page.wait_for(
        "the mark in the legend",
        "document.querySelector('#legend [data-pointed][data-line=ellipsoids]') !== null",
    )
    .await;
    click(page, "Show “Uncertainty”").await;
    reads(page, "The uncertainty of active and random stays above that on purpose").await;

    page.click(next[0], next[1]).await;
    reads(page, "3 of 5").await;
    click(page, "Show the search").await;
    reads(page, "How active chose movement 10").await;

    page.click(next[0], next[1]).await;
    reads(page, "4 of 5").await;
    click(page, "Play to the end").await;
    page.wait_for_state("the end", "state.phase === 'stopped' && Number(state.step) > 20").await;
    reads(page, "times fewer movements than random.").await;
    page.wait_for("how many global needed", &format!("/global [0-9]+/.test({CONTROLS})")).await;

    page.click(next[0], next[1]).await;
    reads(page, "Was it luck?").await;
    click(page, "Run ten more seeds").await;
    reads(page, "of 10 other seeds.").await;
    assert_eq!(
        place(page, "Next: The elbow breaks").await[1],
        next[1],
        "the story goes on where it has always gone on"
    );
    server.stop().await;
}
