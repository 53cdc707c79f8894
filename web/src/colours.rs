//! Colours and marks that keep their meaning everywhere. They are those of the recordings.

#[path = "../../src/recording/palette.rs"]
mod palette;

use egui::Color32;
use egui_plot::{LineStyle, MarkerShape};

/// The colour of the learner at this place in the scenario's list.
pub fn learner(index: usize) -> Color32 {
    let [red, green, blue] = palette::learner_color(index);
    Color32::from_rgb(red, green, blue)
}

/// The line of that learner: told apart without colour too.
pub fn line_style(index: usize) -> LineStyle {
    match index % 3 {
        0 => LineStyle::Solid,
        1 => LineStyle::Dashed { length: 6.0 },
        _ => LineStyle::Dotted { spacing: 4.0 },
    }
}

/// The mark of that learner.
pub fn marker(index: usize) -> MarkerShape {
    const SHAPES: [MarkerShape; 7] = [
        MarkerShape::Circle,
        MarkerShape::Diamond,
        MarkerShape::Square,
        MarkerShape::Up,
        MarkerShape::Down,
        MarkerShape::Cross,
        MarkerShape::Plus,
    ];
    SHAPES[index % SHAPES.len()]
}

/// The viridis colour of `value` in 0..=1; what is not finite is dark.
pub fn viridis(value: f64) -> Color32 {
    let [red, green, blue] = palette::viridis(if value.is_finite() { value } else { 0.0 });
    Color32::from_rgb(red, green, blue)
}
