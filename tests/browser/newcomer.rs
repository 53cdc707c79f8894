//! A newcomer's two minutes: the first story plays by itself, and its cards answer, by the mouse alone.

use crate::browser::{
    Server,
    driver::Browser,
    pointer::{CONTROLS, click, place, reads},
    scene::{drawn, once, place as at},
};

pub async fn visit(page: &Browser, server: Server) {
    page.open(&format!("http://{}/", server.address)).await;
    // Without a click: the first story, to its end.
    page.wait_for_state("the third movement", "state.phase === 'playing' && Number(state.step) >= 3").await;
    reads(page, "grey is the true arm").await;
    assert_eq!(page.evaluate("document.querySelectorAll('#controls table').length").await, 0, "the rest is folded");
    page.wait_for_state("the end", "state.phase === 'stopped' && Number(state.step) > 20").await;
    page.wait_for(
        "the figures",
        &format!("/global needed [0-9]+ movements, active [0-9]+, random [0-9]+/.test({CONTROLS})"),
    )
    .await;
    covers_no_arm(page).await;

    click(page, "Why?").await;
    reads(page, "3 of 5: Why this posture?").await;
    reads(page, "How active chose movement").await;

    // From here on, the same place goes on.
    let next = place(page, "Next").await;
    page.click(next[0], next[1]).await;
    reads(page, "4 of 5").await;
    click(page, "Show the end").await;
    page.click(next[0], next[1]).await;
    reads(page, "Was it luck?").await;
    click(page, "Run ten more seeds").await;
    page.wait_for("their figures", &format!("/of ([3-9]|10) other seeds/.test({CONTROLS})")).await;
    assert_eq!(place(page, "Previous").await[1], next[1], "the story goes on where it has always gone on");
    click(page, "Close").await;
    picks_an_arm(page).await;
    begins_with_one_robot(page, &server).await;
    server.stop().await;
}

/// The first look as it is after three movements: one robot, which the others join when it has learned its arm.
async fn begins_with_one_robot(page: &Browser, server: &Server) {
    let learners =
        "[...document.querySelectorAll('#legend [data-line=learner]')].map((line) => line.textContent).join()";
    page.open(&server.at("?v=1&scenario=arm-6dof&seed=4&step=3&brief=1")).await;
    page.wait_for_state("three movements", "state.phase === 'ready' && state.step === '3'").await;
    reads(page, "its true arm is grey").await;
    assert_eq!(page.evaluate(learners).await, "global");
    once(page, |picture| picture.shows("global") && !picture.shows("active") && !picture.shows("random")).await;
    click(page, "Play").await;
    page.wait_for("the others", &format!("{learners} === 'active,random,global'")).await;
    reads(page, "grey is the true arm").await;
    drawn(page, |_| true).await;
}

/// The legend lies beside the scene, not over it.
async fn covers_no_arm(page: &Browser) {
    let [_, top, _, height] = at(page, "document.getElementById('stage')").await;
    let [_, legend, ..] = at(page, "document.getElementById('legend')").await;
    assert!(legend >= top + height, "the legend begins at {legend}, the scene ends at {}", top + height);
}

/// A click on an arm shows what it chose between.
async fn picks_an_arm(page: &Browser) {
    let [left, top, ..] = at(page, "document.getElementById('scene')").await;
    let found = "document.getElementById('controls').textContent.includes('How global chose movement')";
    let picture = drawn(page, |picture| !picture.within("global").is_empty()).await;
    for [x, y] in picture.within("global") {
        page.click(left + x, top + y).await;
        if page.evaluate(found).await == true {
            return;
        }
    }
    page.wait_for("the choice of the arm", found).await;
}
