//! Buttons that are pressed by the mouse, and words that are read.

use std::time::Duration;

use serde_json::Value;

use crate::browser::driver::Browser;

/// What has stood so long in one place stays there: a few frames of a busy machine.
const STILL: Duration = Duration::from_millis(400);

/// What the panel says, as it is read out.
pub const CONTROLS: &str = "document.getElementById('controls').textContent";

/// The middle of a button that can be pressed, once it is there and stays where it is: what else is said may move it for a while.
pub async fn place(page: &Browser, name: &str) -> [f64; 2] {
    let button = format!(
        "[...document.querySelectorAll('#controls button')].find((one) => one.textContent === '{name}' && !one.disabled)"
    );
    page.wait_for(name, &format!("{button} !== undefined")).await;
    let middle = format!(
        "(({{ left, top, width, height }}) => [left + width / 2, top + height / 2])({button}.getBoundingClientRect())"
    );
    let mut before = Value::Null;
    loop {
        let place: Value = page.evaluate(&middle).await;
        if place == before {
            return [0, 1].map(|index| place[index].as_f64().expect("a number"));
        }
        before = place;
        tokio::time::sleep(STILL).await;
    }
}

/// Clicks on a button, once it can be pressed.
pub async fn click(page: &Browser, name: &str) {
    let [x, y] = place(page, name).await;
    page.click(x, y).await;
}

/// Waits until the panel says these words.
pub async fn reads(page: &Browser, words: &str) {
    page.wait_for(words, &format!("{CONTROLS}.includes('{words}')")).await;
}
