//! The controls that are always at hand, and the sentence that says what goes on.

use egui::{Button, ProgressBar, RichText, Slider, Ui};

use super::{NARROW, alarm};
use crate::{
    panel::{Link, Panel},
    play::SPEEDS,
    settings::StopWhen,
};

impl Panel {
    pub(super) fn controls(&mut self, ui: &mut Ui) {
        ui.horizontal_wrapped(|ui| {
            ui.heading("body-schema");
            if ui.available_width() > NARROW {
                ui.label(RichText::new("learn a robot's body from a few well-chosen movements").weak());
            }
        });
        ui.add_space(2.0);
        ui.horizontal_wrapped(|ui| {
            let (name, tip) = if self.playing { ("Pause", "Pause (Space)") } else { ("Play", "Play (Space)") };
            let ready = self.is_ready() && self.restoring.is_none();
            let accent = ui.visuals().selection.bg_fill;
            let play =
                Button::new(RichText::new(name).strong().color(ui.visuals().selection.stroke.color)).fill(accent);
            if ui.add_enabled(ready, play).on_hover_text(tip).clicked() {
                self.toggle();
            }
            let can_go_back = self.cursor > 0 && !self.history.is_empty();
            if ui.add_enabled(can_go_back, Button::new("Back")).on_hover_text("One step back (left arrow)").clicked() {
                self.back();
            }
            let can_step = self.cursor < self.history.latest() || (ready && self.remaining() != Some(0));
            let tip = "One step on (right arrow); a new one from the end (S)";
            if ui.add_enabled(can_step, Button::new("Step")).on_hover_text(tip).clicked() {
                self.forward();
            }
            if ui.button("Reset").on_hover_text("The same run from its start (Shift+R)").clicked() {
                self.reset();
            }
            if self.link == Link::Expired {
                let restore = ui.button("Restore").on_hover_text("Computes the run again, up to where it was");
                if restore.clicked() {
                    self.open(self.history.latest());
                }
            }
            if ui.button("Tour").on_hover_text("Five cards on what is seen here (T)").clicked() {
                self.tour = Some(0);
            }
            if ui.button("?").on_hover_text("Keyboard and words (?)").clicked() {
                self.help = !self.help;
            }
        });
        self.scrubber(ui);
        ui.horizontal_wrapped(|ui| {
            let mut speed = self.settings.speed;
            egui::ComboBox::from_label("steps/s")
                .width(52.0)
                .selected_text(speed.to_string())
                .show_ui(ui, |ui| {
                    for choice in SPEEDS {
                        ui.selectable_value(&mut speed, choice, choice.to_string());
                    }
                })
                .response
                .on_hover_text("Speed of playing (+ and -)");
            self.settings.speed = speed;
            let usual = self.scenario().map_or(1000, |scenario| scenario.steps);
            let mut to = self.run_to();
            let label = ui.label("Run to");
            let field = egui::DragValue::new(&mut to).range(1..=crate::settings::MAX_RUN).speed(1.0);
            if ui.add(field).labelled_by(label.id).on_hover_text("The last step of a run").changed() {
                self.settings.run_to = Some(to).filter(|to| *to != usual);
            }
            let named = StopWhen::ALL.iter().find(|(stop, ..)| *stop == self.settings.stop);
            let label = ui.label("stop");
            let stop = egui::ComboBox::from_id_salt("stop").selected_text(named.map_or("", |(.., text)| text));
            stop.show_ui(ui, |ui| {
                for (stop, _, text) in StopWhen::ALL {
                    ui.selectable_value(&mut self.settings.stop, stop, text);
                }
            })
            .response
            .labelled_by(label.id)
            .on_hover_text("A learner has settled when it expects, by itself, to predict well enough");
        });
        let troubled = !matches!(self.link, Link::Connected | Link::Loading);
        let status = RichText::new(self.status());
        let status = if troubled { status.color(alarm(ui)) } else { status.strong() };
        ui.add(egui::Label::new(status).wrap());
        if let Some(share) = self.restored().filter(|_| self.restoring.is_some_and(|target| target > 1)) {
            ui.add(ProgressBar::new(share).show_percentage());
        }
    }

    fn scrubber(&mut self, ui: &mut Ui) {
        ui.horizontal(|ui| {
            let latest = self.history.latest();
            let left = self.remaining().map_or(String::new(), |left| format!(", {left} left"));
            let label = ui.label(RichText::new(format!("Step {} of {latest}{left}", self.cursor)).monospace());
            let mut cursor = self.cursor;
            ui.spacing_mut().slider_width = (ui.available_width() - 12.0).max(60.0);
            let slider = Slider::new(&mut cursor, 0..=latest.max(1)).show_value(false);
            let slider = ui.add_enabled(latest > 0, slider).labelled_by(label.id);
            if slider.on_hover_text("Go through the steps made so far (arrow keys)").changed() {
                self.scrub(cursor);
                // The scene has yet to follow.
                self.sought = None;
            }
        });
    }
}
