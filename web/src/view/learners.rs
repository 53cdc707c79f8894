//! The learners: their errors at the step that is shown, and what has become of each.

use egui::{Grid, RichText, Shape, Ui, vec2};
use egui_plot::LineStyle;

use super::{NARROW, alarm, good};
use crate::{colours, history::Verdict, panel::Panel};

const DASH: &str = "–";

fn fixed(value: Option<f64>, scale: f64, digits: usize) -> String {
    value.map_or(DASH.to_owned(), |value| format!("{:.digits$}", value * scale))
}

/// A learner's colour and line, as the charts draw it.
pub(super) fn swatch(ui: &mut Ui, slot: usize) {
    let (rect, _) = ui.allocate_exact_size(vec2(22.0, 12.0), egui::Sense::hover());
    let stroke = egui::Stroke::new(2.5, colours::learner(slot));
    // Round dots and thick ends stay within.
    let rect = rect.shrink2(vec2(1.5, 0.0));
    let line = [rect.left_center(), rect.right_center()];
    match colours::line_style(slot) {
        LineStyle::Solid => ui.painter().add(Shape::line_segment(line, stroke)),
        LineStyle::Dashed { length } => {
            ui.painter().add(Shape::Vec(Shape::dashed_line(&line, stroke, length, length / 2.0)))
        }
        LineStyle::Dotted { spacing } => {
            ui.painter().add(Shape::Vec(Shape::dotted_line(&line, stroke.color, spacing, 1.5)))
        }
    };
}

impl Panel {
    pub(super) fn learners(&mut self, ui: &mut Ui) {
        let Some(description) = self.description() else { return };
        let misses =
            (0..description.learners.len()).any(|i| self.history.row(self.cursor, i).is_some_and(|r| r.misses > 0));
        let head = |ui: &mut Ui, text: &str, tip: &str| {
            ui.label(RichText::new(text).weak().small()).on_hover_text(tip);
        };
        let narrow = ui.available_width() < if misses { 1.2 * NARROW } else { NARROW };
        let spacing = if narrow { 6.0 } else { 10.0 };
        egui::ScrollArea::horizontal().id_salt("learners").show(ui, |ui| {
            Grid::new("learners").num_columns(6).spacing([spacing, 3.0]).min_col_width(30.0).striped(true).show(
                ui,
                |ui| {
                    head(ui, "Learner", "Estimator × policy stands in the tooltip of the name");
                    head(
                        ui,
                        if narrow { "Orient., °" } else { "Orientation, °" },
                        "Mean error of the angles between the joints' axes",
                    );
                    head(
                        ui,
                        if narrow { "Loc., mm" } else { "Location, mm" },
                        "Mean distance of the true axis points from the estimated axes",
                    );
                    head(
                        ui,
                        if narrow { "Pred., mm" } else { "Prediction, mm" },
                        "Mean distance between the predicted and the true marker",
                    );
                    if misses {
                        head(ui, "Misses", "Movements after which the marker was not seen; they count as movements");
                    }
                    head(
                        ui,
                        "State",
                        "Converged: both errors stay within the thresholds, confirmed by 20 more movements",
                    );
                    ui.end_row();
                    let slots = colours::slots(description);
                    for (index, (learner, slot)) in description.learners.iter().zip(slots).enumerate() {
                        ui.horizontal(|ui| {
                            swatch(ui, slot);
                            let tip = format!("Estimator {}, policy {}", learner.estimator, learner.policy);
                            ui.label(RichText::new(&learner.name).strong()).on_hover_text(tip);
                        });
                        let row = self.history.row(self.cursor, index).copied().unwrap_or_default();
                        for text in [
                            fixed(row.orientation_deg, 1.0, 2),
                            fixed(row.location_m, 1e3, 1),
                            fixed(row.prediction_m, 1e3, 1),
                        ] {
                            ui.label(RichText::new(text).monospace());
                        }
                        if misses {
                            ui.label(RichText::new(row.misses.to_string()).monospace());
                        }
                        let text = RichText::new(self.verdict(index));
                        let (text, tip) = match self.history.verdict(self.cursor, index) {
                            Verdict::Converged(_) | Verdict::Settled => (text.color(good(ui)), None),
                            Verdict::Diverged => (text.color(alarm(ui)), self.history.failure(index)),
                            _ => (text, None),
                        };
                        let label = ui.label(if row.settled { text.strong() } else { text });
                        label.on_hover_text(tip.unwrap_or(match row.settled {
                            true => "It has settled: by its own estimate it predicts well enough",
                            false => "It has not settled yet, by its own estimate",
                        }));
                        ui.end_row();
                    }
                },
            );
        });
        if description.truth.is_none() {
            let text = "–: recorded data have no known truth. Prediction is over measurements held out from learning.";
            ui.label(RichText::new(text).weak().small());
        }
    }
}
