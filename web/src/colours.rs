//! Colours and marks that keep their meaning everywhere. They are those of the recordings.

use egui::Color32;
use egui_plot::{LineStyle, MarkerShape};

/// The Okabe–Ito palette, which the colour-blind can tell apart, in the order in which learners take it.
pub const LEARNERS: [[u8; 3]; 7] = [
    [0x00, 0x72, 0xB2],
    [0xD5, 0x5E, 0x00],
    [0x00, 0x9E, 0x73],
    [0xCC, 0x79, 0xA7],
    [0xE6, 0x9F, 0x00],
    [0x56, 0xB4, 0xE9],
    [0xF0, 0xE4, 0x42],
];

/// Stops of the viridis colour map, evenly spaced, dark to bright.
pub const VIRIDIS: [[u8; 3]; 10] = [
    [0x44, 0x01, 0x54],
    [0x48, 0x28, 0x78],
    [0x3E, 0x49, 0x89],
    [0x31, 0x68, 0x8E],
    [0x26, 0x82, 0x8E],
    [0x1F, 0x9E, 0x89],
    [0x35, 0xB7, 0x79],
    [0x6E, 0xCE, 0x58],
    [0xB5, 0xDE, 0x2B],
    [0xFD, 0xE7, 0x25],
];

/// The colour of the learner at this place in the scenario's list.
pub fn learner(index: usize) -> Color32 {
    let [red, green, blue] = LEARNERS[index % LEARNERS.len()];
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

/// The viridis colour of `value` in 0..=1.
pub fn viridis(value: f64) -> Color32 {
    let last = VIRIDIS.len() - 1;
    let place = if value.is_finite() { value.clamp(0.0, 1.0) * last as f64 } else { 0.0 };
    let lower = (place as usize).min(last - 1);
    let amount = place - lower as f64;
    let mix = |i: usize| {
        let (from, to) = (f64::from(VIRIDIS[lower][i]), f64::from(VIRIDIS[lower + 1][i]));
        (from + amount * (to - from)).round() as u8
    };
    Color32::from_rgb(mix(0), mix(1), mix(2))
}
