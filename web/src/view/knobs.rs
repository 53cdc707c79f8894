//! What can be turned in a scenario: each change runs the same scenario anew, on the same seed, up to the same step.

use body_schema_scenario::Knob;
use egui::{ComboBox, RichText, Slider, Ui};

use super::NARROW;
use crate::{panel::Panel, turned};

/// How a knob's numbers are shown: times this, with this unit.
fn shown(knob: &Knob) -> (f64, &'static str) {
    match knob.keys.first().map(|first| first.key.as_str()) {
        Some(key) if key.ends_with("_m") => (1e3, " mm"),
        Some(key) if key.ends_with("_deg") => (1.0, "°"),
        _ => (1.0, ""),
    }
}

impl Panel {
    pub(super) fn knobs(&mut self, ui: &mut Ui, knobs: &[Knob]) {
        for (index, knob) in knobs.iter().enumerate() {
            let (scale, unit) = shown(knob);
            let current = self.turning.filter(|(turned, _)| *turned == index);
            let before = current.map_or_else(|| turned::value(&self.settings.set, knob), |(_, value)| value);
            let mut value = before * scale;
            let row = |ui: &mut Ui| {
                let label = ui.label(&knob.name);
                ui.spacing_mut().slider_width = (ui.available_width() - 76.0).clamp(60.0, 220.0);
                let is_wide = knob.most > 20.0 * knob.least;
                let digits = if knob.whole { 0 } else { 1 };
                let slider = Slider::new(&mut value, knob.least * scale..=knob.most * scale).suffix(unit);
                let slider =
                    slider.logarithmic(is_wide).max_decimals(digits).step_by(if knob.whole { 1.0 } else { 0.0 });
                ui.add_enabled(!self.opening, slider).labelled_by(label.id)
            };
            let slider = if ui.available_width() < NARROW { ui.vertical(row).inner } else { ui.horizontal(row).inner };
            let slider = slider.on_hover_text("The same scenario and seed, run anew to the same step");
            if slider.changed() {
                self.turning = Some((index, value / scale));
            }
            // A run for every value on the way would be in vain.
            let rests = !slider.dragged() && !slider.has_focus() || slider.drag_stopped() || slider.lost_focus();
            if let Some((_, value)) = self.turning.filter(|(turned, _)| *turned == index && rests) {
                self.turning = None;
                self.turn(knob, value);
            }
        }
        self.break_a_joint(ui);
        if !self.settings.set.is_empty() {
            ui.horizontal_wrapped(|ui| {
                let button = egui::Button::new("As in the scenario");
                if ui.add_enabled(!self.opening, button).on_hover_text("All values as they were").clicked() {
                    self.turn_back();
                }
                ui.add(egui::Label::new(RichText::new(self.settings.set.join(", ")).weak().small()).wrap());
            });
        }
    }

    /// A joint that gives way while the visitor watches.
    fn break_a_joint(&mut self, ui: &mut Ui) {
        let joints = self.breakable();
        let Some(first) = joints.first() else { return };
        let usual = joints.iter().find(|name| name.contains("elbow")).unwrap_or(first);
        let mut chosen = self.breaks.clone().filter(|name| joints.contains(name)).unwrap_or_else(|| usual.clone());
        ui.horizontal_wrapped(|ui| {
            let label = ui.label("Joint");
            let list = ComboBox::from_id_salt("breaks").selected_text(chosen.replace('_', " "));
            list.show_ui(ui, |ui| {
                for name in &joints {
                    ui.selectable_value(&mut chosen, name.clone(), name.replace('_', " "));
                }
            })
            .response
            .labelled_by(label.id);
            let button = egui::Button::new("Break it now");
            let tip =
                "Tilts its axis by 20° after the latest movement. No learner is told. The run goes on from there.";
            if ui.add_enabled(self.is_ready() && !self.opening, button).on_hover_text(tip).clicked() {
                self.break_joint(&chosen);
            }
        });
        self.breaks = Some(chosen);
    }
}
