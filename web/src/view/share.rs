//! The downloads: the address, files, and the command that computes the same again.

use egui::{RichText, Ui};

use crate::{
    host::Command,
    panel::Panel,
    settings::{ELLIPSOIDS, ENLARGED},
};

/// The files of every session, and what each is.
const OF_ALL: [(&str, &str); 3] = [
    ("recording.rrd", "The recording, to open with Rerun 0.36"),
    ("steps.csv", "Every metric of every learner at every step"),
    ("result.json", "The outcome and the learned models"),
];
/// The files of a session with a robot elsewhere, and what each is.
const OF_A_ROBOT: [(&str, &str); 6] = [
    ("model.urdf", "The robot's description with what was learned"),
    ("kinematics.yaml", "The same as joint origins, as driver packages of arms take them"),
    ("report.html", "How accurate it is, held against data that was not learned from, to read and print"),
    ("report.json", "The same in numbers"),
    ("observations.csv", "All that was observed, as body-schema calibrate reads it"),
    ("calibration.toml", "The file for body-schema calibrate that goes with it"),
];

/// A word as a shell takes it.
fn quoted(word: &str) -> String {
    let is_plain = word.chars().all(|c| c.is_ascii_alphanumeric() || "._=-".contains(c));
    if is_plain { word.to_owned() } else { format!("'{}'", word.replace('\'', "'\\''")) }
}

impl Panel {
    /// The command that computes what is shown.
    pub fn command_line(&self) -> String {
        let settings = &self.settings;
        let steps = self.cursor.max(1);
        let learners: String = settings.learners.iter().map(|name| format!(" --learner {name}")).collect();
        let ellipsoids = if settings.ellipsoids == ELLIPSOIDS[0].0 {
            String::new()
        } else {
            format!(" --ellipsoids {}", settings.ellipsoids)
        };
        let set: String = settings.set.iter().map(|replacement| format!(" --set {}", quoted(replacement))).collect();
        let enlarge = if settings.enlarge == 1 { String::new() } else { format!(" --enlarge {}", settings.enlarge) };
        format!(
            "body-schema run {}{set} --seed {} --steps {steps}{learners} --rrd run.rrd{ellipsoids}{enlarge}",
            settings.scenario, settings.seed
        )
    }

    pub(super) fn share(&mut self, ui: &mut Ui) {
        let outside = self.is_external();
        ui.label(RichText::new("This view as a link").strong());
        ui.label(match outside {
            true if self.server => "It names the session with this robot, which this server keeps.",
            true => "It names the session with this robot, whose events stand beside this page.",
            false => "It holds scenario, what was turned in it, seed, learners, step and view. Whoever opens it sees the same numbers.",
        });
        let link = format!("?{}", self.settings.link());
        ui.add(egui::Label::new(RichText::new(&link).monospace().small()).wrap().selectable(true));
        ui.vertical(|ui| {
            ui.horizontal(|ui| {
                if ui.button("Copy link").clicked() {
                    self.ask(Command::Copy { text: link });
                }
                if ui.button("Copy picture").on_hover_text("The scene as it is drawn, on the clipboard").clicked() {
                    self.ask(Command::Picture);
                }
            });
            if let Some(copied) = &self.copied {
                ui.label(copied);
            }
        });
        ui.add_space(8.0);
        ui.label(RichText::new("Files of this session").strong());
        ui.horizontal_wrapped(|ui| {
            // A report takes longer than a page without a server has patience.
            let here = |file: &str| self.server || !file.starts_with("report.");
            let of_a_robot: Vec<_> = OF_A_ROBOT.into_iter().filter(|(file, _)| outside && here(file)).collect();
            for (file, tip) in of_a_robot.into_iter().chain(OF_ALL) {
                let session = self.session.as_ref().map(|session| session.id.clone());
                if ui.button(file).on_hover_text(tip).clicked()
                    && let Some(session) = session
                {
                    let path = format!("/v1/sessions/{session}/{file}");
                    self.ask(Command::Download { path, name: self.file_name(file) });
                }
            }
            if !outside && ui.button("scenario.toml").on_hover_text("The scenario, to change and run").clicked() {
                let path = format!("/v1/scenarios/{}", self.settings.scenario);
                self.ask(Command::Download { path, name: format!("{}.toml", self.settings.scenario) });
            }
        });
        if !outside {
            ui.add_space(8.0);
            ui.label(RichText::new("The same run without this page").strong());
            let command = self.command_line();
            ui.add(egui::Label::new(RichText::new(&command).monospace()).wrap().selectable(true));
            if ui.button("Copy command").clicked() {
                self.ask(Command::Copy { text: command });
            }
        }
        ui.add_space(8.0);
        ui.label(RichText::new("The scene").strong());
        if ui.button("Reset view").on_hover_text("Camera and views as they were at first; the run stays").clicked() {
            self.ask(Command::RestoreView);
        }
        if !outside {
            self.choose_ellipsoids(ui);
            self.choose_enlargement(ui);
        }
        if self.server {
            ui.add_space(8.0);
            ui.hyperlink_to("The HTTP interface that this page uses", "/v1/openapi.json");
        }
    }

    fn choose_ellipsoids(&mut self, ui: &mut Ui) {
        ui.horizontal_wrapped(|ui| {
            ui.label("Ellipsoids of uncertainty");
            let mut ellipsoids = self.settings.ellipsoids.clone();
            for (name, text) in ELLIPSOIDS {
                ui.radio_value(&mut ellipsoids, name.to_owned(), text);
            }
            if ellipsoids != self.settings.ellipsoids {
                self.settings.ellipsoids = ellipsoids;
                self.open(self.history.latest());
            }
        });
        ui.label(RichText::new("Another size draws the run anew, up to this step.").weak().small());
    }

    /// A slider for real robots, whose errors would not be seen as they are.
    fn choose_enlargement(&mut self, ui: &mut Ui) {
        if self.description().is_none_or(|description| description.truth.is_some()) {
            return;
        }
        ui.horizontal_wrapped(|ui| {
            let label = ui.label("Errors ×");
            let slider = egui::Slider::new(&mut self.settings.enlarge, ENLARGED).logarithmic(true);
            let slider = ui.add(slider).labelled_by(label.id);
            if slider.drag_stopped() || slider.changed() && !slider.dragged() {
                self.open(self.history.latest());
            }
        });
        let text = "The arm stands at its description (grey) and so many times what was learned of it; another factor draws the run anew.";
        ui.label(RichText::new(text).weak().small());
    }

    fn file_name(&self, file: &str) -> String {
        if let Some(description) = self.description().filter(|_| self.is_external()) {
            return format!("{}-{file}", description.scenario);
        }
        let stem = format!("{}-seed{}-step{}", self.settings.scenario, self.settings.seed, self.history.latest());
        format!("{stem}-{file}")
    }
}
