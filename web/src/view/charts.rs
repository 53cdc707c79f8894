//! Curves over the steps, in step with the scene: what is pointed at can be clicked to go there.

use egui::{Id, RichText, Ui, Vec2b, vec2};
use egui_plot::{FilledArea, HLine, HoverPosition, Line, LineStyle, Plot, PlotPoints, Points, VLine};

use super::{
    chart::{CHARTS, Chart, decades, steps},
    learners::swatch,
};
use crate::{
    colours,
    panel::Panel,
    seeds::{SEEDS, SeedRuns},
};

/// From this width on there are two charts beside each other.
const TWO_COLUMNS: f32 = 640.0;
const HEIGHT: f32 = 150.0;

impl Panel {
    pub(super) fn charts(&mut self, ui: &mut Ui) {
        self.legend(ui);
        let missed = self.description().is_some_and(|description| {
            (0..description.learners.len())
                .any(|learner| self.history.row(self.history.latest(), learner).is_some_and(|row| row.misses > 0))
        });
        let known = self.description().is_some_and(|description| description.truth.is_some());
        let shown: Vec<&Chart> =
            CHARTS.iter().filter(|chart| (known || !chart.judged) && (chart.title != "Misses" || missed)).collect();
        let columns = if ui.available_width() >= TWO_COLUMNS { 2 } else { 1 };
        let mut clicked = None;
        for row in shown.chunks(columns) {
            ui.columns(columns, |uis| {
                for (ui, chart) in uis.iter_mut().zip(row) {
                    clicked = self.chart(ui, chart).or(clicked);
                }
            });
        }
        if let Some(step) = clicked {
            self.scrub(step);
            self.sought = None;
        }
        self.seeds_row(ui);
    }

    fn legend(&self, ui: &mut Ui) {
        let Some(description) = self.description() else { return };
        ui.horizontal_wrapped(|ui| {
            for (learner, slot) in description.learners.iter().zip(colours::slots(description)) {
                swatch(ui, slot);
                ui.label(&learner.name);
                ui.add_space(6.0);
            }
            let converged =
                (0..description.learners.len()).any(|i| self.history.converged_at(self.cursor, i).is_some());
            if description.truth.is_some() && description.movements_by_counting > 0 {
                let tip = format!(
                    "{} unknowns, three equations a movement: nobody can know everything earlier without an initial guess",
                    description.parameters
                );
                let text = format!("dotted: {} movements, as many equations as unknowns", description.movements_by_counting);
                ui.label(RichText::new(text).weak()).on_hover_text(tip);
            }
            if converged {
                ui.label(RichText::new("filled mark: converged").weak());
            }
        });
    }

    /// Draws one chart; the step that was clicked.
    fn chart(&self, ui: &mut Ui, chart: &Chart) -> Option<u64> {
        let description = self.description()?;
        ui.horizontal(|ui| {
            ui.label(RichText::new(format!("{}, {}", chart.title, chart.unit)).strong()).on_hover_text(chart.tip);
            ui.label(RichText::new("over movements").weak().small());
        });
        let mut plot = Plot::new(chart.title)
            .height(HEIGHT)
            .link_axis(Id::unique("steps"), Vec2b::new(true, false))
            .allow_zoom(Vec2b::new(true, false))
            .allow_drag(Vec2b::new(true, false))
            .allow_scroll(false)
            .allow_boxed_zoom(false)
            .include_x(0.0)
            .include_x(10.0)
            .set_margin_fraction(vec2(0.02, 0.08))
            .y_axis_min_width(34.0)
            .show_crosshair(false)
            .x_grid_spacer(steps)
            .x_axis_formatter(|mark, _| if mark.value < 0.0 { String::new() } else { mark.value.to_string() })
            .y_axis_formatter(|mark, _| chart.number(mark.value))
            .label_formatter(|hover| match hover {
                HoverPosition::NearDataPoint { plot_name, position, .. } if !plot_name.is_empty() => {
                    let number = chart.number(position.y);
                    Some(format!("{plot_name}\nstep {}: {number} {}", position.x.round(), chart.unit))
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
        let cursor_colour = ui.visuals().weak_text_color();
        let threshold_colour = ui.visuals().text_color();
        let slots = colours::slots(description);
        let response = plot.show(ui, |plot| {
            for (index, slot) in slots.iter().copied().enumerate() {
                if let Some(band) = self.band(index, chart.value) {
                    let map = |values: &[f64]| -> Vec<f64> { values.iter().map(|value| chart.y(*value)).collect() };
                    let colour = colours::learner(slot);
                    let area = FilledArea::new("", &band.steps, &map(&band.low), &map(&band.high));
                    plot.add(area.fill_color(colour.gamma_multiply(0.18)).allow_hover(false));
                    let middle: Vec<[f64; 2]> =
                        band.steps.iter().zip(map(&band.middle)).map(|(x, y)| [*x, y]).collect();
                    plot.line(Line::new("", middle).color(colour.gamma_multiply(0.5)).width(1.0).allow_hover(false));
                }
            }
            if let Some(threshold) = chart.threshold(self) {
                let line = HLine::new("threshold", chart.y(threshold)).color(threshold_colour).width(1.0);
                plot.hline(line.style(LineStyle::Dashed { length: 3.0 }).allow_hover(false));
            }
            if chart.judged && description.movements_by_counting > 0 {
                let counted = VLine::new("", description.movements_by_counting as f64).color(cursor_colour);
                plot.vline(counted.width(1.0).style(LineStyle::Dotted { spacing: 4.0 }).allow_hover(false));
            }
            plot.vline(VLine::new("", self.cursor as f64).color(cursor_colour).width(1.0).allow_hover(false));
            for (index, (learner, slot)) in description.learners.iter().zip(slots).enumerate() {
                let colour = colours::learner(slot);
                let curve: Vec<[f64; 2]> =
                    self.history.curve(index, chart.value).into_iter().map(|[x, y]| [x, chart.y(y)]).collect();
                if let Some(bound) = chart.bound {
                    let bound: Vec<[f64; 2]> =
                        self.history.curve(index, bound).into_iter().map(|[x, y]| [x, chart.y(y)]).collect();
                    let name = format!("bound of {}'s data", learner.name);
                    plot.line(Line::new(name, bound).color(colour.gamma_multiply(0.6)).width(1.0));
                }
                let line = Line::new(&learner.name, PlotPoints::from(curve)).color(colour).width(1.8);
                plot.line(line.style(colours::line_style(slot)));
                let at = |step: u64| Some([step as f64, chart.y((chart.value)(self.history.row(step, index)?)?)]);
                if let Some(point) = at(self.cursor).filter(|point| point[1].is_finite()) {
                    let here = Points::new(&learner.name, vec![point]).color(colour).radius(4.0);
                    plot.points(here.shape(colours::marker(slot)).filled(false).allow_hover(false));
                }
                let converged = self.history.converged_at(self.cursor, index).filter(|_| chart.judged);
                if let Some(point) = converged.and_then(at) {
                    let name = format!("{} converged", learner.name);
                    let mark = Points::new(name, vec![point]).color(colour).radius(6.0);
                    plot.points(mark.shape(colours::marker(slot)).filled(true));
                }
            }
            plot.pointer_coordinate()
        });
        let clicked = response.response.clicked().then_some(response.inner).flatten()?;
        Some(clicked.x.round().max(0.0) as u64)
    }

    fn seeds_row(&mut self, ui: &mut Ui) {
        ui.add_space(4.0);
        ui.horizontal_wrapped(|ui| {
            if let Some(seeds) = self.seeds.as_ref().filter(|seeds| seeds.running) {
                let (done, progress) = (seeds.done(), seeds.progress());
                if ui.button("Cancel").on_hover_text("What has been computed stays").clicked() {
                    self.cancel_seeds();
                }
                let text = format!("{done} of {SEEDS} seeds");
                ui.add(egui::ProgressBar::new(progress).text(text).desired_width(180.0));
            } else {
                let tip = "Runs ten other seeds in the background: bands hold the middle 80 % of them";
                let ready = self.is_ready();
                if ui
                    .add_enabled(ready, egui::Button::new("Is this luck? Run 10 more seeds"))
                    .on_hover_text(tip)
                    .clicked()
                {
                    self.run_seeds();
                }
                if let Some(done) = self.seeds.as_ref().map(SeedRuns::done).filter(|done| *done > 0) {
                    ui.label(RichText::new(format!("bands: the middle 80 % of {done} seeds")).weak());
                }
            }
        });
    }
}
