//! Charts for print: panels of curves, drawn as SVG and as PNG.
//!
//! Nothing here knows what is plotted. Curves differ in colour, in dashes and in markers, so that they can be told
//! apart in grey.

mod axis;
mod panel;
mod style;
mod svg;

pub use axis::{Axis, Scale};
pub use panel::{Layer, Panel};
pub use style::{Marker, Style};
pub use svg::{Colour, RasterError, png};

use style::{FAINT, INK, face};
use svg::{Align, Svg};

/// A grid of panels with a title, a legend and a note.
#[derive(Clone, Debug)]
pub struct Chart {
    /// Its title.
    pub title: String,
    /// One line below it.
    pub subtitle: String,
    /// What the lines mean.
    pub legend: Vec<(String, Style)>,
    /// The panels, row by row; a row is filled from the left.
    pub rows: Vec<Vec<Panel>>,
    /// Lines below the panels.
    pub notes: Vec<String>,
}

/// Size of a panel's plotting area, and the room left of and below it for its axes.
const PANEL: [f64; 2] = [292.0, 230.0];
const LEFT: f64 = 68.0;
const BELOW: f64 = 52.0;
const RIGHT: f64 = 18.0;
/// Room above a panel for its title and its marks.
const ABOVE: f64 = 34.0;
const HEAD: f64 = 52.0;
const LEGEND: f64 = 26.0;
const NOTE: f64 = 16.0;

impl Chart {
    /// The chart as an SVG document.
    pub fn svg(&self) -> String {
        let columns = self.rows.iter().map(Vec::len).max().unwrap_or(1) as f64;
        let legend = if self.legend.is_empty() { 0.0 } else { LEGEND };
        let [cell_width, cell_height] = [LEFT + PANEL[0] + RIGHT, ABOVE + PANEL[1] + BELOW];
        let width = columns * cell_width;
        let panels = HEAD + legend;
        let notes = panels + self.rows.len() as f64 * cell_height;
        let mut svg = Svg::new(width, notes + self.notes.len() as f64 * NOTE + 10.0);
        svg.text([14.0, 25.0], &self.title, face(15.0, true, INK, Align::Start), 0.0);
        svg.text([14.0, 44.0], &self.subtitle, face(11.0, false, FAINT, Align::Start), 0.0);
        self.draw_legend(&mut svg, panels - 6.0);
        for (row, line) in self.rows.iter().enumerate() {
            for (column, panel) in line.iter().enumerate() {
                let left = column as f64 * cell_width + LEFT;
                let top = panels + row as f64 * cell_height + ABOVE;
                panel.draw(&mut svg, [left, top, PANEL[0], PANEL[1]]);
            }
        }
        for (index, note) in self.notes.iter().enumerate() {
            let y = notes + 12.0 + index as f64 * NOTE;
            svg.text([14.0, y], note, face(10.5, false, FAINT, Align::Start), 0.0);
        }
        svg.finish(&format!("{}. {}", self.title, self.subtitle))
    }

    fn draw_legend(&self, svg: &mut Svg, y: f64) {
        let mut x = LEFT;
        for (label, style) in &self.legend {
            svg.line(&[[x, y - 4.0], [x + 34.0, y - 4.0]], style.stroke());
            if let Some(marker) = style.marker {
                marker.draw(svg, [x + 17.0, y - 4.0], style.colour);
            }
            svg.text([x + 41.0, y], label, face(12.0, false, INK, Align::Start), 0.0);
            x += 41.0 + 7.6 * label.chars().count() as f64 + 26.0;
        }
    }
}
