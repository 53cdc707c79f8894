//! A robot elsewhere: the movement that is suggested to it, what can be said of that, and how the session stands.

use egui::{Frame, Grid, Label, RichText, Stroke, Ui};

use super::{alarm, card::filled, good, style::accent};
use crate::{
    host::Command,
    panel::Panel,
    robot::{Said, expectations, positions, standing},
    wire::Standing,
};

impl Panel {
    pub(super) fn robot(&mut self, ui: &mut Ui) {
        if self.robot.standing.is_none() {
            return;
        }
        self.next_movement(ui);
        let Some(Standing { status, last, pending }) = &self.robot.standing else { return };
        if pending.len() > 1 {
            let others = pending.iter().skip(1).map(|one| match &one.client {
                Some(client) => format!("{} for {client}", one.id),
                None => one.id.to_string(),
            });
            let others = others.collect::<Vec<_>>().join(", ");
            ui.add(Label::new(RichText::new(format!("Suggested too: {others}.")).weak()).wrap());
        }
        ui.add_space(6.0);
        let words = standing(status, last.as_ref());
        for (index, sentence) in words.iter().enumerate() {
            let text = RichText::new(sentence);
            // The first says how accurate it is.
            let text = match index {
                0 if status.enough.is_some() => text.strong().color(good(ui)),
                0 => text.strong(),
                _ => text,
            };
            ui.add(Label::new(text).wrap());
        }
        if status.observations == 0
            && let Some(session) = &self.session
        {
            let how = format!(
                "Its program asks with POST /v1/sessions/{0}/suggestions where to move, and tells with POST \
                 /v1/sessions/{0}/observations where it was and what was seen. In Python: Client(…).session(\"{0}\").",
                session.id
            );
            ui.add(Label::new(RichText::new(how).weak().small()).wrap().selectable(true));
        }
        let unrecorded = self.session.as_ref().and_then(|session| session.recording_failure.as_ref());
        for failure in status.failure.iter().chain(unrecorded) {
            ui.add(Label::new(RichText::new(failure).color(alarm(ui))).wrap());
        }
    }

    /// The movement that is suggested, and what can be said of it.
    fn next_movement(&mut self, ui: &mut Ui) {
        let Some(next) = self.suggestion().cloned() else {
            if !self.server {
                return;
            }
            let tip = "Has the next movement chosen now, as the robot's program would by asking for it";
            let suggest = filled(ui, RichText::new("Suggest a movement"));
            if ui.add_enabled(!self.robot.asking, suggest).on_hover_text(tip).clicked() {
                self.suggest();
            }
            return;
        };
        let (Some(description), Some(stand)) = (self.description(), &self.robot.standing) else { return };
        let positions = positions(description, &next);
        let expectations = expectations(description, &next, &stand.status);
        let line = Stroke::new(1.5, accent(ui.visuals().dark_mode));
        let frame = Frame::new().fill(ui.visuals().window_fill).stroke(line).inner_margin(10).corner_radius(6);
        frame.show(ui, |ui| {
            ui.set_width(ui.available_width());
            let client = next.client.as_ref().map_or(String::new(), |client| format!(" for {client}"));
            let title = format!("Next movement{client}: suggestion {}", next.id);
            ui.add(Label::new(RichText::new(title).strong().size(15.0)).wrap());
            Grid::new("positions").num_columns(3).spacing([16.0, 2.0]).show(ui, |ui| {
                for [name, own, shown] in &positions {
                    ui.label(name);
                    ui.label(RichText::new(own).monospace());
                    ui.label(RichText::new(shown).monospace());
                    ui.end_row();
                }
            });
            for sentence in &expectations {
                ui.add(Label::new(sentence).wrap());
            }
            ui.add_space(4.0);
            ui.horizontal_wrapped(|ui| {
                let all = if self.server { &Said::ALL[..] } else { &[] };
                for &(said, name, tip) in all {
                    if ui.add_enabled(!self.robot.asking, egui::Button::new(name)).on_hover_text(tip).clicked() {
                        self.say(said);
                    }
                }
                if ui.button("Copy").on_hover_text("The posture as JSON, by joint name, on the clipboard").clicked() {
                    // It holds names and numbers alone.
                    let text = serde_json::to_string(&next.configuration).unwrap_or_default();
                    self.ask(Command::Copy { text });
                }
                if let Some(copied) = &self.copied {
                    ui.label(copied);
                }
            });
        });
    }
}
