//! How the panel looks.
//!
//! What is needed all the time stands at the top and stays, with one chart; the rest scrolls under it. Cards of a story
//! stand at the bottom and take their room from what scrolls, so that they cover nothing.

mod card;
mod chart;
mod charts;
mod controls;
mod curves;
mod diagram;
mod dialogs;
mod distribution;
mod drawing;
mod ending;
mod game;
mod knobs;
mod learners;
mod notices;
mod opening;
mod readings;
mod robot;
mod setup;
mod share;
mod slice;
mod stories;
pub mod style;
mod why;

use egui::{CentralPanel, Frame, Id, InnerResponse, RichText, ScrollArea, Ui, UiBuilder, vec2};

use crate::{
    panel::{Link, Panel},
    settings::Tab,
    stories::Spot,
};
pub(crate) use chart::{in_address, of_address};
pub(crate) use style::{alarm, good};

/// Below this width words are shortened.
pub(crate) const NARROW: f32 = 560.0;
/// Below this height, room is kept for what matters most.
pub(crate) const LOW: f32 = 600.0;
/// From this height on there is room to say what each learner does.
pub(crate) const TALL: f32 = 720.0;

impl Panel {
    /// Draws the panel and takes in what the visitor does.
    pub fn ui(&mut self, ui: &mut Ui) {
        let ctx = ui.ctx().clone();
        style::apply(ui);
        self.touch = ctx.input(|input| input.has_touch_screen());
        self.spots = crate::stories::Spots::default();
        self.take_keys(&ctx);
        let again = self.tick(ctx.input(|input| input.time));
        let least = if self.draws_sparingly() { self.drawn_every } else { 0.005 };
        ctx.request_repaint_after(std::time::Duration::from_secs_f64(again.unwrap_or(1.0).clamp(least, 1.0)));

        let margin = egui::Margin::symmetric(10, 6);
        let frame = Frame::new().fill(ui.visuals().window_fill).inner_margin(margin);
        if self.settings.embed {
            CentralPanel::default().frame(frame).show(ui, |ui| {
                self.controls(ui);
                self.pinned_chart(ui, None);
            });
        } else {
            let top = egui::Panel::top("controls").frame(frame).show(ui, |ui| {
                self.controls(ui);
                let height = (ctx.content_rect().height() * 0.2).clamp(88.0, 170.0);
                self.pinned_chart(ui, Some(height));
            });
            let above = top.response.rect;
            // A swipe that begins here moves what scrolls below, as one would expect.
            self.swiped += swipe(ui, above);
            self.card_panel(ui);
            let frame = Frame::new().fill(ui.visuals().panel_fill).inner_margin(margin);
            CentralPanel::default().frame(frame).show(ui, |ui| self.scrolling(ui));
        }
        self.dialogs(&ctx);
        self.notices_above(&ctx);
        self.point(&ctx);
        // What was just clicked is to be done now, not at the next movement of the mouse.
        if self.has_commands() && !self.draws_sparingly() {
            ctx.request_repaint();
        }
    }

    fn scrolling(&mut self, ui: &mut Ui) {
        ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
            ui.scroll_with_delta(vec2(0.0, std::mem::take(&mut self.swiped)));
            if self.session.is_none() {
                self.setup(ui);
                self.empty(ui);
                return;
            }
            if self.is_external() {
                self.with_a_robot(ui);
                return;
            }
            if self.settings.brief {
                self.first_look(ui);
                return;
            }
            self.game(ui);
            self.ending_card(ui);
            let learners = part(ui, "learners", |ui| self.learners(ui)).response;
            self.show_spot(ui, Spot::Learners, &learners);
            ui.add_space(6.0);
            part(ui, "stories", |ui| self.stories_row(ui));
            part(ui, "setup", |ui| self.setup(ui));
            ui.add_space(6.0);
            let tabs = part(ui, "tabs", |ui| self.tabs(ui)).response;
            self.show_spot(ui, Spot::Tabs, &tabs);
            part(ui, "tab", |ui| {
                // Room to bring the tabs to the top, whatever they show or still wait for.
                ui.set_min_height((ui.clip_rect().height() - tabs.rect.height()).max(0.0));
                match self.settings.tab {
                    Tab::Charts => self.charts(ui),
                    Tab::Why => self.why(ui),
                    Tab::Share => self.share(ui),
                }
            });
        });
    }

    /// With a robot elsewhere: what it is to do, how that stands, and all that is known of any session.
    fn with_a_robot(&mut self, ui: &mut Ui) {
        part(ui, "robot", |ui| self.robot(ui));
        ui.add_space(6.0);
        part(ui, "tabs", |ui| self.tabs(ui));
        part(ui, "tab", |ui| match self.settings.tab {
            Tab::Charts => self.charts(ui),
            Tab::Why => self.why(ui),
            Tab::Share => self.share(ui),
        });
        ui.add_space(6.0);
        ui.separator();
        part(ui, "setup", |ui| self.choose_session(ui));
    }

    /// Notes where something is, as far as it is in sight, and brings it there if a card has just begun to speak of it.
    fn show_spot(&mut self, ui: &Ui, spot: Spot, response: &egui::Response) {
        if self.reveal.take_if(|wanted| *wanted == spot).is_some() {
            response.scroll_to_me(Some(egui::Align::TOP));
        }
        let seen = response.rect.intersect(ui.clip_rect());
        if seen.is_positive() {
            self.spots.set(spot, seen);
        }
    }

    fn tabs(&mut self, ui: &mut Ui) {
        let before = self.settings.tab;
        let row = ui.horizontal_wrapped(|ui| {
            for (tab, _, name) in Tab::ALL {
                ui.selectable_value(&mut self.settings.tab, tab, RichText::new(name).strong());
            }
        });
        // What a card or a key has opened is to be seen.
        if self.tab_shown != self.settings.tab {
            if before == self.settings.tab {
                row.response.scroll_to_me(Some(egui::Align::TOP));
            }
            self.tab_shown = self.settings.tab;
        }
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
                ui.label("Asking the engine…");
            }
        });
    }
}

/// A part of the panel whose widgets keep their ids, whatever comes and goes before it: by these the page's elements know
/// what they stand for, and what has the focus keeps it.
fn part<R>(ui: &mut Ui, name: &str, add: impl FnOnce(&mut Ui) -> R) -> InnerResponse<R> {
    ui.scope_builder(UiBuilder::new().scope_id(Id::unique(name)), add)
}

/// How far a finger that began in this rectangle has just moved up or down.
fn swipe(ui: &Ui, rect: egui::Rect) -> f32 {
    if !ui.input(|input| input.has_touch_screen()) {
        return 0.0;
    }
    let began = ui.input(|input| input.pointer.press_origin()).is_some_and(|origin| rect.contains(origin));
    let dragged = ui.ctx().dragged_id().is_some();
    if began && !dragged { ui.input(|input| input.pointer.delta().y) } else { 0.0 }
}
