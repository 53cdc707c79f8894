//! Curves over the steps: one that is always in sight, the others among what scrolls.

use egui::{ComboBox, RichText, Ui};

use super::{
    LOW, TALL,
    chart::{CHARTS, Chart, EXPECTED, SCATTER},
    learners::entry,
};
use crate::{
    colours,
    history::{Row, Yardstick},
    panel::{PREDICTION, Panel},
    seeds::SeedRuns,
    stories::Spot,
    words,
};

/// From this width on there are two charts beside each other.
const TWO_COLUMNS: f32 = 640.0;
const HEIGHT: f32 = 150.0;
/// A lower chart tells nothing.
const LEAST: f32 = 80.0;

impl Panel {
    /// The charts of which there is something to see.
    fn shown_charts(&self) -> Vec<&'static Chart> {
        let known = self.description().is_some_and(|description| description.truth.is_some());
        let learners = self.description().map_or(0, |description| description.learners.len());
        let any = |wanted: fn(&Row) -> bool| {
            (0..learners).any(|learner| self.history.row(self.history.latest(), learner).is_some_and(wanted))
        };
        let yardstick = self.history.yardstick();
        let is_told = |chart: &Chart| match chart.title {
            "Misses" => any(|row| row.misses > 0),
            SCATTER => any(|row| row.scatter_m.is_some()),
            PREDICTION => yardstick == Yardstick::Prediction,
            EXPECTED => yardstick == Yardstick::Expected,
            _ => true,
        };
        CHARTS.iter().filter(|chart| (known || !chart.judged) && is_told(chart)).collect()
    }

    /// The chart that is always in sight: the chosen one, if there is something of it to see.
    fn pinned(&self, shown: &[&'static Chart]) -> Option<&'static Chart> {
        shown.iter().find(|chart| chart.title == self.chart).or(shown.first()).copied()
    }

    /// It, with the legend of all; without a height it takes the room that is left.
    pub(super) fn pinned_chart(&mut self, ui: &mut Ui, height: Option<f32>) {
        if self.session.is_none() {
            return;
        }
        let shown = self.shown_charts();
        let Some(chart) = self.pinned(&shown) else { return };
        let low = ui.ctx().content_rect().height() < LOW;
        let drawn = ui.scope(|ui| {
            ui.horizontal_wrapped(|ui| {
                let combo = ComboBox::from_id_salt("pinned").selected_text(RichText::new(chart.label(self)).strong());
                let response = combo.show_ui(ui, |ui| {
                    for other in &shown {
                        let label = other.label(self);
                        ui.selectable_value(&mut self.chart, other.title, label).on_hover_text(other.tip);
                    }
                });
                let name = format!("Chart: {}", chart.label(self));
                let combo = response.response;
                combo.widget_info(|| egui::WidgetInfo::labeled(egui::accesskit::Role::ComboBox, true, &name));
                combo.on_hover_text(chart.tip);
                let wordy = ui.ctx().content_rect().height() >= TALL;
                self.legend(ui, wordy);
            });
            if !low && height.is_none() {
                self.explained_curves(ui, chart);
            }
            let height = height.unwrap_or_else(|| ui.available_height().max(LEAST));
            self.curves(ui, chart, height)
        });
        self.spots.set(Spot::Chart, drawn.response.rect);
        self.go_to(drawn.inner);
        if !low && height.is_some() {
            self.explained_curves(ui, chart);
        }
    }

    pub(super) fn charts(&mut self, ui: &mut Ui) {
        let mut shown = self.shown_charts();
        let pinned = self.pinned(&shown).map(|chart| chart.title);
        shown.retain(|chart| Some(chart.title) != pinned);
        let columns = if ui.available_width() >= TWO_COLUMNS { 2 } else { 1 };
        let mut clicked = None;
        for row in shown.chunks(columns) {
            ui.columns(columns, |uis| {
                for (ui, chart) in uis.iter_mut().zip(row) {
                    ui.horizontal(|ui| {
                        ui.label(RichText::new(chart.label(self)).strong()).on_hover_text(chart.tip);
                        ui.label(RichText::new("over movements").weak().small());
                    });
                    clicked = self.curves(ui, chart, HEIGHT).or(clicked);
                    self.explained_curves(ui, chart);
                    ui.add_space(4.0);
                }
            });
        }
        self.go_to(clicked);
        self.marks(ui);
        if self.is_external() {
            return;
        }
        if self.ending().is_none() || self.playing {
            self.seeds_row(ui);
        } else if let Some(done) = self.other_seeds().map(SeedRuns::done).filter(|done| *done > 0) {
            ui.label(RichText::new(format!("bands: the middle 80 % of {done} seeds")).weak());
        }
    }

    fn go_to(&mut self, step: Option<u64>) {
        if let Some(step) = step {
            self.scrub(step);
            self.sought = None;
        }
    }

    /// Which colour and line is whose, with what each does where there is room.
    fn legend(&self, ui: &mut Ui, wordy: bool) {
        let Some(description) = self.description() else { return };
        let learners = description.learners.iter().zip(colours::slots(description)).enumerate();
        for (_, (learner, slot)) in learners.filter(|(place, _)| self.is_seen(*place)) {
            let mut texts = vec![RichText::new(&learner.name).strong()];
            if wordy {
                texts.push(RichText::new(words::about(learner)).weak().small());
            }
            entry(ui, slot, texts, &words::terms(learner));
        }
    }

    /// What is drawn beside the curves themselves, in words, where it is drawn.
    fn explained_curves(&self, ui: &mut Ui, chart: &Chart) {
        if chart.bound.is_none() || self.description().is_none_or(|description| description.truth.is_none()) {
            return;
        }
        let mut text = "Thin curves: what the same data allow, whoever learns from them.".to_owned();
        if let Some(names) = self.kept_large() {
            text += &format!(
                " The uncertainty of {names} stays above that on purpose: noise is added to it at every movement, so \
                 that a body that changes can still be learned."
            );
        }
        let tip = "Thin: the trace of the weighted covariance that the data collected allow at the true arm, were the \
                   model linear. Added on purpose: stabilising noise.";
        ui.add(egui::Label::new(RichText::new(text).weak().small()).wrap()).on_hover_text(tip);
    }

    /// The marks that all charts have in common.
    fn marks(&self, ui: &mut Ui) {
        let Some(description) = self.description().filter(|description| description.truth.is_some()) else { return };
        let mut marks = vec!["dashed: accurate below it".to_owned(), "filled mark: learned".to_owned()];
        if description.movements_by_counting > 0 {
            marks.push(format!("dotted: {} movements", description.movements_by_counting));
        }
        let tip = format!(
            "Learned (converged): both errors stay below the dashed thresholds, confirmed by 20 more movements. After the \
             dotted number of movements there are as many equations as unknowns ({}): nobody can know everything earlier \
             without an initial guess.",
            description.parameters
        );
        ui.label(RichText::new(marks.join(" · ")).weak().small()).on_hover_text(tip);
    }
}
