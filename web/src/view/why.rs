//! Why this posture? DIRECT's search for the last movement, and what another posture would have taught.

use egui::{ComboBox, RichText, Slider, Ui};

use crate::{panel::Panel, wire::Selection};

/// From this width on slice and diagram stand beside each other.
const TWO_COLUMNS: f32 = 640.0;

/// A joint's value with its unit: degrees, or millimetres along a slide.
pub(super) fn joint_value(panel: &Panel, selection: &Selection, joint: usize, value: f64) -> String {
    if is_slide(panel, selection, joint) {
        format!("{:.0} mm", value * 1e3)
    } else {
        format!("{:.0}°", value.to_degrees())
    }
}

fn is_slide(panel: &Panel, selection: &Selection, joint: usize) -> bool {
    let Some(name) = selection.joints.get(joint).map(|joint| &joint.name) else { return false };
    let joints = panel.description().map_or(&[][..], |description| &description.joints);
    joints.iter().any(|joint| joint.name == *name && joint.kind.as_deref() == Some("prismatic"))
}

impl Panel {
    pub(super) fn why(&mut self, ui: &mut Ui) {
        self.choose_learner(ui);
        let Some(selection) = self.why.selection.clone() else {
            let text = self.why.reason.clone().unwrap_or_else(|| match self.history.latest() {
                0 => "No movement yet. Step once to see how DIRECT chooses.".to_owned(),
                _ if self.explained().is_none() => "No learner here chooses its movements.".to_owned(),
                _ => "Asking the server…".to_owned(),
            });
            ui.label(text);
            return;
        };
        self.gains(ui, &selection);
        let joints = self.choose_joints(ui, &selection);
        let iteration = self.choose_iteration(ui, &selection);
        let columns = if ui.available_width() >= TWO_COLUMNS { 2 } else { 1 };
        ui.columns(columns, |uis| {
            let proposed = self.slice(&mut uis[0], &selection, joints, iteration);
            if let Some(place) = proposed {
                self.propose(selection.configuration(joints, place));
            }
            self.diagram(&mut uis[columns - 1], &selection, iteration);
        });
        self.proposal(ui, &selection);
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

    fn gains(&self, ui: &mut Ui, selection: &Selection) {
        let Selection { step, learner, evaluations, chosen, variant, .. } = selection;
        let text =
            format!("How {learner} chose movement {step}: {} tried {evaluations} postures.", variant.to_uppercase());
        ui.add(egui::Label::new(RichText::new(text).strong()).wrap());
        let number = |value: Option<f64>| value.map_or("–".to_owned(), |value| format!("{value:.3}"));
        let (predicted, realised) = (number(chosen.predicted_gain), number(chosen.realised_gain));
        let text = format!(
            "Uncertainty tr(W P) before: {:.3} · expected to fall by {predicted} · fell by {realised}",
            selection.trace
        );
        ui.add(egui::Label::new(text).wrap());
        if self.cursor != *step {
            let text = format!(
                "The server keeps the search of the latest movement, {step}; the scene shows step {}.",
                self.cursor
            );
            ui.add(egui::Label::new(RichText::new(text).weak()).wrap());
        }
    }

    fn choose_joints(&mut self, ui: &mut Ui, selection: &Selection) -> (usize, usize) {
        let count = selection.joints.len();
        let fits = |(a, b): (usize, usize)| a < count && b < count && a != b;
        let usual = selection.busiest();
        let before = self.settings.joints.filter(|pair| fits(*pair)).unwrap_or(usual);
        let (mut a, mut b) = before;
        ui.horizontal_wrapped(|ui| {
            for (salt, joint, other) in [("across", &mut a, before.1), ("up", &mut b, before.0)] {
                let label = ui.label(salt);
                ComboBox::from_id_salt(salt)
                    .selected_text(&selection.joints[*joint].name)
                    .show_ui(ui, |ui| {
                        for (index, choice) in selection.joints.iter().enumerate().filter(|(index, _)| *index != other)
                        {
                            ui.selectable_value(joint, index, &choice.name);
                        }
                    })
                    .response
                    .labelled_by(label.id);
            }
        });
        if (a, b) != before && fits((a, b)) {
            self.settings.joints = Some((a, b));
        }
        (a, b)
    }

    fn choose_iteration(&mut self, ui: &mut Ui, selection: &Selection) -> usize {
        let last = selection.last();
        let mut iteration = self.why.iteration.unwrap_or(last).min(last);
        ui.horizontal(|ui| {
            let label = ui.label("Iteration");
            ui.spacing_mut().slider_width = (ui.available_width() - 180.0).clamp(60.0, 320.0);
            let slider = ui.add(Slider::new(&mut iteration, 0..=last.max(1))).labelled_by(label.id);
            slider.on_hover_text("Watch DIRECT divide: outlined boxes are divided next");
            let evaluations = selection.iterations.get(iteration).map_or(0, |iteration| iteration.evaluations);
            ui.label(RichText::new(format!("{evaluations} tried")).weak());
        });
        let iteration = iteration.min(last);
        self.why.iteration = Some(iteration).filter(|iteration| *iteration < last);
        iteration
    }

    fn proposal(&mut self, ui: &mut Ui, selection: &Selection) {
        ui.add_space(6.0);
        let Some(proposed) = self.why.proposed.clone() else {
            ui.label("Could you choose better? Click a point of the slice.");
            return;
        };
        let joints = selection.joints.iter().zip(&proposed).enumerate();
        let words: Vec<String> = joints
            .map(|(index, (joint, value))| format!("{} {}", joint.name, joint_value(self, selection, index, *value)))
            .collect();
        ui.label(RichText::new("Your posture").strong()).on_hover_text(words.join("\n"));
        let Some(evaluation) = &self.why.evaluation else {
            ui.label(if self.why.evaluating { "Asking what it would have taught…" } else { "No answer." });
            return;
        };
        let gain = evaluation.gain;
        let share = selection.chosen.predicted_gain.filter(|best| *best > 0.0).map(|best| gain / best * 100.0);
        let share = share.map_or(String::new(), |share| format!(", {share:.0} % of what DIRECT found"));
        ui.add(egui::Label::new(format!("It would have lowered the uncertainty by {gain:.3}{share}.")).wrap());
        let [x, y, z] = evaluation.predicted_marker_m;
        let spread = (0..3).map(|i| evaluation.marker_covariance_m2[i][i].max(0.0)).sum::<f64>().sqrt();
        let text = format!(
            "Marker expected at ({x:.2}, {y:.2}, {z:.2}) m, give or take {:.0} mm; chance of being seen {:.0} %.",
            spread * 1e3,
            evaluation.chance_of_being_seen * 100.0
        );
        ui.add(egui::Label::new(text).wrap());
    }
}
