//! What the page says of sensors and their readings.

use body_schema_panel::settings::Tab;
use egui::Key;
use egui_kittest::kittest::Queryable;

use crate::support::Page;

/// A session that has made so many steps, with its readings in sight.
fn after(query: &str, steps: u64) -> Page {
    let mut page = Page::with_session(&format!("{query}&stop=never&to={steps}"));
    page.press(Key::Space);
    page.make_steps(steps);
    page.harness.state_mut().settings.tab = Tab::Why;
    page.run();
    page
}

fn says(page: &Page, words: &str) -> bool {
    page.harness.query_all_by_label_contains(words).next().is_some()
}

#[test]
fn the_legend_says_what_there_is_to_see() {
    let caption = |query: &str| Page::with_session(query).harness.state().caption();
    let simulated = caption("scenario=arm-6dof");
    assert!(simulated.truth && simulated.seen == "where the hand was seen", "{simulated:?}");
    let measured = caption("scenario=tiago-mocap");
    assert!(!measured.truth, "of recorded data no true arm is known");
    let camera = caption("scenario=arm-6dof-camera");
    assert!(camera.truth && camera.seen == "from a camera to what it saw", "{camera:?}");
}

#[test]
fn readings_are_told_beside_the_choice() {
    let page = after("scenario=arm-6dof&learners=active,global", 3);
    assert!(says(&page, "What was read at step 3"));
    assert!(says(&page, "marker "));
    let mut page = after("scenario=arm-6dof-camera&learners=global,smoother-random&seed=2", 12);
    let readings = |page: &Page| -> Vec<bool> {
        let panel = page.harness.state();
        (0..2).map(|learner| panel.history.readings(panel.cursor, learner)[0].residual_sigmas.is_some()).collect()
    };
    let mut seen = Vec::new();
    for _ in 0..11 {
        for is_seen in readings(&page) {
            seen.push(is_seen);
            assert!(says(&page, if is_seen { "tag seen by eye " } else { "tag seen by eye: not seen" }));
        }
        page.press(Key::ArrowLeft);
    }
    assert!(seen.contains(&true) && seen.contains(&false), "{seen:?}");
}

#[test]
fn an_outlier_is_called_one_with_its_probability() {
    let page = after("scenario=arm-6dof-outliers&learners=global", 25);
    let panel = page.harness.state();
    let outlier = (1..=25).find(|step| panel.history.readings(*step, 0)[0].is_outlier()).expect("one in ten is one");
    let mut page = page;
    page.harness.state_mut().scrub(outlier);
    page.run();
    assert!(says(&page, ": outlier, p = "), "step {outlier}");
}

#[test]
fn where_drawing_is_slow_a_panel_that_plays_is_drawn_sparingly() {
    let mut page = Page::with_session("stop=never&speed=10");
    page.press(Key::Space);
    page.make_steps(3);
    let panel = page.harness.state_mut();
    assert!(panel.playing);
    panel.drawn_every = 0.3;
    assert!(panel.draws_sparingly());
    let ctx = egui::Context::default();
    let delays = (0..40).map(|frame| {
        let input = egui::RawInput { time: Some(100.0 + 0.05 * f64::from(frame)), ..Default::default() };
        let mut output = ctx.run_ui(input, |ui| panel.ui(ui));
        output.textures_delta.clear();
        output.viewport_output[&egui::ViewportId::ROOT].repaint_delay.as_secs_f64()
    });
    let last = delays.last().expect("frames");
    assert!(last >= 0.3, "drawn again after {last} s");
    panel.pause();
    assert!(!panel.draws_sparingly());
}
