//! One panel: two axes and what is drawn between them.

use super::{
    axis::Axis,
    style::{FAINT, GRID, INK, LEVEL, MINOR_GRID, Marker, Style, face},
    svg::{Align, Colour, Stroke, Svg},
};

/// A plotting area with its axes.
#[derive(Clone, Debug)]
pub struct Panel {
    /// Its title.
    pub title: String,
    /// The horizontal axis.
    pub x: Axis,
    /// The vertical axis.
    pub y: Axis,
    /// The layers, the first at the bottom.
    pub layers: Vec<Layer>,
}

/// Something drawn in a panel, in the units of its axes.
#[derive(Clone, Debug)]
pub enum Layer {
    /// The area between two curves: x, lower, upper.
    Band {
        /// Its points.
        points: Vec<[f64; 3]>,
        /// Its colour.
        colour: Colour,
    },
    /// A curve, with markers spread over the width of the panel.
    Curve {
        /// Its points.
        points: Vec<[f64; 2]>,
        /// Its style.
        style: Style,
    },
    /// Points that are not joined.
    Points {
        /// Their places.
        points: Vec<[f64; 2]>,
        /// Their shape.
        marker: Marker,
        /// Their colour.
        colour: Colour,
    },
    /// A rectangle.
    Cell {
        /// Left and right.
        x: [f64; 2],
        /// Bottom and top.
        y: [f64; 2],
        /// Its inside.
        fill: Colour,
        /// Width of its outline, pixels.
        outline: f64,
    },
    /// A horizontal line with a name, such as a threshold.
    Level {
        /// Its value.
        y: f64,
        /// Its name.
        label: String,
    },
    /// A place on the horizontal axis, marked above the panel.
    Event {
        /// Its value.
        x: f64,
        /// Its name.
        label: String,
        /// Its colour.
        colour: Colour,
        /// Dashes of the line through the panel.
        dashes: &'static str,
    },
}

/// Markers along a curve.
const MARKERS: usize = 7;

impl Panel {
    pub(super) fn draw(&self, svg: &mut Svg, area: [f64; 4]) {
        let [left, top, width, height] = area;
        let place = |x: f64, y: f64| [left + width * self.x.place(x), top + height * (1.0 - self.y.place(y))];
        self.draw_grid(svg, area);
        svg.clipped(area, |svg| {
            let curves = self.layers.iter().filter(|layer| matches!(layer, Layer::Curve { .. })).count();
            let mut curve = 0;
            for layer in &self.layers {
                self.draw_layer(svg, layer, &place, area);
                if let Layer::Curve { points, style } = layer {
                    self.draw_markers(svg, points, *style, (curve as f64 + 0.5) / curves as f64, &place);
                    curve += 1;
                }
            }
        });
        let corners =
            [[left, top], [left + width, top], [left + width, top + height], [left, top + height], [left, top]];
        svg.line(&corners, Stroke { colour: INK, width: 1.0, dashes: "" });
        self.draw_events(svg, area);
        svg.text([left, top - 18.0], &self.title, face(12.0, true, INK, Align::Start), 0.0);
        let below = [left + width / 2.0, top + height + 34.0];
        svg.text(below, &self.x.label, face(11.5, false, INK, Align::Middle), 0.0);
        let beside = [left - 48.0, top + height / 2.0];
        svg.text(beside, &self.y.label, face(11.5, false, INK, Align::Middle), 90.0);
    }

    fn draw_grid(&self, svg: &mut Svg, [left, top, width, height]: [f64; 4]) {
        let stroke = |named: bool| Stroke { colour: if named { GRID } else { MINOR_GRID }, width: 0.8, dashes: "" };
        let ticks = |axis: &Axis| {
            let mut ticks = axis.ticks();
            ticks.sort_by_key(|(_, name)| name.is_some());
            ticks
        };
        for (value, name) in ticks(&self.x) {
            let x = left + width * self.x.place(value);
            svg.line(&[[x, top], [x, top + height]], stroke(name.is_some()));
            if let Some(name) = name {
                svg.text([x, top + height + 16.0], &name, face(10.5, false, INK, Align::Middle), 0.0);
            }
        }
        for (value, name) in ticks(&self.y) {
            let y = top + height * (1.0 - self.y.place(value));
            svg.line(&[[left, y], [left + width, y]], stroke(name.is_some()));
            if let Some(name) = name {
                svg.text([left - 6.0, y + 3.8], &name, face(10.5, false, INK, Align::End), 0.0);
            }
        }
    }

    fn draw_layer(&self, svg: &mut Svg, layer: &Layer, place: &dyn Fn(f64, f64) -> [f64; 2], area: [f64; 4]) {
        let [left, top, width, height] = area;
        match layer {
            Layer::Band { points, colour } => {
                let upper = points.iter().map(|[x, _, upper]| place(*x, *upper));
                let lower = points.iter().rev().map(|[x, lower, _]| place(*x, *lower));
                svg.area(&upper.chain(lower).collect::<Vec<_>>(), *colour, 0.17);
            }
            Layer::Curve { points, style } => {
                let points: Vec<_> = points.iter().map(|[x, y]| place(*x, *y)).collect();
                svg.line(&points, style.stroke());
            }
            Layer::Points { points, marker, colour } => {
                points.iter().for_each(|[x, y]| marker.draw(svg, place(*x, *y), *colour));
            }
            Layer::Cell { x, y, fill, outline } => {
                let corners = [place(x[0], y[0]), place(x[1], y[0]), place(x[1], y[1]), place(x[0], y[1])];
                svg.shape(&corners, *fill, Stroke { colour: INK, width: *outline, dashes: "" });
            }
            Layer::Level { y, label } => {
                let y = top + height * (1.0 - self.y.place(*y));
                svg.line(&[[left, y], [left + width, y]], Stroke { colour: LEVEL, width: 1.2, dashes: "4 2" });
                svg.text([left + 5.0, y - 4.0], label, face(9.5, false, FAINT, Align::Start), 0.0);
            }
            Layer::Event { x, colour, dashes, .. } => {
                let x = left + width * self.x.place(*x);
                svg.line(&[[x, top], [x, top + height]], Stroke { colour: *colour, width: 1.0, dashes });
            }
        }
    }

    /// Draws markers at even distances, each curve's beside the others'.
    fn draw_markers(
        &self,
        svg: &mut Svg,
        points: &[[f64; 2]],
        style: Style,
        shift: f64,
        place: &dyn Fn(f64, f64) -> [f64; 2],
    ) {
        let Some(marker) = style.marker else { return };
        // Few points each carry one.
        if points.len() <= 2 * MARKERS {
            return points.iter().for_each(|[x, y]| marker.draw(svg, place(*x, *y), style.colour));
        }
        for index in 0..MARKERS {
            let wanted = (index as f64 + shift) / MARKERS as f64;
            let distance = |point: &&[f64; 2]| (self.x.place(point[0]) - wanted).abs();
            if let Some([x, y]) = points.iter().min_by(|a, b| distance(a).total_cmp(&distance(b))) {
                marker.draw(svg, place(*x, *y), style.colour);
            }
        }
    }

    /// Draws the names of events above the panel, each no earlier than where the one before it ends, as long as there
    /// is room.
    fn draw_events(&self, svg: &mut Svg, [left, top, width, _]: [f64; 4]) {
        let mut events: Vec<_> = self
            .layers
            .iter()
            .filter_map(|layer| match layer {
                Layer::Event { x, label, colour, .. } => Some((left + width * self.x.place(*x), label, *colour)),
                _ => None,
            })
            .collect();
        events.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut free = left;
        for (x, label, colour) in events {
            let half = 3.2 * label.chars().count() as f64;
            let middle = x.max(free + half);
            free = middle + half + 5.0;
            let tip = [[x, top - 0.5], [x - 3.0, top - 5.0], [x + 3.0, top - 5.0]];
            svg.shape(&tip, colour, Stroke { colour, width: 0.5, dashes: "" });
            // In a crowd those that find no room keep their tip alone; tables have the number.
            if middle + half <= left + width + 20.0 {
                svg.text([middle, top - 7.0], label, face(9.5, false, colour, Align::Middle), 0.0);
            }
        }
    }
}
