//! How the panel looks.
//!
//! What is needed all the time stands at the top and stays; the rest scrolls under it.

mod chart;
mod charts;
mod controls;
mod diagram;
mod dialogs;
mod learners;
mod setup;
mod share;
mod slice;
mod why;

use egui::{CentralPanel, Frame, RichText, ScrollArea, Ui};

use crate::{
    panel::{Link, Panel},
    settings::Tab,
};

/// The colour of alarms, readable on light and dark grounds.
pub(crate) fn alarm(ui: &Ui) -> egui::Color32 {
    if ui.visuals().dark_mode {
        egui::Color32::from_rgb(0xFF, 0x9D, 0x66)
    } else {
        egui::Color32::from_rgb(0xA6, 0x3D, 0)
    }
}

/// The colour of success.
pub(crate) fn good(ui: &Ui) -> egui::Color32 {
    if ui.visuals().dark_mode {
        egui::Color32::from_rgb(0x5F, 0xD3, 0xA8)
    } else {
        egui::Color32::from_rgb(0, 0x66, 0x4A)
    }
}

/// Below this width words are shortened.
pub(crate) const NARROW: f32 = 440.0;

/// egui's small print is too small and its weak colour too weak to be read by everybody.
fn legible(ui: &mut Ui) {
    ui.visuals_mut().weak_text_alpha = 0.8;
    if let Some(small) = ui.style_mut().text_styles.get_mut(&egui::TextStyle::Small) {
        small.size = 11.0;
    }
}

impl Panel {
    /// Draws the panel and takes in what the visitor does.
    pub fn ui(&mut self, ui: &mut Ui) {
        let ctx = ui.ctx().clone();
        legible(ui);
        self.take_keys(&ctx);
        let again = self.tick(ctx.input(|input| input.time));
        ctx.request_repaint_after(std::time::Duration::from_secs_f64(again.unwrap_or(1.0).clamp(0.005, 1.0)));

        let margin = egui::Margin::symmetric(10, 6);
        let frame = Frame::new().fill(ui.visuals().window_fill).inner_margin(margin);
        egui::Panel::top("controls").frame(frame).show(ui, |ui| self.controls(ui));
        let frame = Frame::new().fill(ui.visuals().panel_fill).inner_margin(margin);
        CentralPanel::default().frame(frame).show(ui, |ui| {
            ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
                self.setup(ui);
                self.notices(ui);
                if self.session.is_none() {
                    self.empty(ui);
                    return;
                }
                ui.add_space(4.0);
                self.learners(ui);
                ui.add_space(6.0);
                self.tabs(ui);
                match self.settings.tab {
                    Tab::Charts => self.charts(ui),
                    Tab::Why => self.why(ui),
                    Tab::Share => self.share(ui),
                }
            });
        });
        self.dialogs(&ctx);
        // What was just clicked is to be done now, not at the next movement of the mouse.
        if self.has_commands() {
            ctx.request_repaint();
        }
    }

    fn tabs(&mut self, ui: &mut Ui) {
        ui.horizontal_wrapped(|ui| {
            for (tab, _, name) in Tab::ALL {
                ui.selectable_value(&mut self.settings.tab, tab, RichText::new(name).strong());
            }
        });
        ui.separator();
    }

    fn empty(&mut self, ui: &mut Ui) {
        ui.add_space(16.0);
        ui.vertical_centered(|ui| match &self.link {
            Link::Unreachable(_) => {
                if ui.button("Try again").clicked() {
                    self.reset();
                }
            }
            _ => {
                ui.spinner();
                ui.label("Asking the server…");
            }
        });
    }

    fn notices(&mut self, ui: &mut Ui) {
        let mut closed = None;
        let all = self.notices.iter().chain(self.no_scene.iter()).enumerate();
        for (index, notice) in all {
            Frame::new().fill(ui.visuals().faint_bg_color).inner_margin(6).corner_radius(4).show(ui, |ui| {
                ui.horizontal(|ui| {
                    let is_scene = index >= self.notices.len();
                    if !is_scene && ui.small_button("×").on_hover_text("Dismiss").clicked() {
                        closed = Some(index);
                    }
                    ui.add(egui::Label::new(RichText::new(notice).color(alarm(ui))).wrap());
                });
            });
        }
        if let Some(index) = closed {
            self.notices.remove(index);
        }
    }
}
