//! Clicks on a panel that is drawn slowly.

/// Has what was pressed in one frame and released in the next count as a click, however long the frame took: egui counts by its
/// frames, and a press that seems to last is none to it. `time` is that of the frame which begins, seconds as egui counts them.
pub fn allow_for_slow_frames(ctx: &egui::Context, time: Option<f64>) {
    let since = time.map_or(0.0, |time| time - ctx.input(|input| input.time));
    let usual = egui::InputOptions::default().max_click_duration;
    ctx.options_mut(|options| options.input_options.max_click_duration = usual + since.max(0.0));
}

#[cfg(test)]
mod tests {
    use super::*;
    use egui::{Event, Modifiers, PointerButton, RawInput, pos2, vec2};

    /// Whether a button is clicked on that is pressed in one frame, and released in the one that comes so many seconds later.
    fn is_click(seconds: f64) -> bool {
        let (ctx, place) = (egui::Context::default(), pos2(20.0, 20.0));
        let mut clicked = false;
        let mut frame = |time: f64, events: Vec<Event>| {
            let input = RawInput { time: Some(time), events, ..RawInput::default() };
            allow_for_slow_frames(&ctx, input.time);
            let mut shown = ctx.run_ui(input, |ui| {
                let area = egui::Rect::from_min_size(pos2(0.0, 0.0), vec2(40.0, 40.0));
                clicked |= ui.put(area, egui::Button::new("Step")).clicked();
            });
            // Nothing draws here.
            shown.textures_delta.clear();
        };
        let button = |pressed| {
            vec![Event::PointerButton {
                pos: place,
                button: PointerButton::Primary,
                pressed,
                modifiers: Modifiers::NONE,
            }]
        };
        frame(0.0, vec![Event::PointerMoved(place)]);
        frame(0.1, button(true));
        frame(0.1 + seconds, button(false));
        clicked
    }

    #[test]
    fn a_click_counts_however_long_a_frame_takes() {
        for seconds in [0.05, 0.7, 3.0, 40.0] {
            assert!(is_click(seconds), "after {seconds} s");
        }
    }
}
