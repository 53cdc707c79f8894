//! What the visitor should know, above everything else: it moves nothing.

use egui::{Align2, Area, Context, Frame, Order, RichText, Stroke, vec2};

use super::alarm;
use crate::panel::Panel;

impl Panel {
    pub(super) fn notices_above(&mut self, ctx: &Context) {
        if self.notices.is_empty() && self.no_scene.is_none() {
            return;
        }
        let width = (ctx.content_rect().width() - 32.0).min(460.0);
        let mut closed = None;
        let area = Area::new(egui::Id::unique("notices")).order(Order::Foreground);
        area.anchor(Align2::CENTER_BOTTOM, vec2(0.0, -8.0 - self.card_height)).show(ctx, |ui| {
            let all = self.notices.iter().chain(self.no_scene.iter()).enumerate();
            for (index, notice) in all {
                let line = Stroke::new(1.0, alarm(ui));
                let frame = Frame::new().fill(ui.visuals().window_fill).stroke(line).inner_margin(6).corner_radius(4);
                frame.show(ui, |ui| {
                    ui.set_width(width);
                    ui.horizontal(|ui| {
                        let is_scene = index >= self.notices.len();
                        if !is_scene && ui.small_button("×").on_hover_text("Dismiss").clicked() {
                            closed = Some(index);
                        }
                        ui.add(egui::Label::new(RichText::new(notice).color(alarm(ui))).wrap());
                    });
                });
            }
        });
        if let Some(index) = closed {
            self.notices.remove(index);
        }
    }
}
