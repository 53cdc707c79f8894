//! One chart, drawn: curves in step with the scene. What is pointed at can be clicked to go there.

use egui::{Align2, FontId, Id, Sense, Ui, Vec2b, WidgetInfo, accesskit::Role, pos2, vec2};
use egui_plot::{
    FilledArea, HLine, HoverPosition, Line, LineStyle, Plot, PlotPoint, PlotPoints, PlotUi, Points, VLine,
};

use super::chart::{Chart, decades, steps};
use crate::{colours, panel::Panel};

impl Panel {
    /// Draws one chart; the step that was clicked.
    pub(super) fn curves(&self, ui: &mut Ui, chart: &Chart, height: f32) -> Option<u64> {
        let description = self.description()?;
        let from = self.chart_from();
        // Plots take no drag, so that a swipe over them scrolls the panel.
        let mut plot = Plot::new(chart.title)
            .height(height)
            .sense(Sense::click())
            .link_axis(Id::unique("steps"), Vec2b::new(true, false))
            .allow_zoom(Vec2b::new(true, false))
            .allow_drag(false)
            .allow_axis_zoom_drag(false)
            .allow_scroll(false)
            .allow_boxed_zoom(false)
            .include_x(from)
            .include_x(from + 10.0)
            .set_margin_fraction(vec2(0.02, 0.08))
            .y_axis_min_width(34.0)
            .show_crosshair(false)
            .grid_color(ui.visuals().text_color().gamma_multiply(0.4))
            .x_grid_spacer(steps)
            .x_axis_formatter(|mark, _| if mark.value < 0.0 { String::new() } else { mark.value.to_string() })
            .y_axis_formatter(|mark, _| chart.number(mark.value))
            .label_formatter(|hover| match hover {
                HoverPosition::NearDataPoint { plot_name, position, .. } if !plot_name.is_empty() => {
                    let number = chart.number(position.y);
                    Some(format!("{plot_name}\nstep {}: {number} {}", position.x.round(), chart.unit(self)))
                }
                HoverPosition::NearDataPoint { position, .. } | HoverPosition::Elsewhere { position } => {
                    Some(format!("step {}", position.x.round().max(0.0)))
                }
            });
        if chart.logarithmic {
            plot = plot.y_grid_spacer(decades);
        } else {
            plot = plot.include_y(0.0);
        }
        let [quiet, text] = [ui.visuals().weak_text_color(), ui.visuals().text_color()];
        let slots = colours::slots(description);
        let response = plot.show(ui, |plot| {
            for (index, slot) in slots.iter().copied().enumerate().filter(|(index, _)| self.is_seen(*index)) {
                self.draw_band(plot, chart, index, slot);
            }
            if let Some(threshold) = chart.threshold(self) {
                let line = HLine::new("threshold", chart.y(threshold)).color(text).width(1.0);
                plot.hline(line.style(LineStyle::Dashed { length: 3.0 }).allow_hover(false));
            }
            if chart.judged && description.movements_by_counting as f64 > from {
                let counted = VLine::new("", description.movements_by_counting as f64).color(quiet);
                plot.vline(counted.width(1.0).style(LineStyle::Dotted { spacing: 4.0 }).allow_hover(false));
            }
            if let Some(change) = self.shown_change() {
                plot.vline(VLine::new("", change as f64).color(text).width(1.5).allow_hover(false));
            }
            plot.vline(VLine::new("", self.cursor as f64).color(quiet).width(1.0).allow_hover(false));
            for (index, slot) in slots.iter().copied().enumerate().filter(|(index, _)| self.is_seen(*index)) {
                self.draw_learner(plot, chart, index, slot);
            }
            plot.pointer_coordinate()
        });
        if let Some(change) = self.shown_change() {
            let at = response.transform.position_from_point(&PlotPoint::new(change as f64, 0.0));
            let frame = *response.transform.frame();
            // On the side on which there is room.
            let (off, align) =
                if at.x > frame.center().x { (-4.0, Align2::RIGHT_TOP) } else { (4.0, Align2::LEFT_TOP) };
            let words = format!("body changes after {change}");
            ui.painter().text(pos2(at.x + off, frame.top() + 2.0), align, words, FontId::proportional(11.5), text);
        }
        let summary = self.summary(chart);
        response.response.widget_info(|| WidgetInfo::labeled(Role::Image, true, &summary));
        let clicked = response.response.clicked().then_some(response.inner).flatten()?;
        Some(clicked.x.round().max(0.0) as u64)
    }

    /// The step after which the body changed, once it has come near.
    fn shown_change(&self) -> Option<u64> {
        const NEAR: u64 = 20;
        self.description()?.change_at.filter(|change| self.history.latest() + NEAR >= *change)
    }

    /// The first step that charts show: where the body changes, that and what follows, unless an earlier step is shown in
    /// the scene.
    fn chart_from(&self) -> f64 {
        const BEFORE: u64 = 10;
        let begin = self.shown_change().map(|change| change.saturating_sub(BEFORE));
        begin.filter(|begin| self.cursor >= *begin).unwrap_or(0) as f64
    }

    fn draw_band(&self, plot: &mut PlotUi<'_>, chart: &Chart, index: usize, slot: usize) {
        let Some(band) = self.band(index, chart.value) else { return };
        let from = band.steps.partition_point(|step| *step < self.chart_from());
        let map = |values: &[f64]| -> Vec<f64> { values[from..].iter().map(|value| chart.y(*value)).collect() };
        let (colour, steps) = (colours::learner(slot), &band.steps[from..]);
        let area = FilledArea::new("", steps, &map(&band.low), &map(&band.high));
        plot.add(area.fill_color(colour.gamma_multiply(0.18)).allow_hover(false));
        let middle: Vec<[f64; 2]> = steps.iter().zip(map(&band.middle)).map(|(x, y)| [*x, y]).collect();
        plot.line(Line::new("", middle).color(colour).width(0.8).allow_hover(false));
    }

    fn draw_learner(&self, plot: &mut PlotUi<'_>, chart: &Chart, index: usize, slot: usize) {
        let Some(learner) = self.description().and_then(|description| description.learners.get(index)) else { return };
        let (colour, from) = (colours::learner(slot), self.chart_from());
        let mapped = |value: fn(&crate::history::Row) -> Option<f64>| -> Vec<[f64; 2]> {
            let curve = self.history.curve(index, value).into_iter().filter(|[x, _]| *x >= from);
            curve.map(|[x, y]| [x, chart.y(y)]).collect()
        };
        if let Some(bound) = chart.bound {
            let name = format!("what the data of {} allow", learner.name);
            plot.line(Line::new(name, mapped(bound)).color(colour).width(1.0));
        }
        let line = Line::new(&learner.name, PlotPoints::from(mapped(chart.value))).color(colour).width(1.8);
        plot.line(line.style(colours::line_style(slot)));
        let at = |step: u64| Some([step as f64, chart.y((chart.value)(self.history.row(step, index)?)?)]);
        if let Some(point) = at(self.cursor).filter(|point| point[1].is_finite()) {
            let here = Points::new(&learner.name, vec![point]).color(colour).radius(4.0);
            plot.points(here.shape(colours::marker(slot)).filled(false).allow_hover(false));
        }
        let learned = self.history.converged_at(self.cursor, index).filter(|_| chart.is_error);
        if let Some(point) = learned.and_then(at) {
            let mark = Points::new(format!("{} has learned the arm", learner.name), vec![point]).color(colour);
            plot.points(mark.radius(6.0).shape(colours::marker(slot)).filled(true));
        }
    }

    /// The chart in words: the values at the step that is shown.
    fn summary(&self, chart: &Chart) -> String {
        let mut text = format!("{} at step {}:", chart.title, self.cursor);
        let learners = self.description().into_iter().flat_map(|one| &one.learners).enumerate();
        for (index, learner) in learners.filter(|(index, _)| self.is_seen(*index)) {
            let value = self.history.row(self.cursor, index).and_then(|row| (chart.value)(row));
            let value = value.map_or("not known".to_owned(), |value| chart.number(chart.y(value)));
            text += &format!(" {} {value} {},", learner.name, chart.unit(self));
        }
        text.trim_end_matches([',', ' ']).to_owned() + "."
    }
}
