//! Beat the algorithm: sliders, a slice to click, what the posture would teach, and the score.

use body_schema_wire::JointKind;
use egui::{
    Align2, Button, Color32, ComboBox, FontId, Frame, ProgressBar, Rect, RichText, Sense, Slider, Stroke, StrokeKind,
    Ui, pos2, vec2,
};

use super::{card::filled, learners::entry, style::accent, why::joint_value};
use crate::{
    colours,
    game::{CELLS, ROUNDS},
    host::Command,
    panel::Panel,
    words::terms,
};

const SLICE: f32 = 150.0;

impl Panel {
    pub(super) fn game(&mut self, ui: &mut Ui) {
        if self.human().is_none() {
            return;
        }
        let line = Stroke::new(1.5, accent(ui.visuals().dark_mode));
        let frame = Frame::new().fill(ui.visuals().window_fill).stroke(line).inner_margin(10).corner_radius(6);
        frame.show(ui, |ui| {
            ui.set_width(ui.available_width());
            if self.history.latest() < ROUNDS {
                self.round(ui)
            } else {
                self.final_score(ui)
            }
            ui.add_space(4.0);
            ui.horizontal_wrapped(|ui| {
                if ui.button("Copy challenge").on_hover_text("A link to the same game, on the same seed").clicked() {
                    self.ask(Command::Copy { text: format!("?{}", self.settings.challenge()) });
                }
                if ui.add_enabled(!self.opening, Button::new("Play again")).clicked() {
                    self.open(0);
                }
                if ui.add_enabled(!self.opening, Button::new("Leave the game")).clicked() {
                    self.end_contest();
                }
                if let Some(copied) = &self.copied {
                    ui.label(copied);
                }
            });
        });
        ui.add_space(8.0);
    }

    fn round(&mut self, ui: &mut Ui) {
        let made = self.history.latest();
        let title = format!("Beat the algorithm: movement {} of {ROUNDS}", made + 1);
        ui.label(RichText::new(title).strong().size(16.0));
        ui.label("Choose a posture of which the robot learns as much as it can. The arm in the scene moves as you do.");
        self.teaches(ui);
        ui.horizontal(|ui| {
            let may = self.may_move() && !self.game.wanted;
            let make = filled(ui, RichText::new("Make this movement"));
            if ui.add_enabled(may, make).on_hover_text("All learners make their movements (S)").clicked() {
                self.make_movement();
            }
        });
        ui.add_space(4.0);
        if ui.available_width() > SLICE + 260.0 {
            ui.horizontal_top(|ui| {
                self.sliders(ui, SLICE + 30.0);
                ui.vertical(|ui| {
                    ui.set_max_width(SLICE);
                    self.pad(ui);
                });
            });
        } else {
            self.sliders(ui, 0.0);
            self.pad(ui);
        }
    }

    fn teaches(&self, ui: &mut Ui) {
        let share = self.game.evaluation.as_ref().and_then(|evaluation| evaluation.share);
        let text = match (share, &self.game.evaluation) {
            (Some(share), _) => format!("Your posture teaches {:.0} % of the best.", share * 100.0),
            (None, Some(_)) => "Nothing is to be gained here.".to_owned(),
            (None, None) => "What does this posture teach?…".to_owned(),
        };
        ui.label(RichText::new(text).strong());
        ui.add(ProgressBar::new(share.unwrap_or(0.0).clamp(0.0, 1.0) as f32).desired_height(8.0));
        let seen = self.game.evaluation.as_ref().map_or(1.0, |evaluation| evaluation.chance_of_being_seen);
        if seen < 0.995 {
            ui.label(format!("The head expects to see it with a chance of {:.0} %.", seen * 100.0));
        }
    }

    fn sliders(&mut self, ui: &mut Ui, beside: f32) {
        let Some(joints) = self.description().map(|description| description.joints.clone()) else { return };
        let mut values = self.game.values.clone();
        let enabled = self.may_move();
        ui.vertical(|ui| {
            ui.spacing_mut().slider_width = (ui.available_width() - beside - 170.0).clamp(60.0, 260.0);
            egui::Grid::new("joints").num_columns(2).show(ui, |ui| {
                for (value, joint) in values.iter_mut().zip(&joints) {
                    let label = ui.label(joint.name.replace('_', " "));
                    let (scale, unit) = match joint.kind {
                        JointKind::Prismatic => (1e3, " mm"),
                        JointKind::Revolute => (180.0 / std::f64::consts::PI, "°"),
                    };
                    let [low, high] = joint.limits.map(|limit| limit * scale);
                    let mut shown = *value * scale;
                    let slider = Slider::new(&mut shown, low..=high).suffix(unit).fixed_decimals(0).step_by(1.0);
                    if ui.add_enabled(enabled, slider).labelled_by(label.id).changed() {
                        *value = (shown / scale).clamp(joint.limits[0], joint.limits[1]);
                    }
                    ui.end_row();
                }
            });
        });
        self.pose(values);
    }

    /// A slice of all postures: two joints by a click, with what was tried for this movement.
    fn pad(&mut self, ui: &mut Ui) {
        let Some(joints) = self.description().map(|description| description.joints.clone()) else { return };
        if joints.len() < 2 {
            return;
        }
        let (mut x, mut y) = self.game.axes;
        let plain = |joint: usize| joints[joint].name.replace('_', " ");
        // One above the other: side by side their names have no room.
        ui.vertical(|ui| {
            let taken = (y, x);
            for (salt, way, axis, other) in [("slice across", "x", &mut x, taken.0), ("slice up", "y", &mut y, taken.1)]
            {
                let text = format!("{way}: {}", plain(*axis));
                let combo = ComboBox::from_id_salt(salt).width(SLICE).truncate().selected_text(text);
                let response = combo.show_ui(ui, |ui| {
                    for index in (0..joints.len()).filter(|index| *index != other) {
                        ui.selectable_value(axis, index, plain(index));
                    }
                });
                let name = format!("{salt}: {}", plain(*axis));
                response
                    .response
                    .widget_info(|| egui::WidgetInfo::labeled(egui::accesskit::Role::ComboBox, true, &name));
            }
        });
        self.game.axes = (x, y);
        let (square, response) = ui.allocate_exact_size(vec2(SLICE, SLICE), Sense::click());
        let name = "Slice: click to set both joints";
        response.widget_info(|| egui::WidgetInfo::labeled(egui::accesskit::Role::Image, true, name));
        let place = |posture: &[f64]| {
            let share = |joint: usize| {
                let [low, high] = joints[joint].limits;
                ((posture[joint] - low) / (high - low).max(f64::MIN_POSITIVE)) as f32
            };
            pos2(square.left() + share(x) * square.width(), square.bottom() - share(y) * square.height())
        };
        let painter = ui.painter();
        let text = ui.visuals().text_color();
        painter.rect_filled(square, 2.0, ui.visuals().extreme_bg_color);
        let cell = square.size() / CELLS as f32;
        for (place, share) in self.game.map().iter().enumerate() {
            let [column, row] = [place % CELLS, place / CELLS].map(|at| at as f32);
            let corner = pos2(square.left() + column * cell.x, square.bottom() - (row + 1.0) * cell.y);
            // A little more than it needs, or the ground shows between two.
            painter.rect_filled(Rect::from_min_size(corner, cell + vec2(0.5, 0.5)), 0.0, colours::viridis(*share));
        }
        painter.rect_stroke(square, 2.0, Stroke::new(1.0, text), StrokeKind::Inside);
        if self.game.map().is_empty() {
            let wait = "what do others teach?…";
            painter.text(
                square.center_bottom() - vec2(0.0, 8.0),
                Align2::CENTER_BOTTOM,
                wait,
                FontId::proportional(11.5),
                text,
            );
        }
        for (posture, share) in &self.game.tried {
            painter.circle(place(posture), 4.5, colours::viridis(*share), Stroke::new(1.0, Color32::WHITE));
        }
        // White within black is seen on every colour.
        for (width, colour) in [(5.0, Color32::BLACK), (2.5, Color32::WHITE)] {
            painter.circle_stroke(place(&self.game.values), 7.0, Stroke::new(width, colour));
        }
        let text = "Bright places teach much: click one. Ring: your posture; dots: those that you tried.";
        ui.add(egui::Label::new(RichText::new(text).weak().small()).wrap());
        let clicked = response.interact_pointer_pos().filter(|_| response.clicked() && self.may_move());
        if let Some(at) = clicked {
            let mut values = self.game.values.clone();
            let shares = [(at.x - square.left()) / square.width(), (square.bottom() - at.y) / square.height()];
            for (joint, share) in [x, y].into_iter().zip(shares) {
                let [low, high] = joints[joint].limits;
                values[joint] = low + f64::from(share.clamp(0.0, 1.0)) * (high - low);
            }
            self.pose(values);
        }
        response.on_hover_ui_at_pointer(|ui| {
            for joint in [x, y] {
                ui.label(format!("{}: now {}", plain(joint), joint_value(self, joint, self.game.values[joint])));
            }
        });
    }

    fn final_score(&mut self, ui: &mut Ui) {
        let (Some(score), Some(description)) = (self.score(), self.description()) else { return };
        let slots = colours::slots(description);
        ui.label(RichText::new(&score.verdict).strong().size(18.0));
        ui.label(format!("Prediction error after {ROUNDS} movements, seed {}:", description.seed));
        ui.horizontal_wrapped(|ui| {
            for (learner, error) in &score.errors {
                let is_you = Some(*learner) == self.human();
                let name = if is_you { "you" } else { &description.learners[*learner].name };
                let text = RichText::new(format!("{name} {:.0} mm", error * 1e3)).size(15.0);
                entry(ui, slots[*learner], vec![text], &terms(&description.learners[*learner]));
            }
        });
        if let Some(share) = self.game.mean_share() {
            ui.label(format!("Your movements taught {:.0} % of the best, on average.", share * 100.0));
        }
    }
}
