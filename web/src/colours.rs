//! Colours and marks with the same meaning everywhere, shared with recordings.

use body_schema_palette as palette;
use body_schema_wire::Description;
use egui::Color32;
use egui_plot::{LineStyle, MarkerShape};

/// The slot of the learner whose movements the visitor chooses.
const HUMAN: usize = 4;

/// The slot of every learner by its name, which decides its colour, line and mark.
pub fn slots(description: &Description) -> Vec<usize> {
    palette::learner_slots(description.learners.iter().map(|learner| learner.name.as_str()))
}

/// The colour of a slot.
pub fn learner(slot: usize) -> Color32 {
    let [red, green, blue] = palette::learner_color(slot);
    Color32::from_rgb(red, green, blue)
}

/// The line style of a slot, which is distinct without colour too.
pub fn line_style(slot: usize) -> LineStyle {
    // The visitor's own, whose colour is near that of `random`, is drawn through.
    match slot % 3 {
        _ if slot == HUMAN => LineStyle::Solid,
        0 => LineStyle::Solid,
        1 => LineStyle::Dashed { length: 6.0 },
        _ => LineStyle::Dotted { spacing: 4.0 },
    }
}

/// The mark of a slot.
pub fn marker(slot: usize) -> MarkerShape {
    const SHAPES: [MarkerShape; 7] = [
        MarkerShape::Circle,
        MarkerShape::Diamond,
        MarkerShape::Square,
        MarkerShape::Up,
        MarkerShape::Down,
        MarkerShape::Cross,
        MarkerShape::Plus,
    ];
    SHAPES[slot % SHAPES.len()]
}

/// The viridis colour of `value` in 0..=1; what is not finite is dark.
pub fn viridis(value: f64) -> Color32 {
    let [red, green, blue] = palette::viridis(if value.is_finite() { value } else { 0.0 });
    Color32::from_rgb(red, green, blue)
}
