//! How the run ended, and whether it was luck.

use egui::{Button, Frame, RichText, Stroke, Ui};

use super::{card::filled, good};
use crate::{
    panel::Panel,
    seeds::{SEEDS, SeedRuns},
    stories::Spot,
};

impl Panel {
    pub(super) fn ending_card(&mut self, ui: &mut Ui) {
        let Some(ending) = self.ending().filter(|_| !self.playing) else {
            self.ending_seen = false;
            return;
        };
        let line = Stroke::new(1.5, good(ui));
        let frame = Frame::new().fill(ui.visuals().window_fill).stroke(line).inner_margin(10).corner_radius(6);
        let card = frame.show(ui, |ui| {
            ui.set_width(ui.available_width());
            ui.add(egui::Label::new(RichText::new(&ending.sentence).strong().size(17.0)).wrap());
            ui.add(egui::Label::new(RichText::new(&ending.judged).weak().small()).wrap());
            self.other_endings(ui);
            ui.add_space(4.0);
            ui.horizontal_wrapped(|ui| {
                self.why_button(ui);
                self.seeds_row(ui);
            });
        });
        ui.add_space(8.0);
        self.show_spot(ui, Spot::Ending, &card.response);
        if !self.ending_seen {
            self.ending_seen = true;
            card.response.scroll_to_me(Some(egui::Align::TOP));
        }
    }

    /// Other seeds: is what is seen luck?
    pub(super) fn seeds_row(&mut self, ui: &mut Ui) {
        if self.human().is_some() {
            return;
        }
        let done = self.other_seeds().map(SeedRuns::done).filter(|done| *done > 0);
        ui.horizontal_wrapped(|ui| {
            if let Some(seeds) = self.seeds.as_ref().filter(|seeds| seeds.running) {
                let (done, progress) = (seeds.done(), seeds.progress());
                if ui.button("Cancel").on_hover_text("What has been computed stays").clicked() {
                    self.cancel_seeds();
                }
                let text = format!("{done} of {SEEDS} seeds");
                ui.add(egui::ProgressBar::new(progress).text(text).desired_width(180.0));
                return;
            }
            let text = RichText::new(if done.is_some() { "Run them again" } else { "Luck? Run ten more seeds" });
            let is_next = done.is_none() && self.tour.is_some();
            let button = if is_next { filled(ui, text) } else { Button::new(text) };
            let tip = "Runs ten other seeds in the background, each until its story is told";
            if ui.add_enabled(self.is_ready(), button).on_hover_text(tip).clicked() {
                self.run_seeds();
            }
            if let Some(done) = done {
                ui.label(RichText::new(format!("bands in the charts: the middle 80 % of {done} seeds")).weak());
            }
        });
    }
}
