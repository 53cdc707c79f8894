//! The stories to try first, with every scenario one click further.

use egui::{Button, RichText, Ui};

use crate::{host::Command, panel::Panel};

impl Panel {
    pub(super) fn stories_row(&mut self, ui: &mut Ui) {
        let can_be_played = self.can_play() && self.human().is_none();
        if self.stories().next().is_none() && !can_be_played {
            return;
        }
        let told = self.tour.map(|_| self.story);
        let mut chosen = None;
        ui.horizontal_wrapped(|ui| {
            ui.label(RichText::new("Try this").strong());
            for (index, story) in self.stories() {
                let button = Button::new(story.title).selected(told == Some(index));
                if ui.add_enabled(!self.opening, button).on_hover_text(story.teaser).clicked() {
                    chosen = Some(index);
                }
            }
            if can_be_played {
                let tip = "Choose the movements yourself: ten rounds against active and random, on this seed";
                let play = ui.add_enabled(self.is_ready(), Button::new("Beat the algorithm"));
                if play.on_hover_text(tip).clicked() {
                    self.begin_contest();
                }
            }
            let tip =
                "Drop a URDF and a table of measurements: calibrated in this browser, and nothing leaves your machine";
            if ui.button("Calibrate yours…").on_hover_text(tip).clicked() {
                self.ask(Command::YourRobot);
            }
        });
        if let Some(index) = chosen {
            self.tell(index);
        }
    }
}
