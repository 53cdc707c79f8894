//! Charts for print: panels of curves, drawn as SVG and as PNG.
//!
//! Nothing here knows what is plotted. Curves differ in colour, in dashes and in markers, so that they can be told
//! apart in grey.
//!
//! A [`Chart`] is a grid of [`Panel`]s; a panel has two axes ([`Axis`], linear or logarithmic) and [`Layer`]s that are drawn
//! in order. Sizes are in pixels of the drawing, places on a panel in the units of its axes.

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
/// Height of a legend of one line, and of every further line.
const LEGEND: f64 = 26.0;
const LEGEND_LINE: f64 = 19.0;
/// Length of a line in the legend.
const SAMPLE: f64 = 34.0;
const NOTE: f64 = 16.0;

impl Chart {
    /// The chart as an SVG document.
    pub fn svg(&self) -> String {
        let columns = self.rows.iter().map(Vec::len).max().unwrap_or(1) as f64;
        let [cell_width, cell_height] = [LEFT + PANEL[0] + RIGHT, ABOVE + PANEL[1] + BELOW];
        let width = columns * cell_width;
        let places = self.legend_places(width);
        let legend = places.last().map_or(0.0, |[_, y]| y + LEGEND);
        let panels = HEAD + legend;
        let notes = panels + self.rows.len() as f64 * cell_height;
        let mut svg = Svg::new(width, notes + self.notes.len() as f64 * NOTE + 10.0);
        svg.text([14.0, 25.0], &self.title, face(15.0, true, INK, Align::Start), 0.0);
        svg.text([14.0, 44.0], &self.subtitle, face(11.0, false, FAINT, Align::Start), 0.0);
        self.draw_legend(&mut svg, &places);
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

    /// Where the entries of the legend are, in lines below one another; y from the top of the legend.
    fn legend_places(&self, width: f64) -> Vec<[f64; 2]> {
        let (mut x, mut y) = (LEFT, 0.0);
        let place = |(label, _): &(String, Style)| {
            let room = SAMPLE + 7.0 + 7.4 * label.chars().count() as f64;
            if x > LEFT && x + room > width - RIGHT {
                (x, y) = (LEFT, y + LEGEND_LINE);
            }
            let place = [x, y];
            x += room + 22.0;
            place
        };
        self.legend.iter().map(place).collect()
    }

    fn draw_legend(&self, svg: &mut Svg, places: &[[f64; 2]]) {
        for ((label, style), [x, y]) in self.legend.iter().zip(places) {
            let y = HEAD + y + 20.0;
            if style.is_line() {
                svg.line(&[[*x, y - 4.0], [x + SAMPLE, y - 4.0]], style.stroke());
            }
            if let Some(marker) = style.marker {
                marker.draw(svg, [x + SAMPLE / 2.0, y - 4.0], style.colour);
            }
            svg.text([x + SAMPLE + 7.0, y], label, face(12.0, false, INK, Align::Start), 0.0);
        }
    }
}
