//! The choice of scenario, seed and learners.

use body_schema_scenario::{ScenarioSummary, WorldKind};
use body_schema_wire::LearnerDescription;
use egui::{ComboBox, RichText, TextEdit, Ui};

use super::drawing::Drawing;
use crate::{panel::Panel, settings::MAX_SEED, wire::Session, words};

/// There are so many colours, dashes and markers.
const MOST_LEARNERS: usize = 6;

/// The groups of the list, each with a sentence.
const GROUPS: [(Drawing, &str, &str); 6] = [
    (Drawing::Arm, "Simulated arms", "A marker on the hand is seen wherever it is."),
    (Drawing::Head, "A head that watches", "Movements out of its sight teach nothing."),
    (Drawing::Break, "A body that changes", "What was learned is suddenly wrong."),
    (Drawing::Camera, "Eyes and cameras", "Pictures are measured instead of places."),
    (Drawing::Socket, "Sockets", "A ball in a socket, and nothing measured but the joints."),
    (Drawing::Real, "Real robots", "Measured movements, judged by those held out."),
];

/// The group of a scenario.
fn group(scenario: &ScenarioSummary) -> usize {
    let is_of = |words: &[&str]| words.iter().any(|word| scenario.name.contains(word));
    match scenario.world {
        WorldKind::Measured | WorldKind::External => 5,
        WorldKind::Simulated if is_of(&["head-fov"]) => 1,
        WorldKind::Simulated if is_of(&["change"]) => 2,
        WorldKind::Simulated if is_of(&["camera", "webcam", "eye", "two-arms"]) => 3,
        WorldKind::Simulated if is_of(&["socket"]) => 4,
        WorldKind::Simulated => 0,
    }
}

/// A scenario in figures.
fn figures(scenario: &ScenarioSummary) -> String {
    let world = match scenario.world {
        WorldKind::Measured => "measured data",
        WorldKind::External => "a robot of your own",
        WorldKind::Simulated => "simulated",
    };
    let (joints, parameters) = (scenario.joints.len(), scenario.parameters);
    let (learners, steps) = (scenario.learners.len(), scenario.steps);
    let learners = if learners == 1 { "1 learner".to_owned() } else { format!("{learners} learners") };
    format!("{joints} joints · {parameters} parameters · {learners} · {steps} movements · {world}")
}

impl Panel {
    pub(super) fn setup(&mut self, ui: &mut Ui) {
        ui.horizontal_wrapped(|ui| {
            let text = format!("All scenarios… ({})", self.settings.scenario);
            self.scenario_list(ui, &text);
            self.robot_list(ui);
            let label = ui.label("Seed");
            let field = TextEdit::singleline(&mut self.seed_text).desired_width(70.0).char_limit(16);
            let field = ui.add(field).labelled_by(label.id);
            // Assistive technology sets the whole text at once, without the focus.
            if field.lost_focus() || field.changed() && !field.has_focus() {
                self.choose_seed();
            }
            field.on_hover_text("Initial error, noise and random movements all come from it");
            if ui.button("New seed").on_hover_text("A new seed (N)").clicked() {
                self.reroll();
            }
        });
        let Some(scenario) = self.scenario().cloned() else { return };
        ui.label(&scenario.title);
        ui.label(RichText::new(figures(&scenario)).weak().small());
        self.pace_row(ui);
        ui.horizontal_wrapped(|ui| {
            ui.label("Compare");
            let compared = self.settings.learners.clone();
            let own = scenario.learners.iter();
            let composed = scenario.compositions.iter().filter(|learner| compared.contains(&learner.name));
            for learner in own.chain(composed) {
                self.choose_learner_to_compare(ui, learner, &compared);
            }
            self.add_learner(ui, &scenario, &compared);
        });
        if self.human().is_none() {
            self.knobs(ui, &scenario.knobs);
        }
    }

    /// Another session than that with a robot elsewhere.
    pub(super) fn choose_session(&mut self, ui: &mut Ui) {
        ui.horizontal_wrapped(|ui| {
            self.robot_list(ui);
            self.scenario_list(ui, "Scenarios of the explorer…");
        });
    }

    fn scenario_list(&mut self, ui: &mut Ui, text: &str) {
        let label = ui.label("Scenario");
        let current = Some(&self.settings.scenario).filter(|_| !self.is_external());
        let mut chosen = None;
        let list = ComboBox::from_id_salt("scenario").selected_text(text).width(190.0).height(420.0);
        let list = list.show_ui(ui, |ui| {
            for (place, (drawing, title, about)) in GROUPS.iter().enumerate() {
                let mut scenarios = self.scenarios.iter().filter(|scenario| group(scenario) == place).peekable();
                if scenarios.peek().is_none() {
                    continue;
                }
                ui.horizontal(|ui| {
                    drawing.show(ui);
                    ui.vertical(|ui| {
                        ui.label(RichText::new(*title).strong().size(15.0));
                        ui.label(RichText::new(*about).weak().small());
                    });
                });
                for scenario in scenarios {
                    let text = format!("{}\n{}", scenario.title, scenario.name);
                    let entry = ui.selectable_label(current == Some(&scenario.name), text);
                    if entry.on_hover_text(figures(scenario)).clicked() {
                        chosen = Some(scenario.name.clone());
                    }
                }
                ui.add_space(6.0);
            }
        });
        list.response.labelled_by(label.id);
        if let Some(chosen) = chosen.filter(|chosen| current != Some(chosen)) {
            self.choose_scenario(&chosen);
        }
    }

    /// The sessions with robots elsewhere, where there are any.
    fn robot_list(&mut self, ui: &mut Ui) {
        let current = self.session.as_ref().map(|session| session.id.as_str());
        if self.robots.iter().all(|robot| Some(robot.id.as_str()) == current) {
            return;
        }
        let label = ui.label("Robot");
        let mut chosen = None;
        let list = ComboBox::from_id_salt("robot").selected_text("Robots elsewhere…").width(150.0).height(420.0);
        let list = list.show_ui(ui, |ui| {
            for robot in self.robots.iter().rev() {
                let Session { id, description, step, .. } = robot;
                let told = if *step == 1 { "1 observation".to_owned() } else { format!("{step} observations") };
                let short: String = id.chars().take(8).collect();
                let text =
                    format!("{}\n{} joints · {told} · session {short}", description.scenario, description.joints.len());
                if ui.selectable_label(current == Some(id.as_str()), text).clicked() {
                    chosen = Some(id.clone());
                }
            }
        });
        list.response
            .labelled_by(label.id)
            .on_hover_text("Sessions with robots elsewhere, which ask and tell over HTTP");
        if let Some(session) = chosen {
            self.settings.step = None;
            self.find(session);
        }
    }

    fn choose_learner_to_compare(&mut self, ui: &mut Ui, learner: &LearnerDescription, compared: &[String]) {
        let mut on = compared.contains(&learner.name);
        let refused = if on && compared.len() == 1 {
            Some("At least one learner is needed".to_owned())
        } else if !on && compared.len() >= MOST_LEARNERS {
            Some(format!("{MOST_LEARNERS} learners are as many as can be told apart"))
        } else {
            None
        };
        let about = format!("{} A change runs all learners anew, to the same step.", words::terms(learner));
        let toggled = ui.add_enabled(refused.is_none(), egui::Checkbox::new(&mut on, &learner.name));
        if toggled.on_hover_text(about).on_disabled_hover_text(refused.unwrap_or_default()).changed() {
            self.compare(&learner.name, on);
        }
    }

    /// Any estimator with any policy.
    fn add_learner(&mut self, ui: &mut Ui, scenario: &ScenarioSummary, compared: &[String]) {
        let others = || scenario.compositions.iter().filter(|learner| !compared.contains(&learner.name));
        if others().next().is_none() || compared.len() >= MOST_LEARNERS {
            return;
        }
        let mut chosen = None;
        let menu = ui.menu_button("Add a learner…", |ui| {
            egui::ScrollArea::vertical().max_height(360.0).show(ui, |ui| {
                for learner in others() {
                    let text = format!("{}\n{}", words::how(learner), learner.name);
                    if ui.button(text).clicked() {
                        chosen = Some(learner.name.clone());
                        ui.close();
                    }
                }
            });
        });
        menu.response.on_hover_text(
            "Any way to estimate with any way to choose movements; the run is made anew, to the same step",
        );
        if let Some(name) = chosen {
            self.compare(&name, true);
        }
    }

    fn compare(&mut self, name: &str, on: bool) {
        self.settings.learners.retain(|learner| learner != name);
        if on {
            self.settings.learners.push(name.to_owned());
        }
        self.settings.validate(&self.scenarios);
        self.run_anew();
    }

    /// Opens the usual run of another scenario.
    pub(crate) fn choose_scenario(&mut self, name: &str) {
        name.clone_into(&mut self.settings.scenario);
        self.settings.set.clear();
        self.settings.learners.clear();
        (self.settings.joints, self.settings.learner, self.settings.run_to) = (None, None, None);
        self.notices.clear();
        // The cards speak of another scenario.
        self.tour = None;
        self.choose_usual_learners();
        if let Some(story) = self.story_of_scenario() {
            self.story = story;
        }
        self.open(1);
    }

    fn choose_seed(&mut self) {
        match self.seed_text.trim().parse::<u64>() {
            Ok(seed) if seed <= MAX_SEED => {
                if seed != self.settings.seed {
                    self.settings.seed = seed;
                    self.open(1);
                }
            }
            _ => self.notice(format!("A seed is a whole number from 0 to {MAX_SEED}.")),
        }
        self.seed_text = self.settings.seed.to_string();
    }

    /// Another seed, and its run.
    pub fn reroll(&mut self) {
        if self.is_external() {
            return;
        }
        // A step through all numbers that looks like chance; the first few seeds come from people.
        let mixed = self.settings.seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let seed = (mixed >> 33) % 10_000;
        self.settings.seed = if seed == self.settings.seed { (seed + 1) % 10_000 } else { seed };
        self.seed_text = self.settings.seed.to_string();
        if !self.scenarios.is_empty() {
            self.open(1);
        }
    }
}
