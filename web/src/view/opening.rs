//! The first look: three sentences under the chart, and what unfolds the rest.

use egui::{Button, Label, RichText, Ui};

use super::card::filled;
use crate::panel::Panel;

impl Panel {
    pub(super) fn first_look(&mut self, ui: &mut Ui) {
        ui.add_space(4.0);
        for sentence in self.sentences() {
            ui.add(Label::new(RichText::new(sentence).size(15.0)).wrap());
            ui.add_space(4.0);
        }
        if self.ending().is_some() && !self.playing {
            self.ending_card(ui);
        } else if let Some(standing) = self.standing() {
            ui.add(Label::new(RichText::new(standing).size(15.0).strong()).wrap());
            ui.add_space(8.0);
        }
        ui.horizontal_wrapped(|ui| {
            let more = Button::new("Show everything");
            let tip = "All learners in numbers, other stories and scenarios, more charts, how movements are chosen";
            if ui.add(more).on_hover_text(tip).clicked() {
                self.unfold();
            }
        });
    }

    /// Why the first story ended as it did.
    pub(super) fn why_button(&mut self, ui: &mut Ui) {
        let is_first = self.story == 0 && self.story_of_scenario() == Some(0);
        if is_first && self.tour.is_none() && ui.add(filled(ui, RichText::new("Why?"))).clicked() {
            self.tell_why();
        }
    }
}
