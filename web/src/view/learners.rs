//! The learners: their errors at the step that is shown, and what has become of each.

use std::sync::Arc;

use egui::{
    Align, Galley, Layout, Rect, RichText, Shape, TextStyle, TextWrapMode, Ui, UiBuilder, Vec2, WidgetText,
    accesskit::Role, pos2, vec2,
};
use egui_plot::LineStyle;

use super::{NARROW, alarm, good};
use crate::{
    colours,
    history::{Verdict, Yardstick},
    panel::Panel,
    words,
};

const DASH: &str = "–";
const ROW: f32 = 20.0;
const SWATCH: Vec2 = vec2(22.0, 12.0);

fn fixed(value: Option<f64>, scale: f64, digits: usize) -> String {
    value.map_or(DASH.to_owned(), |value| format!("{:.digits$}", value * scale))
}

/// A learner's colour and line, as the charts draw it.
pub(super) fn swatch(ui: &mut Ui, slot: usize) {
    let (rect, _) = ui.allocate_exact_size(SWATCH, egui::Sense::hover());
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

/// A learner's swatch and words beside it, on one line: the next where this one has no room for them.
pub(super) fn entry(ui: &mut Ui, slot: usize, texts: Vec<RichText>, tip: &str) {
    const GAP: f32 = 4.0;
    let galleys: Vec<Arc<Galley>> = (texts.into_iter())
        .map(|text| WidgetText::from(text).into_galley(ui, Some(TextWrapMode::Extend), f32::INFINITY, TextStyle::Body))
        .collect();
    let width = SWATCH.x + galleys.iter().map(|galley| GAP + galley.size().x).sum::<f32>();
    if ui.available_size_before_wrap().x < width {
        ui.end_row();
    }
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = GAP;
        swatch(ui, slot);
        for galley in galleys {
            ui.label(galley).on_hover_text(tip);
        }
    });
}

/// A row of a table, for the eye and for assistive technology: each cell is drawn in its column.
fn row(ui: &mut Ui, index: usize, shares: &[f32], role: Role, mut cell: impl FnMut(&mut Ui, usize)) {
    let (rect, _) = ui.allocate_exact_size(vec2(ui.available_width(), ROW), egui::Sense::hover());
    if index % 2 == 1 {
        ui.painter().rect_filled(rect, 2.0, ui.visuals().faint_bg_color);
    }
    let builder = UiBuilder::new().id_salt(("row", index)).max_rect(rect).accessibility_role(Role::Row);
    let mut line = ui.new_child(builder);
    let mut left = rect.left();
    for (column, share) in shares.iter().enumerate() {
        let width = share * rect.width();
        let place = Rect::from_min_size(pos2(left, rect.top()), vec2(width - 4.0, rect.height()));
        let layout = Layout::left_to_right(Align::Center);
        let builder = UiBuilder::new().id_salt(column).max_rect(place).layout(layout).accessibility_role(role);
        cell(&mut line.new_child(builder), column);
        left += width;
    }
}

impl Panel {
    pub(super) fn learners(&mut self, ui: &mut Ui) {
        let Some(description) = self.description() else { return };
        let count = description.learners.len();
        let misses = (0..count).any(|i| self.history.row(self.cursor, i).is_some_and(|row| row.misses > 0));
        let yardstick = self.history.yardstick();
        let narrow = ui.available_width() < NARROW;
        let short = |long: &'static str, short: &'static str| if narrow { short } else { long };
        let mut heads = vec![
            ("Learner", "How each goes about it stands beside the chart; the terms stand in the tooltip of its name"),
            (short("Orientation, °", "Orient. °"), "Mean error of the angles between the joints' axes"),
            (short("Location, mm", "Loc. mm"), "Mean distance of the true axis points from the estimated axes"),
            match yardstick {
                Yardstick::Scatter => (
                    "Scatter, mm",
                    "Mean distance of the predicted target from its mean, in sockets that nobody has learned from",
                ),
                Yardstick::Expected => (
                    short("Expected, mm", "Exp. mm"),
                    "Mean error of predictions over the workspace, as the learner expects it by its own estimate",
                ),
                Yardstick::Prediction => {
                    (short("Prediction, mm", "Pred. mm"), "Mean distance between the predicted and the true marker")
                }
            },
            ("State", "What has become of it, judged with the truth; the terms stand in the tooltip of each"),
        ];
        let mut shares = if narrow { vec![0.24, 0.15, 0.14, 0.15, 0.32] } else { vec![0.24, 0.17, 0.16, 0.18, 0.25] };
        if misses {
            heads.push(("Misses", "Movements after which the marker was not seen; they count as movements"));
            shares.iter_mut().for_each(|share| *share *= 0.88);
            shares.push(0.12);
        }
        let table = UiBuilder::new().accessibility_role(Role::Table).accessibility_label("Learners");
        ui.scope_builder(table, |ui| {
            ui.spacing_mut().item_spacing.y = 1.0;
            row(ui, 0, &shares, Role::ColumnHeader, |ui, column| {
                let (text, tip) = heads[column];
                ui.add(egui::Label::new(RichText::new(text).weak().small()).truncate()).on_hover_text(tip);
            });
            for (index, (learner, slot)) in description.learners.iter().zip(colours::slots(description)).enumerate() {
                let numbers = self.history.row(self.cursor, index).copied().unwrap_or_default();
                row(ui, index + 1, &shares, Role::Cell, |ui, column| match column {
                    0 => {
                        swatch(ui, slot);
                        let name = egui::Label::new(RichText::new(&learner.name).strong()).truncate();
                        ui.add(name).on_hover_text(words::terms(learner));
                    }
                    4 => self.state(ui, index),
                    _ => {
                        let text = match column {
                            1 => fixed(numbers.orientation_deg, 1.0, 2),
                            2 => fixed(numbers.location_m, 1e3, 1),
                            3 => fixed(numbers.error_m(), 1e3, if yardstick == Yardstick::Prediction { 1 } else { 2 }),
                            _ => numbers.misses.to_string(),
                        };
                        ui.label(RichText::new(text).monospace());
                    }
                });
            }
        });
        if description.truth.is_none() {
            let text = match yardstick {
                Yardstick::Scatter => {
                    "–: recorded data have no known truth. Scatter is in sockets that nobody has learned from."
                }
                Yardstick::Expected => {
                    "–: a robot elsewhere has no known truth. What is expected is the learner's own account."
                }
                Yardstick::Prediction => {
                    "–: recorded data have no known truth. Prediction is over measurements held out from learning."
                }
            };
            ui.label(RichText::new(text).weak().small());
        }
    }

    fn state(&self, ui: &mut Ui, index: usize) {
        let text = RichText::new(self.verdict(index));
        let text = match self.history.verdict(self.cursor, index) {
            Verdict::Converged(_) | Verdict::Settled => text.color(good(ui)).strong(),
            Verdict::Diverged => text.color(alarm(ui)),
            _ => text,
        };
        ui.add(egui::Label::new(text).truncate()).on_hover_text(self.verdict_terms(index));
    }
}
