//! Small screens, large letters, and fingers.

use std::time::Duration;

use crate::browser::{Server, driver::Browser, keyboard::TOLD, scene::place, visits::ESCAPE};

/// A phone upright, on its side, and 1440 × 900 at 200 %.
const SCREENS: [(u32, u32, bool); 3] = [(414, 896, true), (844, 390, true), (720, 450, false)];
/// A chart lower than this tells nothing, pixels.
const CHART: f64 = 60.0;

pub async fn visit(page: &Browser, server: Server) {
    for (width, height, touch) in SCREENS {
        page.screen(width, height, touch).await;
        page.open(&server.at(TOLD)).await;
        page.wait_for_state("step 1", "state.phase === 'ready' && state.step === '1'").await;
        page.wait_for("the chart", "document.querySelector('#controls [data-kind=image]') !== null").await;
        // Also while the story's card is open.
        in_sight(page, [f64::from(width), f64::from(height)]).await;
        if touch {
            page.press(ESCAPE).await;
            page.wait_for("no card", "!document.getElementById('controls').textContent.includes('1 of 5')").await;
            swipes(page).await;
        }
    }
    server.stop().await;
}

/// Scene, transport and a chart are on the screen.
async fn in_sight(page: &Browser, [width, height]: [f64; 2]) {
    let [.., scene_width, scene_height] = place(page, "document.getElementById('scene')").await;
    let share = scene_width * scene_height / (width * height);
    assert!(share >= 0.3, "the scene has {:.0} % of {width} × {height}", 100.0 * share);
    let play = "[...document.querySelectorAll('#controls button')].find((one) => one.textContent === 'Play')";
    let chart = "document.querySelector('#controls [data-kind=image]')";
    let [_, panel, _, panel_height] = place(page, "document.getElementById('panel')").await;
    for (name, element, least) in [("transport", play, 12.0), ("chart", chart, CHART)] {
        let [left, top, element_width, element_height] = place(page, element).await;
        let is_inside = left >= 0.0
            && top >= panel
            && left + element_width <= width
            && top + element_height <= panel + panel_height
            && element_height >= least;
        assert!(is_inside, "{name} at {width} × {height}: {left} {top} {element_width} {element_height}");
    }
}

/// A swipe moves what scrolls, whether it begins on a chart that stays or on one that scrolls itself.
async fn swipes(page: &Browser) {
    let tab = "[...document.querySelectorAll('#controls button')].find((one) => one.textContent === 'Charts')";
    let [left, panel, width, height] = place(page, "document.getElementById('panel')").await;
    let [pinned, scrolled] =
        [0, 1].map(|chart| format!("document.querySelectorAll('#controls [data-kind=image]')[{chart}]"));
    for chart in [&pinned, &scrolled] {
        // What is below the screen is brought into view first.
        for _ in 0..8 {
            let [_, top, _, chart_height] = place(page, chart).await;
            if top + chart_height / 2.0 < panel + height {
                break;
            }
            let [_, top, _, pinned_height] = place(page, &pinned).await;
            page.swipe([left + width / 2.0, top + pinned_height / 2.0], -120.0).await;
            tokio::time::sleep(Duration::from_secs(1)).await;
        }
        let before = place(page, tab).await[1];
        let [_, top, _, chart_height] = place(page, chart).await;
        let y = (top + chart_height / 2.0).clamp(panel + 10.0, panel + height - 10.0);
        page.swipe([left + width / 2.0, y], -120.0).await;
        let moved = format!("{tab}.getBoundingClientRect().top <= {}", before - 60.0);
        page.wait_for("what is below", &moved).await;
    }
}
