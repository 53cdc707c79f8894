//! The controls that are always at hand, and the sentence that says what goes on.

use egui::{Button, ProgressBar, RichText, Slider, Ui};

use super::{alarm, card::filled};
use crate::{
    panel::{Link, Panel},
    play::SPEEDS,
    settings::StopWhen,
    stories::Spot,
    words::STATEMENT,
};

impl Panel {
    pub(super) fn controls(&mut self, ui: &mut Ui) {
        if !self.settings.embed {
            ui.horizontal(|ui| {
                ui.label(RichText::new("body-schema").strong().size(15.0));
                let robot = self.description().filter(|_| self.is_external());
                let about = robot.map_or_else(
                    || STATEMENT.to_owned(),
                    |robot| format!("{}, a robot elsewhere, learns where its joints are.", robot.scenario),
                );
                ui.add(egui::Label::new(RichText::new(about).weak()).truncate());
            });
        }
        let transport = ui.scope(|ui| {
            ui.horizontal(|ui| self.transport(ui));
            self.scrubber(ui);
            self.status_line(ui);
        });
        self.spots.set(Spot::Transport, transport.response.rect);
    }

    fn transport(&mut self, ui: &mut Ui) {
        if self.is_external() {
            self.transport_of_a_robot(ui);
            return;
        }
        let ready = self.is_ready() && self.restoring.is_none();
        if self.human().is_none() {
            let (name, tip) = if self.playing { ("Pause", "Pause (Space)") } else { ("Play", "Play (Space)") };
            let play = filled(ui, RichText::new(name));
            if ui.add_enabled(ready, play).on_hover_text(tip).clicked() {
                self.toggle();
            }
        }
        let can_go_back = self.cursor > 0 && !self.history.is_empty();
        if ui.add_enabled(can_go_back, Button::new("Back")).on_hover_text("One step back (left arrow)").clicked() {
            self.back();
        }
        let at_end = self.human().is_some() && !self.may_move();
        let can_step = self.cursor < self.history.latest() || (ready && self.remaining() != Some(0) && !at_end);
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
        if self.settings.embed {
            return;
        }
        if ui.button("Tour").on_hover_text("Cards on what is seen here (T)").clicked() {
            self.open_tour();
        }
        if ui.button("?").on_hover_text("Keyboard and words (?)").clicked() {
            self.help = !self.help;
        }
    }

    /// Its steps are its own: they can be gone through, and not made here.
    fn transport_of_a_robot(&mut self, ui: &mut Ui) {
        let (cursor, latest) = (self.cursor, self.history.latest());
        let tip = "One observation back (left arrow)";
        if ui.add_enabled(cursor > 0, Button::new("Back")).on_hover_text(tip).clicked() {
            self.back();
        }
        let tip = "One observation on (right arrow)";
        if ui.add_enabled(cursor < latest, Button::new("Step")).on_hover_text(tip).clicked() {
            self.forward();
        }
        let tip = "The latest observation, and those that come";
        if ui.add_enabled(cursor < latest, Button::new("Latest")).on_hover_text(tip).clicked() {
            self.scrub(latest);
            self.sought = None;
        }
        if self.settings.embed {
            return;
        }
        let tip = "Leaves this session, which goes on, for learners that are compared in scenarios of our own";
        if ui.button("Explorer").on_hover_text(tip).clicked() {
            self.choose_usual_learners();
            self.open(1);
        }
        if ui.button("?").on_hover_text("Keyboard and words (?)").clicked() {
            self.help = !self.help;
        }
    }

    fn scrubber(&mut self, ui: &mut Ui) {
        ui.horizontal(|ui| {
            let latest = self.history.latest();
            let left = self.remaining().map_or(String::new(), |left| format!(", {left} left"));
            let what = if self.is_external() { "Observation" } else { "Step" };
            let label = ui.label(RichText::new(format!("{what} {} of {latest}{left}", self.cursor)).monospace());
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

    /// One line, whatever there is to say: what stands below must not jump.
    fn status_line(&self, ui: &mut Ui) {
        let troubled = !matches!(self.link, Link::Connected | Link::Loading);
        let text = self.status();
        let status = RichText::new(&text);
        let status = if troubled { status.color(alarm(ui)) } else { status.strong() };
        let restored = self.restored().filter(|_| self.restoring.is_some_and(|target| target > 1));
        if let Some(share) = restored {
            ui.add(ProgressBar::new(share).desired_height(ui.text_style_height(&egui::TextStyle::Body)).text(text));
        } else if troubled {
            ui.add(egui::Label::new(status).wrap());
        } else {
            ui.add(egui::Label::new(status).truncate()).on_hover_text(text);
        }
    }

    /// How fast a run goes and when it stops.
    pub(super) fn pace_row(&mut self, ui: &mut Ui) {
        ui.horizontal_wrapped(|ui| {
            let mut speed = self.settings.speed;
            let label = ui.label("Speed");
            egui::ComboBox::from_id_salt("speed")
                .width(96.0)
                .selected_text(format!("{speed} a second"))
                .show_ui(ui, |ui| {
                    for choice in SPEEDS {
                        ui.selectable_value(&mut speed, choice, format!("{choice} a second"));
                    }
                })
                .response
                .labelled_by(label.id)
                .on_hover_text("Movements a second while playing (+ and -)");
            self.settings.speed = speed;
            let usual = self.scenario().map_or(1000, |scenario| scenario.steps);
            let mut to = self.run_to();
            let label = ui.label("Run to");
            let field = egui::DragValue::new(&mut to).range(1..=crate::settings::MAX_RUN).speed(1.0);
            if ui.add(field).labelled_by(label.id).on_hover_text("The last step of a run").changed() {
                self.settings.run_to = Some(to).filter(|to| *to != usual);
            }
            let named = StopWhen::ALL.iter().find(|(stop, ..)| *stop == self.settings.stop);
            let label = ui.label("Stop");
            let stop = egui::ComboBox::from_id_salt("stop").selected_text(named.map_or("", |(.., text)| text));
            stop.show_ui(ui, |ui| {
                for (stop, _, text) in StopWhen::ALL {
                    ui.selectable_value(&mut self.settings.stop, stop, text);
                }
            })
            .response
            .labelled_by(label.id)
            .on_hover_text(
                "The story is told when every learner has converged, judged with hindsight and the truth. A learner is \
                 sure of itself (settled) when it expects, by its own estimate, to predict well enough.",
            );
        });
    }
}
