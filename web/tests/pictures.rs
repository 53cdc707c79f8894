//! Pictures of the panel in every state that a visitor may meet, held against those in `web/tests/snapshots`.
//!
//! They need a Vulkan driver, be it in software (Debian: mesa-vulkan-drivers). Without one they are skipped, unless the
//! environment has `CI` or `BODY_SCHEMA_REQUIRE_PICTURES=1`. `UPDATE_SNAPSHOTS=1` draws them anew: look at them then.

use body_schema_panel::game::ROUNDS;
use egui::{Key, Theme, Vec2, vec2};
use egui_kittest::{Harness, SnapshotOptions, SnapshotResult, SnapshotResults};
use serde_json::json;

use crate::support::{Page, Server, robot};

/// Beside the scene on a screen of 1280 × 800, above it on a narrow one, and on a large screen.
const USUAL: Vec2 = vec2(486.0, 800.0);
const NARROW: Vec2 = vec2(400.0, 700.0);
const WIDE: Vec2 = vec2(720.0, 1000.0);
/// Beside the scene on a phone that lies on its side.
const LOW: Vec2 = vec2(422.0, 390.0);

/// Whether there is anything to draw with.
fn can_draw() -> bool {
    let drawn = std::panic::catch_unwind(|| Harness::new_ui(|ui| drop(ui.label("?"))).render().is_ok());
    if drawn.unwrap_or(false) {
        return true;
    }
    let set = |name: &str| std::env::var(name).is_ok_and(|value| !value.is_empty() && value != "0");
    let required = set("CI") || set("BODY_SCHEMA_REQUIRE_PICTURES");
    assert!(!required, "there is no Vulkan driver, and pictures must not be skipped here");
    eprintln!("skipped: there is no Vulkan driver (Debian: mesa-vulkan-drivers)");
    false
}

/// Drivers differ in how they smooth edges: some pixels of a line or letter, not a missing one.
fn hold(page: &mut Page, name: &str) -> SnapshotResult {
    let options = SnapshotOptions::new().threshold(1.0).max_failed_pixels(400);
    page.harness.try_snapshot_options(name, &options)
}

/// A page after so many steps.
fn run(query: &str, size: Vec2, steps: u64) -> Page {
    play(Page::of_size(query, size), steps)
}

fn play(mut page: Page, steps: u64) -> Page {
    page.begin();
    if steps > 1 {
        page.press(Key::Space);
        page.make_steps(steps - 1);
    }
    page
}

/// A game after so many movements, each from the posture that the sliders happen to be at.
fn game(size: Vec2, rounds: u64) -> Page {
    let mut page = Page::of_size("play=human", size);
    page.tell(Server::scenarios());
    page.open_session();
    for round in 0..=rounds.min(ROUNDS - 1) {
        for tried in [0.9, 0.4] {
            let limits = page.server.experiment().setting().joints.iter().map(|joint| joint.limits);
            let within = |(joint, [lower, upper]): (usize, [f64; 2])| {
                0.5 * (lower + upper + (upper - lower) * tried * (joint as f64 + round as f64 - 2.0).sin())
            };
            let values = limits.enumerate().map(within).collect();
            page.harness.state_mut().pose(values);
            page.answer_postures();
        }
        if round < rounds {
            page.harness.state_mut().make_movement();
            page.make_steps(1);
        }
    }
    page
}

#[test]
fn the_panel_looks_as_it_should() {
    if !can_draw() {
        return;
    }
    // All are drawn before any is judged.
    let mut results = SnapshotResults::new();
    let mut held = |page: &mut Page, name: &str| results.add(hold(page, name));
    held(&mut Page::of_size("", USUAL), "loading");

    let mut page = run("", USUAL, 1);
    held(&mut page, "ready");
    page.press(Key::T);
    held(&mut page, "tour");
    page.press(Key::Escape);
    page.press(Key::Questionmark);
    held(&mut page, "help");

    let mut page = run("learners=active,random,global&speed=100&to=100&stop=never", USUAL, 100);
    held(&mut page, "converged");
    page.harness.ctx.set_theme(Theme::Dark);
    page.run();
    held(&mut page, "converged-dark");
    page.tell(json!({ "is": "lost", "seconds": 2.0 }));
    held(&mut page, "lost-dark");
    page.harness.ctx.set_theme(Theme::Light);
    page.tell(json!({ "is": "ended", "failure": null, "unseen": false }));
    held(&mut page, "expired");

    let mut robot = robot::after(7);
    let mut page = Page::of_size(&robot::address(""), USUAL);
    robot::follow(&mut page, &mut robot);
    held(&mut page, "robot");
    page.harness.ctx.set_theme(Theme::Dark);
    page.click("Share");
    held(&mut page, "robot-share-dark");
    let mut page = Page::of_size(&robot::address(""), NARROW);
    robot::follow(&mut page, &mut robot::Robot::default());
    held(&mut page, "robot-narrow");

    let mut page = run("speed=100&to=60&stop=never", USUAL, 60);
    page.harness.state_mut().run_seeds();
    for seed in 2..7 {
        page.tell(page.server.other_seed(seed, 60));
    }
    held(&mut page, "bands");

    let mut page = run("speed=100&to=60&stop=never", NARROW, 60);
    held(&mut page, "narrow");
    page.harness.ctx.set_theme(Theme::Dark);
    page.press(Key::T);
    (0..2).for_each(|_| page.click("Next"));
    page.click("Show the search");
    page.tell(page.server.selection("active"));
    held(&mut page, "tour-narrow-dark");
    let mut page = run("", LOW, 1);
    page.press(Key::T);
    page.click("Next");
    held(&mut page, "tour-low");

    // The end of the first story, and ten more seeds.
    let mut page = run("speed=50", USUAL, 1000);
    held(&mut page, "ending");
    page.harness.state_mut().run_seeds();
    for seed in 2..8 {
        page.tell(page.server.other_seed(seed, 250));
    }
    held(&mut page, "ending-luck");
    page.harness.ctx.set_theme(Theme::Dark);
    page.run();
    held(&mut page, "ending-luck-dark");
    let mut page = run("scenario=body-change&learners=active,random&speed=100", WIDE, 1000);
    held(&mut page, "recovered");

    let mut page = game(USUAL, 0);
    held(&mut page, "game");
    page.harness.ctx.set_theme(Theme::Dark);
    page.run();
    held(&mut page, "game-dark");
    held(&mut game(NARROW, 3), "game-narrow");
    held(&mut game(USUAL, ROUNDS), "game-over");

    for (name, size) in [("embed", vec2(400.0, 300.0)), ("embed-small", vec2(280.0, 200.0))] {
        held(&mut run("embed=1&speed=100&to=30&stop=never", size, 30), name);
    }

    // A head that does not see every movement, and a gradient whose steps are far too large.
    let mut page = Page::of_size("scenario=head-fov&speed=100&to=60&stop=never", USUAL);
    page.server.edit("gradient.rate", 1e6);
    let mut page = play(page, 60);
    held(&mut page, "diverged");

    for (name, size) in [("why", USUAL), ("why-wide", WIDE)] {
        let mut page = run("tab=why", size, 1);
        page.tell(page.server.selection("active"));
        held(&mut page, name);
    }
    held(&mut run("tab=share&learners=active,random", USUAL, 1), "share");
    held(&mut run("seed=-1&colour=blue", USUAL, 1), "notices");
}
