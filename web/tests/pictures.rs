//! Pictures of the panel in every state that a visitor may meet, held against those in `web/tests/snapshots`.
//!
//! They need a Vulkan driver, be it in software (Debian: mesa-vulkan-drivers). Without one they are skipped, unless the
//! environment has `CI` or `BODY_SCHEMA_REQUIRE_PICTURES=1`. `UPDATE_SNAPSHOTS=1` draws them anew: look at them then.

mod support;

use egui::{Key, Theme, Vec2, vec2};
use egui_kittest::{Harness, SnapshotOptions, SnapshotResult, SnapshotResults};
use serde_json::{Value, json};
use support::{Page, report, scenarios, selection};

/// Beside the scene on a screen of 1280 × 800, above it on a narrow one, and on a large screen.
const USUAL: Vec2 = vec2(486.0, 800.0);
const NARROW: Vec2 = vec2(400.0, 700.0);
const WIDE: Vec2 = vec2(720.0, 1000.0);

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

/// Learners as they fare on arm-6dof: the first converges soon, the second late, the third hardly.
fn faring(step: u64, learner: usize, report: &mut Value) {
    let rate = [0.035, 0.012, 0.004][learner];
    let wave = 1.0 + 0.1 * ((step as f64) * [0.9, 0.7, 0.5][learner]).sin();
    let error = 30.0 * (-rate * step as f64).exp() * wave + 0.8;
    report["metrics"]["orientation_deg"] = json!(error);
    report["metrics"]["location_m"] = json!(error / 150.0);
    report["metrics"]["prediction_mean_m"] = json!(error / 80.0);
    if learner < 2 {
        report["metrics"]["trace"] = json!(error / 10.0);
    }
}

fn run(query: &str, size: Vec2, steps: u64) -> Page {
    let mut page = Page::of_size(query, size);
    page.tell(scenarios());
    page.open_session();
    page.make_steps(1, faring);
    if steps > 1 {
        page.press(Key::Space);
        page.make_steps(steps - 1, faring);
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

    let mut page = run("speed=100&to=140&stop=never", USUAL, 140);
    held(&mut page, "converged");
    page.harness.ctx.set_theme(Theme::Dark);
    page.run();
    held(&mut page, "converged-dark");
    page.tell(json!({ "is": "lost", "seconds": 2.0 }));
    held(&mut page, "lost-dark");
    page.harness.ctx.set_theme(Theme::Light);
    page.tell(json!({ "is": "ended", "failure": null, "unseen": false }));
    held(&mut page, "expired");

    let mut page = run("speed=100&to=60&stop=never", USUAL, 60);
    page.harness.state_mut().run_seeds();
    for seed in 0..5u64 {
        let luck = 0.7 + 0.15 * seed as f64;
        let unlucky = |step: u64, learner: usize, value: &mut Value| {
            faring(step, learner, value);
            for error in ["orientation_deg", "location_m", "prediction_mean_m"] {
                value["metrics"][error] = json!(value["metrics"][error].as_f64().expect("an error") * luck);
            }
        };
        let reports: Vec<Value> =
            (1..=60).map(|step| report(step, 3, |learner, value| unlucky(step, learner, value))).collect();
        page.tell(json!({ "is": "seeds", "seed": seed, "reports": reports, "done": true }));
    }
    held(&mut page, "bands");

    let mut page = run("speed=100&to=60&stop=never", NARROW, 60);
    held(&mut page, "narrow");

    let mut page = run("speed=100&to=60&stop=never", USUAL, 30);
    page.make_steps(30, |step, learner, report| {
        faring(step, learner, report);
        report["metrics"]["misses"] = json!(step / 5);
        if learner == 2 {
            report["failure"] = json!("the estimate ran away");
        }
    });
    held(&mut page, "diverged");

    for (name, size) in [("why", USUAL), ("why-wide", WIDE)] {
        let mut page = run("tab=why", size, 1);
        page.tell(json!({ "is": "selection", "learner": "active", "selection": selection(1) }));
        held(&mut page, name);
    }
    held(&mut run("tab=share&learners=active,random", USUAL, 1), "share");
    held(&mut run("seed=-1&colour=blue", USUAL, 1), "notices");
}
