//! The scene as a visitor sees it.

use std::time::Duration;

use tokio::time::Instant;

use crate::browser::{driver::Browser, pixels::Picture};

/// Long, because the pictures are computed without a graphics card.
const DRAWN_WITHIN: Duration = Duration::from_secs(120);

/// Left, top, width and height of an element, pixels.
pub async fn place(page: &Browser, element: &str) -> [f64; 4] {
    let rectangle = "(({ left, top, width, height }) => [left, top, width, height])";
    let place = page.evaluate(&format!("{rectangle}({element}.getBoundingClientRect())")).await;
    std::array::from_fn(|index| place[index].as_f64().expect("a number"))
}

/// A picture in which all learners are drawn and that is as asked.
pub async fn drawn(page: &Browser, is_it: impl Fn(&Picture) -> bool) -> Picture {
    once(page, |picture| picture.shows_all_learners() && is_it(picture)).await
}

/// A picture that is as asked.
pub async fn once(page: &Browser, is_it: impl Fn(&Picture) -> bool) -> Picture {
    let [left, top, ..] = place(page, "document.getElementById('scene')").await;
    let [.., legend] = place(page, "document.getElementById('legend')").await;
    let (corner, legend) = ([left as usize, top as usize], legend as usize + 10);
    let deadline = Instant::now() + DRAWN_WITHIN;
    loop {
        let picture = Picture::of_scene(&page.screenshot().await, corner, legend);
        if is_it(&picture) {
            return picture;
        }
        if Instant::now() > deadline {
            let file = std::env::temp_dir().join("body-schema-page.png");
            drop(std::fs::write(&file, page.screenshot().await));
            panic!("the scene is not drawn: {:?}; see {}", picture.counts(), file.display());
        }
        tokio::time::sleep(Duration::from_millis(500)).await;
    }
}

/// A picture of the scene at rest: one that the next does not differ from.
pub async fn at_rest(page: &Browser) -> Picture {
    let mut picture = drawn(page, |_| true).await;
    for _ in 0..20 {
        tokio::time::sleep(Duration::from_secs(1)).await;
        let next = drawn(page, |_| true).await;
        if !next.differs_from(&picture) {
            return next;
        }
        picture = next;
    }
    panic!("the scene does not come to rest");
}

/// Does to the scene what would make the viewer speak of entities, select one, or open its palette; `before` is how it
/// looked.
pub async fn stays_as_it_is(page: &Browser, before: &Picture) {
    let [left, top, width, height] = place(page, "document.getElementById('scene')").await;
    for part in [0.3, 0.5, 0.7] {
        page.point(left + part * width, top + 0.45 * height).await;
    }
    page.click(left + 0.5 * width, top + 0.45 * height).await;
    page.press_with(CONTROL, 'p').await;
    assert!(!at_rest(page).await.differs_from(before), "pointing, clicking and typing leave the scene as it is");
}

/// Turns the camera and has the view restored; `before` is how it looked.
pub async fn turns_and_is_restored(page: &Browser, before: &Picture) {
    let [left, top, width, height] = place(page, "document.getElementById('scene')").await;
    page.drag([left + 0.5 * width, top + 0.45 * height], [0.15 * width, 0.05 * height]).await;
    drawn(page, |picture| picture.differs_from(before)).await;
    page.press('r').await;
    drawn(page, |picture| !picture.differs_from(before)).await;
}

const CONTROL: char = '\u{e009}';
