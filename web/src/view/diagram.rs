//! The boxes of DIRECT by size and value, and the hull from which it takes those to divide: Fig. 3c of the paper.

use body_schema_engine::optimize::{MAX_LEVEL, Variant};
use egui::{RichText, Sense, Ui, Vec2b, vec2};
use egui_plot::{GridInput, GridMark, HoverPosition, Line, MarkerShape, Plot, PlotPoints, Points};

use super::style::accent;
use crate::{panel::Panel, search::Search};

impl Panel {
    pub(super) fn diagram(&self, ui: &mut Ui, search: &Search, iteration: usize) {
        let tip = "Every box: its size, and the criterion at its centre. DIRECT divides those on the lower right hull: \
                   large ones, where something may hide, and good ones.";
        ui.label(RichText::new("Boxes by size and criterion").strong()).on_hover_text(tip);
        let dots = search.diagram(iteration);
        let of = |optimal: bool| -> Vec<[f64; 2]> {
            let some = dots.iter().filter(|dot| dot.optimal == optimal);
            some.map(|dot| [dot.size.log(3.0), dot.value]).collect()
        };
        let mut hull = of(true);
        hull.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let bold = accent(ui.visuals().dark_mode);
        let quiet = ui.visuals().text_color().gamma_multiply(0.6);
        // The largest size that is marked: those of DIRECT-l are halves of powers of three.
        let (name, largest) = match search.variant() {
            Variant::Original => ("half the diagonal", 1.0),
            Variant::LocallyBiased => ("half the longest side", 0.5_f64),
        };
        Plot::new("hull")
            .height(220.0)
            .allow_zoom(false)
            .sense(Sense::click())
            .allow_drag(false)
            .allow_scroll(false)
            .allow_boxed_zoom(false)
            .auto_bounds(Vec2b::TRUE)
            .set_margin_fraction(vec2(0.06, 0.08))
            .show_crosshair(false)
            .grid_color(ui.visuals().text_color().gamma_multiply(0.4))
            .x_axis_label(format!("size of the box: {name}"))
            .y_axis_label("criterion")
            .y_axis_min_width(40.0)
            .x_grid_spacer(move |input| thirds(input, largest.log(3.0)))
            .x_axis_formatter(|mark, _| match 3f64.powf(-mark.value).round() {
                1.0 => "1".to_owned(),
                parts => format!("1/{parts}"),
            })
            .label_formatter(|hover| match hover {
                HoverPosition::NearDataPoint { plot_name, position, .. } if !plot_name.is_empty() => {
                    Some(format!("{plot_name}\nsize {:.3}\ncriterion {:.4}", 3f64.powf(position.x), position.y))
                }
                _ => None,
            })
            .show(ui, |plot| {
                plot.points(Points::new("box", PlotPoints::from(of(false))).color(quiet).radius(2.5));
                plot.line(Line::new("", PlotPoints::from(hull.clone())).color(bold).width(1.5).allow_hover(false));
                let optimal = Points::new("divided next", PlotPoints::from(hull)).color(bold).radius(5.0);
                plot.points(optimal.shape(MarkerShape::Diamond));
            });
    }
}

/// Marks at the largest size and its thirds, ninths, …, as logarithms to base 3.
fn thirds(input: GridInput, largest: f64) -> Vec<GridMark> {
    let (low, high) = input.bounds;
    let marks = (0..=i32::from(MAX_LEVEL)).map(|level| largest - f64::from(level));
    marks.filter(|value| (low..=high).contains(value)).map(|value| GridMark { value, step_size: 2.0 }).collect()
}
