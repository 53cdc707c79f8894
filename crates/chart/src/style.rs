//! How lines, markers and letters look.

use super::svg::{Align, Colour, Stroke, Svg, Type};

/// Text and axes.
pub const INK: Colour = [0x22, 0x22, 0x22];
/// Text of lesser weight.
pub const FAINT: Colour = [0x55, 0x55, 0x55];
/// Grid lines.
pub const GRID: Colour = [0xDD, 0xDD, 0xDD];
/// Grid lines between those that are named.
pub const MINOR_GRID: Colour = [0xF0, 0xF0, 0xF0];
/// Thresholds.
pub const LEVEL: Colour = [0x77, 0x77, 0x77];

/// The style of a curve: colour, dashes and marker, each enough to tell it from the others.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Style {
    /// Its colour.
    pub colour: Colour,
    /// Its dashes, an SVG pattern; empty for a solid line.
    pub dashes: &'static str,
    /// Its marker, if any.
    pub marker: Option<Marker>,
}

/// The shape of a marker.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Marker {
    /// ○, filled white.
    Circle,
    /// ■
    Square,
    /// △, filled white.
    Triangle,
    /// ◆
    Diamond,
    /// ●, small.
    Dot,
}

/// The dash pattern of points without a line.
const NO_LINE: &str = "none";

const DASHES: [&str; 4] = ["", "7 3", "2 2.5", "9 3 2 3"];
const MARKERS: [Marker; 4] = [Marker::Circle, Marker::Square, Marker::Triangle, Marker::Diamond];

impl Style {
    /// The style of the curve at this place among others.
    pub fn at(index: usize, colour: Colour) -> Self {
        Self { colour, dashes: DASHES[index % DASHES.len()], marker: Some(MARKERS[index % MARKERS.len()]) }
    }

    /// The style of points that are not joined.
    pub fn points(marker: Marker, colour: Colour) -> Self {
        Self { colour, dashes: NO_LINE, marker: Some(marker) }
    }

    pub(super) fn is_line(&self) -> bool {
        self.dashes != NO_LINE
    }

    pub(super) fn stroke(&self) -> Stroke {
        Stroke { colour: self.colour, width: 1.9, dashes: self.dashes }
    }
}

impl Marker {
    pub(super) fn draw(self, svg: &mut Svg, [x, y]: [f64; 2], colour: Colour) {
        const WHITE: Colour = [0xFF; 3];
        let outline = Stroke { colour, width: 1.4, dashes: "" };
        let around = |offsets: &[[f64; 2]]| -> Vec<[f64; 2]> { offsets.iter().map(|[a, b]| [x + a, y + b]).collect() };
        match self {
            Self::Circle => svg.disc([x, y], 3.5, WHITE, outline),
            Self::Dot => svg.disc([x, y], 2.2, colour, Stroke { width: 0.5, ..outline }),
            Self::Square => svg.shape(&around(&[[-3., -3.], [3., -3.], [3., 3.], [-3., 3.]]), colour, outline),
            Self::Triangle => svg.shape(&around(&[[-4., 3.2], [4., 3.2], [0., -4.2]]), WHITE, outline),
            Self::Diamond => svg.shape(&around(&[[-4.2, 0.], [0., -4.2], [4.2, 0.], [0., 4.2]]), colour, outline),
        }
    }
}

/// A way to set text.
pub fn face(size: f64, bold: bool, colour: Colour, align: Align) -> Type {
    Type { size, bold, colour, align }
}
