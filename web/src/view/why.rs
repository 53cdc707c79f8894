//! Why this posture? DIRECT's search for the last movement, and what another posture would have taught.

use body_schema_engine::optimize::Plane;
use body_schema_wire::{Choice, JointKind};
use egui::{ComboBox, RichText, Slider, Ui};

use crate::{panel::Panel, search::Search};

/// From this width on slice and diagram stand beside each other.
const TWO_COLUMNS: f32 = 640.0;

/// A joint's value with its unit: degrees, or millimetres along a slide.
pub(super) fn joint_value(panel: &Panel, joint: usize, value: f64) -> String {
    match panel.description().and_then(|description| description.joints.get(joint)).map(|joint| joint.kind) {
        Some(JointKind::Prismatic) => format!("{:.0} mm", value * 1e3),
        _ => format!("{:.0}°", value.to_degrees()),
    }
}

impl Panel {
    pub(super) fn why(&mut self, ui: &mut Ui) {
        self.choice(ui);
        ui.add_space(8.0);
        self.readings(ui);
    }

    fn choice(&mut self, ui: &mut Ui) {
        self.choose_learner(ui);
        let Some(search) = self.why.search.clone() else {
            let text = self.why.reason.clone().unwrap_or_else(|| match self.history.latest() {
                0 => "No movement yet. Step once to see how DIRECT chooses.".to_owned(),
                _ if self.explained().is_none() => "No learner here chooses its movements.".to_owned(),
                _ => "Asking the engine…".to_owned(),
            });
            ui.label(text);
            return;
        };
        self.gains(ui, search.choice());
        let about = "A box is a range of every joint. Its colour says how much the posture at its centre would teach.";
        ui.add(egui::Label::new(RichText::new(about).weak()).wrap());
        let plane = self.choose_plane(ui, &search);
        let iteration = self.choose_iteration(ui, &search);
        let columns = if ui.available_width() >= TWO_COLUMNS { 2 } else { 1 };
        ui.columns(columns, |uis| {
            let proposed = self.slice(&mut uis[0], &search, plane, iteration);
            if let Some(place) = proposed {
                self.propose(search.configuration(plane, place));
            }
            self.proposal(&mut uis[0], search.choice());
            self.diagram(&mut uis[columns - 1], &search, iteration);
        });
    }

    fn choose_learner(&mut self, ui: &mut Ui) {
        let Some(description) = self.description() else { return };
        let active: Vec<String> = description
            .learners
            .iter()
            .filter(|learner| learner.policy.starts_with("active"))
            .map(|learner| learner.name.clone())
            .collect();
        let Some(explained) = self.explained().map(str::to_owned) else { return };
        if active.len() > 1 {
            let mut chosen = explained.clone();
            ComboBox::from_label("learner").selected_text(&chosen).show_ui(ui, |ui| {
                for name in active {
                    ui.selectable_value(&mut chosen, name.clone(), name);
                }
            });
            if chosen != explained {
                self.settings.learner = Some(chosen);
            }
        }
    }

    fn gains(&self, ui: &mut Ui, choice: &Choice) {
        let Choice { step, learner, evaluations, chosen, variant, .. } = choice;
        let text =
            format!("How {learner} chose movement {step}: {} tried {evaluations} postures.", variant.to_uppercase());
        ui.add(egui::Label::new(RichText::new(text).strong()).wrap());
        let number = |value: Option<f64>| value.map_or("–".to_owned(), |value| format!("{value:.3}"));
        let fall = |gain: Option<f64>| match gain {
            Some(gain) if gain < 0.0 => format!("to rise by {:.3}", -gain),
            gain => format!("to fall by {}", number(gain)),
        };
        let fell = match chosen.realised_gain {
            None => String::new(),
            Some(gain) if gain < 0.0 => format!(" · rose by {:.3}", -gain),
            Some(gain) => format!(" · fell by {gain:.3}"),
        };
        let unit = self.uncertainty_unit();
        let text = format!(
            "Uncertainty before, {unit}: {} · expected {}{fell}",
            number(choice.trace),
            fall(chosen.predicted_gain)
        );
        let tip = "The trace of the weighted covariance, tr(W P), and its fall. Stabilising noise lets it rise again.";
        ui.add(egui::Label::new(text).wrap()).on_hover_text(tip);
        if self.cursor != *step {
            let text = format!(
                "The engine keeps the search of the latest movement, {step}; the scene shows step {}.",
                self.cursor
            );
            ui.add(egui::Label::new(RichText::new(text).weak()).wrap());
        }
    }

    /// The joints of the slice: those divided most, unless the visitor chose others.
    fn choose_plane(&mut self, ui: &mut Ui, search: &Search) -> Plane {
        let joints = &search.choice().joints;
        let fits = |(x, y): &(usize, usize)| x.max(y) < &joints.len() && x != y;
        let chosen = self.settings.joints.filter(fits).map(|(x, y)| Plane { x, y: Some(y) });
        let before = chosen.unwrap_or(search.busiest());
        let Plane { mut x, y: Some(mut y) } = before else { return before };
        let others = [y, x];
        ui.horizontal_wrapped(|ui| {
            for ((salt, joint), other) in [("across", &mut x), ("up", &mut y)].into_iter().zip(others) {
                let label = ui.label(salt);
                ComboBox::from_id_salt(salt)
                    .selected_text(&joints[*joint].name)
                    .show_ui(ui, |ui| {
                        for (index, choice) in joints.iter().enumerate().filter(|(index, _)| *index != other) {
                            ui.selectable_value(joint, index, &choice.name);
                        }
                    })
                    .response
                    .labelled_by(label.id);
            }
        });
        let plane = Plane { x, y: Some(y) };
        if plane != before {
            self.settings.joints = Some((x, y));
        }
        plane
    }

    fn choose_iteration(&mut self, ui: &mut Ui, search: &Search) -> usize {
        let last = search.last();
        let grown = self.why.grown(self.now, last);
        let mut iteration = grown.or(self.why.iteration).unwrap_or(last).min(last);
        // While movements are made the arm itself is looked at.
        let mut follows = self.why.slowly && !self.playing;
        if grown.is_some() {
            ui.ctx().request_repaint();
        }
        ui.horizontal(|ui| {
            let label = ui.label("Iteration");
            ui.spacing_mut().slider_width = (ui.available_width() - 180.0).clamp(60.0, 320.0);
            let slider = ui.add(Slider::new(&mut iteration, 0..=last.max(1))).labelled_by(label.id);
            if slider.on_hover_text("Watch DIRECT divide: outlined boxes are divided next").changed() {
                (self.why.grows, self.why.growing, follows) = (false, None, true);
            }
            let evaluations = search.choice().iterations.get(iteration).map_or(0, |iteration| iteration.evaluations);
            ui.label(RichText::new(format!("{evaluations} tried")).weak());
        });
        let iteration = iteration.min(last);
        self.why.iteration = Some(iteration).filter(|iteration| *iteration < last);
        if follows {
            self.show_best(iteration);
        }
        ui.horizontal_wrapped(|ui| {
            let is_watched = self.why.growing.is_some() && self.why.slowly;
            let tip =
                "From its first box on, a sentence each time; the scene shows the best posture so far, as a ghost";
            if is_watched {
                if ui.button("Stop watching").clicked() {
                    self.why.growing = None;
                }
            } else if ui.button("Watch it search").on_hover_text(tip).clicked() {
                (self.why.growing, self.why.slowly) = (Some(self.now), true);
            }
            ui.add(egui::Label::new(search.next(iteration)).wrap());
        });
        iteration
    }

    /// What the visitor's posture would have taught, as a share of what was chosen.
    pub(super) fn share_of_chosen(&self, choice: &Choice) -> Option<f64> {
        let gain = self.why.appraisal.as_ref()?.gain;
        Some(gain / choice.chosen.predicted_gain.filter(|best| *best > 0.0)?)
    }

    fn proposal(&mut self, ui: &mut Ui, choice: &Choice) {
        ui.add_space(4.0);
        let Some(proposed) = self.why.proposed.clone() else {
            let verb = if self.touch { "Tap" } else { "Click" };
            ui.label(format!("Could you do better? {verb} a point of the slice."));
            return;
        };
        let joints = choice.joints.iter().zip(&proposed).enumerate();
        let words: Vec<String> = joints
            .map(|(index, (joint, value))| format!("{} {}", joint.name, joint_value(self, index, *value)))
            .collect();
        let whose = if self.why.of_search { "The best centre so far" } else { "Your posture" };
        ui.label(RichText::new(whose).strong()).on_hover_text(words.join("\n"));
        let Some(appraisal) = &self.why.appraisal else {
            ui.label(if self.why.evaluating { "Asking what it would have taught…" } else { "No answer." });
            return;
        };
        let gain = appraisal.gain;
        let share = self.share_of_chosen(choice);
        let share = share.map_or(String::new(), |share| format!(", {:.0} % of what DIRECT found", share * 100.0));
        let text = match gain < 0.0 {
            true => format!("It would have raised the uncertainty by {:.3}.", -gain),
            false => format!("It would have lowered the uncertainty by {gain:.3}{share}."),
        };
        ui.add(egui::Label::new(text).wrap());
        let [x, y, z] = appraisal.predicted_marker_m;
        let spread = (0..3).map(|i| appraisal.marker_covariance_m2[i][i].max(0.0)).sum::<f64>().sqrt();
        let text = format!(
            "Marker expected at ({x:.2}, {y:.2}, {z:.2}) m, give or take {:.0} mm; chance of being seen {:.0} %.",
            spread * 1e3,
            appraisal.chance_of_being_seen * 100.0
        );
        ui.add(egui::Label::new(text).wrap());
    }
}
